//! Warnings about objects that a suction cup can't hold, from their shapes and masses.

use crate::Env;
use actcheck_actions as actions;
use actcheck_base::Diagnostic;
use actcheck_data::{ObjectModel, Pose, Suction};
use actcheck_world::{self as world, GRAVITY};

/// Safety factor of a seal against the accelerations of the arm. Vendors of cups take 1.5 for level
/// motions.
const SAFETY: f64 = 1.5;

impl Env {
    /// S070 or S072 for an object that the robot's suction cup can't hold.
    pub(super) fn unsealed(
        &self,
        key: &str,
        model: &ObjectModel,
        cup: &Suction,
    ) -> Option<Diagnostic> {
        let lips = actions::lips_on(model.size_m, cup);
        let flat = lips.iter().filter(|lip| world::would_seal(model, lip, cup));
        match flat.map(|lip| carried_n(lip, model, cup)).reduce(f64::max) {
            Some(force_n) => self.too_heavy_to_seal(key, model, force_n),
            None => Some(self.no_flat_place(key, model, cup)),
        }
    }

    fn no_flat_place(&self, key: &str, model: &ObjectModel, cup: &Suction) -> Diagnostic {
        let message = format!(
            "`{}` can't be held by the suction cup: it has no flat place as wide as the cup, {:.1} cm, in the middle of its top or \
             of a side",
            model.name,
            cup.radius_m * 200.0,
        );
        let help = "every pick of it will fail: name an object with a flat top, or a robot with a smaller cup";
        self.campaign.warning("S070", key, message).help(help)
    }

    fn too_heavy_to_seal(
        &self,
        key: &str,
        model: &ObjectModel,
        force_n: f64,
    ) -> Option<Diagnostic> {
        let [lightest_kg, heaviest_kg] =
            <[f64; 2]>::from(self.campaign.physics.mass_scale).map(|scale| model.mass_kg * scale);
        let carried_kg = force_n / GRAVITY;
        if heaviest_kg * SAFETY <= carried_kg {
            return None;
        }
        let (breaks, mass) = match lightest_kg > carried_kg {
            true => ("breaks", format!("at least {lightest_kg:.2} kg")),
            false => ("may break", format!("up to {heaviest_kg:.2} kg")),
        };
        let message = format!(
            "`{}` {breaks} the seal of the suction cup: it has {mass}, and a seal that carries {force_n:.1} N holds \
             {carried_kg:.2} kg at rest and {:.2} kg with a safety factor of {SAFETY} for motions",
            model.name,
            carried_kg / SAFETY,
        );
        let help = "reduce the object's mass or `mass_scale`, or raise `suction_force_n` in the robot's profile";
        Some(self.campaign.warning("S072", key, message).help(help))
    }
}

/// The weight that a seal at this place of an upright object carries. On a side, it shears the lip
/// and peels it off. Unit: newtons.
fn carried_n(lip: &Pose, model: &ObjectModel, cup: &Suction) -> f64 {
    let [x, y, z] = lip.position;
    if (z - model.size_m[2]).abs() < 1e-6 {
        return cup.force_n;
    }
    // The middle of the object is as far from the lip as the lip is from the object's axis.
    let lever_m = libm::hypot(x, y).max(1e-6);
    cup.most_shear_n(cup.force_n)
        .min(cup.most_peel_nm(cup.force_n) / lever_m)
}
