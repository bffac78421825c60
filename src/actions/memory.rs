//! The robot's knowledge from earlier actions of a run.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};

use crate::grip::EMPTY_M;
use crate::pick_fault::PickFault;
use actcheck_data::{KnownKind, Perceived, PerceivedPlane, PerceivedThing, Pose};
use actcheck_world::Sighting;

/// The robot's beliefs about its surroundings. Empty at the start of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Memory {
    /// Result of the last perception; `None` before the first.
    pub perceived: Option<Perceived>,
    /// The object in the hand; `None` if the hand is believed to be empty.
    pub held: Option<Held>,
    /// Obstacles that the last drive saw on the floor and that are not on the map.
    pub floor: Vec<Standing>,
}

/// A grid cell of the floor on which something was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Centre of the cell. Unit: metres. Frame: world, by the base's belief at that moment.
    pub at_m: [f64; 2],
    /// Height of the highest point seen in the cell. Unit: metres.
    pub top_m: f64,
}

/// A grasped object, as perceived and as felt when the hand closed.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// Id of the requested object.
    pub id: String,
    /// Dimensions along the axes of its foot. Unit: metres.
    pub size_m: [f64; 3],
    /// Upright pose of its foot when it was grasped. Frame: world, by the base's belief.
    pub foot: Isometry3<f64>,
    /// Pose of the grasp link at that moment. Frame: that of the foot.
    pub grasp_from_foot: Isometry3<f64>,
    /// Heading of the base at that moment. Unit: radians.
    pub heading: f64,
    /// Gap between the fingers that hold it. Unit: metres.
    pub opening_m: f64,
    /// Thickness of the wall between the fingers, if it is held at its rim. Unit: metres.
    pub wall_m: Option<f64>,
}

impl Held {
    /// Returns the smallest gap between fingers that hold it. Unit: metres.
    pub fn least_gap_m(&self) -> f64 {
        least_gap_m(self.wall_m)
    }
}

/// Returns the smallest gap between fingers that hold something, or a wall of this thickness. Unit:
/// metres.
pub fn least_gap_m(wall_m: Option<f64>) -> f64 {
    wall_m.map_or(EMPTY_M, |wall_m| wall_m / 2.0)
}

/// Weight of the distance against the size mismatch. No unit: both are metres.
const DISTANCE_SHARE: f64 = 0.02;

/// Chooses the perceived object that best matches the requested one and returns it with all other
/// objects. The surface is among the others, as furniture that reaches down to the floor.
///
/// Among objects of the requested kind, the one closest to the kind's size is chosen; ties go to
/// the one nearest to `from`. Frame: world, by the base's belief.
///
/// # Errors
/// [`PickFault::NoMatch`] if no percept is of that kind.
pub fn recall(
    perceived: &Perceived,
    id: &str,
    kind: &KnownKind,
    from: &Vector3<f64>,
) -> Result<(Sighting, Vec<Sighting>), PickFault> {
    let of_kind = |thing: &&PerceivedThing| thing.category.as_ref() == Some(&kind.category);
    let miss = |thing: &PerceivedThing| {
        let off: f64 = thing
            .size_m
            .iter()
            .zip(kind.size_m)
            .map(|(seen, known)| (seen - known).abs())
            .sum();
        off + DISTANCE_SHARE * (Vector3::from(thing.pose.position) - from).norm()
    };
    let things = perceived
        .things
        .iter()
        .enumerate()
        .filter(|(_, thing)| of_kind(thing));
    let (chosen, target) = things
        .min_by(|(_, a), (_, b)| miss(a).total_cmp(&miss(b)))
        .ok_or_else(|| PickFault::NoMatch(id.to_owned()))?;
    let others = perceived
        .things
        .iter()
        .enumerate()
        .filter(|(idx, _)| *idx != chosen);
    let surface = perceived.plane.map(|plane| furniture("surface", &plane));
    let others = others
        .map(|(idx, thing)| sighting(format!("thing_{}", idx + 1), thing))
        .chain(surface);
    Ok((sighting(id.to_owned(), target), others.collect()))
}

/// The furniture of a map, except the piece whose top was perceived: its percept is more accurate
/// than the map.
pub fn elsewhere(map: Vec<Sighting>, perceived: &Perceived) -> Vec<Sighting> {
    let is_other = |piece: &Sighting| {
        perceived.plane.is_none_or(|plane| {
            let local =
                piece.pose.to_isometry().inverse() * nalgebra::Point3::from(plane.pose.position);
            local.x.abs() > piece.size_m[0] / 2.0 || local.y.abs() > piece.size_m[1] / 2.0
        })
    };
    map.into_iter().filter(is_other).collect()
}

/// The furniture below a surface, as a box down to the floor.
pub fn furniture(id: &str, plane: &PerceivedPlane) -> Sighting {
    let [x, y, height] = plane.pose.position;
    let [width, depth] = plane.size_m;
    let pose = Pose::upright([x, y, 0.0], plane.pose.yaw());
    Sighting {
        id: id.to_owned(),
        pose,
        size_m: [width, depth, height],
        furniture: true,
        angular: false,
    }
}

/// Edge of the squares that floor cells are merged into. Unit: metres. Two cells of a grid.
const PIECE_M: f64 = 0.1;

/// Obstacles seen on the floor, for the arm and the base to avoid: one per occupied square.
pub fn obstacles(floor: &[Standing]) -> Vec<Sighting> {
    let mut tops: BTreeMap<[i64; 2], f64> = BTreeMap::new();
    for Standing { at_m, top_m } in floor {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a few metres of decimetres"
        )]
        let square = at_m.map(|along| (along / PIECE_M).floor() as i64);
        let top = tops.entry(square).or_default();
        *top = top.max(*top_m);
    }
    let piece = |(number, (square, top)): (usize, ([i64; 2], f64))| {
        let [x, y] = square.map(|along| (along as f64 + 0.5) * PIECE_M);
        let pose = Pose::upright([x, y, 0.0], 0.0);
        Sighting {
            id: format!("obstacle_{}", number + 1),
            pose,
            size_m: [PIECE_M, PIECE_M, top],
            furniture: false,
            angular: false,
        }
    };
    tops.into_iter().enumerate().map(piece).collect()
}

/// Converts a percept to a sighting, the format of the abstract detector.
pub fn sighting(id: String, thing: &PerceivedThing) -> Sighting {
    Sighting {
        id,
        pose: thing.pose,
        size_m: thing.size_m,
        furniture: false,
        angular: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: &str = "http://actions#Glass";

    fn thing(category: Option<&str>, x: f64, height: f64) -> PerceivedThing {
        let pose = Pose::upright([x, 0.0, 0.7], 0.0);
        PerceivedThing {
            category: category.map(str::to_owned),
            pose,
            size_m: [0.088, 0.088, height],
        }
    }

    fn recalled(things: Vec<PerceivedThing>) -> Result<(Sighting, Vec<Sighting>), PickFault> {
        let plane = PerceivedPlane {
            pose: Pose::upright([1.0, 0.0, 0.7], 0.3),
            size_m: [0.6, 0.5],
        };
        let kind = KnownKind {
            name: "glass".into(),
            category: GLASS.into(),
            size_m: [0.088, 0.088, 0.146],
            rim: None,
            is_box: false,
        };
        recall(
            &Perceived {
                plane: Some(plane),
                things,
                look: None,
            },
            "glass_1",
            &kind,
            &Vector3::zeros(),
        )
    }

    #[test]
    fn the_best_match_is_chosen_and_the_nearest_of_equal_ones() {
        let things = vec![
            thing(None, 0.5, 0.146),
            thing(Some(GLASS), 1.2, 0.146),
            thing(Some(GLASS), 1.0, 0.146),
        ];
        let (target, others) = recalled(things).expect("two things match");
        assert_eq!(
            (target.id.as_str(), target.pose.position[0]),
            ("glass_1", 1.0)
        );
        assert_eq!(
            others
                .iter()
                .map(|other| other.id.as_str())
                .collect::<Vec<_>>(),
            ["thing_1", "thing_2", "surface"]
        );
        assert_eq!(
            (others[2].size_m, others[2].furniture),
            ([0.6, 0.5, 0.7], true)
        );
        let (target, _) = recalled(vec![
            thing(Some(GLASS), 0.9, 0.14),
            thing(Some(GLASS), 1.0, 0.146),
        ])
        .expect("two");
        assert_eq!(target.pose.position[0], 1.0);
    }

    #[test]
    fn mapped_furniture_at_the_perceived_surface_is_omitted() {
        let table = |x: f64| Sighting {
            id: "table".to_owned(),
            pose: Pose::upright([x, 0.0, 0.0], 0.3),
            size_m: [0.6, 0.5, 0.7],
            furniture: true,
            angular: false,
        };
        let plane = PerceivedPlane {
            pose: Pose::upright([1.0, 0.0, 0.7], 0.3),
            size_m: [0.6, 0.5],
        };
        let perceived = Perceived {
            plane: Some(plane),
            things: Vec::new(),
            look: None,
        };
        assert_eq!(
            elsewhere(vec![table(1.1), table(3.0)], &perceived),
            [table(3.0)]
        );
        assert_eq!(elsewhere(vec![table(1.1)], &Perceived::default()).len(), 1);
    }

    #[test]
    fn floor_pieces_are_merged_into_squares_of_the_largest_height() {
        let piece = |x: f64, top_m: f64| Standing {
            at_m: [x, -0.025],
            top_m,
        };
        let found = obstacles(&[piece(0.125, 0.2), piece(0.175, 0.4), piece(0.225, 0.1)]);
        let told: Vec<([f64; 3], f64)> = found
            .iter()
            .map(|thing| (thing.pose.position, thing.size_m[2]))
            .collect();
        assert_eq!(found.iter().filter(|thing| thing.furniture).count(), 0);
        assert_eq!(told.len(), 2);
        for (told, known) in told
            .iter()
            .zip([([0.15, -0.05, 0.0], 0.4), ([0.25, -0.05, 0.0], 0.1)])
        {
            assert!(
                (Vector3::from(told.0) - Vector3::from(known.0)).norm() < 1e-9 && told.1 == known.1,
                "{told:?}"
            );
        }
    }

    #[test]
    fn an_unperceived_object_cannot_be_grasped() {
        assert_eq!(
            recalled(vec![thing(None, 0.5, 0.146)]),
            Err(PickFault::NoMatch("glass_1".to_owned()))
        );
    }
}
