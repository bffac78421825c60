//! The camera's images that a run's program asked for, drawn again small.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use actcheck_data::{SkillDeed, Trace};

/// Most images of a run.
const MOST_IMAGES: usize = 8;

/// A small image that a program asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmImage {
    /// When, since the run began. Unit: seconds.
    pub secs: f64,
    /// Its file.
    pub png: Vec<u8>,
}

/// Returns the times at which a run's program asked for colour images, of too many some evenly over
/// all. Unit: seconds since the run began.
pub fn film_times(trace: &Trace) -> Vec<f64> {
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    let asked = trace.skill.entries.iter().filter_map(|entry| {
        let is_image = matches!(&entry.deed, SkillDeed::Asked(question) if question.what == "rgb");
        is_image.then_some(entry.time_secs - begin)
    });
    let all: Vec<f64> = asked.collect();
    match all.len() {
        0..=MOST_IMAGES => all,
        count => (0..MOST_IMAGES)
            .filter_map(|number| all.get(number * (count - 1) / (MOST_IMAGES - 1)).copied())
            .collect(),
    }
}

/// The images as the page gets them: times and addresses.
pub(super) fn packed_film(film: &[FilmImage]) -> Value {
    let image = |image: &FilmImage| {
        let file = STANDARD.encode(&image.png);
        json!([image.secs, format!("data:image/png;base64,{file}")])
    };
    film.iter().map(image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{AnsweredQuestion, SkillEntry, SkillLog};

    fn asked(what: &str, time_secs: f64) -> SkillEntry {
        let question = AnsweredQuestion {
            what: what.to_owned(),
            of: None,
            count: 0,
            bytes: 0,
            objects: Vec::new(),
        };
        SkillEntry {
            time_secs,
            deed: SkillDeed::Asked(question),
        }
    }

    #[test]
    fn a_film_has_few_images_from_the_first_to_the_last() {
        let of = |count: u32| {
            let images = (0..count).map(|number| asked("rgb", f64::from(number)));
            let entries = images.chain([asked("depth", 0.5)]).collect();
            film_times(&Trace {
                skill: SkillLog {
                    entries,
                    ..SkillLog::default()
                },
                ..Trace::default()
            })
        };
        assert_eq!(of(0), Vec::<f64>::new());
        assert_eq!(of(2), [0.0, 1.0]);
        let many = of(100);
        assert_eq!((many.len(), many[0], many[7]), (MOST_IMAGES, 0.0, 99.0));
    }
}
