//! Codes of histories, queries and merges.

use super::{Area, Code, code};

/// Codes that begin with `H`.
pub(super) const HISTORY: Area = Area {
    letter: 'H',
    title: "Histories, queries and merges",
    codes: CODES_H,
};

const CODES_H: &[Code] = &[
    code(
        "H001",
        "the history can't be opened",
        "its folder is not writable, or a file is at its path",
        "name a writable folder with `--history DIR`",
    ),
    code(
        "H002",
        "the history is open in another process",
        "a process is writing it, such as a campaign; only commands that read can be used meanwhile",
        "wait until it ends, or name another folder",
    ),
    code(
        "H003",
        "there is no history",
        "the folder is wrong, empty, or holds other files",
        "name the folder of a history with `--history DIR`; `actcheck run CONFIG` writes one",
    ),
    code(
        "H004",
        "a history has another format",
        "another version of actcheck wrote it",
        "use that version, or name another folder",
    ),
    code(
        "H005",
        "the disk of the history is full",
        "runs need space",
        "free some space and run again; stored data is complete",
    ),
    code(
        "H006",
        "reading or writing a file of the history failed",
        "the disk has a fault, or too many files are open",
        "check the disk, or raise the limit with `ulimit -n`, and run again; stored data is complete",
    ),
    code(
        "H007",
        "the history is damaged",
        "a file was changed or truncated from outside",
        "`actcheck health --integrity` names the damaged files; `actcheck merge --salvage DIR --into NEW` copies all readable data, or restore the folder from a backup",
    ),
    code(
        "H008",
        "there is no such run, or several match",
        "the id or its prefix is misspelt or too short",
        "take the suggested id; `actcheck list` shows all runs",
    ),
    code(
        "H009",
        "values of a run can't be read",
        "a file of its segment is missing",
        "restore the file from a backup; the other files are intact",
    ),
    code(
        "H010",
        "a SPARQL query has a syntax error",
        "a word, bracket or prefix is wrong or missing, or it is nested too deeply or too long",
        "correct the marked place",
    ),
    code(
        "H011",
        "a query is an update",
        "histories are read-only",
        "use `SELECT`, `ASK`, `CONSTRUCT` or `DESCRIBE`",
    ),
    code(
        "H012",
        "a query failed",
        "it uses `SERVICE`, or the evaluator could not answer",
        "query only the history; if the help names no way out, report this bug",
    ),
    code(
        "H013",
        "a query was stopped",
        "Ctrl-C, or its time limit",
        "ask for less, or raise the limit",
    ),
    code(
        "H014",
        "there is no such campaign",
        "the id is misspelt",
        "take the suggested id; `actcheck list` shows all runs with their campaigns",
    ),
    code(
        "H015",
        "the stored configuration of a campaign can't be used",
        "the files that it names have moved",
        "name the configuration's new path with `--config`",
    ),
    code(
        "H016",
        "an RDF file can't be written",
        "the folder does not exist or is not writable",
        "name a file in an existing, writable folder",
    ),
    code(
        "H017",
        "a query over HTTP uses `SERVICE`",
        "it would query another endpoint",
        "query only the history, and join the results elsewhere",
    ),
    code(
        "H018",
        "the answer of a query over HTTP is too large",
        "it has more rows than `--limits rows=N` allows",
        "request less, or fetch it in parts with `LIMIT` and `OFFSET`",
    ),
    code(
        "H020",
        "the same run has two different results",
        "parts of a campaign were made under conditions that their records don't show, such as another machine or program",
        "leave one out with `--leave-out`",
    ),
    code(
        "H021",
        "parts of a campaign were made with different versions",
        "program, ontology, rules or models changed between the parts",
        "run the part again, or leave one out",
    ),
    code(
        "H022",
        "two campaigns have the same id",
        "they come from different histories",
        "`--rename` gives the later one a new id",
    ),
    code(
        "H023",
        "the destination of a merge holds parts of one campaign",
        "campaigns in the destination are not changed",
        "name a new folder with `--into`, and add this one to the histories to merge",
    ),
    code(
        "H024",
        "a run was rechecked in both histories with different results",
        "the rules differed",
        "leave one out, and recheck the result",
    ),
    code(
        "H025",
        "there is no such campaign to leave out",
        "the id is misspelt",
        "take the suggested id",
    ),
    code(
        "H026",
        "a campaign or run of a history has an id that is not an id",
        "another program wrote or changed the history; such an id could name a file outside of the history",
        "don't use the history; ids have only letters, digits, `-` and `_`",
    ),
    code(
        "H027",
        "a file or folder of a history is a link, a pipe or a device, or is far longer than any that this program writes",
        "another person made the history, or a part of it was moved and replaced by a link",
        "remove it if you do not know its origin; to keep a history elsewhere, move all of it, and name its folder with `--history`",
    ),
    code(
        "H028",
        "the history of a configuration or of this folder is a link, and is not named on the command line",
        "`.actcheck`, `[history] dir`, or a folder on the way is a link",
        "name the folder with `--history` if you know where the link leads; otherwise remove the link",
    ),
    code(
        "H029",
        "a segment of a history ends early, or runs are missing from it",
        "a process was killed or lost power while it wrote, the disk was full, or a copy is incomplete",
        "restore the file from a backup, or `actcheck run --resume ID` makes the missing runs again",
    ),
    code(
        "H030",
        "a query needs more statements than fit in memory",
        "it asks about many runs for facts, or for any property",
        "name the properties, ask a smaller history, or export tables (`actcheck export tables`)",
    ),
    code(
        "H031",
        "a run whose motion is not kept can't be simulated again",
        "a model, a rule of the scene or the program changed since, so that another run would result",
        "`actcheck replay` names the changes; the run's outcomes and states are intact",
    ),
    code(
        "H032",
        "a campaign of the history began later than now",
        "the machine's clock was ahead then, or is behind now",
        "set the clock; campaigns keep the order in which they were added, so that the newest is the last one",
    ),
    code(
        "H040",
        "the answer of another store can't be read",
        "the address is that of another service, or the server or the connection ended the answer early",
        "check the address; ask for less, or raise the time limit of that server",
    ),
];
