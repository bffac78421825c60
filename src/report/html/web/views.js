// Views that follow the robot: along its hand, and from its camera.

/** Distance of the eye behind the grasp point, and above it. Unit: metres. */
const BEHIND_HAND_M = 0.3;
const ABOVE_HAND_M = 0.1;

/** The view along the hand: from behind the grasp point, in the direction in which the hand reaches. */
function handEye(course, secs) {
  const hand = course.hand(secs), link = course.pose(course.grasp.slot, secs);
  const reach = hand.map((value, axis) => value - link[axis]), length = Math.hypot(...reach);
  const ahead = length > 0.02 ? reach.map((value) => value / length) : [0, 0, -1];
  // A hand that reaches down has no up: then it is the direction away from the robot.
  const robot = course.robot(secs), steep = Math.abs(ahead[2]) > 0.8, out = [hand[0] - robot[0], hand[1] - robot[1], 0];
  const up = steep ? out.map((value) => value / (Math.hypot(...out) || 1)) : [0, 0, 1];
  return {
    up, from: hand.map((value, axis) => value - BEHIND_HAND_M * ahead[axis] + ABOVE_HAND_M * (steep ? -up[axis] : up[axis])),
    to: hand.map((value, axis) => value + 0.1 * ahead[axis]),
  };
}

/** The view of the robot's camera, as a function of the time; `null` if it is not in the recording. */
function sightOf(course, camera) {
  if (!camera) return null;
  const slot = course.slot.get(camera.link);
  const pose = slot !== undefined ? (secs) => course.pose(slot, secs) : camera.at && (() => camera.at);
  if (!pose) return null;
  // The camera looks along its x axis; its z axis points up in the picture.
  return (secs) => {
    const link = pose(secs), at = (point) => placed(link, placed(camera.pose, point));
    const from = at([0, 0, 0]), top = at([0, 0, 1]);
    return { angle: CAMERA_DEG, from, to: at([1, 0, 0]), up: top.map((value, axis) => value - from[axis]) };
  };
}
