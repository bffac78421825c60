//! Settings of physics, sensors and budgets that a scene is simulated with.

use crate::DecorRanges;

/// A range to sample from, both ends included.
pub type Range = (f64, f64);

/// Ranges of each object's physical parameters, and the settings of the solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Physics {
    /// Factor on the model's mass.
    pub mass_scale: Range,
    /// Factor on the model's friction.
    pub friction_scale: Range,
    /// Factor on the model's size.
    pub size_scale: Range,
    /// Coefficient of restitution.
    pub restitution: Range,
    /// Physics steps per second.
    pub steps_per_second: u32,
    /// Solver iterations per step.
    pub iterations: u32,
    /// Whether the engine may be spared the parts of a tick that have no effect. Without, it
    /// simulates everything in every tick, which takes several times as long.
    pub shortcuts: bool,
}

/// Standard deviations of sensing and localisation errors; 0 is perfect.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensing {
    /// Of a perceived object's position, along each horizontal axis. Unit: metres.
    pub position_noise_m: f64,
    /// Of a perceived object's height. Unit: metres.
    pub height_noise_m: f64,
    /// Of a perceived object's heading. Unit: radians.
    pub yaw_noise_rad: f64,
    /// Of a perceived object's dimensions. Unit: metres.
    pub size_noise_m: f64,
    /// Of the base's initial position estimate. Unit: metres.
    pub localisation_noise_m: f64,
    /// Of the base's initial heading estimate. Unit: radians.
    pub heading_noise_rad: f64,
    /// Of a measured finger opening. Unit: metres.
    pub gripper_noise_m: f64,
    /// Localisation while the base drives.
    pub odometry: Odometry,
    /// The camera (`[camera]`).
    pub camera: Camera,
    /// The light and colours of scenes, for colour images (`[camera]`).
    pub decor: DecorRanges,
}

/// Localisation while the base drives: keys of `[sensing]`. Standard deviations unless noted
/// otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Position error per distance driven, along and across the path (`odometry_drift`).
    pub drift: f64,
    /// Heading error per radian turned and per metre driven (`heading_drift`). Unit: radians.
    pub heading_drift: f64,
    /// Distance driven between two landmark sightings, which correct the estimate
    /// (`landmark_every_m`); 0 means no landmarks. Unit: metres.
    pub landmark_every_m: f64,
    /// Error of a position measured by landmarks (`landmark_noise_m`). Unit: metres.
    pub landmark_noise_m: f64,
    /// Error of a heading measured by landmarks (`landmark_noise_rad`). Unit: radians.
    pub landmark_noise_rad: f64,
}

impl Odometry {
    /// Odometry without errors or landmarks: the initial localisation error stays constant.
    pub const IDEAL: Self = Self {
        drift: 0.0,
        heading_drift: 0.0,
        landmark_every_m: 0.0,
        landmark_noise_m: 0.0,
        landmark_noise_rad: 0.0,
    };
}

/// The camera on the robot's camera link, for depth and colour: its intrinsics and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Image width. Unit: pixels.
    pub width: u32,
    /// Image height. Unit: pixels.
    pub height: u32,
    /// Angle between the outermost columns. Unit: radians. The vertical angle follows, as pixels
    /// are square.
    pub field_of_view_rad: f64,
    /// Nearest visible distance from the camera. Unit: metres.
    pub min_range_m: f64,
    /// Farthest visible distance from the camera. Unit: metres.
    pub max_range_m: f64,
    /// Standard deviation of the range at a distance of 1 m; it grows with the square of the
    /// distance. Unit: metres.
    pub range_noise_m: f64,
    /// Share of pixels that are dropped at random.
    pub dropout: f64,
    /// Angle between ray and surface below which pixels are dropped: all at 0, none at this angle.
    /// Unit: radians.
    pub grazing_rad: f64,
    /// Standard deviation of each channel of a colour image, as a share of full brightness.
    pub image_noise: f64,
}

impl Camera {
    /// 320 × 240 pixels, 57 degrees wide, from 0.3 to 5 m like the depth cameras of service robots,
    /// and without noise.
    pub const IDEAL: Self = Self {
        width: 320,
        height: 240,
        field_of_view_rad: 1.0,
        min_range_m: 0.3,
        max_range_m: 5.0,
        range_noise_m: 0.0,
        dropout: 0.0,
        grazing_rad: 0.0,
        image_noise: 0.0,
    };

    /// Focal length. Unit: pixels.
    pub fn focal_px(&self) -> f64 {
        f64::from(self.width) / 2.0 / libm::tan(self.field_of_view_rad / 2.0)
    }
}

/// Limits on one action. An action that exceeds them ends as `timeout`.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// Simulated time of one action. Unit: seconds.
    pub action_secs: f64,
}

/// Control commands and contact records per second of simulated time. Every physics rate is a
/// multiple of it, so that a control period is a whole number of physics steps.
pub const CONTROL_HZ: u32 = 60;
