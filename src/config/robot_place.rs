//! The base of a robot, or the place where a fixed one is mounted.

use crate::Table;
use crate::robot::names;
use crate::robot_roles::Roles;
use actcheck_base::did_you_mean;
use actcheck_data::RobotCore;

/// Reads the base: joints of the URDF, joints added below its root (`true`), or none.
pub(super) fn read_base(
    table: &mut Table,
    roles: &mut Roles,
) -> Option<(Option<[String; 3]>, bool)> {
    let kind = table.string("base");
    let joints = if table.has("base_joints") {
        Some(names(table, "base_joints", roles)?)
    } else {
        None
    };
    let Some(kind) = kind else {
        return Some((joints, false));
    };
    match (kind.value.as_str(), joints) {
        ("planar", None) => Some((Some(RobotCore::PLANAR_JOINTS.map(str::to_owned)), true)),
        ("fixed", None) => Some((None, false)),
        ("planar" | "fixed", Some(_)) => {
            let message = format!(
                "`base = \"{}\"` and `base_joints` exclude each other",
                kind.value
            );
            table.fault(
                "W052",
                kind.span,
                message,
                "use `base_joints` only if the URDF has joints for the base",
            );
            None
        }
        (other, _) => {
            let help = did_you_mean(other, ["planar", "fixed"]);
            table.fault("W011", kind.span, format!("unknown base `{other}`"), help);
            None
        }
    }
}

/// Reads where a fixed robot is mounted, and how far it reaches.
pub(super) fn read_place(table: &mut Table, is_mobile: bool) -> (bool, Option<[f64; 2]>) {
    for key in ["mount", "mount_turned_rad", "reach_m"]
        .into_iter()
        .filter(|_| is_mobile)
    {
        if let Some(span) = table.key_span(key) {
            let help = format!("leave out `{key}`, or the base if the robot does not drive");
            table.fault(
                "W052",
                span,
                format!("`{key}` is of a fixed robot, and this one has a mobile base"),
                help,
            );
        }
    }
    let mount = table.string("mount");
    let on_surface = mount.as_ref().is_some_and(|mount| mount.value == "surface");
    if let Some(mount) = mount.filter(|mount| !["floor", "surface"].contains(&mount.value.as_str()))
    {
        let help = did_you_mean(&mount.value, ["floor", "surface"]);
        table.fault(
            "W011",
            mount.span,
            format!("unknown mount `{}`", mount.value),
            help,
        );
    }
    (
        on_surface,
        table
            .range("reach_m", 0.0..=3.0)
            .map(|(nearest, farthest)| [nearest, farthest]),
    )
}
