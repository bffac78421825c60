//! Percepts that a fault falsifies.

use nalgebra::Vector3;

use actcheck_data::{KnownKind, PerceivedThing};

/// How far above its place an object is perceived. Unit: metres. Higher than any of our objects.
const RAISED_M: f64 = 0.4;

/// Exchanges the poses of two perceived objects: one of the category, if there is one, and the
/// nearest of another category. Returns whether there are two such objects.
pub fn swap(things: &mut [PerceivedThing], category: Option<&str>) -> bool {
    let Some(first) = chosen(things, category) else {
        return false;
    };
    let at = |idx: usize| Vector3::from(things[idx].pose.position);
    let others = (0..things.len()).filter(|idx| things[*idx].category != things[first].category);
    let distance = |idx: &usize| (at(*idx) - at(first)).norm();
    let Some(second) = others.min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
        return false;
    };
    let pose = things[first].pose;
    things[first].pose = things[second].pose;
    things[second].pose = pose;
    true
}

/// Turns a perceived object, one of the category if there is one, into one of the known kind whose
/// size differs most. Returns whether there is such an object and kind.
pub fn mistake(things: &mut [PerceivedThing], category: Option<&str>, kinds: &[KnownKind]) -> bool {
    let Some(idx) = chosen(things, category) else {
        return false;
    };
    let thing = &mut things[idx];
    let off = |kind: &&KnownKind| -> f64 {
        (0..3)
            .map(|axis| (kind.size_m[axis] - thing.size_m[axis]).abs())
            .sum()
    };
    let others = kinds
        .iter()
        .filter(|kind| thing.category.as_ref() != Some(&kind.category));
    let Some(kind) = others.max_by(|a, b| off(a).total_cmp(&off(b))) else {
        return false;
    };
    (thing.category, thing.size_m) = (Some(kind.category.clone()), kind.size_m);
    true
}

/// Moves every perceived object up. Returns whether there is one.
pub fn raise(things: &mut [PerceivedThing]) -> bool {
    things
        .iter_mut()
        .for_each(|thing| thing.pose.position[2] += RAISED_M);
    !things.is_empty()
}

/// The index of the first object of the category, or else of the first recognised object.
fn chosen(things: &[PerceivedThing], category: Option<&str>) -> Option<usize> {
    let wanted = things
        .iter()
        .position(|thing| category.is_some() && thing.category.as_deref() == category);
    wanted.or_else(|| things.iter().position(|thing| thing.category.is_some()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    fn thing(category: Option<&str>, x: f64) -> PerceivedThing {
        let pose = Pose::upright([x, 0.0, 0.7], 0.0);
        PerceivedThing {
            category: category.map(str::to_owned),
            pose,
            size_m: [0.1; 3],
        }
    }

    fn shown(things: &[PerceivedThing]) -> Vec<(Option<&str>, f64)> {
        things
            .iter()
            .map(|thing| (thing.category.as_deref(), thing.pose.position[0]))
            .collect()
    }

    #[test]
    fn the_nearest_object_of_another_category_is_exchanged() {
        let mut things = vec![
            thing(Some("mug"), 0.0),
            thing(Some("glass"), 1.0),
            thing(Some("can"), 1.2),
        ];
        assert!(swap(&mut things, Some("glass")));
        assert_eq!(
            shown(&things),
            [(Some("mug"), 0.0), (Some("glass"), 1.2), (Some("can"), 1.0)]
        );
        assert!(!swap(
            &mut [thing(Some("mug"), 0.0), thing(Some("mug"), 1.0)],
            None
        ));
        assert!(!swap(&mut [], Some("glass")));
    }

    #[test]
    fn raised_objects_keep_their_places_on_the_map() {
        let mut things = vec![thing(Some("mug"), 0.5)];
        assert!(raise(&mut things) && !raise(&mut []));
        assert!((things[0].pose.position[2] - 1.1).abs() < 1e-9);
        assert_eq!(shown(&things), [(Some("mug"), 0.5)]);
    }

    #[test]
    fn a_mistaken_object_gets_another_category_and_size() {
        let kind = |name: &str, side: f64| KnownKind {
            name: name.into(),
            category: name.into(),
            size_m: [side; 3],
            rim: None,
            is_box: false,
        };
        let kinds = [kind("can", 0.1), kind("glass", 0.12), kind("bowl", 0.3)];
        let mut things = vec![thing(None, 0.0), thing(Some("can"), 1.0)];
        assert!(mistake(&mut things, Some("glass"), &kinds));
        assert_eq!(
            (things[1].category.as_deref(), things[1].size_m),
            (Some("bowl"), [0.3; 3])
        );
        assert!(!mistake(&mut [thing(None, 0.0)], None, &kinds));
    }
}
