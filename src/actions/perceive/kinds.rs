//! Recognises objects by their size.

use actcheck_data::KnownKind;

/// How much larger than its true length a side may appear. Unit: metres. Noise at the outline, and
/// the grid of points.
const WIDER_M: f64 = 0.008;
/// How much smaller it may appear: part of the side may be hidden by other objects or by the object
/// itself.
const NARROWER_M: f64 = 0.02;
/// How far off a height may appear. Unit: metres. The top of an object is seldom hidden.
const HIGHER_M: f64 = 0.008;
/// Sum of squares beyond which an object is of no known kind: all three at their limit, or one at
/// nearly twice its limit.
const MOST: f64 = 3.0;

/// A kind that matches a size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit<'a> {
    /// The kind.
    pub kind: &'a KnownKind,
    /// Whether its x side lies along the object's second side.
    pub crosswise: bool,
    /// Mismatch: 0 is perfect. No unit.
    pub miss: f64,
}

/// The best match. Returns `None` if no kind is similar enough. Unit: metres. The first two sides
/// are horizontal and in any order.
pub fn recognise(size_m: [f64; 3], kinds: &[KnownKind]) -> Option<Fit<'_>> {
    let fits = kinds.iter().flat_map(|kind| {
        [false, true].map(|crosswise| {
            let [x, y, z] = kind.size_m;
            let [x, y] = if crosswise { [y, x] } else { [x, y] };
            let miss = squared(side(size_m[0], x))
                + squared(side(size_m[1], y))
                + squared((size_m[2] - z) / HIGHER_M);
            Fit {
                kind,
                crosswise,
                miss,
            }
        })
    });
    fits.filter(|fit| fit.miss <= MOST)
        .min_by(|a, b| a.miss.total_cmp(&b.miss))
}

/// Mismatch of a perceived side, in units of its expected error.
fn side(seen: f64, known: f64) -> f64 {
    let off = seen - known;
    if off > 0.0 {
        off / WIDER_M
    } else {
        off / NARROWER_M
    }
}

fn squared(x: f64) -> f64 {
    x * x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds() -> Vec<KnownKind> {
        let kind = |name: &str, size_m| KnownKind {
            name: name.to_owned(),
            category: name.to_owned(),
            size_m,
            rim: None,
            is_box: false,
        };
        vec![
            kind("box", [0.1, 0.06, 0.15]),
            kind("can", [0.066, 0.066, 0.115]),
            kind("glass", [0.088, 0.088, 0.146]),
        ]
    }

    fn name_of(size_m: [f64; 3]) -> Option<(String, bool)> {
        recognise(size_m, &kinds()).map(|fit| (fit.kind.name.clone(), fit.crosswise))
    }

    #[test]
    fn the_kind_of_the_nearest_size_is_chosen_and_an_unknown_size_has_none() {
        assert_eq!(
            name_of([0.088, 0.086, 0.144]),
            Some(("glass".to_owned(), false))
        );
        assert_eq!(name_of([0.06, 0.1, 0.15]), Some(("box".to_owned(), true)));
        assert_eq!(
            name_of([0.101, 0.058, 0.152]),
            Some(("box".to_owned(), false))
        );
        // Its far side is hidden.
        assert_eq!(
            name_of([0.066, 0.05, 0.113]),
            Some(("can".to_owned(), false))
        );
        assert_eq!(name_of([0.2, 0.09, 0.146]), None);
        assert_eq!(name_of([0.088, 0.088, 0.2]), None);
        assert_eq!(recognise([0.1; 3], &[]), None);
    }
}
