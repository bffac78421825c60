"""Properties about time, judged anew from their labels and comments in `ontology/time.ttl`.

    actcheck export tables DIR --course --history HISTORY
    python -m second_judge.time_properties DIR

It reads the course of each action at the control rate (`course_*.parquet`), without the rules, and compares the result with
the stored outcomes. Each function returns whether the property holds, or None if it says nothing, and how far the deciding
quantity is from its limit (None if no quantity decides).
"""

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

# Stored samples are rounded: outcomes this close to a limit, as a share of it, may differ.
SHARE = 1e-3


@dataclass
class Course:
    """One action over time, at a fixed number of samples a second."""

    run: str
    step: int
    end: str
    parameters: dict
    outcomes: dict = field(default_factory=dict)
    #: Seconds since the action began, one for each sample.
    times: np.ndarray = None
    #: By object: columns of `course_bodies`, one row for each sample.
    bodies: dict = field(default_factory=dict)
    #: Columns of `course_robot`.
    robot: dict = field(default_factory=dict)

    @property
    def period(self):
        return self.times[1] - self.times[0] if len(self.times) > 1 else 1.0

    def target(self):
        """The object to pick or place, or None if it was not recorded."""
        return self.bodies.get(self.parameters.get("pickObject", [None])[0])


def columns(frame, names):
    return frame.select(names).to_numpy().astype(float)


def read(folder):
    """The actions of an export with their courses, in order."""
    folder = Path(folder)
    table = {name: pl.read_parquet(folder / f"{name}.parquet") for name in ("actions", "outcomes", "course_bodies", "course_robot")}
    found = {}
    for row in table["actions"].iter_rows(named=True):
        found[row["run"], row["step"]] = Course(row["run"], row["step"], row["end"], json.loads(row["parameters"]))
    for (run, step), frame in table["course_robot"].partition_by(["run", "step"], as_dict=True, maintain_order=True).items():
        course = found[run, step]
        course.times = frame["time_s"].to_numpy()
        course.robot = {
            "hand": columns(frame, ["gripper_x_m", "gripper_y_m", "gripper_z_m"]),
            "base": columns(frame, ["base_x_m", "base_y_m"]),
        }
    bodies = table["course_bodies"].partition_by(["run", "step", "body"], as_dict=True, maintain_order=True)
    for (run, step, body), frame in bodies.items():
        x, y = frame["qx"].to_numpy(), frame["qy"].to_numpy()
        found[run, step].bodies[body] = {
            "position": columns(frame, ["x_m", "y_m", "z_m"]),
            "speed": np.linalg.norm(columns(frame, ["vx_m_s", "vy_m_s", "vz_m_s"]), axis=1),
            # The vertical part of the body's own z axis.
            "tilt": np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)),
            "held": frame["held"].to_numpy(),
        }
    for row in table["outcomes"].select(["run", "step", "property", "outcome"]).iter_rows(named=True):
        if (row["run"], row["step"]) in found:
            name = row["property"].rsplit("#")[-1]
            found[row["run"], row["step"]].outcomes[name] = row["outcome"]
    return [found[key] for key in sorted(found) if found[key].times is not None]


def rates(values, period):
    """The change per second since the sample before; 0 at the first one."""
    return np.diff(values, axis=0, prepend=values[:1]) / period


def accelerations(places, period):
    """The acceleration averaged over a tick. Unit: m/s²."""
    return np.linalg.norm(rates(rates(places, period), period), axis=1)


def below(values, limit):
    """Whether every value is at most the limit, and by how much of it."""
    most = values.max(initial=0.0)
    return bool(most <= limit), (limit - most) / limit


def later(flags, period, seconds):
    """Number of whole samples in a duration. Times in tables are rounded, so that a second may seem to have 59.99."""
    return int(seconds / period + 0.1)


def still_at_the_end(course):
    """In the last half second of the action, the object is slower than 5 cm/s."""
    thing = course.target()
    if thing is None:
        return None, None
    return below(thing["speed"][course.times >= course.times[-1] - 0.5 - 1e-6], 0.05)


def smooth_hand(course):
    """The acceleration of the hand, averaged over a tick, stays below 25 m/s²."""
    return below(accelerations(course.robot["hand"], course.period), 25.0)


def smooth_drive(course):
    """The acceleration of the base, averaged over a tick, stays below 6 m/s²."""
    return below(accelerations(course.robot["base"], course.period), 6.0)


def short_path(course):
    """The path of the hand is at most four times its largest distance from its start, plus 50 cm."""
    hand = course.robot["hand"]
    length = np.linalg.norm(np.diff(hand, axis=0), axis=1).sum()
    limit = 4.0 * np.linalg.norm(hand - hand[0], axis=1).max() + 0.5
    return bool(length <= limit), (limit - length) / limit


def upright_when_lifted(course):
    """From 2 cm above its initial height on, the object is tilted by less than 30 degrees; one that lay says nothing."""
    thing = course.target()
    if thing is None or thing["tilt"][0] >= 0.26:
        return None, None
    height = thing["position"][:, 2]
    return below(thing["tilt"][height - height[0] > 0.02], np.radians(30.0))


def held_while_lifted(course):
    """While the object is 3 cm above its initial height, both fingers touch it, or touch it again within 0.04 s."""
    thing = course.target()
    if thing is None:
        return None, None
    height, held = thing["position"][:, 2], thing["held"]
    lost = later(held, course.period, 0.04)
    for at in np.flatnonzero(height - height[0] > 0.03):
        window = held[at : at + lost + 1]
        # At the end of the action, the 0.04 s are not over.
        if len(window) == lost + 1 and not window.any():
            return False, None
    return True, None


def one_grasp(course):
    """An object that was held and then free for 0.2 s is not held again."""
    thing = course.target()
    if thing is None:
        return None, None
    held = np.flatnonzero(thing["held"])
    if len(held) == 0:
        return None, None
    free = np.diff(held) - 1
    return bool((free * course.period < 0.2 + course.period / 2).all()), None


def settles_after_release(course):
    """Within a second after it was released, the object is slower than 2 cm/s and stays so."""
    thing = course.target()
    if thing is None or not thing["held"].any():
        return None, None
    held = thing["held"]
    free = np.flatnonzero(held[:-1] & ~held[1:]) + 1
    if len(free) == 0:
        return None, None
    return below(thing["speed"][free[0] + later(held, course.period, 1.0) :], 0.02)


#: The judged properties by name. Where one says nothing, the stored outcome may be `passed` or `inapplicable`.
TIME_PROPERTIES = {
    "StillAtTheEnd": still_at_the_end,
    "SmoothHand": smooth_hand,
    "SmoothDrive": smooth_drive,
    "ShortPath": short_path,
    "UprightWhenLifted": upright_when_lifted,
    "HeldWhileLifted": held_while_lifted,
    "OneGrasp": one_grasp,
    "SettlesAfterRelease": settles_after_release,
}


def agrees(stored, holds, slack):
    """Whether a stored outcome is that of the second judgement, up to the rounding of samples."""
    if holds is None:
        return stored in ("inapplicable", "passed")
    # Whether a property applies is not judged again; it never excuses one that does not hold.
    if stored == "inapplicable":
        return holds
    if stored not in ("passed", "failed"):
        return False
    return stored == ("passed" if holds else "failed") or (slack is not None and abs(slack) <= SHARE)


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    counts, wrong = {}, []
    for course in read(sys.argv[1]):
        for name, judge in TIME_PROPERTIES.items():
            stored = course.outcomes.get(name)
            if stored is None or course.end != "completed":
                continue
            holds, slack = judge(course)
            if agrees(stored, holds, slack):
                of = counts.setdefault(name, {})
                of[stored] = of.get(stored, 0) + 1
            else:
                wrong.append(f"{course.run}/{course.step} {name}: stored {stored}, judged {holds} by {slack}")
    for name, of in counts.items():
        print(f"{name:20} agree: {sum(of.values()):4} ({', '.join(f'{count} {word}' for word, count in sorted(of.items()))})")
    print("\n".join(wrong))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
