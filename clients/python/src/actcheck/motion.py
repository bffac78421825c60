"""Joint trajectories: at rest at both ends and within the joints' velocity limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from actcheck.pose import Matrix, Vector

#: Share of a joint's velocity limit that is used, so that the controller can catch up.
SPEED_SHARE = 0.9
#: Peak over mean speed of a trajectory that starts and ends at rest (of 3s² − 2s³).
PEAK_OVER_MEAN = 1.5


def course(waypoints: Sequence[Vector], speeds: Vector, period_s: float, least_s: float = 0.0) -> Matrix:
    """Positions at each tick along straight legs between waypoints, the first of which is the start.

    Shape: ticks × joints. `speeds` are the joints' velocity limits; `least_s` is the shortest duration.
    """
    points = np.array(waypoints)
    legs = (np.abs(np.diff(points, axis=0)) / np.maximum(speeds, 1e-3)).max(axis=1, initial=0.0)
    ends = np.concatenate([[0.0], np.cumsum(legs)])
    seconds = max(float(ends[-1]) * PEAK_OVER_MEAN / SPEED_SHARE, least_s)
    ticks = math.ceil(seconds / period_s - 1e-9)
    if ticks <= 0:
        return points[:0]
    share = np.arange(1, ticks + 1) / ticks
    at = ends[-1] * share * share * (3.0 - 2.0 * share)
    # Legs of length zero repeat an end time; interpolation then takes the last value, which is correct.
    return np.column_stack([np.interp(at, ends, column) for column in points.T])
