//! Colours of shapes, for pictures.

use actcheck_data::{Colour, TreeColour};

/// Help text about a colour that is not read.
pub(crate) const NO_EFFECT: &str = "colours have no effect on the simulation";

/// Reads the channels of a colour: red, green and blue, and any others. Returns `None` if it has
/// another form.
pub(crate) fn numbers(text: &str) -> Option<Vec<f64>> {
    let words = text.split_whitespace();
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    numbers.filter(|numbers| numbers.len() >= 3 && numbers.iter().all(|x| x.is_finite()))
}

/// Returns the colour of a shape, instead of the colours of its mesh file. The fourth channel, if
/// there is one, is the opacity.
pub(crate) fn whole(channels: &[f64]) -> Option<TreeColour> {
    colour(channels).map(|colour| colour.map_or(TreeColour::Clear, TreeColour::Whole))
}

/// As [`whole`], but for parts without a colour in their mesh file, as RViz does.
pub(crate) fn rest(channels: &[f64]) -> Option<TreeColour> {
    colour(channels).map(|colour| colour.map_or(TreeColour::Clear, TreeColour::Rest))
}

/// Returns `Some(None)` for a colour without opacity.
fn colour(channels: &[f64]) -> Option<Option<Colour>> {
    let colour = channels.first_chunk().map(|rgb| Colour::of_srgb(*rgb))?;
    let is_clear = channels.get(3).is_some_and(|opacity| *opacity <= 0.0);
    Some((!is_clear).then_some(colour))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_has_three_channels_and_may_have_an_opacity() {
        let read = |text| whole(&numbers(text)?);
        let red = TreeColour::Whole(Colour([255, 0, 0]));
        assert_eq!(read("1 0 0"), Some(red));
        assert_eq!(read(" 1 0 0\t0.5"), Some(red));
        assert_eq!(read("1 0 0 0"), Some(TreeColour::Clear));
        assert_eq!(read("1 0"), None);
        assert_eq!(read("1 0 nan 1"), None);
        assert_eq!(read("red"), None);
    }
}
