//! Elements of made-up robots.

/// A link that is a box with its middle at a place, of uniform mass.
pub fn link(name: &str, size: [f64; 3], at: [f64; 3], mass: f64) -> String {
    let [x, y, z] = at;
    let moment = |a: f64, b: f64| mass * (a * a + b * b) / 12.0;
    let (ixx, iyy, izz) = (
        moment(size[1], size[2]),
        moment(size[0], size[2]),
        moment(size[0], size[1]),
    );
    format!(
        "<link name=\"{name}\"><inertial><origin xyz=\"{x} {y} {z}\"/><mass value=\"{mass}\"/>\
        <inertia ixx=\"{ixx}\" iyy=\"{iyy}\" izz=\"{izz}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>\
        <collision><origin xyz=\"{x} {y} {z}\"/><geometry><box size=\"{} {} {}\"/></geometry></collision></link>\n",
        size[0], size[1], size[2]
    )
}

/// A joint between two links, with strong motors.
pub fn joint(
    name: &str,
    kind: &str,
    ends: [&str; 2],
    at: [f64; 3],
    axis: &str,
    range: [f64; 2],
) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{}\"/><child link=\"{}\"/>\
        <origin xyz=\"{} {} {}\"/><axis xyz=\"{axis}\"/>\
        <limit lower=\"{}\" upper=\"{}\" effort=\"100\" velocity=\"1\"/></joint>\n",
        ends[0], ends[1], at[0], at[1], at[2], range[0], range[1]
    )
}
