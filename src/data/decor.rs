//! The light of a scene and the colours of its objects, for colour images. They do not affect the
//! simulation.

use crate::{Choice, ChoiceName, Choices, Colour, Stream};

/// A pattern of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Texture {
    /// One colour.
    Plain,
    /// Cubes of two brightnesses.
    Checker,
    /// Rings and streaks, as of wood.
    Wood,
}

impl Texture {
    /// All patterns.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Checker, Self::Wood];

    /// Its name in configurations and choices.
    pub fn word(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Checker => "checker",
            Self::Wood => "wood",
        }
    }

    /// Returns the pattern with this name, or `None`.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|texture| texture.word() == word)
    }
}

/// The light and colours of scenes that a configuration describes (`[camera]`). Values without a
/// range are those of [`Decor::PLAIN`], and no choice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DecorRanges {
    /// Horizontal direction to the light, counterclockwise from the world's x axis. Unit: radians.
    pub light_azimuth_rad: Option<(f64, f64)>,
    /// Height of the light above the horizon. Unit: radians.
    pub light_elevation_rad: Option<(f64, f64)>,
    /// Brightness of a white surface that faces the light.
    pub light_brightness: Option<(f64, f64)>,
    /// Brightness of a white surface in the light from all around.
    pub ambient: Option<(f64, f64)>,
    /// Patterns of the tables.
    pub table_textures: Vec<Texture>,
    /// Colours of the tables.
    pub table_colours: Vec<Colour>,
    /// Whether objects have random colours.
    pub random_object_colours: bool,
}

impl DecorRanges {
    /// No range: no choice.
    pub const PLAIN: Self = Self {
        light_azimuth_rad: None,
        light_elevation_rad: None,
        light_brightness: None,
        ambient: None,
        table_textures: Vec::new(),
        table_colours: Vec::new(),
        random_object_colours: false,
    };

    /// Chooses the light and colours of a scene, from a stream of their own.
    pub fn choose(&self, choices: &mut Choices) {
        choices.apart(|choices| self.choose_from(choices));
    }

    fn choose_from(&self, choices: &mut Choices) {
        let plain = Decor::PLAIN;
        for (name, range, nominal) in [
            (
                ChoiceName::LightAzimuth,
                self.light_azimuth_rad,
                plain.light_azimuth_rad,
            ),
            (
                ChoiceName::LightElevation,
                self.light_elevation_rad,
                plain.light_elevation_rad,
            ),
            (
                ChoiceName::LightBrightness,
                self.light_brightness,
                plain.light_brightness,
            ),
            (ChoiceName::LightAmbient, self.ambient, plain.ambient),
        ] {
            if let Some((low, high)) = range {
                choices.real(name, low, high, nominal);
            }
        }
        let textures = self.table_textures.iter().map(|of| of.word().to_owned());
        let colours = self.table_colours.iter().map(|of| of.hex());
        for (name, candidates) in [
            (ChoiceName::TableTexture, textures.collect::<Vec<_>>()),
            (ChoiceName::TableColour, colours.collect()),
        ] {
            if !candidates.is_empty() {
                choices.candidate(name, candidates);
            }
        }
        if self.random_object_colours {
            choices.index(ChoiceName::ObjectColours, Decor::SEEDS);
        }
    }
}

/// The light of a scene and the colours of its objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decor {
    /// As [`DecorRanges::light_azimuth_rad`].
    pub light_azimuth_rad: f64,
    /// As [`DecorRanges::light_elevation_rad`].
    pub light_elevation_rad: f64,
    /// As [`DecorRanges::light_brightness`].
    pub light_brightness: f64,
    /// As [`DecorRanges::ambient`].
    pub ambient: f64,
    /// The pattern of the tables; `None` for those of their files.
    pub table_texture: Option<Texture>,
    /// The colour of the tables; `None` for those of their files.
    pub table_colour: Option<Colour>,
    /// Seed of the colours of objects; 0 for those of their files.
    pub object_seed: u64,
}

impl Decor {
    /// A light from above, a little from the side, and the colours of the files.
    pub const PLAIN: Self = Self {
        light_azimuth_rad: 2.2,
        light_elevation_rad: 1.0,
        light_brightness: 0.7,
        ambient: 0.4,
        table_texture: None,
        table_colour: None,
        object_seed: 0,
    };

    /// Number of seeds of colours, including 0 (those of the files).
    pub const SEEDS: usize = 1 << 32;

    /// Returns the light and colours that a scene's choices made.
    pub fn of(choices: &[Choice]) -> Self {
        let mut decor = Self::PLAIN;
        for choice in choices {
            match choice.name {
                ChoiceName::LightAzimuth => decor.light_azimuth_rad = choice.value,
                ChoiceName::LightElevation => decor.light_elevation_rad = choice.value,
                ChoiceName::LightBrightness => decor.light_brightness = choice.value,
                ChoiceName::LightAmbient => decor.ambient = choice.value,
                ChoiceName::TableTexture => {
                    decor.table_texture = choice.candidate().and_then(Texture::from_word);
                }
                ChoiceName::TableColour => {
                    decor.table_colour = choice.candidate().and_then(Colour::from_hex);
                }
                ChoiceName::ObjectColours => decor.object_seed = choice.value as u64,
                _ => {}
            }
        }
        decor
    }

    /// Returns the colour of an object, by its id; `None` for that of its files.
    pub fn object_colour(&self, id: &str) -> Option<Colour> {
        (self.object_seed > 0).then(|| Colour::random(of_text(self.object_seed, id)))
    }

    /// Unit vector to the light. Frame: world.
    pub fn to_light(&self) -> [f64; 3] {
        let level = libm::cos(self.light_elevation_rad);
        [
            level * libm::cos(self.light_azimuth_rad),
            level * libm::sin(self.light_azimuth_rad),
            libm::sin(self.light_elevation_rad),
        ]
    }
}

/// Random numbers of a text and a seed.
fn of_text(seed: u64, text: &str) -> Stream {
    let key = text
        .bytes()
        .fold(seed, |key, byte| Stream::new(key).bits(u64::from(byte)));
    Stream::new(key)
}

impl Colour {
    /// Returns the colour with this notation, `#rrggbb`, or `None`.
    pub fn from_hex(text: &str) -> Option<Self> {
        let digits = text.strip_prefix('#').filter(|digits| {
            digits.len() == 6 && digits.bytes().all(|byte| byte.is_ascii_hexdigit())
        })?;
        let [_, red, green, blue] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
        Some(Self([red, green, blue]))
    }

    /// Returns its notation, `#rrggbb`.
    pub fn hex(self) -> String {
        let [red, green, blue] = self.0;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }

    /// A colour for a body without one, which depends on its name only.
    pub fn of_name(name: &str) -> Self {
        Self::random(of_text(0, name))
    }

    /// A random colour that is neither black nor white.
    fn random(stream: Stream) -> Self {
        let hue = 6.0 * stream.unit(0);
        let saturation = 0.25 + 0.6 * stream.unit(1);
        let value = 0.4 + 0.55 * stream.unit(2);
        let channel = |of: f64| {
            let away = (hue - of).abs();
            let share = (away.min(6.0 - away) - 1.0).clamp(0.0, 1.0);
            value * (1.0 - saturation * share)
        };
        Self::of_srgb([channel(0.0), channel(2.0), channel(4.0)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_written_as_they_are_read() {
        for text in ["#000000", "#a0b1c2", "#ffffff"] {
            assert_eq!(
                Colour::from_hex(text).map(Colour::hex).as_deref(),
                Some(text)
            );
        }
        for wrong in [
            "", "#", "a0b1c2", "#a0b1c", "#a0b1c2d", "#+0b1c2", "#a0b1cé",
        ] {
            assert_eq!(Colour::from_hex(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn choices_make_the_light_and_missing_ones_leave_it_plain() {
        assert_eq!(Decor::of(&[]), Decor::PLAIN);
        let mut choices = Choices::random(1, 0);
        let azimuth = choices.real(ChoiceName::LightAzimuth, 0.0, 3.0, 1.0);
        let textures = vec!["plain".to_owned(), "wood".to_owned()];
        let texture = choices.candidate(ChoiceName::TableTexture, textures);
        let colours = vec!["#102030".to_owned()];
        choices.candidate(ChoiceName::TableColour, colours);
        let decor = Decor::of(choices.made());
        assert_eq!(decor.light_azimuth_rad, azimuth);
        assert_eq!(
            decor.table_texture,
            Some([Texture::Plain, Texture::Wood][texture])
        );
        assert_eq!(decor.table_colour, Some(Colour([16, 32, 48])));
        assert_eq!(decor.object_colour("mug_1"), None);
    }

    /// Scenes and noise of a seed are the same with and without ranges of light.
    #[test]
    fn the_light_is_chosen_from_a_stream_of_its_own() {
        let ranges = DecorRanges {
            light_azimuth_rad: Some((0.0, 6.0)),
            table_textures: Texture::ALL.to_vec(),
            random_object_colours: true,
            ..DecorRanges::PLAIN
        };
        let values = |ranges: &DecorRanges| {
            let mut choices = Choices::random(7, 3).with_noise(8, 3);
            let first = choices.real("yaw".into(), -1.0, 1.0, 0.0);
            ranges.choose(&mut choices);
            let second = choices.real("x".into(), -1.0, 1.0, 0.0);
            choices.begin_noise();
            let third = choices.normal("noise".into(), 0.1);
            ([first, second, third], choices)
        };
        let (plain, _) = values(&DecorRanges::PLAIN);
        let (with, choices) = values(&ranges);
        assert_eq!(plain, with);
        assert_eq!(choices.made().len(), 6);
        let chosen = choices.made()[1].value / 6.0;
        assert!((chosen - (plain[1] + 1.0) / 2.0).abs() > 1e-6);
        let mut again = Choices::recorded(choices.made());
        again.real("yaw".into(), -1.0, 1.0, 0.0);
        ranges.choose(&mut again);
        assert_eq!(Decor::of(again.made()), Decor::of(choices.made()));
    }

    #[test]
    fn objects_have_colours_of_their_own() {
        let decor = Decor {
            object_seed: 5,
            ..Decor::PLAIN
        };
        let [first, second] = ["mug_1", "mug_2"].map(|id| decor.object_colour(id));
        assert!(first.is_some() && first != second);
        assert_eq!(first, decor.object_colour("mug_1"));
    }
}
