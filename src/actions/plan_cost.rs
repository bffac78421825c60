//! The cost of a mobile robot's plan, and arm paths around obstacles.

use crate::hindrance::Hindrance;
use crate::motion::{self, ArmClearance, ArmSpace, Samples};
use crate::plan::{
    AMPLE_BODY_CLEAR_M, AMPLE_CLEAR_M, BODY_CLEAR_M, FURNITURE_CLEAR_M, LEAST_CLEAR_M, Plan,
    Planner,
};
use crate::route::length;

/// Number of postures checked along the path of an unfolding arm.
const N_CHECKS: usize = 12;
/// Cost of each metre that the clearance to objects lacks.
const THING_COST: f64 = 50.0;
/// As [`THING_COST`], for the clearance of the base and the arm to furniture.
const FURNITURE_COST: f64 = 30.0;
/// Samples allowed per grasp.
const SAMPLES_A_GRASP: u32 = 400;

impl Planner<'_> {
    /// Cost of a plan: proximity to obstacles, then path length. If the arm can't unfold in a
    /// straight line, a path around the obstacles is sampled while samples remain.
    ///
    /// # Errors
    /// The hindrance if the path is not free or costs at least `bound`.
    pub(super) fn cost(
        &self,
        plan: &mut Plan,
        bound: f64,
        samples: &mut Samples,
    ) -> Result<f64, Hindrance> {
        let below_bound = |cost: f64| {
            if cost < bound {
                Ok(cost)
            } else {
                Err(Hindrance::Dearer)
            }
        };
        let [Some(stand), Some(unfolded), Some(at_thing), Some(lifted)] = [
            plan.drive.last(),
            plan.reach.last(),
            plan.approach.last(),
            plan.lift.last(),
        ] else {
            return Err(Hindrance::NoRoute);
        };
        let travel = self.travel_cost(stand) + 0.4 * self.detour(&plan.drive);
        let course = [unfolded, &plan.near[0], at_thing, lifted];
        let mut cost = travel;
        // Check the last leg first: most plans fail there.
        for pair in course.windows(2).rev() {
            cost = cost.max(below_bound(self.leg_cost(pair[0], pair[1], travel)?)?);
        }
        let hindrance = match self.leg_cost(stand, unfolded, travel) {
            Ok(leg) if self.keeps_off_itself(stand, unfolded) => return below_bound(cost.max(leg)),
            Ok(_) => Hindrance::Itself { links: None },
            Err(hindrance) => hindrance,
        };
        let mut samples = samples.share(SAMPLES_A_GRASP);
        let around = self
            .around(stand, unfolded, &mut samples)
            .ok_or(hindrance)?;
        for (from, to) in std::iter::once(stand).chain(&around).zip(&around) {
            cost = cost.max(self.leg_cost(from, to, travel)?);
        }
        plan.reach = around;
        below_bound(cost)
    }

    /// Cost of one leg.
    ///
    /// # Errors
    /// [`Hindrance::Blocked`] if something is in the way.
    fn leg_cost(&self, from: &[f64], to: &[f64], travel: f64) -> Result<f64, Hindrance> {
        let nearest = self.clearance(from, to)?;
        let lack_of_room = AMPLE_BODY_CLEAR_M - nearest.body_m;
        Ok(
            travel
                + (AMPLE_CLEAR_M - nearest.things_m) * THING_COST
                + lack_of_room * FURNITURE_COST,
        )
    }

    /// Whether the path is free of self-collisions.
    pub(super) fn keeps_off_itself(&self, from: &[f64], to: &[f64]) -> bool {
        (1..=N_CHECKS).all(|step| {
            let share = step as f64 / N_CHECKS as f64;
            let positions: Vec<f64> = from
                .iter()
                .zip(to)
                .map(|(a, b)| a + (b - a) * share)
                .collect();
            !self.touches_itself(&positions)
        })
    }

    /// A sampled arm path around the obstacles.
    fn around(&self, from: &[f64], to: &[f64], samples: &mut Samples) -> Option<Vec<Vec<f64>>> {
        if samples.are_spent() {
            return None;
        }
        let space = ArmSpace::new(
            self.kinematics,
            self.layout,
            &self.furniture,
            &self.things,
            std::slice::from_ref(&self.start),
        );
        let space = space.farther(BODY_CLEAR_M - FURNITURE_CLEAR_M);
        let least = ArmClearance {
            furniture_m: FURNITURE_CLEAR_M,
            things_m: LEAST_CLEAR_M,
        };
        motion::way(&space, from, to, least, samples)
    }

    /// Length of the drive beyond the straight line. Unit: metres.
    fn detour(&self, drive: &[Vec<f64>]) -> f64 {
        let ([x, y, _], Some(end)) = (self.base, drive.last()) else {
            return 0.0;
        };
        let way = |a: &[f64], b: &[f64]| length(b[x] - a[x], b[y] - a[y]);
        let legs = std::iter::once(&self.start).chain(drive);
        legs.zip(drive).map(|(a, b)| way(a, b)).sum::<f64>() - way(&self.start, end)
    }

    /// Smallest distances to furniture and to objects along the path between two postures, up to
    /// the distance beyond which more brings no benefit.
    ///
    /// # Errors
    /// [`Hindrance::Blocked`] with the first posture that is not free.
    fn clearance(&self, from: &[f64], to: &[f64]) -> Result<PathClearance, Hindrance> {
        let mut nearest = PathClearance::AMPLE;
        for step in 0..=N_CHECKS {
            let share = step as f64 / N_CHECKS as f64;
            let positions: Vec<f64> = from
                .iter()
                .zip(to)
                .map(|(a, b)| a + (b - a) * share)
                .collect();
            let links = self.kinematics.links(&positions);
            for points in &self.points {
                let pose = &links[points.link];
                let of_furniture = if self.is_hand[points.link] {
                    &mut nearest.hand_m
                } else {
                    &mut nearest.body_m
                };
                for block in &self.furniture {
                    *of_furniture =
                        points.nearest(pose, *of_furniture, |point| block.distance(point));
                }
                for pillar in &self.things {
                    nearest.things_m =
                        points.nearest(pose, nearest.things_m, |point| pillar.distance(point));
                }
                if !nearest.is_free() {
                    return Err(Hindrance::Blocked {
                        posture: positions,
                        lack_m: nearest.lack_m(),
                    });
                }
            }
        }
        Ok(nearest)
    }
}

/// Smallest distances on a path. Unit: metres; negative inside.
struct PathClearance {
    /// Of the hand to furniture.
    hand_m: f64,
    /// Of the other links to furniture.
    body_m: f64,
    /// Of all links to objects.
    things_m: f64,
}

impl PathClearance {
    /// Distances beyond which more brings no benefit.
    const AMPLE: Self = Self {
        hand_m: FURNITURE_CLEAR_M,
        body_m: AMPLE_BODY_CLEAR_M,
        things_m: AMPLE_CLEAR_M,
    };

    /// Largest lack of clearance. Unit: metres.
    fn lack_m(&self) -> f64 {
        (FURNITURE_CLEAR_M - self.hand_m)
            .max(BODY_CLEAR_M - self.body_m)
            .max(LEAST_CLEAR_M - self.things_m)
    }

    /// Whether nothing is in the way.
    fn is_free(&self) -> bool {
        self.hand_m >= FURNITURE_CLEAR_M
            && self.body_m >= BODY_CLEAR_M
            && self.things_m >= LEAST_CLEAR_M
    }
}
