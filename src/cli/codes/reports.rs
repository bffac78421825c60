//! Codes of tables, health and tests of properties.

use super::{Area, Code, code};

/// Codes that begin with `A`.
pub(super) const TABLES: Area = Area {
    letter: 'A',
    title: "Tables",
    codes: CODES_A,
};

const CODES_A: &[Code] = &[
    code(
        "A001",
        "a table beside the history can't be written",
        "the folder is not writable, or the disk is full",
        "check permissions and free disk space",
    ),
    code(
        "A002",
        "a table beside the history can't be read",
        "it is damaged or was written by another version",
        "delete the folder `tables` in the history: the same command makes it anew",
    ),
];

/// Codes that begin with `Q`.
pub(super) const HEALTH: Area = Area {
    letter: 'Q',
    title: "Health of campaigns",
    codes: CODES_Q,
};

const CODES_Q: &[Code] = &[
    code(
        "Q001",
        "a property is often inapplicable",
        "its `applicable` condition rarely holds in these scenes",
        "generate scenes to which it applies, or widen the condition",
    ),
    code(
        "Q002",
        "values of a parameter are rarely drawn",
        "discards exclude such scenes",
        "check the reasons of discards (`act:discards` of each run)",
    ),
    code(
        "Q003",
        "few pairs of values of two parameters were tried",
        "there are few runs, or discards exclude pairs",
        "run more scenes, or check the reasons of discards",
    ),
    code(
        "Q004",
        "runs repeat each other",
        "the ranges are so narrow that the same scene is drawn again",
        "widen the ranges, or ask for fewer runs",
    ),
    code(
        "Q005",
        "a run took much longer than the others",
        "a complex scene, slow rules or a slow skill",
        "`actcheck show RUN` shows it; `[budget] run_secs` limits the time of a run",
    ),
    code(
        "Q006",
        "bodies penetrated each other",
        "contacts were simulated inaccurately",
        "raise `[physics] steps_per_second` or `iterations`, or make heavy objects lighter",
    ),
    code(
        "Q007",
        "objects gained energy without a cause",
        "the simulation was unstable",
        "raise `[physics] steps_per_second` or `iterations`, or lower `restitution`",
    ),
];

/// Codes that begin with `V`.
pub(super) const ORACLES: Area = Area {
    letter: 'V',
    title: "Tests of properties (`actcheck check-oracles`)",
    codes: CODES_V,
};

const CODES_V: &[Code] = &[
    code(
        "V001",
        "no property detects an injected fault",
        "the properties don't check the effect of that fault",
        "add a property that fails with it, or tighten one that should",
    ),
    code(
        "V002",
        "a property detects no injected fault",
        "its rule is too weak, or its threshold too wide",
        "tighten the rule, or remove the property",
    ),
    code(
        "V003",
        "an injected fault rarely took effect",
        "the action rarely gets far enough",
        "run more scenes (`--runs`), or scenes in which the action succeeds more often",
    ),
    code(
        "V004",
        "a property rarely passed without a fault",
        "too few scenes remain to judge which faults it detects",
        "run more scenes (`--runs`), or scenes in which it passes more often",
    ),
    code(
        "V005",
        "an action passes although a fault was injected",
        "no property checks the action's effect on the world",
        "add such a property",
    ),
    code(
        "V010",
        "no scene could be judged",
        "every run broke or timed out",
        "`actcheck run` with the same configuration shows why",
    ),
];
