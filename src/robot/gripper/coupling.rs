//! The joints of a gripper: those with motors, and those that mimic them.

use crate::description::RobotModel;

/// A joint that follows a leader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Follower {
    pub(super) joint: usize,
    /// Index in the list of leaders.
    pub(super) leader: usize,
    pub(super) factor: f64,
    pub(super) offset: f64,
}

/// Returns the joints that lead the named ones, each once.
pub(super) fn leaders(named: &[usize], model: &RobotModel) -> Vec<usize> {
    let mut leaders: Vec<usize> = Vec::new();
    for joint in named {
        let leader = model.leader_of(*joint).0;
        if !leaders.contains(&leader) {
            leaders.push(leader);
        }
    }
    leaders
}

/// Returns the joints that follow these leaders.
pub(super) fn followers(leaders: &[usize], model: &RobotModel) -> Vec<Follower> {
    let followers = (0..model.joints.len())
        .filter(|joint| model.joints[*joint].mimic.is_some())
        .filter_map(|joint| {
            let (leader, factor, offset) = model.leader_of(joint);
            let leader = leaders.iter().position(|known| *known == leader)?;
            Some(Follower {
                joint,
                leader,
                factor,
                offset,
            })
        });
    followers.collect()
}
