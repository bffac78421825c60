//! Masses and sizes of the models that scenes use, and warnings about those that can't be meant.
//!
//! A number in grams or millimetres, or a missing factor, gives a valid model that behaves as no
//! real thing does: its runs fail, and the robot seems to be at fault.

use crate::Env;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_config::Campaign;
use actcheck_data::ObjectModel;
use actcheck_world::{Robot, RobotMeasures};

/// A solid of less than this is lighter than the air around it, which has 1.2 kg/m³ (1.225 kg/m³ at
/// sea level by ISO 2533), and would float away; the lightest foam of packages has 10. Unit: kg/m³.
const LEAST_DENSITY: f64 = 1.0;
/// Osmium, the densest element, has 22,590 kg/m³ (CRC Handbook of Chemistry and Physics); the rest
/// is for shapes that are a little smaller than the thing. Unit: kg/m³.
const GREATEST_DENSITY: f64 = 25_000.0;
/// Nothing of this size fits into a scene; in millimetres that are read as metres, it would have
/// 2 cm. Unit: metres.
const LARGEST_M: f64 = 20.0;
/// The same for furniture that is built in, such as walls: the floor of a world has a radius of
/// 14 m. Unit: metres.
const LARGEST_BUILT_IN_M: f64 = 28.0;
/// No gripper takes something this small; in metres that are read as millimetres, it would have
/// 2 m. Unit: metres.
const SMALLEST_M: f64 = 2e-3;
/// The same for robots: the smallest arms for desks are ten times as large. Unit: metres.
const SMALLEST_ROBOT_M: f64 = 0.02;
/// Of the arms on the market, the RM65 of RealMan is among the lightest for its load: 7.2 kg for
/// 5 kg (its data sheet), 0.7 times its mass. Motors reach about twice the effort that they are
/// rated for, so that twice as much, 1.4, may be true.
const MOST_LIFTED: f64 = 1.5;

impl Env {
    /// Mass and size of the robot and of each model that the configuration names, one line each.
    pub fn masses_and_sizes(&self) -> String {
        let robot = &self.robot.profile.core;
        let RobotMeasures {
            mass_kg, size_m, ..
        } = self.robot.measures();
        let of_robot = format!("{}: {}, {}\n", robot.name, mass(mass_kg), size(size_m));
        let named = named_models(&self.campaign).into_iter();
        let of_models = named.map(|model| {
            let mass_kg = model.mass_kg + of_parts(model).map(|part| part.mass_kg).sum::<f64>();
            format!(
                "{}: {}, {}\n",
                model.name,
                mass(mass_kg),
                size(model.size_m)
            )
        });
        std::iter::once(of_robot).chain(of_models).collect()
    }
}

/// Warnings (W056) about the robot and the models of a campaign whose mass or size can't be meant.
pub(super) fn implausible(campaign: &Campaign, robot: Option<&Robot>) -> Diagnostics {
    let used = campaign.used_models();
    let models = campaign.models.values();
    let of_models = models
        .filter(|model| used.contains(&model.name))
        .flat_map(|model| {
            let found = faults_of(model).into_iter();
            found.map(move |(message, help)| warning(campaign, &model.name, message, help))
        });
    let of_robot = robot.map(|robot| implausible_robot(campaign, robot.measures()));
    of_models.chain(of_robot.into_iter().flatten()).collect()
}

/// The faults of a model, with their help. One of its size makes its densities wrong, too.
fn faults_of(model: &ObjectModel) -> Vec<(String, &'static str)> {
    match implausible_size(model) {
        Some(fault) => vec![fault],
        None => std::iter::once(model)
            .chain(of_parts(model))
            .filter_map(implausible_density)
            .collect(),
    }
}

/// The models that the configuration names, by name.
fn named_models(campaign: &Campaign) -> Vec<&ObjectModel> {
    let candidates = campaign.candidates.values().flatten();
    let mut names: Vec<&String> = candidates.chain(&campaign.nav_obstacles).collect();
    names.sort();
    names.dedup();
    let named = names
        .into_iter()
        .filter_map(|name| campaign.models.get(name));
    named.map(AsRef::as_ref).collect()
}

/// The parts of a model that joints move.
fn of_parts(model: &ObjectModel) -> impl Iterator<Item = &ObjectModel> {
    model.moving.iter().map(|part| part.model.as_ref())
}

/// A warning at the first place where the configuration names a model.
fn warning(campaign: &Campaign, name: &str, message: String, help: &str) -> Diagnostic {
    let key = campaign.candidates.iter().find_map(|(table, names)| {
        let idx = names.iter().position(|other| other == name)?;
        Some(format!("{table}.{idx}"))
    });
    campaign
        .warning("W056", &key.unwrap_or_default(), message)
        .help(help)
}

/// The fault of a body that is lighter than air or denser than any element. The mass of a static
/// one has no effect.
fn implausible_density(body: &ObjectModel) -> Option<(String, &'static str)> {
    let volume_m3 = body.volume();
    let density = body.mass_kg / volume_m3;
    if body.fixed || !density.is_finite() || (LEAST_DENSITY..=GREATEST_DENSITY).contains(&density) {
        return None;
    }
    let comparison = if density < LEAST_DENSITY {
        "less than air"
    } else {
        "more than any element"
    };
    let message = format!(
        "`{}` has {} for {}: {} kg/m³ is {comparison}",
        body.name,
        mass(body.mass_kg),
        volume(volume_m3),
        rounded(density),
    );
    let help = "correct its mass, in kilograms, or its shapes, in metres: a thing like this does not move as a real one";
    Some((message, help))
}

/// The fault of a model that is too large or too small for any scene.
fn implausible_size(model: &ObjectModel) -> Option<(String, &'static str)> {
    let largest_m = model.size_m.into_iter().fold(0.0, f64::max);
    let all = size(model.size_m);
    let limit_m = match model.fixed {
        true => LARGEST_BUILT_IN_M,
        false => LARGEST_M,
    };
    if largest_m > limit_m {
        let message = format!(
            "`{}` is {all} large: are its lengths in millimetres?",
            model.name
        );
        let help = "lengths are in metres: correct them, or give its meshes `scale` 0.001";
        Some((message, help))
    } else if largest_m < SMALLEST_M {
        let message = format!(
            "`{}` is only {all} large: is its `scale` too small?",
            model.name
        );
        Some((
            message,
            "lengths are in metres: correct them, or the `scale` of its meshes",
        ))
    } else {
        None
    }
}

/// Warnings about the robot's size, and about its mass for the load that it lifts.
fn implausible_robot(campaign: &Campaign, measured: RobotMeasures) -> Vec<Diagnostic> {
    let robot = &campaign.robot.core;
    let RobotMeasures {
        mass_kg,
        size_m,
        lift_kg,
    } = measured;
    let warning = |message: String, help: &str| {
        campaign
            .warning("W056", "robot.profile", message)
            .help(help)
    };
    let mut found = Vec::new();
    let largest_m = size_m.into_iter().fold(0.0, f64::max);
    if largest_m > LARGEST_M || (largest_m > 0.0 && largest_m < SMALLEST_ROBOT_M) {
        let message = format!("{} is {} large", robot.name, size(size_m));
        let help = "lengths of joints and shapes are in metres: correct them, or the `scale` of the meshes";
        found.push(warning(message, help));
    }
    if let Some(lift_kg) = lift_kg.filter(|lift_kg| *lift_kg > MOST_LIFTED * mass_kg) {
        let message = format!(
            "{} has {} and motors that lift {} in every posture: no arm lifts {MOST_LIFTED} times its own mass",
            robot.name,
            mass(mass_kg),
            mass(lift_kg),
        );
        let help = "correct the masses of its links or the `effort` of its joints: with wrong ones, it moves and \
                    carries as no real robot does";
        found.push(warning(message, help));
    }
    found
}

/// Formats a mass in kilograms.
fn mass(kg: f64) -> String {
    let (value, unit) = match kg {
        kg if kg >= 1.0 => (kg, "kg"),
        kg if kg >= 1e-3 => (kg * 1e3, "g"),
        kg => (kg * 1e6, "mg"),
    };
    format!("{} {unit}", rounded(value))
}

/// Formats a volume in cubic metres.
fn volume(m3: f64) -> String {
    let (value, unit) = match m3 {
        m3 if m3 >= 1.0 => (m3, "m³"),
        m3 if m3 >= 1e-3 => (m3 * 1e3, "l"),
        m3 if m3 >= 1e-6 => (m3 * 1e6, "cm³"),
        m3 => (m3 * 1e9, "mm³"),
    };
    format!("{} {unit}", rounded(value))
}

/// Formats lengths in metres, all in one unit.
fn size(metres: [f64; 3]) -> String {
    let (factor, unit) = match metres.into_iter().fold(0.0, f64::max) {
        largest if largest >= 1.0 => (1.0, "m"),
        largest if largest >= 0.01 => (100.0, "cm"),
        _ => (1e3, "mm"),
    };
    let [x, y, z] = metres.map(|length| rounded(length * factor));
    format!("{x} × {y} × {z} {unit}")
}

/// Formats a number with three significant digits.
fn rounded(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 12"
    )]
    let digits = (2.0 - libm::floor(libm::log10(value.abs()))).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
