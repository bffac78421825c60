//! Facts about one snapshot.

use crate::writer::Writer;
use actcheck_base::TermId;
use actcheck_data::{BodyState, JointState, Pose, RobotState, Snapshot};

pub(super) const POSITION: [&str; 3] = ["x", "y", "z"];
pub(super) const ROTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];

/// Writes the state of all bodies and of the robot.
pub(super) fn write(snapshot: &Snapshot, writer: &mut Writer) {
    for body in &snapshot.bodies {
        write_body(body, writer);
    }
    write_robot(&snapshot.robot, writer);
}

/// Writes a body. Sleeping and fixed bodies don't move, so their velocities (all zero) are omitted.
fn write_body(body: &BodyState, writer: &mut Writer) {
    let subject = writer.thing(&body.id);
    writer.class(subject, &body.category);
    write_pose(subject, &body.pose, writer);
    writer.number(subject, "yaw", body.pose.yaw());
    writer.number(subject, "tilt", body.pose.tilt());
    if !body.asleep && !body.fixed {
        writer.numbers(subject, ["vx", "vy", "vz"], body.linear_velocity);
        writer.numbers(subject, ["wx", "wy", "wz"], body.angular_velocity);
    }
    writer.numbers(subject, ["minX", "minY", "minZ"], body.aabb_min);
    writer.numbers(subject, ["maxX", "maxY", "maxZ"], body.aabb_max);
    writer.numbers(
        subject,
        ["mass", "friction", "restitution"],
        [body.mass_kg, body.friction, body.restitution],
    );
    writer.numbers(subject, ["sizeX", "sizeY", "sizeZ"], body.size_m);
    if let Some(distance) = body.grasp_distance_m {
        writer.number(subject, "gripperDistance", distance);
    }
    if let Some((whole, position)) = &body.part {
        writer.things(subject, "partOf", std::slice::from_ref(whole));
        writer.number(subject, "jointPosition", *position);
    }
    writer.things(subject, "touches", &body.touches);
    writer.things(subject, "restsOn", &body.rests_on);
    writer.boolean(subject, "asleep", body.asleep);
    writer.boolean(subject, "fixed", body.fixed);
    if body.left_world {
        writer.boolean(subject, "leftWorld", true);
    }
}

fn write_robot(robot: &RobotState, writer: &mut Writer) {
    let subject = writer.w("robot");
    writer.numbers(subject, ["baseX", "baseY", "baseYaw"], robot.base_true);
    writer.numbers(
        subject,
        ["believedX", "believedY", "believedYaw"],
        robot.base_believed,
    );
    let gripper = writer.w("gripper");
    write_pose(gripper, &robot.gripper, writer);
    writer.number(gripper, "opening", robot.gripper_opening_m);
    writer.things(gripper, "leftTouches", &robot.left_touches);
    writer.things(gripper, "rightTouches", &robot.right_touches);
    if let Some(cup) = robot.cup {
        writer.numbers(gripper, ["suctionForce", "pull"], [cup.force_n, cup.pull_n]);
    }
    for joint in &robot.joints {
        write_joint(joint, writer);
    }
}

/// Writes the poses of all links.
pub(super) fn write_links(robot: &RobotState, writer: &mut Writer) {
    for link in &robot.links {
        let subject = writer.named("link", &link.name);
        write_pose(subject, &link.pose, writer);
    }
}

fn write_joint(joint: &JointState, writer: &mut Writer) {
    let subject = writer.named("joint", &joint.name);
    writer.world_class(subject, "Joint");
    writer.numbers(
        subject,
        [
            "position",
            "velocity",
            "lower",
            "upper",
            "maxVelocity",
            "maxEffort",
        ],
        [
            joint.position,
            joint.velocity,
            joint.lower,
            joint.upper,
            joint.max_velocity,
            joint.max_effort,
        ],
    );
}

fn write_pose(subject: TermId, pose: &Pose, writer: &mut Writer) {
    writer.numbers(subject, POSITION, pose.position);
    writer.numbers(subject, ROTATION, pose.rotation);
}
