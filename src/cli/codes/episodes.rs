//! Codes of imported episodes.

use super::{Area, Code, code};

/// Codes that begin with `E`.
pub(super) const EPISODES: Area = Area {
    letter: 'E',
    title: "Episodes of other simulators",
    codes: CODES_E,
};

const CODES_E: &[Code] = &[
    code(
        "E001",
        "an episode can't be read",
        "its path is misspelt, or the file can't be opened",
        "give files of episodes, or folders with them",
    ),
    code(
        "E002",
        "a file is not an episode file, or it is damaged",
        "it was cut while it was copied, or another program wrote it",
        "record it again, or copy it again from its source",
    ),
    code(
        "E003",
        "an episode has an impossible value",
        "the simulation diverged (NaN), or the file was edited",
        "leave the episode out; its simulation has no result",
    ),
    code(
        "E004",
        "an episode is too large",
        "several episodes were recorded into one file",
        "record each episode in a file of its own",
    ),
    code(
        "E005",
        "a mapping can't be read",
        "its path is misspelt",
        "`actcheck import --propose FILE > mapping.toml` drafts one",
    ),
    code(
        "E006",
        "no shipped mapping is for the environment of an episode",
        "its bodies have names that are not known",
        "`actcheck import --propose FILE > mapping.toml` drafts a mapping; then add `--mapping mapping.toml`",
    ),
    code(
        "E007",
        "more episodes could not be imported",
        "the first ones are listed before",
        "mend these first; the others often have the same fault",
    ),
    code(
        "E008",
        "the converter can't be started",
        "the Python is misspelt or missing",
        "name one that has h5py and the recording's MuJoCo: `--python venv/bin/python`",
    ),
    code(
        "E009",
        "a file can't be converted",
        "a Python package is missing, or the file is damaged or of an unknown kind",
        "do as the message says; `docs/episodes.md` lists the kinds of files and the packages that they need",
    ),
    code(
        "E010",
        "a name of the mapping fits no body",
        "the name is misspelt, or another version of the environment has other names",
        "take the suggested name; several patterns may be listed",
    ),
    code(
        "E011",
        "a name can't be the id of an object",
        "it has spaces or other characters",
        "use letters, digits, `-` and `_`",
    ),
    code(
        "E012",
        "an axis is unknown",
        "`up` is not an axis of the body",
        "write one of `x`, `y`, `z`, `-x`, `-y`, `-z`",
    ),
    code(
        "E013",
        "a kind of report is unknown",
        "`reported` has another value than `success`",
        "write `reported = \"success\"`, or leave it out",
    ),
    code(
        "E014",
        "an action handles an unknown object",
        "`handles` names no object of the mapping",
        "take the suggested name",
    ),
    code(
        "E015",
        "a moment is unknown",
        "`from` or `to` is misspelt",
        "write `start`, `settled`, `end`, `grasp`, `top`, `release`, or a time in seconds",
    ),
    code(
        "E016",
        "an episode has no actions",
        "the mapping lists none, and the recording marks none",
        "add `[[actions]]` to the mapping, or call `recorder.mark(\"Pick\", \"begin\")` where you record",
    ),
    code(
        "E017",
        "the ontology has no such action",
        "the action of a mapping or a mark is misspelt, or the ontology is another one",
        "take the suggested name, or name the ontology with `--ontology`",
    ),
    code(
        "E018",
        "the recording does not state a value",
        "a designator of the mapping is taken from the recording (`about:…`), which lacks it",
        "record it again with this version, or write the object's id",
    ),
    code(
        "E019",
        "the runs have several physics engines",
        "a history has imported and simulated campaigns, or campaigns of several engines or versions",
        "name the campaigns with `--campaign`; for `compare`, add `--across-engines`",
    ),
    code(
        "E020",
        "an imported run can't be simulated",
        "its simulator is another one; only its states are known",
        "run it again in its own simulator; `actcheck report` replays its recorded motion",
    ),
    code(
        "E021",
        "a designator names no object of the episode, or a place although recordings have no map",
        "the mapping gives the object another id, the recorder marked another name, or the action needs a map",
        "take the suggested id, or the name of the object's body",
    ),
    code(
        "E022",
        "a body belongs to two things",
        "patterns of two objects, or of an object and the robot, fit the same body; or an object is the world's own body",
        "write patterns that do not have a body in common",
    ),
];
