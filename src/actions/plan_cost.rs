//! The cost of a mobile robot's plan, and arm paths around obstacles.

use crate::motion::{self, ArmSpace, Room, Samples};
use crate::plan::{AMPLE_CLEAR_M, FURNITURE_CLEAR_M, LEAST_CLEAR_M, Plan, Planner};
use crate::route::length;

/// Number of postures checked along the path of an unfolding arm.
const N_CHECKS: usize = 12;
/// Samples allowed per grasp.
const SAMPLES_A_GRASP: u32 = 400;

impl Planner<'_> {
    /// Cost of a plan: proximity to obstacles, then path length. Returns `None` if the path is not free or costs at
    /// least `bound`. If the arm can't unfold in a straight line, a path around the obstacles is sampled while samples
    /// remain.
    pub(super) fn cost(&self, plan: &mut Plan, bound: f64, samples: &mut Samples) -> Option<f64> {
        let travel = self.travel_cost(plan.drive.last()?) + 0.4 * self.detour(&plan.drive);
        let course = [plan.reach.last()?, &plan.near[0], plan.approach.last()?, plan.lift.last()?];
        let mut cost = travel;
        // Check the last leg first: most plans fail there.
        for pair in course.windows(2).rev() {
            cost = cost.max(self.leg_cost(pair[0], pair[1], travel).filter(|cost| *cost < bound)?);
        }
        let stand = plan.drive.last()?;
        let straight = self.leg_cost(stand, plan.reach.last()?, travel);
        if let Some(leg) = straight.filter(|_| self.keeps_off_itself(stand, plan.reach.last())) {
            return Some(cost.max(leg)).filter(|cost| *cost < bound);
        }
        let mut samples = samples.share(SAMPLES_A_GRASP);
        plan.reach = self.around(stand, plan.reach.last()?, &mut samples)?;
        for (from, to) in std::iter::once(stand).chain(&plan.reach).zip(&plan.reach) {
            cost = cost.max(self.leg_cost(from, to, travel)?);
        }
        Some(cost).filter(|cost| *cost < bound)
    }

    /// Cost of one leg. Returns `None` if something is in the way.
    fn leg_cost(&self, from: &[f64], to: &[f64], travel: f64) -> Option<f64> {
        let (furniture, things) = self.clearance(from, to);
        let is_free = furniture >= FURNITURE_CLEAR_M && things >= LEAST_CLEAR_M;
        is_free.then(|| travel + (AMPLE_CLEAR_M - things).max(0.0) * 50.0)
    }

    /// Whether the path is free of self-collisions.
    fn keeps_off_itself(&self, from: &[f64], to: Option<&Vec<f64>>) -> bool {
        let Some(to) = to else { return true };
        (1..=N_CHECKS).all(|step| {
            let share = step as f64 / N_CHECKS as f64;
            let positions: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect();
            !self.itself.touches(&self.kinematics.links(&positions))
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
        let least = Room { furniture_m: FURNITURE_CLEAR_M, things_m: LEAST_CLEAR_M };
        motion::way(&space, from, to, least, samples)
    }

    /// Length of the drive beyond the straight line. Unit: metres.
    fn detour(&self, drive: &[Vec<f64>]) -> f64 {
        let ([x, y, _], Some(end)) = (self.base, drive.last()) else { return 0.0 };
        let way = |a: &[f64], b: &[f64]| length(b[x] - a[x], b[y] - a[y]);
        let legs = std::iter::once(&self.start).chain(drive);
        legs.zip(drive).map(|(a, b)| way(a, b)).sum::<f64>() - way(&self.start, end)
    }

    /// Smallest distances to furniture and to objects along the path between two postures. Unit: metres; negative
    /// inside.
    fn clearance(&self, from: &[f64], to: &[f64]) -> (f64, f64) {
        let mut least = (f64::INFINITY, f64::INFINITY);
        for step in 0..=N_CHECKS {
            let share = step as f64 / N_CHECKS as f64;
            let positions: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect();
            let links = self.kinematics.links(&positions);
            for (link, point) in &self.points {
                let point = links[*link] * point;
                for block in &self.furniture {
                    least.0 = least.0.min(block.distance(&point));
                }
                for pillar in &self.things {
                    least.1 = least.1.min(pillar.distance(&point));
                }
            }
        }
        least
    }
}
