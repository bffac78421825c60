//! Reasons why grasps can't be planned, and the sentence about the grasp that came nearest to a
//! plan.
//!
//! Never: plans, or decides how much clearance is needed.

use std::fmt;

use nalgebra::{Isometry3, Point3};

use crate::link_points::LinkPoints;
use crate::plan::{BODY_CLEAR_M, FURNITURE_CLEAR_M, LEAST_CLEAR_M, NO_WAY};
use crate::route::{Block, Pillar};
use actcheck_world::{Kinematics, Sighting};

/// Why a grasp is not planned, in the order in which the planner finds out.
#[derive(Debug, Clone, PartialEq)]
pub enum Hindrance {
    /// Another plan costs less.
    Dearer,
    /// No joint positions bring the hand there.
    OutOfReach,
    /// The open hand would touch the object before it closes. The planner then looks for other
    /// grasps.
    Touches,
    /// The arm can't move the hand straight to the object or up from it.
    NoLift,
    /// The arm would collide with the robot. `links` are the two that come too close, if the
    /// postures were found.
    Itself { links: Option<(usize, usize)> },
    /// The base has no free path to its place.
    NoRoute,
    /// The arm has no free path to its posture.
    NoPath,
    /// A posture is too close to furniture or objects. `lack_m` is the clearance that it lacks.
    /// Unit: metres.
    Blocked { posture: Vec<f64>, lack_m: f64 },
}

impl Hindrance {
    /// Later stages are greater; among blocked postures, those that lack less.
    fn progress(&self) -> (u8, f64) {
        match self {
            Self::Dearer => (0, 0.0),
            // Says nothing about the object: other grasps are tried, and then this one again.
            Self::Touches => (0, 1.0),
            Self::OutOfReach => (1, 0.0),
            Self::NoLift => (2, 0.0),
            Self::Itself { links } => (3, if links.is_some() { 1.0 } else { 0.0 }),
            Self::NoRoute => (4, 0.0),
            Self::Blocked { lack_m, .. } => (5, -lack_m),
            Self::NoPath => (6, 0.0),
        }
    }
}

/// No grasp has a plan: a sentence for the action's report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoPlan {
    /// A clause about the grasp that came nearest to a plan, if one says something about the
    /// object.
    pub why: Option<String>,
}

impl fmt::Display for NoPlan {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.why {
            None => out.write_str(NO_WAY),
            Some(why) => write!(out, "{NO_WAY}: {why}"),
        }
    }
}

impl std::error::Error for NoPlan {}

/// The hindrance of the grasp that came nearest to a plan.
#[derive(Debug, Default)]
pub struct Nearest(Option<Hindrance>);

impl Nearest {
    /// Keeps the hindrance if its grasp came nearer to a plan than the others so far.
    pub fn note(&mut self, hindrance: Hindrance) {
        let is_nearer = self
            .0
            .as_ref()
            .is_none_or(|kept| kept.progress() < hindrance.progress());
        if is_nearer {
            self.0 = Some(hindrance);
        }
    }

    /// Whether no posture brought the hand to the object.
    pub fn is_out_of_reach(&self) -> bool {
        matches!(
            self.0,
            None | Some(Hindrance::Dearer | Hindrance::OutOfReach)
        )
    }

    /// The reason for the action's report.
    pub fn reason(&self, thing: Option<&Sighting>, around: &Surroundings<'_>) -> NoPlan {
        let why = match &self.0 {
            None | Some(Hindrance::Dearer | Hindrance::Touches) => return NoPlan { why: None },
            Some(Hindrance::OutOfReach) => out_of_reach(thing, around.furniture),
            Some(Hindrance::NoLift) => {
                "the arm reaches it but can't lift it straight up".to_owned()
            }
            Some(Hindrance::Itself { links: None }) => {
                "the arm would collide with the robot".to_owned()
            }
            Some(Hindrance::Itself {
                links: Some((first, second)),
            }) => {
                let [first, second] =
                    [first, second].map(|link| around.kinematics.link_name(*link));
                format!("the arm would collide with the robot, {second} with {first}")
            }
            Some(Hindrance::NoRoute) => {
                "the base has no free path to where the arm reaches it".to_owned()
            }
            Some(Hindrance::NoPath) => {
                "the arm found no free path to where it reaches it".to_owned()
            }
            Some(Hindrance::Blocked { posture, .. }) => around.in_the_way(posture),
        };
        NoPlan { why: Some(why) }
    }
}

/// The robot and the obstacles around it, as a planner knows them.
pub struct Surroundings<'a> {
    pub(super) kinematics: &'a Kinematics,
    /// Points on the links, with those of the hand marked in `is_hand` by the link's index.
    pub(super) points: &'a [LinkPoints],
    pub(super) is_hand: &'a [bool],
    pub(super) furniture: &'a [Block],
    pub(super) things: &'a [Pillar],
    /// Whether the arm has to stay farther from furniture than the hand.
    pub(super) arm_farther: bool,
}

/// The clearance of a link to an obstacle. Unit: metres.
struct Gap<'a> {
    link: usize,
    obstacle: &'a str,
    clear_m: f64,
    needed_m: f64,
}

impl Surroundings<'_> {
    /// A clause about the link that lacks the most clearance.
    fn in_the_way(&self, posture: &[f64]) -> String {
        let links = self.kinematics.links(posture);
        let gaps = self
            .points
            .iter()
            .flat_map(|points| self.gaps(points, &links[points.link]));
        let Some(gap) =
            gaps.max_by(|a, b| (a.needed_m - a.clear_m).total_cmp(&(b.needed_m - b.clear_m)))
        else {
            return "something is in the way".to_owned();
        };
        let Gap {
            link,
            obstacle,
            clear_m,
            needed_m,
        } = gap;
        let link = self.kinematics.link_name(link);
        let needs = if needed_m > 0.0 {
            format!("needs {}", centimetres(needed_m))
        } else {
            "must be out".to_owned()
        };
        match clear_m >= 0.0 {
            true => format!(
                "{link} would be {} from {obstacle} and {needs}",
                centimetres(clear_m)
            ),
            false => format!(
                "{link} would be {} inside {obstacle} and {needs}",
                centimetres(-clear_m)
            ),
        }
    }

    fn gaps(&self, points: &LinkPoints, pose: &Isometry3<f64>) -> Vec<Gap<'_>> {
        let link = points.link;
        let nearest =
            |distance: &dyn Fn(&Point3<f64>) -> f64| points.nearest(pose, f64::INFINITY, distance);
        let needed_m = if self.is_hand[link] || !self.arm_farther {
            FURNITURE_CLEAR_M
        } else {
            BODY_CLEAR_M
        };
        let furniture = self.furniture.iter().map(|block| {
            let clear_m = nearest(&|point| block.distance(point));
            Gap {
                link,
                obstacle: &block.id,
                clear_m,
                needed_m,
            }
        });
        let things = self.things.iter().map(|pillar| {
            let clear_m = nearest(&|point| pillar.distance(point));
            Gap {
                link,
                obstacle: &pillar.id,
                clear_m,
                needed_m: LEAST_CLEAR_M,
            }
        });
        furniture.chain(things).collect()
    }
}

/// A clause with the place of an object that the arm does not reach.
fn out_of_reach(thing: Option<&Sighting>, furniture: &[Block]) -> String {
    let Some(thing) = thing else {
        return "it is out of reach".to_owned();
    };
    let place = Point3::from(thing.pose.position);
    let below = furniture.iter().find(|block| block.beside(&place) < 0.0);
    let inwards = below.map(|block| {
        format!(
            " and {} from the edge of {}",
            centimetres(-block.beside(&place)),
            block.id
        )
    });
    format!(
        "it is out of reach, {} above the floor{}",
        centimetres(place.z),
        inwards.unwrap_or_default()
    )
}

fn centimetres(metres: f64) -> String {
    format!("{:.1} cm", metres * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grasp_that_came_nearest_to_a_plan_is_reported() {
        let blocked = |lack_m| Hindrance::Blocked {
            posture: Vec::new(),
            lack_m,
        };
        let mut nearest = Nearest::default();
        for hindrance in [
            Hindrance::NoLift,
            blocked(0.03),
            Hindrance::OutOfReach,
            blocked(0.01),
            blocked(0.02),
        ] {
            nearest.note(hindrance);
        }
        assert_eq!(nearest.0, Some(blocked(0.01)));
    }
}
