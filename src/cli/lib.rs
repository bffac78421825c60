//! Arguments, exit codes, progress, and the one place that prints errors.
//!
//! Never: does a stage's work.

mod replay;
mod replay_text;

mod analyse;
mod args;
mod bisect;
mod case;
mod check;
mod check_oracles;
mod chosen;
mod clock;
mod codes;
mod compare;
mod completions;
mod configurations;
mod datalog;
mod entry;
mod explain;
mod explanations;
mod export;
mod export_sparql;
mod export_tables;
mod groups;
mod health;
mod history_dir;
mod integrity;
mod launch;
mod list;
mod live_failures;
mod man;
mod margin_bounds;
mod merge;
mod named_queries;
mod new;
mod new_campaign;
mod new_files;
mod new_property;
mod new_robot;
mod options;
mod output;
mod output_file;
mod own_files;
mod picture;
mod progress;
mod query;
mod query_endpoint;
mod recheck;
mod regressions;
mod remote;
mod replayed_runs;
mod report;
mod report_formats;
mod report_html;
#[cfg(feature = "rerun")]
mod report_rrd;
mod restore;
mod rules;
mod run;
mod run_args;
mod schema;
mod serve;
mod session;
mod show;
mod shrink;
mod stop;
mod terminal;
mod trust;
mod when;
mod where_rows;
mod why;
mod work;

pub use args::Arguments;
pub use entry::run;
