//! Codes of configurations.

use super::{Area, Code, code};

/// Codes that begin with `C`.
pub(super) const CONFIG: Area = Area {
    letter: 'C',
    title: "Configurations",
    codes: CODES_C,
};

const CODES_C: &[Code] = &[
    code(
        "C001",
        "the configuration can't be read",
        "the path is wrong, or the file is not readable",
        "name an existing TOML file, such as `configs/pick.toml`; `actcheck new campaign` writes one",
    ),
    code(
        "C002",
        "the file is not TOML",
        "a quotation mark, bracket or equals sign is missing, or a key is written twice",
        "correct the text at the marked place; https://toml.io describes the format",
    ),
    code(
        "C003",
        "a table has an unknown key",
        "the key is misspelt, or it is in the wrong table",
        "take the suggested key; `actcheck new schema` prints all keys for completion in editors",
    ),
    code(
        "C004",
        "a value has the wrong type or number of elements",
        "for instance a string in place of a number, or a list of one number in place of a range",
        "write the value as the help shows",
    ),
    code(
        "C005",
        "a required key is missing",
        "a table lacks a key that has no default",
        "add the key",
    ),
    code(
        "C006",
        "a value is not allowed",
        "a number is out of its bounds, or a name is empty",
        "choose a value that the help allows",
    ),
    code(
        "C007",
        "a list is empty",
        "a list of models, actions or candidates has no element",
        "name at least one, or set the count to 0",
    ),
    code(
        "C008",
        "there is no such model",
        "the model's name is misspelt, or `model_dir` names another folder",
        "take a name from the help, or add the model to the folder of objects",
    ),
    code(
        "C009",
        "a range ends before it begins",
        "the larger number is written first",
        "write the smaller number first",
    ),
    code(
        "C010",
        "the model folder has no models",
        "`model_dir` names the wrong folder, or its `objects` is empty",
        "name a folder with `objects/NAME.toml` or with a folder and `model.sdf` for each model",
    ),
    code(
        "C011",
        "a folder of models from other programs can't be used",
        "a path in `model_dirs` or in the environment is wrong",
        "correct the path; it is relative to the configuration",
    ),
    code(
        "C012",
        "the ontology of the configuration does not exist",
        "the path is not relative to the configuration, or the file was moved",
        "correct `ontology`, or remove it to use the shipped ontology",
    ),
    code(
        "C013",
        "the control period does not match the physics step",
        "a control period is not a whole number of physics steps",
        "choose `steps_per_second` as the help says",
    ),
    code(
        "C014",
        "a model file can't be read",
        "a file in the folder `objects` is not readable",
        "make it readable, or move it out of the folder",
    ),
    code(
        "C015",
        "a choice of a case is ambiguous or has an unknown name as its value",
        "a choice is written twice, or it names a candidate that the configuration lacks",
        "remove one of the two, or take the suggested name",
    ),
    code(
        "C016",
        "there is no such search strategy",
        "the name in `[search] strategy` is misspelt",
        "take one of the names in the help",
    ),
    code(
        "C017",
        "a history can't keep runs in this way",
        "the word in `[history] keep` is misspelt",
        "write `all`, `failures` or `outcomes`",
    ),
    code(
        "C018",
        "motion of runs that a program performs may be lost",
        "the history does not keep motion, and a program may not do the same a second time",
        "`keep = \"all\"` in `[history]` keeps the motion",
    ),
    code(
        "C020",
        "there is no such world",
        "the world's name is misspelt, or its file can't be read",
        "take a name from the help; worlds are in the folder `worlds` of the model folder",
    ),
    code(
        "C021",
        "no world has such a location or surface",
        "the name is misspelt, or it belongs to a world that the configuration does not name",
        "take a name from the help, or add the world to `[world]`",
    ),
    code(
        "C022",
        "the rules for scenes can't be read",
        "`[scene] require` names a file that does not exist",
        "correct the path; it is relative to the configuration",
    ),
    code(
        "C030",
        "the command in `test_launcher` is malformed",
        "it is empty, or a quotation mark is not closed",
        "write it as in a shell, such as `python3 my_pick.py --speed 0.5`",
    ),
    code(
        "C031",
        "the program in `test_launcher` does not exist",
        "its name is misspelt, it is not installed, or its path is not relative to the configuration",
        "name a file relative to the configuration, an installed program, or `reference`",
    ),
    code(
        "C032",
        "the program in `test_launcher` can't be started",
        "the file is not executable, or Python is not installed",
        "run `chmod +x` on the file, install Python, or name the program that runs the file",
    ),
    code(
        "C033",
        "a ROS launch file can't be started",
        "ROS is not installed, or its `setup.bash` was not sourced",
        "source `setup.bash` first, or name the program that the file launches",
    ),
    code(
        "C034",
        "the working folder of the skill does not exist",
        "`[skill] dir` is misspelt or not relative to the configuration",
        "correct the path",
    ),
    code(
        "C035",
        "`[skill]` has no effect",
        "the reference skills perform all actions, because `test_launcher` names no program",
        "name a program in `test_launcher`, or remove `[skill]`",
    ),
];
