"""The default properties, judged from their meaning in words.

Each function returns a `Verdict` for one completed action. Limits are those that the ontology's and the rules' comments
state in words; nothing here reads or runs a rule.
"""

from dataclasses import dataclass

import numpy as np

from .geometry import surface_distance, turn, wrapped

# Facts for rules are rounded to single precision, and the tables are not.
ROUNDING = 1e-5
# The same for shares of limits, the smallest of which is 5 mm.
SHARE = 1e-4
# A hull is exported with its outermost points in 26 directions, so that it is slightly smaller. Unit: metres.
HULL = 5e-3
# An arm reaches this far from the base: heading errors are measured as arcs there. Unit: metres.
ARM = 0.7


@dataclass
class Verdict:
    """An outcome, and how far the deciding quantity is from its limit.

    `slack` is None if no quantity decided. A quantity within `tolerance` of its limit may give another outcome."""

    outcome: str
    slack: float | None = None
    tolerance: float = ROUNDING

    def doubt(self):
        """Why another outcome is possible, or None."""
        if self.slack is None or abs(self.slack) > self.tolerance:
            return None
        return "facts for rules are rounded to single precision" if self.tolerance < HULL else "the exported hull is smaller than the shape"


INAPPLICABLE = Verdict("inapplicable")


def held(true):
    return Verdict("passed" if true else "failed")


def at_most(values, limit, tolerance=ROUNDING):
    """Passed if every value is at most the limit, or there is none."""
    slack = min((limit - value for value in values), default=None)
    return Verdict("passed" if slack is None or slack >= 0 else "failed", slack, tolerance)


# Reports -----------------------------------------------------------------------------------------------------------


def reported(action):
    """The action reported success."""
    return held(action.reported is True)


# Things and motion -------------------------------------------------------------------------------------------------


def target(action):
    return action.parameters["pickObject"][0]


def is_robot(thing):
    return thing == "robot" or thing.startswith("robot/")


def moved_by(action, body):
    """How far a body's origin moved."""
    return np.linalg.norm(action.after.bodies[body].pose.position - action.before.bodies[body].pose.position)


def largest(action, body, extreme):
    """An extreme of a body during the action: `max_tilt_rad` or `max_displacement_m`."""
    return action.extremes.get(body, {}).get(extreme) or 0.0


def left_its_place_by(action, body):
    """Largest distance of a body from its place, during the action or at its end."""
    return max(moved_by(action, body), largest(action, body, "max_displacement_m"))


def knocked_over(action, body):
    """At some time it tilts by 45 degrees (0.79 rad) more than at the start."""
    tilt = max(action.after.bodies[body].pose.tilt(), largest(action, body, "max_tilt_rad"))
    return tilt - action.before.bodies[body].pose.tilt() > 0.79


def rolls_on(action, body):
    """It was faster than 2 cm/s when the action began, and neither the robot nor a movable thing touched it since."""
    was = action.before.bodies[body]
    if was.fixed or was.asleep or not np.linalg.norm(was.velocity) > 0.02:
        return False
    partners = {contact["first"] for contact in action.contacts if contact["second"] == body}
    partners |= {contact["second"] for contact in action.contacts if contact["first"] == body}
    return not any(is_robot(each) or each in action.before.bodies and not action.before.bodies[each].fixed for each in partners)


def shifted_by(action, body):
    """How far furniture moved, at its origin or, if it turned, at its ends."""
    before, after = action.before.bodies[body], action.after.bodies[body]
    angle = abs(wrapped(after.pose.yaw() - before.pose.yaw()))
    return max(left_its_place_by(action, body), (before.high - before.low)[:2].max() * np.sin(angle / 2))


def robot_moved(action):
    """A joint other than the head's used 1 % of its speed, or gripper or base ended elsewhere (1 mm, 0.01 rad)."""
    if not action.joints:
        return True
    joints = any(share >= 0.01 for name, share in action.joints.items() if not name.startswith("head"))
    hand = np.linalg.norm(action.after.gripper - action.before.gripper) > 0.001
    base = action.after.base - action.before.base
    return bool(joints or hand or np.hypot(*base[:2]) > 0.001 or abs(wrapped(base[2])) > 0.01)


def robot_drove(action):
    """The base left its place by more than 1 cm."""
    if action.path is not None and (action.path[1] - action.path[0]).max() > 0.01:
        return True
    return bool(np.hypot(*(action.after.base - action.before.base)[:2]) > 0.01)


def box_distance(body, point):
    return np.linalg.norm(np.maximum(0.0, np.maximum(body.low - point, point - body.high)))


def gripper_distance(action, body):
    """Distance from the point between the fingertips to the surface of a body, and its tolerance.

    Of a fixed body, the distance to its bounding box counts."""
    body, point = action.after.bodies[body], action.after.gripper
    if body.fixed:
        return box_distance(body, point), ROUNDING
    parts = action.run.shapes[body.id]
    exact = all(part.is_exact() for part in parts)
    return surface_distance(parts, body.pose, point), ROUNDING if exact else HULL


# Collisions --------------------------------------------------------------------------------------------------------


def forces(action):
    """The largest force of the robot in each contact with another thing.

    A link that touched the floor from the start carries the robot, like a wheel."""
    found, standing = [], set()
    for contact in action.contacts:
        links = [thing for thing in (contact["first"], contact["second"]) if is_robot(thing)]
        things = [thing for thing in (contact["first"], contact["second"]) if not is_robot(thing)]
        if len(links) == 1:
            found.append((links[0], things[0], contact["max_force_n"]))
            if things[0] == "floor" and contact["start_s"] <= 0.0:
                standing.add(links[0])
    return [(thing, force) for link, thing, force in found if thing != "floor" or link not in standing]


def in_hand(action):
    return [id for id in action.before.bodies if action.before.holds(id)]


def let_go(action, body):
    """It was in the hand, and at the end no finger touches it, or something else supports it that did not before."""
    touching = {*action.after.left_touches, *action.after.right_touches}
    below = [id for id in action.after.bodies[body].rests_on if not is_robot(id) and id not in action.before.bodies[body].rests_on]
    return body not in touching or (not action.after.holds(body) and bool(below))


def carried_forces(action, carried, since_start):
    """The largest force of each contact of things that the robot moves with others; also of old contacts if `since_start`."""
    for contact in action.contacts:
        pair = [contact["first"], contact["second"]]
        if since_start or contact["start_s"] > 0.0:
            for own, other in (pair, pair[::-1]):
                if own in carried and other not in carried and not is_robot(other):
                    yield contact["max_force_n"]


def harm(action, force_limit, meant, placed=(), since_start=True):
    """Used shares of limits, over the whole action and for everything but the things that it is meant to move.

    Things move by 1 cm, are knocked over, are pressed, are dropped; the robot presses itself with 5 N or is 5 mm inside
    itself. A thing that leaves the world has moved by metres."""
    shares = [force / force_limit for thing, force in forces(action) if thing not in meant]
    shares += [force / force_limit for force in carried_forces(action, meant, since_start)]
    for id, body in action.before.bodies.items():
        if body.fixed:
            shares.append(shifted_by(action, id) / 0.01)
        elif id not in meant and not rolls_on(action, id):
            shares += [left_its_place_by(action, id) / 0.01, 2.0 if knocked_over(action, id) else 0.0]
    shares += [2.0 for id in in_hand(action) if id not in placed and let_go(action, id)]
    # Fingers of one hand may meet.
    own = [contact for contact in action.self_contacts if not contact["of_hand"]]
    shares += [contact["max_depth_m"] / 0.005 for contact in own]
    shares += [contact["max_force_n"] / 5.0 for contact in own]
    return shares


def verdict_of_shares(shares, applies):
    """Inapplicable if nothing happened that could violate the property."""
    verdict = at_most(shares, 1.0, SHARE)
    return INAPPLICABLE if verdict.outcome == "passed" and not applies else verdict


def no_handling_collisions(action):
    """The robot harmed nothing but its object: 70 N."""
    target = action.parameters["pickObject"]
    shares = harm(action, 70.0, [*target, *in_hand(action)], placed=target)
    return verdict_of_shares(shares, robot_moved(action))


def no_drive_collisions(action):
    """The robot and its held object harmed nothing (1 N), and it still holds that object."""
    return verdict_of_shares(harm(action, 1.0, in_hand(action), since_start=False), robot_drove(action))


# Pick --------------------------------------------------------------------------------------------------------------


def close_object(action):
    """The object's surface is less than 5 cm from the point between the fingertips."""
    distance, tolerance = gripper_distance(action, target(action))
    return at_most([distance], 0.05, tolerance)


def moved_object(action):
    """The object moved by more than 2 cm, and is as far above its former support, or all of it is as far beyond the edge."""
    body = target(action)
    before, after = action.before.bodies[body], action.after.bodies[body]
    gaps = [moved_by(action, body)]
    for below in (id for id in before.rests_on if not is_robot(id)):
        rise = after.low[2] - before.low[2]
        gaps.append(rise if below == "floor" else max(rise, *(beyond(action.before.bodies[below], after) - half_width(after))))
    return at_most([-gap for gap in gaps], -0.02)


def half_width(body):
    return (body.high - body.low)[:2].max() / 2


def beyond(support, body):
    """How far the centre of a body is beyond the edges of another, along its length and its width; negative inside."""
    middle, heading, size = rectangle(support)
    return np.abs(turn(-heading) @ (box_centre(body) - middle)) - size / 2


def object_in_gripper(action):
    """Both fingers touch the object, and nothing but the robot supports it."""
    body = action.after.bodies[target(action)]
    return held(action.after.holds(body.id) and all(is_robot(thing) for thing in body.rests_on))


# Perceive plane ----------------------------------------------------------------------------------------------------


def surface(action, designator="objectSurface"):
    return action.parameters[designator][0]


def from_believed(action, seen):
    """Position and heading of a percept, from the true base when its picture was taken.

    A localisation error is not a perception error. Without a picture, the base at the start of the action counts."""
    base = action.before.base if seen.base is None else seen.base
    believed = action.before.believed if seen.believed is None else seen.believed
    angle = base[2] - believed[2]
    return base[:2] + turn(angle) @ (seen.pose.position[:2] - believed[:2]), seen.pose.yaw() + angle


def box_centre(body):
    return (body.low[:2] + body.high[:2]) / 2


def rectangle(body):
    """Centre, heading, length and width of a body from above."""
    return box_centre(body), body.pose.yaw(), body.size[:2]


def plane_found(action):
    """The plane has the height of the surface (1 cm), is level (2 cm across it), and has its edges (4 cm)."""
    plane = action.plane
    if plane is None:
        return held(False)
    body = action.before.bodies[surface(action)]
    middle, heading, size = rectangle(body)
    centre, yaw = from_believed(action, plane)
    # In the frame of the surface: where the plane's centre is, and how far it reaches along the axes.
    offset = turn(-heading) @ (centre - middle)
    reach = np.abs(turn(yaw - heading)) @ plane.size / 2
    edges = np.abs(np.concatenate([offset - reach + size / 2, offset + reach - size / 2]))
    height = abs(plane.pose.position[2] - body.high[2])
    return at_most([height / 0.01, plane.pose.tilt() * plane.size.max() / 0.02, *(edges / 0.04)], 1.0, SHARE)


def size_error(seen, body):
    """Largest error of the perceived sides of an upright object; the horizontal ones count in either order."""
    if body.pose.tilt() >= 0.26:
        return 0.0
    orders = [seen.size[:2], seen.size[1::-1]]
    return max(min(np.abs(order - body.size[:2]).max() for order in orders), abs(seen.size[2] - body.size[2]))


def objects_detected(action):
    """Each object on the surface has one percept within 5 cm, of its kind, height and size (5 cm), and there are no others.

    A percept without a kind is enough, except of the object to pick; `Object` does not count as a kind. An upright object is
    perceived upright (15 degrees, 0.26 rad). The robot harmed nothing (1 N), and still holds its object."""
    undisturbed = at_most(harm(action, 1.0, in_hand(action), since_start=False), 1.0, SHARE)
    if undisturbed.outcome == "failed":
        return undisturbed
    on_it = [body for body in action.before.bodies.values() if not body.fixed and surface(action) in body.rests_on]
    centres = np.array([box_centre(body) for body in on_it]).reshape(-1, 2)
    places = np.array([from_believed(action, seen)[0] for seen in action.objects]).reshape(-1, 2)
    if len(centres) == 0 or len(places) == 0:
        return held(len(centres) == len(places))
    gaps = np.linalg.norm(places[:, None] - centres[None], axis=2)
    nearest = gaps.argmin(axis=1)
    near = gaps.min(axis=1) <= 0.05
    pairs = [(seen, on_it[body]) for seen, body, close in zip(action.objects, nearest, near) if close]
    counts = np.bincount(nearest[near], minlength=len(on_it))
    target = action.parameters.get("pickObject", [])
    kinds = all(
        seen.category in body.kinds
        if seen.category and (seen.category != "Object" or body.id not in target)
        else body.id not in target
        for seen, body in pairs
    )
    leans = any(seen.pose.tilt() >= 0.26 for seen, body in pairs if body.pose.tilt() < 0.26)
    sizes = [abs(seen.pose.position[2] - body.low[2]) for seen, body in pairs]
    sizes += [size_error(seen, body) for seen, body in pairs]
    good = near.all() and (counts == 1).all() and kinds and not leans and all(size <= 0.05 for size in sizes)
    slack = min([np.abs(gaps.min(axis=1) - 0.05).min(), *(abs(size - 0.05) for size in sizes)])
    return Verdict("passed" if good else "failed", slack)


# Place -------------------------------------------------------------------------------------------------------------


def object_on_surface(action):
    """The surface carries the object, which is upright (15 degrees, 0.26 rad), 2 cm inside the edges, and at rest.

    At rest: slower than 1 cm/s and 0.2 rad/s, and not faster than 2 cm/s in the last 0.2 s."""
    body, below = action.after.bodies[target(action)], action.after.bodies[surface(action, "placeSurface")]
    on_it = below.id in body.rests_on
    gap = abs(body.low[2] - below.high[2])
    speed, spin = (0.0, 0.0) if body.asleep else (np.linalg.norm(body.velocity), np.linalg.norm(body.spin))
    slacks = [0.005 - gap, 0.26 - body.pose.tilt(), 0.01 - speed, 0.2 - spin, -beyond(below, body).max() - 0.02]
    # Times have another unit than the rest, but only their sign and a narrow miss matter.
    slacks += [action.duration - end - 0.2 for _, end in action.motions.get(body.id, [])]
    return Verdict("passed" if on_it and min(slacks) >= 0 else "failed", min(slacks) if on_it else None)


def object_released(action):
    """The hand held the object before. Now no finger touches it, and it is more than 5 cm away."""
    body = target(action)
    if not action.before.holds(body):
        return INAPPLICABLE
    if body in action.after.left_touches or body in action.after.right_touches:
        return held(False)
    distance, tolerance = gripper_distance(action, body)
    return at_most([-distance], -0.05, tolerance)


# Move to -----------------------------------------------------------------------------------------------------------


def pose_errors(base, other):
    """Distance, and difference of headings as an arc at arm's length."""
    return [np.hypot(*(base[:2] - other[:2])), ARM * abs(wrapped(base[2] - other[2]))]


def goal_reached(action):
    """The base is within 10 cm of its goal, also in the heading at arm's length."""
    goal = action.run.locations.get(action.parameters["objectLocation"][0])
    return held(False) if goal is None else at_most(pose_errors(action.after.base, goal), 0.1)


def localisation_agrees(action):
    """The believed base pose is within 5 cm of the true one, also in the heading at arm's length."""
    if not robot_moved(action):
        return INAPPLICABLE
    return at_most(pose_errors(action.after.base, action.after.believed), 0.05)


def stayed_in_zone(action):
    """The base, 43 cm wide, stayed within the rooms and 18 cm from each wall on an outer side of the rooms."""
    if not action.run.rooms or not robot_drove(action):
        return INAPPLICABLE
    low = np.min([room[0] for room in action.run.rooms], axis=0)
    high = np.max([room[1] for room in action.run.rooms], axis=0)
    path, half = action.path, 0.215
    slacks = [*(path[0] - low - half), *(high - path[1] - half)]
    for wall in (body for body in action.before.bodies.values() if "Wall" in body.kinds):
        # A wall on an outer side contains its line, and runs along it.
        across = int((wall.high - wall.low)[1] <= (wall.high - wall.low)[0])
        if any(wall.low[across] <= end[across] <= wall.high[across] for end in (low, high)):
            gap = np.maximum(0.0, np.maximum(wall.low[:2] - path[1], path[0] - wall.high[:2]))
            slacks.append(np.linalg.norm(gap) - half - 0.18)
    return at_most([-min(slacks)], 0.0)


PROPERTIES = {
    "CloseObject": close_object,
    "ObjectGrasped": reported,
    "NoGraspCollisions": no_handling_collisions,
    "MovedObject": moved_object,
    "ObjectInGripper": object_in_gripper,
    "PlaneReported": reported,
    "PlaneFound": plane_found,
    "ObjectsDetected": objects_detected,
    "PlaceReported": reported,
    "ObjectOnSurface": object_on_surface,
    "ObjectReleased": object_released,
    "NoPlaceCollisions": no_handling_collisions,
    "GoalReported": reported,
    "NoDriveCollisions": no_drive_collisions,
    "GoalReached": goal_reached,
    "LocalisationAgrees": localisation_agrees,
    "StayedInZone": stayed_in_zone,
}


def judge(action, name):
    """The verdict about one property; an action that did not complete gives its end to all of its properties."""
    if action.end != "completed":
        return Verdict(action.end)
    return PROPERTIES[name](action)
