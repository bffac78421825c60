//! Codes of the values that a program gives to be judged.

use super::{Area, Code, code};

/// Codes that begin with `J`.
pub(super) const JUDGE: Area = Area {
    letter: 'J',
    title: "Judging in a program",
    codes: CODES_J,
};

const CODES_J: &[Code] = &[
    code(
        "J001",
        "a value has an unknown key",
        "the key is misspelt, or it is in the wrong dictionary",
        "take the suggested key; the README of the Python package lists all",
    ),
    code(
        "J002",
        "a value has the wrong kind or shape",
        "for instance a matrix in place of a position, or a quaternion that is not of length 1",
        "give the values that the message names; rotations are quaternions x, y, z, w",
    ),
    code(
        "J003",
        "a number is not finite",
        "the simulation diverged (NaN), or a quantity was divided by 0",
        "leave the episode out; its simulation has no result",
    ),
    code(
        "J004",
        "a required value is missing",
        "a body has no position, or samples have no period",
        "add the key",
    ),
    code(
        "J005",
        "the ontology has no such action",
        "the name is misspelt, or the action is in another ontology",
        "take the suggested name, or give the ontology that has the action",
    ),
    code(
        "J006",
        "a designator is unknown or missing",
        "its name is misspelt, or a property is about a thing that was not named",
        "give `parameters` with the designators of the action, such as `pickObject`",
    ),
    code(
        "J007",
        "a name is unknown",
        "no body has this id, or the ontology has no such category",
        "take the suggested name",
    ),
    code(
        "J008",
        "two states have different bodies",
        "a body was added or removed during the action, or one state leaves it out",
        "give all bodies in all states",
    ),
    code(
        "J009",
        "a property of your own can't have this name",
        "the ontology has a property of this name, or the name has other characters than letters, digits and `_`",
        "choose another name",
    ),
    code(
        "J010",
        "the steps of a monitor have different lengths",
        "the times are not those since the action began, or a step was left out",
        "give the time since the action began, in steps of equal length",
    ),
    code(
        "J011",
        "the judge stopped at a fault of its own",
        "a fault of this program",
        "report it with the values that you gave",
    ),
    code(
        "J012",
        "a property can't be explained",
        "the verdict has no such property, or the statement to explain is not valid",
        "take the suggested name, or write the statement as in a rule, such as `near_its_place(obj:cube)`",
    ),
];
