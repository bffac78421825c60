//! From arguments to an exit code.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::FromArgMatches as _;

use crate::args::{Arguments, Command};
use crate::{
    check, check_oracles, datalog, explain, export, groups, list, new, output, query, recheck,
    show, shrink, stop, why,
};
use actcheck_base::set_program_digest;

/// Options of `export run` that name a kind of file: `export RUN --mjcf DIR` is short for
/// `export run RUN --mjcf DIR`.
const WRITES_A_RUN: [&str; 3] = ["--mcap", "--mjcf", "--setpoints"];

/// Adds the kind `run` to an export of a run that does without it.
fn with_kind_of_export(mut words: Vec<OsString>) -> Vec<OsString> {
    let is_export = words.get(1).is_some_and(|word| word == "export");
    let names_none = words.get(2).is_some_and(|word| {
        ["run", "tables", "rdf", "store", "help"]
            .iter()
            .all(|kind| word != kind)
    });
    let writes = |word: &OsString| {
        let name = word.to_string_lossy();
        let name = name.split_once('=').map_or(&*name, |(name, _)| name);
        WRITES_A_RUN.contains(&name)
    };
    if is_export && names_none && words.iter().any(writes) {
        words.insert(2, OsString::from("run"));
    }
    words
}

/// Parses the process's arguments and runs the command.
///
/// Exit codes: 0 done (for `run` and `recheck`: nothing failed), 1 a property failed or a traced
/// fact does not hold, 2 the command failed, 130 interrupted.
pub fn run(sources_digest: &'static str) -> ExitCode {
    set_program_digest(sources_digest);
    // clap prints help, version and usage errors itself; after a usage error it exits with 2.
    let matches = groups::program()
        .try_get_matches_from(with_kind_of_export(std::env::args_os().collect()))
        .unwrap_or_else(|error| groups::with_suggestion(error).exit());
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let done = match arguments.command {
        Command::Analyse(args) => crate::analyse::analyse(&args).map(|()| 0),
        Command::Report(args) => crate::report::report(&args).map(|()| 0),
        Command::Run(args) => crate::run::run(&args),
        Command::Launch(args) => crate::launch::launch(&args),
        Command::LaunchTask(args) => crate::launch::task(&args),
        Command::Replay(args) => crate::replay::replay(&args),
        Command::Check(args) => stop::interruptible(|stop| check::check(&args, stop).map(|()| 0)),
        Command::Compare(args) => crate::compare::compare(&args),
        Command::Bisect(args) => crate::bisect::bisect(&args),
        Command::CheckEpisodes(args) => crate::check_episodes::check_episodes(&args),
        Command::Calibrate(args) => crate::calibrate::calibrate(&args),
        Command::CrossCheck(args) => crate::cross_check::cross_check(&args),
        Command::CheckOracles(args) => check_oracles::check_oracles(&args),
        Command::Explain(args) => explain::explain(&args).map(|()| 0),
        Command::Export(args) => export::export(&args),
        Command::Health(args) => crate::health::health(&args),
        Command::Import(args) => crate::import::import(&args),
        Command::List(args) => list::list(&args).map(|()| 0),
        Command::Merge(args) => crate::merge::merge(&args),
        Command::Serve(args) => crate::serve::serve(&args).map(|()| 0),
        Command::ServeQuery(args) => crate::serve::serve_query(&args).map(|()| 0),
        Command::ServeReport(args) => crate::serve::serve_report(&args).map(|()| 0),
        Command::Show(args) => show::show(&args).map(|()| 0),
        Command::Shrink(args) => shrink::shrink(&args),
        Command::Query(args) => query::query(&args),
        Command::Relate(args) => crate::relate::relate(&args),
        Command::ProposeProperties(args) => crate::propose_properties::propose_properties(&args),
        Command::Recheck(args) => recheck::recheck(&args),
        Command::Why(args) => stop::interruptible(|stop| why::why(&args, stop).map(|()| 0)),
        Command::New(args) => new::new(&args).map(|()| 0),
        Command::Datalog(args) => stop::interruptible(|stop| datalog::datalog(&args, stop)),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(faults) => {
            output::print_diagnostics(&faults);
            ExitCode::from(2)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_exported_without_the_kind() {
        let words = |text: &str| text.split(' ').map(OsString::from).collect::<Vec<_>>();
        for (given, read) in [
            (
                "actcheck export k7f3-3 --mjcf d",
                "actcheck export run k7f3-3 --mjcf d",
            ),
            (
                "actcheck export k7f3-3 --mcap f",
                "actcheck export run k7f3-3 --mcap f",
            ),
            (
                "actcheck export --mjcf=d k7f3-3",
                "actcheck export run --mjcf=d k7f3-3",
            ),
            (
                "actcheck export run k7f3-3 --mjcf d",
                "actcheck export run k7f3-3 --mjcf d",
            ),
            ("actcheck export tabels d", "actcheck export tabels d"),
            (
                "actcheck show k7f3-3 --mjcf d",
                "actcheck show k7f3-3 --mjcf d",
            ),
        ] {
            assert_eq!(with_kind_of_export(words(given)), words(read), "{given}");
        }
    }
}
