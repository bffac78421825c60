"""Limits of targets: metres instead of millimetres, radians instead of degrees."""

from __future__ import annotations

import math

#: Targets beyond a limit by less than this share of it, or by less than this distance, are rounding errors.
SLACK_SHARE, SLACK = 0.01, 0.01
#: No scene has a place with such a coordinate. Unit: metres.
FARTHEST_M = 30.0
#: Largest angle about one axis, and largest heading: the sum of a heading and of a turn. Unit: radians.
LARGEST_ANGLE, LARGEST_HEADING = math.tau, 2 * math.tau


def within(name: str, number: float, limits: tuple[float, float], unit: str) -> None:
    """Raises `ValueError` if a target is beyond its limits: with the name, the unit, the limits, and the likely mistake."""
    low, high = limits
    if not math.isfinite(number):
        raise ValueError(f"{name} is {number}, but must be finite")
    if low - max(SLACK, SLACK_SHARE * abs(low)) <= number <= high + max(SLACK, SLACK_SHARE * abs(high)):
        return
    allowed = f"from {low:.4g} to {high:.4g} {unit}" if high < 1e300 else f"at least {low:.4g} {unit}"
    others = {"m": (("cm", 0.01), ("mm", 0.001)), "rad": (("°", math.pi / 180.0),)}.get(unit, ())
    meant = [f"{number:g} {other} are {number * factor:.4g} {unit}" for other, factor in others if low <= number * factor <= high]
    remedy = f"; its unit is {unit}: {' and '.join(meant)}" if meant else ""
    raise ValueError(f"{name} is {number:g} {unit}, but must be {allowed}{remedy}")
