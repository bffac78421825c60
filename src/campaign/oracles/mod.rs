//! Tests the oracles: runs with injected faults show which properties detect them.
//!
//! Never: stores these runs in a history, where they would count as the robot's, or decides when a
//! fault counts as detected.

mod course_faults;
mod faults;
mod retouch;
mod trials;

pub use course_faults::{COURSE_FAULTS, CourseChange, CourseFault};
pub use faults::{FAULTS, Fault};
pub use trials::{Trial, TrialOptions, try_faults};
