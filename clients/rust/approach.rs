//! A skill in Rust: drives up to the object to pick and gives up there. It needs only a socket and
//! JSON, not the actcheck crate.
//!
//!     cargo build --release --example approach
//!     actcheck run my.toml         # with test_launcher = "target/release/examples/approach"

#[path = "link.rs"]
mod link;

use serde_json::{Value, json};

/// Distance from the object at which the base stops. Unit: metres.
const BEFORE_M: f64 = 0.7;
/// Highest speed. Unit: m/s.
const FASTEST: f64 = 0.3;
/// Turning speed per radian of heading error. Unit: 1/s.
const TURNING: f64 = 1.5;

fn main() -> std::io::Result<()> {
    link::serve(&["Pick"], |link, begin| {
        let wanted = begin["parameters"]["pickObject"][0].clone();
        let Some(seen) = link.ask(&json!({ "type": "ask", "what": "objects", "of": wanted }))?
        else {
            return Ok(None);
        };
        let at = number::<3>(&seen["objects"][0]["pose"]["position_m"]);
        let mut base = begin["observation"]["base"].clone();
        loop {
            let [x, y] = number::<2>(&base["position_m"]);
            let heading = base["heading_rad"].as_f64().unwrap_or_default();
            let (dx, dy) = (at[0] - x, at[1] - y);
            let (away, aside) = (dx.hypot(dy), turn(dy.atan2(dx) - heading));
            if away < BEFORE_M && aside.abs() < 0.05 {
                break;
            }
            let speed = (away - BEFORE_M).clamp(0.0, FASTEST) * aside.cos().max(0.0);
            let command =
                json!({ "type": "command", "base_velocity": [speed + 0.01, 0.0, TURNING * aside] });
            let Some(observation) = link.ask(&command)? else {
                return Ok(None);
            };
            base = observation["base"].clone();
        }
        let still = json!({ "type": "command", "ticks": 30, "base_velocity": [0.0, 0.0, 0.0] });
        let Some(_) = link.ask(&still)? else {
            return Ok(None);
        };
        Ok(Some(
            json!({ "type": "end", "succeeded": false, "message": format!("reached {wanted}, but has no grasp skill") }),
        ))
    })
}

fn number<const N: usize>(list: &Value) -> [f64; N] {
    std::array::from_fn(|idx| list[idx].as_f64().unwrap_or_default())
}

/// Wraps an angle to (−π, π].
fn turn(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}
