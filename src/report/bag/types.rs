//! The types of messages, as files with the ending `.msg` state them.

use std::collections::BTreeSet;

/// A topic of the bag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Topic {
    /// Its name.
    pub name: &'static str,
    /// The type of its messages: package and name.
    pub kind: [&'static str; 2],
    /// Whether later subscribers get its last message.
    pub is_latched: bool,
}

const fn topic(name: &'static str, kind: [&'static str; 2], is_latched: bool) -> Topic {
    Topic {
        name,
        kind,
        is_latched,
    }
}

/// Poses that change.
pub(super) const TF: Topic = topic("/tf", ["tf2_msgs", "TFMessage"], false);
/// Poses that never change.
pub(super) const TF_STATIC: Topic = topic("/tf_static", ["tf2_msgs", "TFMessage"], true);
/// Measurements of the joints.
pub(super) const JOINT_STATES: Topic = topic("/joint_states", ["sensor_msgs", "JointState"], false);
/// The robot's model.
pub(super) const ROBOT_DESCRIPTION: Topic =
    topic("/robot_description", ["std_msgs", "String"], true);
/// Shapes of objects, furniture, percepts and contacts.
pub(super) const MARKERS: Topic = topic("/markers", ["visualization_msgs", "MarkerArray"], true);
/// Forces between bodies.
pub(super) const CONTACTS: Topic = topic("/contacts", ["actcheck_msgs", "Contacts"], false);
/// Believed poses of objects.
pub(super) const PERCEPTS: Topic = topic("/percepts", ["vision_msgs", "Detection3DArray"], false);
/// Believed pose of the base.
pub(super) const BASE_BELIEVED: Topic =
    topic("/base_believed", ["geometry_msgs", "PoseStamped"], false);
/// Outcomes of properties.
pub(super) const DIAGNOSTICS: Topic = topic(
    "/diagnostics",
    ["diagnostic_msgs", "DiagnosticArray"],
    false,
);

/// Fields of types, one on each line. Those of ROS have the same fields in all releases since Humble.
const FIELDS: &[([&str; 2], &str)] = &[
    (
        ["actcheck_msgs", "Contact"],
        "string first\nstring second\ngeometry_msgs/Point point\nfloat64 force",
    ),
    (
        ["actcheck_msgs", "Contacts"],
        "std_msgs/Header header\nactcheck_msgs/Contact[] contacts",
    ),
    (
        ["builtin_interfaces", "Duration"],
        "int32 sec\nuint32 nanosec",
    ),
    (["builtin_interfaces", "Time"], "int32 sec\nuint32 nanosec"),
    (
        ["diagnostic_msgs", "DiagnosticArray"],
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status",
    ),
    (
        ["diagnostic_msgs", "DiagnosticStatus"],
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values",
    ),
    (["diagnostic_msgs", "KeyValue"], "string key\nstring value"),
    (
        ["geometry_msgs", "Point"],
        "float64 x\nfloat64 y\nfloat64 z",
    ),
    (
        ["geometry_msgs", "Pose"],
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    ),
    (
        ["geometry_msgs", "PoseStamped"],
        "std_msgs/Header header\ngeometry_msgs/Pose pose",
    ),
    (
        ["geometry_msgs", "PoseWithCovariance"],
        "geometry_msgs/Pose pose\nfloat64[36] covariance",
    ),
    (
        ["geometry_msgs", "Quaternion"],
        "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    ),
    (
        ["geometry_msgs", "Transform"],
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    ),
    (
        ["geometry_msgs", "TransformStamped"],
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    ),
    (
        ["geometry_msgs", "Vector3"],
        "float64 x\nfloat64 y\nfloat64 z",
    ),
    (
        ["sensor_msgs", "CompressedImage"],
        "std_msgs/Header header\nstring format\nuint8[] data",
    ),
    (
        ["sensor_msgs", "JointState"],
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    ),
    (
        ["std_msgs", "ColorRGBA"],
        "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    ),
    (
        ["std_msgs", "Header"],
        "builtin_interfaces/Time stamp\nstring frame_id",
    ),
    (["std_msgs", "String"], "string data"),
    (
        ["tf2_msgs", "TFMessage"],
        "geometry_msgs/TransformStamped[] transforms",
    ),
    (
        ["vision_msgs", "BoundingBox3D"],
        "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    ),
    (
        ["vision_msgs", "Detection3D"],
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\nstring id",
    ),
    (
        ["vision_msgs", "Detection3DArray"],
        "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
    ),
    (
        ["vision_msgs", "ObjectHypothesis"],
        "string class_id\nfloat64 score",
    ),
    (
        ["vision_msgs", "ObjectHypothesisWithPose"],
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    ),
    (
        ["visualization_msgs", "Marker"],
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n\
         bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n\
         string texture_resource\nsensor_msgs/CompressedImage texture\n\
         visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n\
         visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials",
    ),
    (
        ["visualization_msgs", "MarkerArray"],
        "visualization_msgs/Marker[] markers",
    ),
    (
        ["visualization_msgs", "MeshFile"],
        "string filename\nuint8[] data",
    ),
    (
        ["visualization_msgs", "UVCoordinate"],
        "float32 u\nfloat32 v",
    ),
];

fn fields(kind: [&str; 2]) -> &'static str {
    let found = FIELDS.iter().find(|(known, _)| *known == kind);
    found.map_or("", |(_, fields)| fields)
}

/// The name of a type in a schema: `package/msg/Name`.
pub(super) fn schema_name([package, name]: [&str; 2]) -> String {
    format!("{package}/msg/{name}")
}

/// The text of a type with all types that it needs, as a schema with the encoding `ros2msg`.
pub(super) fn schema(kind: [&'static str; 2]) -> String {
    let mut text = format!("{}\n", fields(kind));
    let mut met = BTreeSet::from([kind]);
    let mut open = needs(kind);
    while let Some(next) = open.pop() {
        if met.insert(next) {
            let line = "=".repeat(80);
            text += &format!("{line}\nMSG: {}\n{}\n", next.join("/"), fields(next));
            open.extend(needs(next));
        }
    }
    text
}

/// The types of a type's fields that are not primitive.
fn needs(kind: [&str; 2]) -> Vec<[&'static str; 2]> {
    let types = fields(kind)
        .lines()
        .filter_map(|line| line.split([' ', '[']).next());
    let named = types.filter_map(|name| name.split_once('/'));
    named.map(|(package, name)| [package, name]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_has_each_type_that_it_needs_once() {
        for topic in [
            TF,
            JOINT_STATES,
            MARKERS,
            CONTACTS,
            PERCEPTS,
            BASE_BELIEVED,
            DIAGNOSTICS,
        ] {
            let schema = schema(topic.kind);
            let stated: Vec<&str> = schema
                .lines()
                .filter_map(|line| line.strip_prefix("MSG: "))
                .collect();
            let all: BTreeSet<&str> = stated.iter().copied().collect();
            assert_eq!(all.len(), stated.len(), "{schema}");
            for line in schema.lines().filter(|line| !line.starts_with("MSG: ")) {
                let kind = line.split([' ', '[']).next().unwrap_or_default();
                assert!(
                    !kind.contains('/') || all.contains(kind),
                    "{kind} in {schema}"
                );
            }
        }
    }

    #[test]
    fn types_are_sorted_and_are_all_used() {
        assert!(FIELDS.is_sorted_by(|a, b| a.0 < b.0));
        let all = [
            TF,
            TF_STATIC,
            JOINT_STATES,
            ROBOT_DESCRIPTION,
            MARKERS,
            CONTACTS,
            PERCEPTS,
            BASE_BELIEVED,
            DIAGNOSTICS,
        ];
        let texts: String = all.iter().map(|topic| schema(topic.kind)).collect();
        for (kind, fields) in FIELDS {
            assert!(texts.contains(fields), "{kind:?}");
        }
    }
}
