//! Colours and patterns of surfaces, as shares of reflected light.

use nalgebra::Point3;

use actcheck_data::{Colour, Stream, Texture};

/// Side of a square of the checker pattern. Unit: metres.
const SQUARE_M: f64 = 0.08;
/// Distance between rings of wood. Unit: metres.
const RING_M: f64 = 0.045;
/// Length of the streaks of wood, and their width. Unit: metres.
const STREAK_M: [f64; 2] = [0.35, 0.012];
/// Brightness of the darker parts of a pattern.
const DARK: f32 = 0.45;

/// The colour of a body that replaces those of its files.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finish {
    /// The pattern, which fills the body's frame like the grain of a solid.
    pub texture: Texture,
    /// The colour of its brighter parts.
    pub colour: Colour,
}

impl Finish {
    /// The reflected light at a point. Frame: the body's.
    pub(super) fn at(&self, point: &Point3<f64>) -> [f32; 3] {
        let share = match self.texture {
            Texture::Plain => 1.0,
            Texture::Checker => {
                // Moved a little, so that the sides of bodies of round sizes are not on a border.
                let square = |along: f64| ((along + 0.0013) / SQUARE_M).floor();
                let sum = square(point.x) + square(point.y) + square(point.z);
                if sum.rem_euclid(2.0) < 0.5 { 1.0 } else { DARK }
            }
            Texture::Wood => wood(point),
        };
        to_light(self.colour).map(|channel| channel * share)
    }
}

/// The brightness of wood: rings that are bent and streaks along x.
fn wood(point: &Point3<f64>) -> f32 {
    let bend = noise([point.x / 0.5, point.y / 0.12, point.z / 0.12]);
    let ring = (point.y + 0.6 * point.z) / RING_M + 2.0 * bend;
    // A triangle wave, from 0 to 1.
    let ring = (2.0 * (ring - ring.floor()) - 1.0).abs();
    let [long, wide] = STREAK_M;
    let streak = noise([point.x / long, point.y / wide, point.z / wide]);
    #[expect(clippy::cast_possible_truncation, reason = "a share")]
    let dark = (0.55 * ring + 0.45 * streak) as f32;
    1.0 - (1.0 - DARK) * dark
}

/// Smooth noise from 0 to 1: one random number for each point of a grid, with weights between.
fn noise(at: [f64; 3]) -> f64 {
    let low = at.map(f64::floor);
    let weights = [0, 1, 2].map(|axis| {
        let share = at[axis] - low[axis];
        share * share * (3.0 - 2.0 * share)
    });
    let mut sum = 0.0;
    for corner in 0..8_u32 {
        let side = |axis: usize| f64::from(corner >> axis & 1);
        let weight: f64 = [0, 1, 2]
            .map(|axis| match side(axis) > 0.5 {
                true => weights[axis],
                false => 1.0 - weights[axis],
            })
            .into_iter()
            .product();
        sum += weight * lattice([0, 1, 2].map(|axis| low[axis] + side(axis)));
    }
    sum
}

fn lattice(at: [f64; 3]) -> f64 {
    let key = at.into_iter().fold(0_u64, |key, along| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "bodies have a few metres"
        )]
        let whole = along as i64 as u64;
        key.wrapping_mul(0x0100_0000_01b3).wrapping_add(whole)
    });
    Stream::new(key).unit(0)
}

/// The shares of reflected light of a colour.
///
/// Source: IEC 61966-2-1, the transfer function of sRGB.
pub(super) fn to_light(colour: Colour) -> [f32; 3] {
    colour.0.map(|byte| {
        let encoded = f64::from(byte) / 255.0;
        let light = match encoded <= 0.040_45 {
            true => encoded / 12.92,
            false => libm::pow((encoded + 0.055) / 1.055, 2.4),
        };
        #[expect(clippy::cast_possible_truncation, reason = "a share of 8 bits")]
        let light = light as f32;
        light
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_becomes_light_and_a_colour_again() {
        for byte in 0..=255 {
            let colour = Colour([byte; 3]);
            assert_eq!(Colour::of_linear(to_light(colour).map(f64::from)), colour);
        }
    }

    #[test]
    fn patterns_vary_between_dark_and_bright() {
        for texture in [Texture::Checker, Texture::Wood] {
            let finish = Finish {
                texture,
                colour: Colour([200, 150, 100]),
            };
            let all: Vec<f32> = (0..400)
                .map(|idx| Point3::new(f64::from(idx % 20) * 0.03, f64::from(idx / 20) * 0.03, 0.0))
                .map(|point| finish.at(&point)[0] / to_light(finish.colour)[0])
                .collect();
            let low = all.iter().copied().fold(f32::INFINITY, f32::min);
            let high = all.iter().copied().fold(0.0, f32::max);
            assert!((DARK - 1e-3..0.65).contains(&low), "{texture:?}: {low}");
            assert!(high > 0.85 && high < 1.001, "{texture:?}: {high}");
        }
    }
}
