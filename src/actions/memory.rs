//! What the robot knows from earlier actions of a run.

use nalgebra::{Isometry3, Vector3};

use crate::actions::{Perceived, PerceivedPlane, PerceivedThing};
use crate::base::Pose;
use crate::scenario::KnownKind;
use crate::world::Sighting;

/// The robot's beliefs about its surroundings. A new run begins with none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Memory {
    /// What the last look around found; nothing where there was none.
    pub perceived: Option<Perceived>,
    /// What the hand holds; nothing where it is believed to be empty.
    pub held: Option<Held>,
}

/// What was taken, by what was perceived of it and felt when the hand closed.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// What was asked for.
    pub id: String,
    /// Its dimensions along the axes of its foot. Unit: metres.
    pub size_m: [f64; 3],
    /// Its upright foot when it was taken. Frame: world, by the base's belief.
    pub foot: Isometry3<f64>,
    /// The grasp link at that moment. Frame: that of the foot.
    pub grasp_from_foot: Isometry3<f64>,
    /// Heading of the base at that moment. Unit: radians.
    pub heading: f64,
    /// Gap between the fingers that hold it. Unit: metres.
    pub opening_m: f64,
}

/// How much a thing may be farther away for a centimetre that it fits better. No unit: both are metres.
const DISTANCE_SHARE: f64 = 0.02;

/// Which of the perceived things is the one that is asked for, and everything else. The surface is among the others, as
/// furniture down to the floor.
///
/// Of several things of the kind the one that is nearest to the kind's size is taken, and of equal ones the nearest to
/// `from`. Frame: world, by the base's belief.
///
/// # Errors
/// A sentence for the action's report: nothing of that kind was perceived.
pub fn recall(
    perceived: &Perceived,
    id: &str,
    kind: &KnownKind,
    from: &Vector3<f64>,
) -> Result<(Sighting, Vec<Sighting>), String> {
    let of_kind = |thing: &&PerceivedThing| thing.category.as_ref() == Some(&kind.category);
    let miss = |thing: &PerceivedThing| {
        let off: f64 = thing.size_m.iter().zip(kind.size_m).map(|(seen, known)| (seen - known).abs()).sum();
        off + DISTANCE_SHARE * (Vector3::from(thing.pose.position) - from).norm()
    };
    let things = perceived.things.iter().enumerate().filter(|(_, thing)| of_kind(thing));
    let (chosen, target) = things
        .min_by(|(_, a), (_, b)| miss(a).total_cmp(&miss(b)))
        .ok_or_else(|| format!("nothing that was perceived is like {id}"))?;
    let others = perceived.things.iter().enumerate().filter(|(idx, _)| *idx != chosen);
    let surface = perceived.plane.map(|plane| furniture("surface", &plane));
    let others = others.map(|(idx, thing)| sighting(format!("thing_{}", idx + 1), thing)).chain(surface);
    Ok((sighting(id.to_owned(), target), others.collect()))
}

/// The furniture of a map but for the piece whose top was perceived, which is known better than by the map.
pub fn elsewhere(map: Vec<Sighting>, perceived: &Perceived) -> Vec<Sighting> {
    let is_other = |piece: &Sighting| {
        perceived.plane.is_none_or(|plane| {
            let local = piece.pose.to_isometry().inverse() * nalgebra::Point3::from(plane.pose.position);
            local.x.abs() > piece.size_m[0] / 2.0 || local.y.abs() > piece.size_m[1] / 2.0
        })
    };
    map.into_iter().filter(is_other).collect()
}

/// What carries a surface: a box down to the floor.
pub fn furniture(id: &str, plane: &PerceivedPlane) -> Sighting {
    let [x, y, height] = plane.pose.position;
    let [width, depth] = plane.size_m;
    let pose = Pose::upright([x, y, 0.0], plane.pose.yaw());
    Sighting { id: id.to_owned(), pose, size_m: [width, depth, height], furniture: true }
}

/// A thing as the abstract detector would give it.
pub fn sighting(id: String, thing: &PerceivedThing) -> Sighting {
    Sighting { id, pose: thing.pose, size_m: thing.size_m, furniture: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: &str = "http://actions#Glass";

    fn thing(category: Option<&str>, x: f64, height: f64) -> PerceivedThing {
        let pose = Pose::upright([x, 0.0, 0.7], 0.0);
        PerceivedThing { category: category.map(str::to_owned), pose, size_m: [0.088, 0.088, height] }
    }

    fn recalled(things: Vec<PerceivedThing>) -> Result<(Sighting, Vec<Sighting>), String> {
        let plane = PerceivedPlane { pose: Pose::upright([1.0, 0.0, 0.7], 0.3), size_m: [0.6, 0.5] };
        let kind = KnownKind { name: "glass".into(), category: GLASS.into(), size_m: [0.088, 0.088, 0.146] };
        recall(&Perceived { plane: Some(plane), things }, "glass_1", &kind, &Vector3::zeros())
    }

    #[test]
    fn the_best_fit_is_taken_and_of_equal_ones_the_nearest() {
        let things = vec![thing(None, 0.5, 0.146), thing(Some(GLASS), 1.2, 0.146), thing(Some(GLASS), 1.0, 0.146)];
        let (target, others) = recalled(things).expect("there are two");
        assert_eq!((target.id.as_str(), target.pose.position[0]), ("glass_1", 1.0));
        assert_eq!(others.iter().map(|other| other.id.as_str()).collect::<Vec<_>>(), ["thing_1", "thing_2", "surface"]);
        assert_eq!((others[2].size_m, others[2].furniture), ([0.6, 0.5, 0.7], true));
        let (target, _) = recalled(vec![thing(Some(GLASS), 0.9, 0.14), thing(Some(GLASS), 1.0, 0.146)]).expect("two");
        assert_eq!(target.pose.position[0], 1.0);
    }

    #[test]
    fn what_was_looked_at_is_known_better_than_by_the_map() {
        let table = |x: f64| Sighting {
            id: "table".to_owned(),
            pose: Pose::upright([x, 0.0, 0.0], 0.3),
            size_m: [0.6, 0.5, 0.7],
            furniture: true,
        };
        let plane = PerceivedPlane { pose: Pose::upright([1.0, 0.0, 0.7], 0.3), size_m: [0.6, 0.5] };
        let perceived = Perceived { plane: Some(plane), things: Vec::new() };
        assert_eq!(elsewhere(vec![table(1.1), table(3.0)], &perceived), [table(3.0)]);
        assert_eq!(elsewhere(vec![table(1.1)], &Perceived::default()).len(), 1);
    }

    #[test]
    fn what_was_not_perceived_can_not_be_taken() {
        assert_eq!(
            recalled(vec![thing(None, 0.5, 0.146)]),
            Err("nothing that was perceived is like glass_1".to_owned())
        );
    }
}
