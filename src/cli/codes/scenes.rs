//! Codes of scenes, runs and cases.

use super::{Area, Code, code};

/// Codes that begin with `S`.
pub(super) const SCENES: Area = Area {
    letter: 'S',
    title: "Scenes, runs and cases",
    codes: CODES_S,
};

const CODES_S: &[Code] = &[
    code(
        "S001",
        "the ontology has no such action",
        "an action in `tests` is misspelt",
        "take the suggested name",
    ),
    code(
        "S002",
        "an action has no success property",
        "the ontology states none, so that runs can't be judged",
        "state one: `act:NAME act:successProperty …`",
    ),
    code(
        "S003",
        "an action needs a designator without candidates",
        "the configuration lacks its table",
        "add the table that the help shows",
    ),
    code(
        "S004",
        "a table is named after no designator",
        "its name is misspelt",
        "take the suggested name",
    ),
    code(
        "S005",
        "a model's category is not a class of the ontology",
        "the category is misspelt, or the class is not declared",
        "correct the category, or declare the class",
    ),
    code(
        "S006",
        "a model has no surface to place objects on",
        "it is an object in place of furniture",
        "name one of the models in the help",
    ),
    code(
        "S007",
        "an object does not fit on a surface",
        "the object is larger than the surface",
        "choose a smaller object or a larger surface",
    ),
    code(
        "S008",
        "the configuration names no surface",
        "an action needs `[objectSurface]`",
        "add `[objectSurface]` with `object_surfaces = [\"coffee_table\"]`",
    ),
    code(
        "S009",
        "a surface or location does not match the world",
        "the world has no such surface, or no location from which the robot reaches it",
        "name one of those in the help",
    ),
    code(
        "S010",
        "the reference skills can't perform an action",
        "the action is new, or its name is misspelt",
        "name a program that performs it in `test_launcher`, or take the suggested name",
    ),
    code(
        "S011",
        "an action of a test has no such designator",
        "the designator is misspelt, or it is the same for all actions of a scene",
        "take the suggested name, or set candidates in the designator's table",
    ),
    code(
        "S012",
        "an action of a test can't have such a value",
        "the object or place is misspelt, or no scene has it",
        "take a value from the help",
    ),
    code(
        "S024",
        "the search strategy contradicts another option",
        "guided searches are biased towards failures, so a width or a part can't be requested",
        "remove the option, or use `strategy = \"random\"`",
    ),
    code(
        "S025",
        "the robot starts inside furniture, an object or the floor",
        "its start, its home posture or its height does not fit the furniture",
        "move the robot, change its `home` or `mount_height_m`, or choose other furniture",
    ),
    code(
        "S026",
        "the first action of a test is never performed",
        "one of its preconditions does not hold at the start",
        "let another action come first that makes it hold",
    ),
    code(
        "S030",
        "no scene could be built for a run",
        "in 50 draws, objects overlapped or did not come to rest",
        "use fewer or smaller objects, or a larger surface",
    ),
    code(
        "S031",
        "a run could not be made",
        "the simulation crashed twice in the same way",
        "report this bug with the configuration and seed",
    ),
    code(
        "S032",
        "many scenes were discarded",
        "objects rarely fit, or few scenes satisfy `[scene] require`",
        "use fewer or smaller objects, a larger surface, or ranges closer to the requirement",
    ),
    code(
        "S033",
        "the program that performs actions broke too many runs in a row",
        "it crashes or does not answer",
        "`actcheck show RUN` shows its output; `[skill] max_broken` is the limit",
    ),
    code(
        "S034",
        "all of the first runs of a campaign were broken for the same reason",
        "a model, a rule or the simulation fails in every scene, so that further runs would end in the same way",
        "`actcheck show RUN` shows one of them; correct the cause and run again",
    ),
    code(
        "S040",
        "the configuration has no test with the actions of a stored run",
        "`tests` changed since the run was made",
        "use the configuration of the run's campaign, or add the test again",
    ),
    code(
        "S041",
        "a stored run can't be run again",
        "models, configuration or program changed so that its scene can't be built",
        "restore them; `actcheck show` prints the digests of the run's campaign",
    ),
    code(
        "S042",
        "the recorded choices of a run don't fit exactly",
        "a range or a list of candidates changed",
        "leave `--exact` out: values are clamped then, and missing choices are nominal",
    ),
    code(
        "S050",
        "the run has nothing to shrink",
        "no property fails in it under the present rules and models, or the named property does not",
        "name a property that fails, or another run",
    ),
    code(
        "S051",
        "the scene of a run to shrink can't be built",
        "models, robot or program changed since the run was made",
        "make a new run with `actcheck run`",
    ),
    code(
        "S053",
        "a run can't be written as a model for MuJoCo",
        "its robot holds things by a suction cup, whose seal MuJoCo does not have",
        "export runs of robots with fingers",
    ),
    code(
        "S054",
        "a campaign can't be cross-checked",
        "it was imported: its simulator is elsewhere",
        "name a campaign of `actcheck run`",
    ),
    code(
        "S055",
        "a campaign has no relations between runs",
        "its configuration has no `[relations]`",
        "add `[relations]` with a rule file for each change, and name the file with `--config`",
    ),
    code(
        "S056",
        "no property can be proposed from a campaign",
        "it was imported, so that no fault can be injected into its runs, and there are no labels",
        "label its runs, good ones and bad ones, and name the file with `--labels`",
    ),
    code(
        "S060",
        "the scene of a case can't be built",
        "an edited value moved an object onto another one",
        "move the objects in the way, or remove them",
    ),
    code(
        "S061",
        "a case has a choice that its scene lacks",
        "the choice is misspelt, or its object was removed",
        "remove it, or take the suggested name",
    ),
    code(
        "S062",
        "a choice of a case is out of bounds",
        "a value was edited, or the range changed",
        "choose a value within the bounds in the help",
    ),
    code(
        "S063",
        "an object of a case can't be placed",
        "another object is in the way",
        "move one of the two, or remove one",
    ),
    code(
        "S064",
        "the scene of a case can't be run",
        "it can't be built or does not come to rest with the present models, robot or program",
        "move the objects in the way, or export the case again",
    ),
    code(
        "S065",
        "a file in the folder `regressions` is not a case",
        "it has no `[case]`",
        "keep only files from `actcheck export` in this folder",
    ),
    code(
        "S066",
        "a candidate in a case is written as an index",
        "the choice has several candidates, whose order may change",
        "write the name of the candidate instead, as the help suggests",
    ),
    code(
        "S070",
        "an object is too wide for the gripper, or has no flat place for its suction cup",
        "its narrower side and a room of 2.5 mm are wider than `max_opening_m` and it has no rim to be taken at, or its \
         top and sides are curved, hollow or narrower than the cup",
        "name a narrower or flatter object, or a robot whose gripper opens wider or whose cup is smaller",
    ),
    code(
        "S071",
        "the arm can't pick an object from a surface",
        "no grasp is reachable and free in the middle or at two corners of the surface, even without sensor noise",
        "name a lower or smaller surface, or add `postures` to the robot's profile",
    ),
    code(
        "S072",
        "an object is too heavy for the gripper or the arm",
        "friction between the fingers, the seal of a suction cup, or the effort of a joint can't carry it, or fingers that turn \
         squeeze it out",
        "reduce the object's mass, or raise `grip_force_n`, `suction_force_n` or the joint's `effort`",
    ),
    code(
        "S073",
        "the camera does not see a surface",
        "the camera is too low, or the surface is out of its range or of the head's",
        "change `camera_link` or `home` in the robot's profile, `[camera]`, or the surface",
    ),
    code(
        "S074",
        "the motors of an arm can't hold its own weight",
        "the joint's `effort` is too small, or springs that the URDF does not describe balance the arm",
        "nothing, if the robot has springs or counterweights: its arm is simulated as balanced",
    ),
    code(
        "S075",
        "the effort or the speed of joints is unknown",
        "the URDF limits the effort or the velocity of joints with a role to 0, with which they could not move, or to -1, \
         which means no limit",
        "write the largest force or torque and the largest speed of each joint into the URDF",
    ),
    code(
        "S076",
        "a collision shape is between the fingers of the robot",
        "the URDF marks the middle of the grasp with a small link that collides, or a coarse shape of another link includes \
         the fingers: objects meet it before the fingers close",
        "name the link in `no_collision_links` of the robot's profile",
    ),
];
