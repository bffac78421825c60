//! The postures of a robot's profile as shapes and frames, for pictures.

use nalgebra::Isometry3;

use crate::Robot;
use actcheck_data::{Part, Pose, RobotView};

impl Robot {
    /// Returns the robot in its driving posture and in each of the profile's other postures, with open
    /// fingers.
    pub fn views(&self) -> Vec<RobotView> {
        let profile = &self.profile;
        let (kinematics, layout, home) = self.at(&self.start_at_origin());
        let reach = profile
            .postures
            .iter()
            .enumerate()
            .map(|(idx, posture)| (format!("posture {}", idx + 1), posture));
        let postures = std::iter::once(("home".to_owned(), &profile.home)).chain(reach);
        let views = postures.map(|(title, arm)| {
            let mut positions = home.clone();
            layout
                .arm
                .iter()
                .zip(arm)
                .for_each(|(joint, position)| positions[*joint] = *position);
            layout
                .gripper
                .set(&mut positions, profile.hand.max_opening_m);
            let base = layout.base.map_or(0, |[.., heading]| heading + 1);
            let frame = |name: String, pose: &Isometry3<f64>| (name, Pose::from_isometry(pose));
            let frames = vec![
                frame("base".to_owned(), &kinematics.links(&positions)[base]),
                frame(
                    format!("grasp: {}", profile.hand.grasp.link),
                    &kinematics.grasp(&positions),
                ),
                frame(
                    format!("camera: {}", profile.camera.link),
                    &kinematics.camera(&positions),
                ),
            ];
            let solids = kinematics.solids(&positions).into_iter();
            let solids = solids
                .map(|(pose, shape)| Part {
                    pose: Pose::from_isometry(&pose),
                    shape,
                })
                .collect();
            RobotView {
                title,
                solids,
                frames,
            }
        });
        views.collect()
    }
}
