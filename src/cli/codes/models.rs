//! Codes of models, robots and worlds.

use super::{Area, Code, code};

/// Codes that begin with `W`.
pub(super) const MODELS: Area = Area {
    letter: 'W',
    title: "Models, robots and worlds",
    codes: CODES_W,
};

const CODES_W: &[Code] = &[
    code(
        "W001",
        "a model has a part of an unknown kind",
        "the kind is misspelt",
        "write box, capsule, cylinder, sphere or tube",
    ),
    code(
        "W002",
        "the size of a model does not match its parts",
        "`size_m` is not the outer size, or the origin is not on the ground below the middle",
        "correct `size_m` or move the parts",
    ),
    code(
        "W003",
        "a category is not an IRI",
        "the prefix is missing or unknown",
        "write it like `category = \"act:Glass\"`",
    ),
    code(
        "W010",
        "a robot profile or its URDF can't be read",
        "the path is wrong, or required keys of the profile are missing",
        "correct the path; that of the URDF is relative to the profile",
    ),
    code(
        "W011",
        "a robot profile is inconsistent",
        "an unknown kind of base, lists of joints and positions of different lengths, or a key such as `home` or \
         `grasp_offset_m` without the one that it depends on",
        "give one position for each joint, a base that the help names, and both keys or neither",
    ),
    code(
        "W012",
        "the URDF of a profile can't be found",
        "a `package://` path names an unknown package",
        "add the folder of the package to `package_dirs`",
    ),
    code(
        "W013",
        "an argument for a xacro file is not of the form NAME:=VALUE",
        "it is an option of the program xacro, which could write files",
        "write `xacro_args = [\"arm:=left\"]`; expand the file by hand if it needs more",
    ),
    code(
        "W020",
        "the URDF of the robot can't be used",
        "the file is not a URDF file with one tree of links",
        "name a URDF file in the profile's `urdf`",
    ),
    code(
        "W021",
        "the robot lacks a part that its profile names",
        "a link or a joint is misspelt",
        "take the suggested name",
    ),
    code(
        "W022",
        "the robot has a part that is not supported",
        "a joint is floating or planar, or a shape is of an unknown kind",
        "use fixed, revolute, continuous or prismatic joints, and boxes, cylinders, spheres, capsules or meshes",
    ),
    code(
        "W023",
        "the physics settings can't be simulated",
        "`[physics]` contradicts itself",
        "correct `[physics]` in the configuration",
    ),
    code(
        "W024",
        "the opening of the robot's gripper can't be measured, or is smaller than `max_opening_m`; no gripper was found; or no \
         arm carries it",
        "the grasp frame is not between the fingertips or is turned, or `finger_joints` or `finger_links` names others \
         than those that move",
        "fill in the gap that `new robot` left; otherwise follow the help: fingers open along the y axis of the \
         grasp frame, whose origin is between the fingertips",
    ),
    code(
        "W030",
        "a model of another program can't be read",
        "its folder lacks `model.config` or the SDF file that it names",
        "name a folder with both, or a file of URDF or MJCF",
    ),
    code(
        "W031",
        "a model file is not XML",
        "an element is not closed, or a `<` in a text is not escaped",
        "correct the marked place",
    ),
    code(
        "W032",
        "a model file has another format or version than its name says",
        "the root element is wrong, or the file has no model or several",
        "follow the help; a file with a `<world>` belongs in the folder `worlds`",
    ),
    code(
        "W033",
        "a model file lacks a required element or attribute",
        "the file is incomplete",
        "add the element or attribute that the help names",
    ),
    code(
        "W034",
        "a value in a model file is not allowed",
        "a number is malformed, zero or negative where it must not be, such as a moment of inertia of a moving link",
        "correct the value; `actcheck check --mend` mends moments of inertia in a copy of a robot's URDF",
    ),
    code(
        "W035",
        "a model file uses a feature that is not supported",
        "an object with a ball joint, links that no joint connects, or a joint that moves the whole model",
        "follow the help; robots are read through `[robot] profile`",
    ),
    code(
        "W036",
        "a part of a model file is ignored or replaced, or is that of no real body",
        "the simulation has no counterpart for it, such as plugins and sensors; one moment of inertia exceeds the sum of \
         the others; a gripper, or a link that a joint moves, has no `<collision>`; a joint moves the whole robot; the \
         limits of a joint contradict its coupling; or a colour is not four numbers",
        "nothing, if the model works without it; otherwise follow the help",
    ),
    code(
        "W037",
        "a mesh can't be used",
        "the file is missing or damaged, or its surface is not closed",
        "export it again as triangles to stl, obj, dae or glb; use a thin box for a sheet",
    ),
    code(
        "W038",
        "a model has no solid shape",
        "none of its links has a `<collision>`",
        "give a link a `<collision>`",
    ),
    code(
        "W039",
        "a model has no category",
        "its file and `[categories]` name none, so rules see only `act:Object`",
        "add the model to `[categories]`",
    ),
    code(
        "W040",
        "a world uses a model that does not exist",
        "the model's name is misspelt, or the model itself has errors",
        "take the suggested name, or correct the model",
    ),
    code(
        "W041",
        "two things in a world have the same name",
        "a part of the file was copied",
        "give one of them another name",
    ),
    code(
        "W042",
        "a location names a surface that the world lacks",
        "the name is misspelt, or that furniture has no surface",
        "take the suggested name",
    ),
    code(
        "W043",
        "a location is inside a piece of furniture",
        "its coordinates are wrong; the robot drives to locations",
        "move the location away",
    ),
    code(
        "W044",
        "a room or wall has no extent",
        "both corners or both ends are the same, or their coordinates are swapped",
        "correct the coordinates",
    ),
    code(
        "W045",
        "models that the configuration does not name can't be used",
        "their files have faults; the message has the first of each",
        "mend those that you need: a model that the configuration names gets all its faults",
    ),
    code(
        "W050",
        "the robot has no such link or joint",
        "a name in the robot profile is misspelt",
        "take the suggested name",
    ),
    code(
        "W051",
        "the links of a model don't form one tree",
        "a link has two parents or none, links form a cycle, or names are used twice",
        "correct the joints; the help names the fault",
    ),
    code(
        "W052",
        "a joint has two roles, or keys of a profile exclude each other",
        "a joint is in two lists, or `base` and `base_joints`, or keys of fingers and of a suction cup, are both set",
        "leave the joint in one list, and the keys of one base and one gripper",
    ),
    code(
        "W053",
        "a joint can't have its role",
        "it has the wrong type, such as a base joint that turns where it must slide, or does not move",
        "name another joint, or correct its type in the URDF",
    ),
    code(
        "W054",
        "a posture or opening exceeds the limits of a joint",
        "the profile and the URDF disagree",
        "choose a value within the limits in the help",
    ),
    code(
        "W055",
        "a model exceeds a limit of its structure",
        "a damaged or malicious file: entities that grow, hundreds of attributes or namespaces, thousands of levels, copies of copies, or models that include each other many times",
        "don't use the file, include fewer models, or export the model again",
    ),
    code(
        "W056",
        "a mass or a size can't be meant",
        "a model has less than 1 or more than 25,000 kg/m³, or is larger than 20 m or smaller than 2 mm; a robot lifts 1.5 \
         times its own mass: masses in grams, lengths in millimetres, a missing mass, or a wrong volume or effort",
        "correct the number: masses are in kilograms, lengths in metres, efforts in newtons or newton metres",
    ),
];
