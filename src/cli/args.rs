//! The command line: commands and their options.

use clap::{Parser, Subcommand};

/// QuickCheck for robot actions: generated scenes, physics simulation, verdicts by rules that you
/// edit.
#[derive(Debug, Parser)]
#[command(
    name = "actcheck",
    version,
    max_term_width = 100,
    disable_help_subcommand = true
)]
#[command(
    after_help = "Example:\n  actcheck run configs/pick.toml\n\nEnvironment:\n  NO_COLOR, CLICOLOR=0  no colours\n  CLICOLOR_FORCE=1      colours also in pipes and files\n  COLUMNS               width of the output, instead of the terminal's"
)]
pub struct Arguments {
    /// The command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a campaign: generate scenes, perform the actions, judge the outcomes, store every run
    ///
    /// The campaign ends after the last planned run, or when a budget is spent: time, number of
    /// failures, or precision of the pass rates. To limit the wall-clock time of each run, set
    /// `run_secs` in the configuration's `[budget]`.
    ///
    /// A file from `actcheck export` (a case) runs its one scene, and reports whether it fails in
    /// the same way, in another way, or no longer. Cases in the folder `regressions`, beside the
    /// configuration or in the folder above, run before the campaign and are reported separately:
    /// they count for the exit code, but not for pass rates.
    ///
    /// Exit code: 0 everything passed, 1 a property failed, 2 the campaign could not run or no run
    /// could be judged, 130 interrupted by Ctrl-C (finished runs are kept).
    #[command(
        after_help = "Example:\n  actcheck run configs/pick.toml --runs 5 --history /tmp/try"
    )]
    Run(crate::run_args::RunArgs),
    /// List the runs of a history, or the properties with their pass rates
    #[command(
        after_help = "Examples:\n  actcheck list --format csv\n  actcheck list --rules\n  actcheck list --failed --property ObjectInGripper --where 'target_mass_kg > 0.3'"
    )]
    List(crate::list::ListArgs),
    /// Explain why a property holds in a run, or how close it came and which facts were missing
    ///
    /// Uses the current rules: those that the ontology links now.
    #[command(
        after_help = "Example:\n  actcheck why k7f3-3 MovedObject    (a run id from `actcheck list`)"
    )]
    Why(crate::why::WhyArgs),
    /// Write a report: one HTML page that works offline, or results for Allure, JUnit readers,
    /// EARL, …
    ///
    /// The page has an overview with counts, scores and intervals, properties, failure modes,
    /// patterns with plots, target positions, trends, and each run with witnesses, explanations and
    /// parameters. Failed runs have a 3D replay, up to the limit of `--replay-mb`, so that each
    /// failure mode and property has one; the others are listed with the command that shows them.
    ///
    /// Reads the tables beside the history, and updates them first. Exit code: 0 written, 2 the
    /// report could not be written.
    #[command(
        after_help = "Examples:\n  actcheck report --html report.html    (after `actcheck run configs/pick.toml`)\n  actcheck report --html picks.html --campaign k7f3 --property ObjectInGripper\n  actcheck report --rrd runs.rrd    (built with `--features rerun`; `rerun runs.rrd` shows it)\n  actcheck report --allure allure-results --junit junit.xml --markdown"
    )]
    Report(crate::report::ReportArgs),
    /// Query a history with SPARQL 1.1
    ///
    /// The prefixes act, w, obj, run, campaign, rdf, rdfs, owl, xsd, earl and prov are predefined.
    /// Facts about the world are in named graphs, one for each moment:
    /// `?execution act:before ?g . GRAPH ?g { … }`.
    #[command(
        after_help = "Examples:\n  actcheck query 'SELECT (COUNT(?r) AS ?n) WHERE { ?r a act:Run }'\n  actcheck query --named\n  actcheck query --named failure-rates\n  actcheck query --named failure-rates --endpoint http://localhost:3030/history/query"
    )]
    Query(crate::query::QueryArgs),
    /// Judge stored runs by the current rules, without simulating
    ///
    /// Properties that are newer than the runs are judged too. New and changed outcomes are stored
    /// beside the old ones, with the digest of the rules and the time. From then on,
    /// `list`, `show`, `why`, `analyse`, `report` and `export` use the newest outcomes; `compare`
    /// and `replay` use the campaign's own. In queries, the newest outcomes are those in the graph
    /// act:rechecked that no other supersedes (see ontology/history.ttl).
    ///
    /// `--ontology` also takes a folder with the rules of another version, such as an older
    /// checkout: with `ontology/actions.ttl` or `actions.ttl`.
    ///
    /// Exit code: 0 no property fails now, 1 a property fails now, 2 the recheck failed or nothing
    /// could be decided, 130 interrupted by Ctrl-C (judgements so far are kept).
    #[command(
        after_help = "Example:\n  actcheck recheck MovedObject    (after `actcheck run configs/pick.toml`)"
    )]
    Recheck(crate::recheck::RecheckArgs),
    /// Write a configuration, a property or a robot's profile to edit, or files for editors and
    /// shells
    #[command(
        after_help = "Examples:\n  actcheck new campaign\n  actcheck new property StaysUpright --for Pick"
    )]
    New(crate::new::NewArgs),
    /// Check configuration, ontology, rules and models without simulating; reports all mistakes at
    /// once
    #[command(after_help = "Example:\n  actcheck check configs/pick.toml")]
    Check(crate::check::CheckArgs),
    /// Show one run: its scene, and every property's outcome with margin and witness
    #[command(
        after_help = "Examples:\n  actcheck show k7f3-3    (a run id from `actcheck list`; a prefix is enough)\n  actcheck show @last    (the last run; @last-failed: the last one in which a property failed)"
    )]
    Show(crate::show::ShowArgs),
    /// Run stored runs again from their recorded choices, and check that every state is the same
    ///
    /// For a run that differs, prints the first time, body and quantity that differ, and which
    /// model, configuration, rule or program has changed since. Outcomes come from the current
    /// rules; they don't affect the exit code.
    ///
    /// Exit code: 0 every state is the same bit for bit, 1 a run differs, 2 a run could not be
    /// replayed.
    #[command(
        after_help = "Examples:\n  actcheck replay k7f3-3    (a run id from `actcheck list`; a prefix is enough)\n  actcheck replay --sample 100 --jobs 2    (a random sample, after `actcheck run configs/pick.toml`)"
    )]
    Replay(crate::replay::ReplayArgs),
    /// Find the smallest scene that still fails in the same way as a run, and report which of its
    /// values matter
    ///
    /// Removes objects and trailing actions, and resets noise, physics and poses to their nominal
    /// values, as long as the same properties fail. The shrunk run is stored in the history. Exit
    /// code: 0 done, 130 interrupted by Ctrl-C (the smallest run so far is stored and printed), 2
    /// the run does not fail or can't be reproduced.
    #[command(
        after_help = "Example:\n  actcheck shrink k7f3-3 --picture small.svg    (a run id from `actcheck list`; a prefix is enough)"
    )]
    Shrink(crate::shrink::ShrinkArgs),
    /// Find when and how actions fail: conditions and effects that go with failures more often than
    /// by chance
    ///
    /// For each property, two lists of patterns. When it fails: up to three conditions before the
    /// action, of the scene and of the errors drawn (object categories at any level of the
    /// ontology's hierarchy, ranges with bounds found in the runs; directions wrap). How it fails:
    /// up to two effects during the action, such as the perceived position of the target against
    /// the true one, the first contact, a blocked base, the phase reached. Patterns are merged into
    /// the simplest ones, corrected for multiple testing, and confirmed on a held-out third of the
    /// runs. If none is confirmed, the strongest conditions are listed with the number of runs that
    /// would decide. Then the distribution of margins; changes from campaign to campaign; flaky
    /// scenes.
    ///
    /// For all properties together: failure modes, which failure leads to which later one, and
    /// collisions: the things that were hit, how often, how hard, and where they were around the
    /// target or goal. Only passed and failed outcomes count; the others are reported separately.
    ///
    /// Reads the tables beside the history, and updates them first.
    #[command(
        after_help = "Examples:\n  actcheck analyse    (after `actcheck run configs/pick.toml --runs 300`)\n  actcheck analyse --property ObjectInGripper --by target_category,target_turned_rad\n  actcheck analyse --picture patterns.png\n  actcheck analyse --collisions collisions.svg"
    )]
    Analyse(crate::analyse::AnalyseArgs),
    /// Compare two campaigns on the same scenes: which properties hold more or less often, and in
    /// which scenes outcomes flipped
    ///
    /// Runs with the same number and the same scene (test, world, poses of objects and robot) form
    /// a pair; other runs are counted and listed. A scene that is run several times passes if all
    /// its runs pass. For each property, and for whole runs (at least one property passed, none
    /// failed), prints both pass rates, their difference with a 95 % confidence interval (Tango's
    /// score interval for paired proportions), McNemar's exact test, and Holm's correction for the
    /// number of lines.
    ///
    /// Only passed and failed outcomes are compared: a scene in which either side is inapplicable,
    /// broken, timed out or untested is excluded from that line and counted. `--fail-if-worse`
    /// therefore does not detect a robot that hangs; the table shows the counts.
    ///
    /// Each line has one of four answers: B is worse, better, not different (the interval of the
    /// difference lies within the margin), or the comparison is underpowered, with the number of
    /// scenes that would decide.
    ///
    /// Exit code: 0 done (B is not shown to be worse), 1 B is worse (only with --fail-if-worse), 2
    /// the comparison failed. With --decide it is the answer.
    #[command(
        after_help = "Examples:\n  actcheck run configs/pick.toml --history /tmp/before\n  actcheck run configs/pick.toml --history /tmp/after    (with another skill, robot or physics)\n  actcheck compare /tmp/before /tmp/after --fail-if-worse 0.05\n  actcheck compare k7f3 k7f3@rechecked    (one campaign, before and after `actcheck recheck`)"
    )]
    Compare(crate::compare::CompareArgs),
    /// Find the first revision whose rules, skill or program changed the outcomes
    ///
    /// Without CONFIG, judges the runs of a history anew by the ontology and rules of each
    /// revision, without simulating; nothing is stored. With CONFIG, runs its scenes at each
    /// revision: with the revision's own configuration, rules, models and skills, and with this
    /// program or the one that `--build` and `--program` make. A case is the same scene at each
    /// revision. `--programs` searches a list of programs instead.
    ///
    /// Revisions are halved as by `git bisect`. One that does not parse, build or run is skipped,
    /// and so is one for which `--most-scenes` are too few. `--good` may also be the newer end:
    /// then the first good revision is found. The checkout and git's folder are only read: files of
    /// revisions are in a temporary folder, which is removed at the end.
    ///
    /// Exit code: 0 found, 1 one of several because the others were skipped, 2 the bisection failed
    /// or the ends don't differ, 130 interrupted by Ctrl-C.
    #[command(
        after_help = "Examples:\n  actcheck bisect --good v1.0    (stored runs by the rules of each revision since v1.0)\n  actcheck bisect --good v1.0 --property MovedObject --run k7f3-3\n  actcheck bisect configs/my_skill.toml --good v1.0 --bad main    (the skill of each revision)\n  actcheck bisect configs/pick.toml --good v1.0 --build make --program ./actcheck\n  actcheck bisect case.toml --programs old/actcheck newer/actcheck ./actcheck"
    )]
    Bisect(crate::bisect::BisectArgs),
    /// Report a campaign's health: discarded and repeated scenes, values never tried, slow runs,
    /// inaccurate simulation
    ///
    /// Prints how much of each parameter's range the scenes cover, compared with the same number of
    /// random draws, and the same for pairs of parameters. Warns, with advice, where the results
    /// are less conclusive than they look.
    ///
    /// Exit code: 0 healthy, 1 there is a warning, 2 the campaign could not be examined.
    #[command(
        after_help = "Example:\n  actcheck health    (the newest campaign, after `actcheck run configs/pick.toml`)"
    )]
    Health(crate::health::HealthArgs),
    /// Serve the report of a history, live while a campaign runs, with the replay of every run, a
    /// query page and a read-only SPARQL 1.1 endpoint
    ///
    /// Light queries are answered at once. Others wait for a process, which is stopped if it
    /// exceeds its limit of time, memory or answer size. Updates, `SERVICE`, file access and
    /// requests from pages of other sites are refused. Answers come from snapshots, so that other
    /// commands can use and change the history meanwhile. `/health` counts requests and reports
    /// their response times.
    ///
    /// Exit code: 0 stopped by Ctrl-C, 2 the history could not be served.
    #[command(
        after_help = "Examples:\n  actcheck serve    (after `actcheck run configs/pick.toml`)\n  curl -H 'Accept: text/csv' --data-urlencode 'query=SELECT ?run { ?run a act:Run }' http://localhost:7878/sparql"
    )]
    Serve(crate::serve::ServeArgs),
    /// Explain the code of an error or a warning: its meaning, usual causes, and the way out
    ///
    /// Without a code, lists all codes by area.
    #[command(
        after_help = "Examples:\n  actcheck explain C003\n  actcheck explain    (lists all codes)"
    )]
    Explain(crate::explain::ExplainArgs),
    /// Run a campaign in shards, each in a process of its own, and merge them into one history
    ///
    /// The processes run here, or where Slurm, Kubernetes or Ray starts them (`--on`). The results
    /// are those of `actcheck run`. A shard whose process was lost is resumed. Until they are
    /// merged, the shards are in a folder beside the history (DIR.launch); after an interrupt, the
    /// same command continues there, and follows a submitted job again.
    ///
    /// Exit code: 0 everything passed, 1 a property failed, 2 a shard could not be completed, 130
    /// interrupted by Ctrl-C (finished runs are kept).
    #[command(
        after_help = "Examples:\n  actcheck launch configs/quick.toml --shards 2 --history /tmp/shards\n  \
                      actcheck launch configs/quick.toml --shards 3 --on slurm --resources cpus=2,time=1h --dry-run"
    )]
    Launch(crate::launch::LaunchArgs),
    /// Merge histories into one: parts of a campaign (`run --shard`) become one campaign,
    /// duplicates are kept once
    ///
    /// Copies everything: runs with their traces and facts, later judgements, shrunk runs. Parts
    /// with the same configuration, seed and number of runs belong to one campaign; they must be
    /// made with the same program, ontology, rules and models, and agree on every run that several
    /// of them contain. On a conflict, prints how to resolve it and writes nothing.
    ///
    /// Exit code: 0 merged, 1 merged, but a campaign of parts lacks runs (they are listed), 2
    /// conflict or error, 130 interrupted by Ctrl-C (written runs are complete; merge again to
    /// continue).
    #[command(
        after_help = "Example:\n  actcheck run configs/pick.toml --shard 1/2 --history /tmp/h1\n  actcheck run configs/pick.toml --shard 2/2 --history /tmp/h2\n  actcheck merge /tmp/h1 /tmp/h2 --into /tmp/all"
    )]
    Merge(crate::merge::MergeArgs),
    /// Import episodes of another simulator or a robot, and judge them by the same rules
    ///
    /// A mapping says which body is the object, the gripper, the fingers and the surface, and which
    /// action was performed when. Properties that read something which was not recorded are
    /// inapplicable, with the name of the missing fact. Imported runs can be listed, explained,
    /// rechecked, queried and reported like simulated ones, but not replayed.
    ///
    /// Exit code: 0 everything passed, 1 a property failed, 2 an episode could not be imported (the
    /// others are), 130 interrupted by Ctrl-C (imported episodes are kept).
    #[command(
        after_help = "Examples:\n  actcheck import episodes/\n  actcheck import demo.hdf5 --python venv/bin/python\n  actcheck import --propose episode.mcap > mapping.toml"
    )]
    Import(crate::import::ImportArgs),
    /// Check whether the first states of episodes are those that their tasks are about
    ///
    /// Judges the premises that the ontology states of the episodes' actions, over the first state at
    /// rest, and prints one line for each task. Nothing is stored.
    ///
    /// Exit code: 0 all premises hold, 1 one does not, 2 an episode could not be read.
    #[command(after_help = "Example:\n  actcheck check-episodes episodes/ --mapping mapping.toml")]
    CheckEpisodes(crate::check_episodes::CheckEpisodesArgs),
    /// Play runs of a campaign in MuJoCo and compare the verdicts: is it the robot or the engine?
    ///
    /// The runs are simulated again, and MuJoCo plays the robot's setpoints in the same scenes. Its
    /// courses are stored as a campaign of their own, judged by the present rules. For each property
    /// the agreement is printed, beside MuJoCo's agreement with itself under four other settings;
    /// for each disagreement, where the courses part. Runs that any engine or setting decides
    /// otherwise are contested: `list` and `compare` mark them.
    ///
    /// Exit code: 0 all properties agree in all runs, 1 some do not, 2 a run could not be compared.
    #[command(
        after_help = "Example:\n  actcheck cross-check k7f3 --runs 100 --python venv/bin/python    (with: pip install mujoco mcap)"
    )]
    CrossCheck(crate::cross_check::CrossCheckArgs),
    /// Run the scenes of a campaign again with one change, and compare the verdicts of both runs
    ///
    /// `[relations]` in the configuration names the changes, such as a mirrored scene, more friction
    /// or other names of the objects, and for each a rule about the verdicts of both runs. A
    /// relation that does not hold shows a fault without knowing which of the two verdicts is right.
    /// `actcheck run` makes the pairs too; here, missing ones are made, and all are judged by the
    /// present rules. The second runs are stored as a campaign of their own, which no rate counts.
    ///
    /// Exit code: 0 all relations hold in all pairs, 1 some do not, 2 a pair could not be judged, 130
    /// interrupted by Ctrl-C.
    #[command(after_help = "Example:\n  actcheck relate k7f3 --config configs/pick_relations.toml")]
    Relate(crate::relate::RelateArgs),
    /// Propose properties: limits, durations and orders that all passing runs keep
    ///
    /// Limits are fitted to two of three passing runs of a campaign. A property is proposed only if
    /// the third ones keep it too (at most one of a hundred does not), and if it notices a fault: one
    /// that is injected into fresh scenes, as `check-oracles` does, or a run that people labelled as
    /// bad. The rule files have the evidence as comments; they are to be read and edited.
    ///
    /// Exit code: 0 something was proposed, 1 nothing, 2 it failed, 130 interrupted by Ctrl-C.
    #[command(
        after_help = "Example:\n  actcheck propose-properties configs/.actcheck    (after `actcheck run configs/pick.toml --runs 300`)"
    )]
    ProposeProperties(crate::propose_properties::ProposePropertiesArgs),
    /// Compare verdicts with people's labels: agreement, limits that fit better, likely wrong labels
    ///
    /// For each property with labels: how often its verdict agrees, and whether another limit in its
    /// rule would agree more often. A limit is fitted to one half of the labels, and proposed only if
    /// the other half confirms it. Labels that contradict a sure verdict come first.
    ///
    /// Exit code: 0 all labels agree, 1 some do not, 2 the labels could not be read.
    #[command(after_help = "Example:\n  actcheck calibrate labels.csv    (run,property,label)")]
    Calibrate(crate::calibrate::CalibrateArgs),
    /// Export a stored run as a case, or the history as tables or RDF, or send it to a SPARQL store
    #[command(
        after_help = "Examples:\n  actcheck export run k7f3-3 -o case.toml    (a run id from `actcheck list`; a prefix is enough)\n  actcheck export tables columns    (after `actcheck run configs/pick.toml`)\n  actcheck export rdf history.nq\n  actcheck export store http://localhost:3030/history/update    (another store, such as Fuseki)"
    )]
    Export(crate::export::ExportArgs),
    /// Test the properties themselves: inject faults into the world and the robot, and see which
    /// property detects them
    ///
    /// Runs every scene without a fault and once with each fault (a robot that does nothing, a
    /// gripper that opens in mid-air, a false report, …), from the same choices. A property detects
    /// a fault if it fails with the fault in scenes that it passes without, more often than by
    /// chance. Runs are not stored in a history.
    ///
    /// Exit code: 0 every fault is detected and every property detects one, 1 there is a gap, 2 the
    /// check failed, 130 interrupted by Ctrl-C.
    #[command(after_help = "Example:\n  actcheck check-oracles configs/pick.toml")]
    CheckOracles(crate::check_oracles::CheckOraclesArgs),
    /// Run a standalone Datalog program, with its imports and exports
    #[command(after_help = "Example:\n  actcheck datalog program.rls -D results")]
    Datalog(crate::datalog::DatalogArgs),
    /// Begin or resume one shard of `actcheck launch`
    #[command(
        hide = true,
        after_help = "Example:\n  actcheck launch configs/quick.toml --shards 2    (starts this for each shard)"
    )]
    LaunchTask(crate::launch::LaunchTaskArgs),
    /// Answer one query of `actcheck serve`
    #[command(
        hide = true,
        after_help = "Example:\n  actcheck serve    (starts this for each query)"
    )]
    ServeQuery(crate::serve::ServeQueryArgs),
    /// Print the report for `actcheck serve`, or a replay
    #[command(
        hide = true,
        after_help = "Example:\n  actcheck serve    (starts this for the report)"
    )]
    ServeReport(crate::serve::ServeReportArgs),
}
