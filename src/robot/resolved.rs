//! A robot as its profile and its file describe it, resolved once for many simulations.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::RobotError;
use crate::description::RobotModel;
use crate::layout::Named;
use actcheck_data::RobotProfile;

/// The links and joints of a robot, with their roles.
pub struct Resolved {
    /// The links and joints.
    pub model: Arc<RobotModel>,
    /// Those with a role.
    pub named: Named,
    /// The pairs of links that pass through each other.
    pub passing: BTreeSet<(usize, usize)>,
    /// The links of its hand.
    pub hand: BTreeSet<usize>,
}

thread_local! {
    /// The robot of the last simulation in this thread: a campaign has only one.
    static LAST: RefCell<Option<(Arc<RobotProfile>, Arc<Resolved>)>> = const { RefCell::new(None) };
}

/// Resolves a profile, or returns the result for the same profile in the last simulation.
///
/// # Errors
/// [`RobotError`] if profile and URDF don't match.
pub fn resolved(profile: &Arc<RobotProfile>) -> Result<Arc<Resolved>, RobotError> {
    let known = LAST.with_borrow(|last| match last {
        Some((of, known)) if Arc::ptr_eq(of, profile) => Some(Arc::clone(known)),
        _ => None,
    });
    if let Some(known) = known {
        return Ok(known);
    }
    let model = Arc::new(RobotModel::read(profile)?);
    let named = Named::find(profile, &model)?;
    let (passing, hand) = (named.passing(&model), named.links_of_hand(&model));
    let found = Arc::new(Resolved {
        model,
        named,
        passing,
        hand,
    });
    LAST.set(Some((Arc::clone(profile), Arc::clone(&found))));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Files;
    use std::path::Path;

    /// A profile is resolved again only if it is another one, although it may be equal.
    #[test]
    fn each_profile_is_resolved_once_in_a_row() {
        let path = Path::new("models/robots/fixed_arm.toml");
        let profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid");
        let mut shorter = profile.clone();
        shorter.arm_joints.pop();
        let (first, second) = (Arc::new(profile.clone()), Arc::new(shorter));
        let of =
            |profile: &Arc<RobotProfile>| resolved(profile).expect("the shipped robot is valid");
        let known = of(&first);
        assert!(Arc::ptr_eq(&known, &of(&first)));
        assert_eq!(
            of(&second).named.layout.arm.len() + 1,
            known.named.layout.arm.len()
        );
        assert!(!Arc::ptr_eq(&known, &of(&Arc::new(profile))));
        assert_eq!(of(&first).named.layout, known.named.layout);
    }
}
