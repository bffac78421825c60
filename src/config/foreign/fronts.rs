//! Turns furniture of worlds so that the side at which robots work is one with room for them.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::Furniture;
use crate::foreign::world::{LOW_M, World};
use actcheck_base::digest_of;
use actcheck_data::{
    FLOOR_M, Inertia, Location, OVERHEAD_M, ObjectModel, Part, Pose, Surface, bounds,
};

/// Distance between the edge of a surface and the middle of the base of a robot working at it.
/// Unit: metres.
const FRONT_GAP_M: f64 = 0.69;
/// Distance of other furniture from that place. Unit: metres. A slim mobile manipulator can stop
/// there.
const ROOM_M: f64 = 0.4;
/// Distance between the points at which the way from a surface to the place in front of it is
/// tested. Unit: metres. Walls are thicker.
const STEP_M: f64 = 0.01;
/// Quarter turns by which a side becomes the front: first the one that is it already, then the
/// opposite one.
const SIDES: [u8; 4] = [0, 2, 1, 3];

/// Adds a location in front of each surface of some pieces, by index, and turns furniture without
/// room there if another side has some. Returns the pieces that have no room at any side, and
/// therefore no location.
pub(super) fn add_fronts(
    world: &mut World,
    included: &BTreeMap<String, Arc<ObjectModel>>,
    pieces: impl Iterator<Item = usize>,
) -> Vec<usize> {
    let World { map, models } = world;
    let own = |name: &str| models.iter().find(|model| model.name == name);
    let model_of = |piece: &Furniture| {
        own(&piece.model).or_else(|| included.get(&piece.model).map(|model| &**model))
    };
    let obstacles: Vec<Option<Obstacle>> = map
        .furniture
        .iter()
        .map(|piece| Obstacle::new(&piece.pose, model_of(piece)?))
        .collect();
    let mut made: BTreeMap<String, ObjectModel> = BTreeMap::new();
    let mut without = Vec::new();
    for idx in pieces {
        let piece = &map.furniture[idx];
        let Some((model, surface)) =
            model_of(piece).and_then(|model| Some((model, model.surface?)))
        else {
            continue;
        };
        let itself = obstacles[idx].as_ref();
        let others = || {
            obstacles
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != idx)
                .filter_map(|(_, one)| one.as_ref())
        };
        // A model with drawers or doors has them at its front.
        let mut sides = SIDES.into_iter().take(if model.moving.is_empty() {
            SIDES.len()
        } else {
            1
        });
        match sides.find(|side| has_room(&piece.pose, &surface, *side, itself, others)) {
            Some(0) => map.locations.push(front(piece, &surface)),
            Some(side) => {
                let model = turned(model, side, &map.name);
                let yaw = piece.pose.yaw() + f64::from(side) * FRAC_PI_2;
                let pose = Pose::upright(
                    piece.pose.position,
                    libm::atan2(libm::sin(yaw), libm::cos(yaw)),
                );
                let piece = Furniture {
                    name: piece.name.clone(),
                    model: model.name.clone(),
                    pose,
                };
                map.locations
                    .extend(model.surface.map(|surface| front(&piece, &surface)));
                map.furniture[idx] = piece;
                made.insert(model.name.clone(), model);
            }
            None => without.push(idx),
        }
    }
    models.extend(made.into_values());
    without
}

/// The location in front of a surface, from which a robot can work on it.
fn front(piece: &Furniture, surface: &Surface) -> Location {
    let at =
        piece.pose.to_isometry() * Point3::new(-surface.size_m[0] / 2.0 - FRONT_GAP_M, 0.0, 0.0);
    Location {
        name: format!("{}_front", piece.name),
        at: [at.x, at.y, piece.pose.yaw()],
        surface: Some(piece.name.clone()),
    }
}

/// Whether a robot can stand at a side of a surface, with nothing between them.
fn has_room<'a, I: Iterator<Item = &'a Obstacle>>(
    pose: &Pose,
    surface: &Surface,
    side: u8,
    own: Option<&Obstacle>,
    others: impl Fn() -> I,
) -> bool {
    let out = quarter_turn(side) * -Vector3::x();
    let edge_m = surface.size_m[usize::from(side % 2)] / 2.0;
    let at = |gap_m: f64| pose.to_isometry() * Point3::from(out * (edge_m + gap_m));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few dozen steps"
    )]
    let n_steps = (FRONT_GAP_M / STEP_M) as u32;
    let place = at(FRONT_GAP_M);
    if libm::hypot(place.x, place.y) > FLOOR_M {
        return false;
    }
    let is_open = |other: &Obstacle| {
        other.distance(&place) >= ROOM_M
            && (1..n_steps).all(|step| other.distance(&at(f64::from(step) * STEP_M)) > 0.0)
    };
    // A model may be wider below its surface, or have a back.
    own.is_none_or(|own| own.distance(&place) >= ROOM_M) && others().all(is_open)
}

fn quarter_turn(turns: u8) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), f64::from(turns) * FRAC_PI_2)
}

/// A model with another side at its negative x side, after a number of quarter turns.
fn turned(model: &ObjectModel, turns: u8, world: &str) -> ObjectModel {
    let from_model = quarter_turn(turns).inverse();
    let at = Isometry3::from_parts(Translation3::identity(), from_model);
    let swapped = |size: [f64; 2]| {
        if turns % 2 == 1 {
            [size[1], size[0]]
        } else {
            size
        }
    };
    let [x, y] = swapped([model.size_m[0], model.size_m[1]]);
    let turn = from_model.to_rotation_matrix();
    let inertia = model.inertia.map(|inertia| {
        let about_com = turn.matrix()
            * Matrix3::from(inertia.about_com).transpose()
            * turn.matrix().transpose();
        Inertia {
            com_m: (from_model * Vector3::from(inertia.com_m)).into(),
            about_com: [0, 1, 2].map(|row| [0, 1, 2].map(|column| about_com[(row, column)])),
        }
    });
    let part = |part: &Part| Part {
        pose: Pose::from_isometry(&(at * part.pose.to_isometry())),
        shape: part.shape.clone(),
    };
    ObjectModel {
        // A category is found by the end of the name.
        name: format!(
            "{world}/turned_{turns}/{}",
            model
                .name
                .strip_prefix(&format!("{world}/"))
                .unwrap_or(&model.name)
        ),
        origin_m: (from_model * Vector3::from(model.origin_m)).into(),
        size_m: [x, y, model.size_m[2]],
        parts: model.parts.iter().map(part).collect(),
        inertia,
        surface: model.surface.map(|surface| Surface {
            size_m: swapped(surface.size_m),
            ..surface
        }),
        digest: digest_of(&format!("{} turned {turns}", model.digest)),
        ..model.clone()
    }
}

/// The bounding rectangle of furniture that is in the way of a robot.
struct Obstacle {
    from_world: Isometry3<f64>,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Obstacle {
    /// `None` if a robot can drive over it or below it.
    fn new(pose: &Pose, model: &ObjectModel) -> Option<Self> {
        let (low, high) = bounds(&model.parts);
        let foot_m = pose.position[2];
        let is_in_the_way = foot_m < OVERHEAD_M && foot_m + high.z >= LOW_M;
        is_in_the_way.then(|| Self {
            from_world: pose.to_isometry().inverse(),
            low,
            high,
        })
    }

    /// Horizontal distance of a point; 0 inside. Unit: metres.
    fn distance(&self, point: &Point3<f64>) -> f64 {
        let local = (self.from_world * point).coords;
        let beyond = (self.low - local)
            .sup(&(local - self.high))
            .sup(&Vector3::zeros());
        libm::hypot(beyond.x, beyond.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::WorldMap;
    use actcheck_data::Shape;

    /// A table of 1.2 m by 0.8 m with a leg at one corner.
    fn table() -> ObjectModel {
        let part = |at: [f64; 3], size| Part {
            pose: Pose::upright(at, 0.0),
            shape: Shape::Box { size },
        };
        ObjectModel {
            name: "table".to_owned(),
            category: String::new(),
            mass_kg: 10.0,
            friction: 1.0,
            restitution: 0.0,
            origin_m: [0.1, 0.0, 0.0],
            size_m: [1.2, 0.8, 0.7],
            parts: vec![
                part([0.0, 0.0, 0.68], [1.2, 0.8, 0.04]),
                part([0.5, 0.3, 0.33], [0.1, 0.1, 0.66]),
            ],
            fixed: true,
            inertia: None,
            surface: Some(Surface {
                height_m: 0.7,
                size_m: [1.2, 0.8],
            }),
            moving: Vec::new(),
            digest: String::new(),
        }
    }

    fn world(table_at: Pose, walls: &[[f64; 4]]) -> (World, Vec<usize>) {
        let wall = |number: usize, [x, y, length, width]: [f64; 4]| {
            let mut model = table();
            model.name = format!("w/wall_{number}");
            model.parts = vec![Part {
                pose: Pose::upright([0.0, 0.0, 1.0], 0.0),
                shape: Shape::Box {
                    size: [length, width, 2.0],
                },
            }];
            (
                Furniture {
                    name: model.name.clone(),
                    model: model.name.clone(),
                    pose: Pose::upright([x, y, 0.0], 0.0),
                },
                model,
            )
        };
        let (mut furniture, models): (Vec<_>, Vec<_>) =
            walls.iter().enumerate().map(|(n, at)| wall(n, *at)).unzip();
        furniture.insert(
            0,
            Furniture {
                name: "t".to_owned(),
                model: "table".to_owned(),
                pose: table_at,
            },
        );
        let map = WorldMap {
            furniture,
            ..WorldMap::floor_only("w")
        };
        let mut world = World { map, models };
        let included = BTreeMap::from([("table".to_owned(), Arc::new(table()))]);
        let without = add_fronts(&mut world, &included, std::iter::once(0));
        (world, without)
    }

    /// The parts of the table in the world. Shape: lowest and highest corner.
    fn corners(world: &World) -> Vec<[i64; 6]> {
        let piece = &world.map.furniture[0];
        let shared = table();
        let model = world
            .models
            .iter()
            .find(|model| model.name == piece.model)
            .unwrap_or(&shared);
        let placed = |part: &Part| {
            let pose = Pose::from_isometry(&(piece.pose.to_isometry() * part.pose.to_isometry()));
            let (low, high) = Part {
                pose,
                shape: part.shape.clone(),
            }
            .bounds();
            [low, high]
                .concat()
                .iter()
                .map(|value| (value * 1e6).round() as i64)
                .collect::<Vec<_>>()
        };
        model
            .parts
            .iter()
            .map(|part| placed(part).try_into().expect("six numbers"))
            .collect()
    }

    #[test]
    fn furniture_is_turned_towards_room_and_stays_where_it_is() {
        let north = [0.0, 0.6, 4.0, 0.2];
        let south = [0.0, -0.6, 4.0, 0.2];
        let west = [-1.1, 0.0, 0.2, 4.0];
        let east = [1.1, 0.0, 0.2, 4.0];
        let (as_it_was, _) = world(Pose::upright([0.0, 0.0, 0.0], 0.0), &[]);
        for (walls, expected) in [
            (vec![north, south, east], Some([-1.29, 0.0, 0.0])),
            (vec![west], Some([1.29, 0.0, 180.0])),
            (vec![west, east, north], Some([0.0, -1.09, 90.0])),
            (vec![west, east, south], Some([0.0, 1.09, -90.0])),
            (vec![north, south, west, east], None),
        ] {
            let (world, without) = world(Pose::upright([0.0, 0.0, 0.0], 0.0), &walls);
            let found = world.map.locations.first().map(|location| {
                let [x, y, heading] = location.at;
                [x, y, heading.to_degrees()].map(|value| (value * 100.0).round() / 100.0 + 0.0)
            });
            assert_eq!(found, expected, "{walls:?}");
            assert_eq!(without.is_empty(), expected.is_some());
            assert_eq!(corners(&world), corners(&as_it_was), "{walls:?}");
        }
    }

    #[test]
    fn a_place_behind_a_wall_is_not_in_front() {
        // There is room beyond this wall, which is along the table.
        let (world, _) = world(
            Pose::upright([0.0, 0.0, 0.0], 0.0),
            &[[-0.65, 0.0, 0.04, 4.0]],
        );
        assert!(
            world.map.locations[0].at[0] > 1.0,
            "{:?}",
            world.map.locations
        );
    }
}
