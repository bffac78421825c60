//! Mutated messages of a program: each is understood or refused, without a panic, and the wait for
//! it ends.

use std::io::Write as _;
use std::net::Shutdown;
use std::os::unix::net::UnixStream;

use crate::command::WireCommand;
use crate::frame::{FROM_PROGRAM_LIMIT, Wire};
use crate::hello::{Joints, Role};
use crate::message::{Ask, End, Hello, Plain, kind_of, parse};
use crate::mutations::cases;

const MESSAGES: [&str; 10] = [
    r#"{"type": "hello", "protocol": 1, "name": "arm", "actions": ["Pick", "Place"]}"#,
    r#"{"type": "ready"}"#,
    r#"{"type": "command", "ticks": 12, "positions": {"a": 0.5, "b": -1e3}, "velocities": {}, "efforts": {"c": 2}}"#,
    r#"{"type": "command", "base_velocity": [0.1, 0.0, 0.2], "gripper": {"opening_m": 0.08, "force_n": 20}, "head": {"pan_rad": 0.1}}"#,
    r#"{"type": "ask", "what": "objects"}"#,
    r#"{"type": "ask", "what": "depth", "of": "glass_1"}"#,
    r#"{"type": "ask", "what": "rgb"}"#,
    r#"{"type": "end", "succeeded": true, "message": "done"}"#,
    r#"{"type": "end", "succeeded": false, "perceived": [{"pose": {"position_m": [0, 0, 1], "quaternion_xyzw": [0, 0, 0, 1]},
        "size_m": [0.1, 0.1, 0.2], "category": "http://actions#Cup"}]}"#,
    r#"{"type": "end", "succeeded": true, "held": {"pose": {"position_m": [0, 0, 1], "quaternion_xyzw": [0, 0, 0, 1]}, "size_m": [1, 1, 1]},
        "plane": {"pose": {"position_m": [0, 0, 0.7], "quaternion_xyzw": [0, 0, 0, 1]}, "size_m": [1, 2]}}"#,
];

const WORDS: [&str; 16] = [
    "\"type\": \"end\", ",
    "\"ticks\": 4294967296, ",
    "\"a\": 1, ",
    "[",
    "{\"x\": ",
    "}",
    "\\ud800",
    "\\u0000",
    "null",
    "true",
    "1e999",
    "[0, 0, 0, 0]",
    "\"positions\": {\"a\": 1, \"a\": 2}, ",
    "\u{0}\u{0}\u{0}\u{0}J",
    "\u{7f}\u{0}\u{0}\u{0}J{}",
    "\"of\": \"can_1\", ",
];

fn joints() -> Joints {
    let roles = [
        ("a", Role::Arm),
        ("b", Role::Arm),
        ("c", Role::Base),
        ("f", Role::Gripper),
        ("h", Role::Head),
    ];
    let by_name = roles
        .iter()
        .enumerate()
        .map(|(idx, (name, role))| ((*name).to_owned(), (idx, *role)))
        .collect();
    Joints {
        by_name,
        names: roles.iter().map(|(name, _)| (*name).to_owned()).collect(),
        limits: vec![([-3.0, 3.0], "rad"); roles.len()],
        max_opening_m: 0.1,
        head: vec![4],
        drives: true,
    }
}

/// Parses a message as the type that it names.
fn understand(message: &[u8], joints: &Joints) -> Result<(), actcheck_actions::ExternalFault> {
    match kind_of(message)?.as_str() {
        "hello" => parse::<Hello>("hello", message).map(drop),
        "ready" => parse::<Plain>("ready", message).map(drop),
        "command" => parse::<WireCommand>("command", message)?
            .controls(joints)
            .map(drop),
        "ask" => parse::<Ask>("ask", message).map(drop),
        _ => {
            let end: End = parse("end", message)?;
            let poses = end.perceived.iter().flatten().map(|thing| &thing.pose);
            let poses = poses
                .chain(end.held.iter().map(|held| &held.pose))
                .chain(end.plane.iter().map(|plane| &plane.pose));
            for pose in poses {
                let length: f64 = pose.pose()?.rotation.iter().map(|part| part * part).sum();
                assert!((length - 1.0).abs() < 1e-6, "{pose:?}");
            }
            Ok(())
        }
    }
}

#[test]
fn mutated_frames_are_understood_or_refused() {
    let joints = joints();
    let others: Vec<&[u8]> = MESSAGES.iter().map(|message| message.as_bytes()).collect();
    cases("frames", 500, |mut random| {
        let message = random.pick(&MESSAGES).as_bytes();
        // Either the whole frame is mutated, or only its payload.
        let whole = random.below(3) == 0;
        let payload = if whole {
            message.to_vec()
        } else {
            random.text(message, &WORDS, &others)
        };
        let mut frame = u32::try_from(payload.len())
            .expect("it is short")
            .to_le_bytes()
            .to_vec();
        frame.push(b'J');
        frame.extend(payload);
        let frame = if whole {
            random.text(&frame, &WORDS, &others)
        } else {
            frame
        };
        let (ours, mut theirs) = UnixStream::pair().expect("a pair of sockets");
        let mut wire = Wire::new(ours, || 0.0).expect("it can be configured");
        std::thread::scope(|scope| {
            scope.spawn(move || {
                // The reader may refuse the frame before its end.
                let _ = theirs.write_all(&frame);
                let _ = theirs.shutdown(Shutdown::Both);
            });
            match wire.receive(1.0, &mut || Ok(())) {
                Ok(range) => {
                    assert!(range.len() <= FROM_PROGRAM_LIMIT);
                    if let Err(fault) = understand(wire.payload(range), &joints) {
                        assert!(
                            !fault.reason.is_empty() && fault.reason.len() < 10_000,
                            "{}",
                            fault.reason
                        );
                    }
                }
                Err(fault) => assert!(!fault.late && !fault.reason.is_empty(), "{}", fault.reason),
            }
            drop(wire);
        });
    });
}

/// The reason of a fault repeated a field's name of a megabyte, and was kept with the run.
#[test]
fn a_fault_does_not_repeat_a_long_name() {
    let long = "x".repeat(500_000);
    for message in [
        format!("{{\"type\": \"{long}\"}}"),
        format!("{{\"type\": \"end\", \"succeeded\": true, \"{long}\": 1}}"),
        format!("{{\"type\": \"command\", \"positions\": {{\"{long}\": 1}}}}"),
    ] {
        let fault = understand(message.as_bytes(), &joints()).expect_err("it is wrong");
        assert!(fault.reason.len() < 1_000, "{} bytes", fault.reason.len());
    }
}
