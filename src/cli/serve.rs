//! `actcheck serve`

use std::net::{IpAddr, Ipv4Addr};
use std::path::Path;
use std::sync::mpsc::channel;

use clap::Args;

use crate::options::{HistoryArgs, duration};
use crate::{history_dir, named_queries, output, stop};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::History;
use actcheck_serve as serve;
use actcheck_serve::{ExampleQuery, ServeOptions};

/// `actcheck serve`
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Address to listen on; any but this machine's own allows access from the network
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub bind: IpAddr,
    /// Port to listen on; 0 takes a free one, which is printed
    #[arg(long, value_name = "PORT", default_value_t = 7878)]
    pub port: u16,
    /// A host name by which clients reach this server, besides addresses and localhost (may be
    /// given several times)
    #[arg(long, value_name = "NAME")]
    pub allow_host: Vec<String>,
    /// Time limit for a query, such as 500ms, 10s or 1m
    #[arg(long, alias = "max-secs", value_name = "DURATION", default_value = "10s", value_parser = at_most_a_day)]
    pub max_time: f64,
    /// Maximum number of rows or triples in an answer
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    pub max_rows: u64,
    /// Maximum size of an answer
    #[arg(long, value_name = "MB", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub max_mb: u64,
    /// Memory limit for a query
    #[arg(long, value_name = "MB", default_value_t = 2000, value_parser = clap::value_parser!(u64).range(100..=1_000_000))]
    pub max_memory_mb: u64,
    /// Maximum number of processes for queries that are not light; others wait
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    pub max_queries: u16,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
}

/// `actcheck serve-query`, which [`serve`] starts for queries that are not light.
#[derive(Debug, Args)]
pub struct ServeQueryArgs {
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
}

fn at_most_a_day(text: &str) -> Result<f64, String> {
    duration(text).and_then(|secs| {
        if secs <= 86_400.0 {
            Ok(secs)
        } else {
            Err(format!("`{text}` must be at most a day (24h)"))
        }
    })
}

/// Serves until Ctrl-C.
pub fn serve(args: &ServeArgs) -> Result<(), Diagnostics> {
    let folder = history_dir::folder(&args.history)?;
    // A wrong folder is reported now; a history that a campaign is just creating is served once it
    // exists.
    if let Err(faults) = History::open_to_read(&folder)
        && faults.iter().any(|fault| fault.code != "H002")
    {
        return Err(faults);
    }
    let (asked, waiting) = channel();
    let _flag = stop::on_interrupt(move || {
        // The receiver lives as long as the process.
        let _ = asked.send(());
    });
    let serving = serve::serve(options(args, &folder)?).map_err(|error| unheard(args, &error))?;
    let address = serving.address;
    output::print_prose(&format!(
        "http://{address}/ serves {}, with a report at http://{address}/report and SPARQL at http://{address}/sparql; Ctrl-C stops it\n",
        folder.display()
    ));
    // Only Ctrl-C sends; if its handler is dropped, the wait ends too.
    let _ = waiting.recv();
    output::print_prose(&format!("{}\n", serving.counts));
    Ok(())
}

/// Answers the queries from standard input.
pub fn serve_query(args: &ServeQueryArgs) -> Result<(), Diagnostics> {
    let folder = history_dir::folder(&args.history)?;
    serve::answer(&folder, std::io::stdin().lock(), std::io::stdout().lock()).map_err(|error| {
        Diagnostic::error(
            "X005",
            format!("the query can't be read or answered: {error}"),
        )
        .into()
    })
}

fn options(args: &ServeArgs, folder: &Path) -> Result<ServeOptions, Diagnostics> {
    let program = std::env::current_exe().map_err(|error| {
        Diagnostic::error(
            "X052",
            format!("the path of this program can't be found: {error}"),
        )
        .help("start actcheck by its full path")
    })?;
    let history = folder.display().to_string();
    let with_history = |words: &[&str]| {
        words
            .iter()
            .map(|word| (*word).to_owned())
            .chain([history.clone()])
            .collect()
    };
    let named = named_queries::all()?;
    let example = |query: named_queries::NamedQuery| ExampleQuery {
        name: query.name,
        title: query.title,
        description: query.description,
        query: query.text,
    };
    Ok(ServeOptions {
        history: folder.to_owned(),
        program,
        query_arguments: with_history(&["serve-query", "--history"]),
        report_arguments: with_history(&["report", "--html", "-", "--history"]),
        address: args.bind,
        port: args.port,
        hosts: args.allow_host.clone(),
        most_secs: args.max_time,
        most_rows: args.max_rows,
        most_bytes: args.max_mb * 1_000_000,
        most_memory: args.max_memory_mb * 1_000_000,
        most_queries: usize::from(args.max_queries),
        examples: named.into_iter().map(example).collect(),
    })
}

fn unheard(args: &ServeArgs, error: &std::io::Error) -> Diagnostics {
    Diagnostic::error(
        "X053",
        format!("can't listen on {} port {}: {error}", args.bind, args.port),
    )
    .help("name another port with `--port`, or 0 for any; another address with `--bind`")
    .into()
}
