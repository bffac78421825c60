//! Selects the region of the world that a panel shows.

use std::collections::BTreeSet;

use crate::picture::drawing::Rect;
use actcheck_data::{BodyState, Snapshot, Trace};

/// An axis-aligned box in the world. Unit: metres. Shape: x, y, z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

impl Bounds {
    pub(super) fn of(body: &BodyState) -> Self {
        Self {
            low: body.aabb_min,
            high: body.aabb_max,
        }
    }

    pub(super) fn point(at: [f64; 3]) -> Self {
        Self { low: at, high: at }
    }

    pub(super) fn with(self, other: Self) -> Self {
        let pick = |choose: fn(f64, f64) -> f64, a: [f64; 3], b: [f64; 3]| {
            [0, 1, 2].map(|axis| choose(a[axis], b[axis]))
        };
        Self {
            low: pick(f64::min, self.low, other.low),
            high: pick(f64::max, self.high, other.high),
        }
    }

    pub(super) fn union(all: impl IntoIterator<Item = Self>) -> Option<Self> {
        let finite = |bounds: &Self| {
            bounds
                .low
                .iter()
                .chain(&bounds.high)
                .all(|value| value.abs() < 1e3)
        };
        all.into_iter().filter(finite).reduce(Self::with)
    }

    pub(super) fn grown(self, by: f64) -> Self {
        Self {
            low: self.low.map(|value| value - by),
            high: self.high.map(|value| value + by),
        }
    }

    pub(super) fn extent(&self, axis: usize) -> f64 {
        self.high[axis] - self.low[axis]
    }

    fn middle(&self, axis: usize) -> f64 {
        f64::midpoint(self.low[axis], self.high[axis])
    }

    /// Horizontal distance between two boxes; 0 if they overlap.
    fn level_gap(&self, other: &Self) -> f64 {
        let gap = |axis: usize| {
            (self.low[axis] - other.high[axis])
                .max(other.low[axis] - self.high[axis])
                .max(0.0)
        };
        gap(0).hypot(gap(1))
    }

    pub(super) fn meets(&self, other: &Self, axis: usize) -> bool {
        self.low[axis] <= other.high[axis] && self.high[axis] >= other.low[axis]
    }
}

/// The two axes that a panel shows, across and up, as indices of x, y, z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    pub(super) across: usize,
    pub(super) up: usize,
}

impl View {
    pub(super) const TOP: Self = Self { across: 0, up: 1 };

    pub(super) fn title(self) -> String {
        let letter = |axis: usize| ["x", "y", "z"][axis];
        let from = if self.up == 1 {
            "from above"
        } else {
            "from the side"
        };
        format!("{from}   {} → {} ↑", letter(self.across), letter(self.up))
    }
}

/// A region of the world shown on a panel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub(super) view: View,
    /// The region, along all axes.
    pub(super) bounds: Bounds,
    /// Pixels per metre.
    pub(super) scale: f64,
    pub(super) panel: Rect,
}

impl Window {
    /// Centres `bounds` in a panel.
    pub(super) fn new(view: View, bounds: Bounds, scale: f64, panel: Rect) -> Self {
        let mut wide = bounds;
        for (axis, pixels) in [(view.across, panel.width), (view.up, panel.height)] {
            let (middle, half) = (bounds.middle(axis), pixels / scale / 2.0);
            (wide.low[axis], wide.high[axis]) = (middle - half, middle + half);
        }
        Self {
            view,
            bounds: wide,
            scale,
            panel,
        }
    }

    /// Projects a point of the world to a pixel.
    pub(super) fn pixel(&self, point: [f64; 3]) -> [f64; 2] {
        let View { across, up } = self.view;
        let right = (point[across] - self.bounds.low[across]) * self.scale;
        let down = (self.bounds.high[up] - point[up]) * self.scale;
        [self.panel.left + right, self.panel.top + down]
    }

    /// Projects a box of the world to a rectangle.
    pub(super) fn rect(&self, bounds: &Bounds) -> Rect {
        let ([left, bottom], [right, top]) = (self.pixel(bounds.low), self.pixel(bounds.high));
        Rect {
            left,
            top,
            width: right - left,
            height: bottom - top,
        }
    }

    /// Whether a body overlaps the window's region on all three axes.
    pub(super) fn overlaps(&self, bounds: &Bounds) -> bool {
        [0, 1, 2]
            .into_iter()
            .all(|axis| bounds.meets(&self.bounds, axis))
    }
}

/// Movable objects within this distance of the subjects are shown. Unit: metres.
const NEIGHBOURS_M: f64 = 0.6;
/// The hand is shown within this distance of the subjects. Unit: metres.
const HAND_M: f64 = 0.9;
/// Margin around the close-up. Unit: metres.
const AROUND_M: f64 = 0.12;
/// The same close-up shows before and after, if it is not larger than this. Unit: metres.
const LARGEST_CLOSE_UP_M: f64 = 2.8;

/// Regions of the close-ups before and after: the same region if it is small enough. Returns `None`
/// if the trace has no states. The region after includes `point`, and both include `mount`, if
/// these are near enough.
pub(super) fn close_ups(
    trace: &Trace,
    subjects: &BTreeSet<&str>,
    point: Option<[f64; 3]>,
    mount: Option<Bounds>,
) -> Option<[Bounds; 2]> {
    let mut before = region_of_interest(trace.snapshots.first()?, subjects, trace);
    let mut after = region_of_interest(trace.snapshots.last()?, subjects, trace);
    let is_small = |bounds: &Bounds| {
        [0, 1]
            .into_iter()
            .all(|axis| bounds.extent(axis) <= LARGEST_CLOSE_UP_M)
    };
    let wider = point.map(|point| after.with(Bounds::point(point).grown(AROUND_M)));
    if let Some(wider) = wider.filter(is_small) {
        after = wider;
    }
    if let Some(mount) = mount {
        let wider = [before.with(mount), after.with(mount)];
        if wider.iter().all(is_small) {
            [before, after] = wider;
        }
    }
    let both = before.with(after);
    let [mut before, mut after] = if is_small(&both) {
        [both, both]
    } else {
        [before, after]
    };
    for bounds in [&mut before, &mut after] {
        *bounds = limited(bounds.grown(AROUND_M));
    }
    // In side views, both start at the floor and have the same height.
    let height = before.high[2].max(after.high[2]).clamp(0.4, 2.4);
    for bounds in [&mut before, &mut after] {
        (bounds.low[2], bounds.high[2]) = (-0.04, height);
    }
    Some([before, after])
}

/// Region of interest at a moment: the subjects, the furniture below them, their neighbours, and
/// the hand.
fn region_of_interest(snapshot: &Snapshot, subjects: &BTreeSet<&str>, trace: &Trace) -> Bounds {
    let bodies = || snapshot.bodies.iter();
    let base = Bounds::point([
        snapshot.robot.base_true[0],
        snapshot.robot.base_true[1],
        0.5,
    ]);
    let perceived = trace
        .actions
        .iter()
        .filter_map(|action| action.perceived.as_ref()?.plane);
    let found = bodies()
        .filter(|body| subjects.contains(body.id.as_str()))
        .map(Bounds::of);
    let seen = perceived.map(|plane| Bounds::point(plane.pose.position));
    let core = Bounds::union(found)
        .or_else(|| Bounds::union(seen))
        .unwrap_or_else(|| base.grown(0.5));
    let near = bodies()
        .filter(|body| !body.fixed)
        .map(Bounds::of)
        .filter(|other| core.level_gap(other) < NEIGHBOURS_M);
    let mut shown = core;
    if let Some(near) = Bounds::union(near) {
        shown = shown.with(near);
    }
    let carries = |body: &&BodyState| {
        body.fixed && Bounds::of(body).level_gap(&core) == 0.0 && body.aabb_min[2] < 0.05
    };
    let low = |body: &&BodyState| (0..2).all(|axis| Bounds::of(body).extent(axis) < 2.0);
    if let Some(carriers) = Bounds::union(bodies().filter(carries).filter(low).map(Bounds::of)) {
        shown = shown.with(carriers);
    }
    let hand = Bounds::point(snapshot.robot.gripper.position);
    if core.level_gap(&hand) < HAND_M {
        shown.with(hand)
    } else {
        shown
    }
}

/// Crops a region that is too large to its middle, and enlarges one that is too small.
fn limited(mut bounds: Bounds) -> Bounds {
    for axis in 0..2 {
        let middle = bounds.middle(axis);
        let half = (bounds.extent(axis) / 2.0).clamp(0.4, LARGEST_CLOSE_UP_M / 2.0 + AROUND_M);
        (bounds.low[axis], bounds.high[axis]) = (middle - half, middle + half);
    }
    bounds
}

/// The whole world. Returns `None` if the close-ups already show nearly all of it: places,
/// furniture and the path of the base.
pub(super) fn overview(
    trace: &Trace,
    close_ups: &[Bounds; 2],
    paths: &[[f64; 3]],
) -> Option<Bounds> {
    let rooms = trace.map.rooms.iter().map(|room| Bounds {
        low: [room.low_m[0], room.low_m[1], 0.0],
        high: [room.high_m[0], room.high_m[1], 0.0],
    });
    let bodies = trace
        .snapshots
        .iter()
        .flat_map(|snapshot| &snapshot.bodies)
        .map(Bounds::of);
    let paths = paths.iter().map(|point| Bounds::point(*point).grown(0.3));
    let whole = Bounds::union(rooms.chain(bodies).chain(paths))?.grown(0.15);
    let seen = close_ups[0].with(close_ups[1]);
    let beyond =
        |axis: usize| (seen.low[axis] - whole.low[axis]).max(whole.high[axis] - seen.high[axis]);
    (beyond(0).max(beyond(1)) > 0.35).then_some(whole)
}
