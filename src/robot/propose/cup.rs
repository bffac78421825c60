//! The suction cup of a robot without fingers: a link with such a name, its lip and its radius.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::body::chain;
use super::fingers::{ProposedHand, is_called, rounded, written};
use super::frames::corners;
use crate::description::RobotModel;
use actcheck_data::{Hand, Suction};

/// Words in the names of links with a cup.
const WORDS: [&str; 2] = ["suction", "vacuum"];
/// Usual pressure of the vacuum below that of the air. Unit: pascals. Ejectors reach 80 kPa on
/// tight surfaces.
const PRESSURE_PA: f64 = 6e4;
/// Friction of the lip: that of rubber on dry surfaces.
const FRICTION: f64 = 0.5;
/// Depth of the lip's part of a shape. Unit: metres.
const LIP_M: f64 = 5e-3;
/// Radius of a cup without shapes, and the least and greatest ones. Unit: metres.
const RADIUS_M: f64 = 0.015;
const RADII_M: (f64, f64) = (0.003, 0.1);

/// Finds a link with the name of a cup, and proposes its lip as the grasp frame. Returns `None` if
/// there is none.
pub(super) fn find(model: &RobotModel, wanted: Option<&str>) -> Option<ProposedHand> {
    let has_word = |name: &str| WORDS.iter().any(|word| name.to_lowercase().contains(word));
    let is_wanted = |link: usize| wanted.is_none_or(|wanted| is_called(model, link, wanted));
    let named = model
        .frames()
        .filter(|(name, (link, _))| has_word(name) && is_wanted(*link));
    let far = |(_, (link, at)): &(&str, &(usize, Isometry3<f64>))| {
        (chain(model, *link).len(), at.translation.vector.norm())
    };
    // Of several links of one tool, the farthest from the arm.
    let (name, (palm, at)) =
        named.max_by(|a, b| far(a).0.cmp(&far(b).0).then(far(a).1.total_cmp(&far(b).1)))?;
    let name = name.to_owned();
    let points: Vec<Point3<f64>> = model.links[*palm].solids.iter().flat_map(corners).collect();
    let axis = outwards(at, &points);
    let inside = |point: &Point3<f64>| at.inverse() * point;
    let along = |point: &Point3<f64>| inside(point).coords.dot(&axis);
    let reach_m = points.iter().map(along).fold(0.0, f64::max);
    let lip = points
        .iter()
        .filter(|point| along(point) > reach_m - LIP_M)
        .map(|point| {
            let aside = inside(point).coords - axis * along(point);
            // Half of the side of the box around a round cup.
            aside.amax()
        });
    let radius_m = lip.fold(None, |widest: Option<f64>, aside| {
        Some(widest.map_or(aside, |known| known.max(aside)))
    });
    let radius_m = radius_m.unwrap_or(RADIUS_M).clamp(RADII_M.0, RADII_M.1);
    let turned = UnitQuaternion::rotation_between(&Vector3::x(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI));
    let frame = Isometry3::from_parts(Translation3::from(axis * reach_m), turned);
    let force_n = (PRESSURE_PA * PI * radius_m * radius_m).round();
    let cup = Suction {
        force_n,
        radius_m: rounded([radius_m; 3])[0],
        friction: FRICTION,
    };
    let notes = BTreeMap::from([
        ("grasp_link", "its name is that of a suction cup".to_owned()),
        ("grasp_offset_m", "the end of its shapes".to_owned()),
        ("grasp_turned_rad", "x away from the arm".to_owned()),
        (
            "suction_radius_m",
            "half of the width of the shapes there".to_owned(),
        ),
        (
            "suction_force_n",
            "the area of the lip at 0.6 bar below the air's pressure".to_owned(),
        ),
    ]);
    let hand = Hand::of_cup(written(name, &frame), cup);
    Some(ProposedHand {
        notes,
        ..ProposedHand::known(hand, *palm)
    })
}

/// The axis of a link's frame, as a vector in it, that points away from the joint before the link.
fn outwards(at: &Isometry3<f64>, points: &[Point3<f64>]) -> Vector3<f64> {
    let offset = at.translation.vector;
    let away = if offset.norm() > LIP_M {
        offset
    } else {
        points.iter().map(|point| point.coords).sum()
    };
    let inside = at.rotation.inverse() * away;
    let idx = inside.iamax();
    let mut axis = Vector3::zeros();
    axis[idx] = if inside[idx] < 0.0 { -1.0 } else { 1.0 };
    axis
}
