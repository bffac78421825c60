//! Mass and size of a robot, and the load that its arm lifts, without a simulation.

use crate::counterweight::{N_POSTURES, position_in};
use crate::{GRAVITY, Kinematics, Robot};
use actcheck_data::{LEAST_LINK_KG, Part, Pose, bounds};

/// A joint with a shorter lever carries nothing of the load. Unit: metres, or 1.
const LEVER_M: f64 = 1e-3;

/// A robot in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotMeasures {
    /// Mass of all its links. Unit: kilograms.
    pub mass_kg: f64,
    /// Dimensions of the box around its collision shapes at `home`, along the axes of the world;
    /// zeros if it has none. Unit: metres.
    pub size_m: [f64; 3],
    /// The greatest load that the motors of its arm hold in every posture, beside the arm's own
    /// weight. `None` if no joint of the arm carries a load, or if an effort is unknown. Unit:
    /// kilograms.
    pub lift_kg: Option<f64>,
}

impl Robot {
    /// Measures the robot.
    pub fn measures(&self) -> RobotMeasures {
        let (kinematics, layout, home) = self.at(&self.start_at_origin());
        let model = &self.model;
        // Links without mass and shapes only join others; the engine needs some mass for them.
        let is_real = |mass_kg: f64, is_bare: bool| mass_kg > LEAST_LINK_KG || !is_bare;
        let links = model.links.iter();
        let mass_kg = links
            .filter(|link| is_real(link.mass, link.solids.is_empty()))
            .map(|link| link.mass)
            .sum();
        let solids: Vec<Part> = kinematics
            .solids(&home)
            .into_iter()
            .map(|(pose, shape)| Part {
                pose: Pose::from_isometry(&pose),
                shape,
            })
            .collect();
        let size_m = match solids.as_slice() {
            [] => [0.0; 3],
            solids => {
                let (low, high) = bounds(solids);
                (high - low).into()
            }
        };
        let is_unknown = |idx: &usize| model.assumed.contains(&model.joints[*idx].name);
        let lift_kg = match layout.arm.iter().any(is_unknown) {
            true => None,
            false => lift_kg(&kinematics, &layout.arm, &home),
        };
        RobotMeasures {
            mass_kg,
            size_m,
            lift_kg,
        }
    }
}

/// The load that every joint of an arm holds in `home` and in postures spread over its range.
fn lift_kg(kinematics: &Kinematics, arm: &[usize], home: &[f64]) -> Option<f64> {
    let mut least = f64::INFINITY;
    for posture in 0..=N_POSTURES {
        let mut positions = home.to_vec();
        for idx in arm.iter().filter(|_| posture > 0) {
            positions[*idx] = position_in(posture, *idx, &kinematics.joints()[*idx]);
        }
        kinematics.follow(&mut positions);
        let own = kinematics.holding_efforts(&positions);
        let (_, jacobian) = kinematics.grasp_jacobian(&positions);
        for idx in arm {
            let lever_m = jacobian[*idx].z;
            if lever_m.abs() < LEVER_M {
                continue;
            }
            let spare = kinematics.joints()[*idx].effort - own[*idx] * lever_m.signum();
            least = least.min((spare / (lever_m.abs() * GRAVITY)).max(0.0));
        }
    }
    least.is_finite().then_some(least)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use actcheck_base::{Files, Source};
    use actcheck_data::{Hand, LinkFrame, RobotCore, RobotProfile};
    use std::path::Path;

    /// An arm of one beam of `mass_kg`, 0.5 m long, with two fingers of 50 g.
    fn beam(mass_kg: f64, effort: f64) -> Arc<RobotProfile> {
        let path = Path::new("models/robots/fixed_arm.toml");
        let shipped = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        let inertial = |at: &str, mass_kg: f64| {
            format!(
                "<inertial><origin xyz=\"{at}\"/><mass value=\"{mass_kg}\"/><inertia ixx=\"1e-3\" ixy=\"0\" ixz=\"0\" \
                 iyy=\"1e-3\" iyz=\"0\" izz=\"1e-3\"/></inertial>"
            )
        };
        let finger = |name: &str, y: f64| {
            format!(
                "<link name=\"{name}\">{}<collision><origin xyz=\"0 {y} 0\"/><geometry><box size=\"0.04 0.01 0.02\"/>\
                 </geometry></collision></link><joint name=\"{name}_joint\" type=\"prismatic\"><origin xyz=\"0.5 0 0\"/>\
                 <parent link=\"beam\"/><child link=\"{name}\"/><axis xyz=\"0 {} 0\"/><limit lower=\"0\" upper=\"0.04\" \
                 effort=\"40\" velocity=\"0.1\"/></joint>",
                inertial("0 0 0", 0.05),
                y.signum(),
            )
        };
        let urdf = format!(
            "<robot name=\"beam\"><link name=\"base\"/><link name=\"beam\">{}</link><joint name=\"hinge\" type=\"revolute\">\
             <parent link=\"base\"/><child link=\"beam\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" \
             effort=\"{effort}\" velocity=\"1\"/></joint>{}{}<link name=\"tool\"/><joint name=\"fix\" type=\"fixed\">\
             <origin xyz=\"0.5 0 0\"/><parent link=\"beam\"/><child link=\"tool\"/></joint></robot>",
            inertial("0.25 0 0", mass_kg),
            finger("left", 0.005),
            finger("right", -0.005),
        );
        let urdf = Source::new("beam.urdf", urdf);
        let core = actcheck_config::robot::with_urdf(shipped.core, urdf).expect("it is a URDF");
        let on = |link: &str| LinkFrame {
            link: link.to_owned(),
            offset_m: [0.0; 3],
            turned_rad: [0.0; 3],
        };
        Arc::new(RobotProfile {
            core: RobotCore {
                head_joints: Vec::new(),
                mount_height_m: 1.0,
                ..core
            },
            arm_joints: vec!["hinge".to_owned()],
            hand: Hand {
                grasp: on("tool"),
                finger_joints: ["left_joint", "right_joint"].map(str::to_owned).to_vec(),
                finger_links: ["left", "right"].map(str::to_owned),
                max_opening_m: 0.08,
                ..shipped.hand
            },
            camera: on("base"),
            home: vec![0.0],
            postures: vec![vec![0.0]],
        })
    }

    /// Level, a beam of 2 kg and fingers of 0.1 kg leave 25 N·m − 9.81 m/s² · (2 kg · 0.25 m + 0.1 kg
    /// · 0.5 m) for a load at 0.5 m.
    #[test]
    fn an_arm_lifts_as_much_as_its_motors_leave() {
        let measured = Robot::compile(&beam(2.0, 25.0))
            .expect("it is valid")
            .measures();
        assert!((measured.mass_kg - 2.1).abs() < 1e-9, "{measured:?}");
        let expected = 25.0 / (GRAVITY * 0.5) - (2.0 * 0.25 + 0.1 * 0.5) / 0.5;
        let lift_kg = measured.lift_kg.expect("its effort is known");
        assert!(
            (lift_kg - expected).abs() < 1e-6,
            "{lift_kg}, not {expected}"
        );
        let across_m = measured.size_m[1];
        assert!((0.02..0.101).contains(&across_m), "{measured:?}");
        let unknown = Robot::compile(&beam(2.0, 0.0))
            .expect("it is valid")
            .measures();
        assert_eq!(unknown.lift_kg, None);
    }
}
