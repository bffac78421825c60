//! `actcheck serve`

use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::mpsc::channel;

use clap::Args;

use crate::analyse::{Question, analysed};
use crate::chosen::ChosenRuns;
use crate::option_fault::OptionFault;
use crate::options::{HistoryArgs, duration, memory};
use crate::{history_dir, named_queries, output, report_html, restore, stop};
use actcheck_base::{Diagnostic, Diagnostics, did_you_mean};
use actcheck_history::History;
use actcheck_report::HTML_COLUMNS;
use actcheck_serve as serve;
use actcheck_serve::{ExampleQuery, ServeOptions};

/// `actcheck serve`
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Port to listen on; 0 takes a free one, which is printed. With an address before it, such as
    /// 0.0.0.0:7878, the server can be reached from the network
    #[arg(long, value_name = "[ADDRESS:]PORT", default_value = "7878", value_parser = listened)]
    pub port: SocketAddr,
    /// A host name by which clients reach this server, besides addresses and localhost (may be
    /// given several times)
    #[arg(long, value_name = "NAME")]
    pub allow_host: Vec<String>,
    /// Limits, such as `time=30s,rows=1000`: time, rows or triples, and size of an answer [default:
    /// time=10s,rows=100000,size=50MB]; memory of a query [default: memory=2GB]; processes for
    /// queries that are not light, while others wait [default: processes=4]
    #[arg(long, value_name = "KEY=VALUE,…", value_delimiter = ',', value_parser = Limit::parse)]
    pub limits: Vec<Limit>,
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

/// `actcheck serve-report`, which [`serve`] starts for the report and for replays.
#[derive(Debug, Args)]
pub struct ServeReportArgs {
    /// Print the replay of this run, instead of the report and its data.
    #[arg(long, value_name = "ID")]
    pub run: Option<String>,
    /// The runs to report, and their history.
    #[command(flatten)]
    pub chosen: ChosenRuns,
}

/// Parses a port of this machine, or an address with a port.
fn listened(text: &str) -> Result<SocketAddr, OptionFault> {
    let own = text
        .parse()
        .map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    own.or_else(|_| text.parse()).map_err(|_| {
        "must be a port from 0 to 65535, or an address with a port such as 0.0.0.0:7878".into()
    })
}

/// A limit of the server.
#[derive(Debug, Clone, Copy)]
pub enum Limit {
    /// Time of a query, in seconds.
    Time(f64),
    /// Rows or triples of an answer.
    Rows(u64),
    /// Bytes of an answer.
    Size(u64),
    /// Bytes of memory of a query.
    Memory(u64),
    /// Processes for queries.
    Processes(usize),
}

impl Limit {
    const KEYS: [&str; 5] = ["time", "rows", "size", "memory", "processes"];

    /// Parses a limit such as `time=30s`.
    fn parse(text: &str) -> Result<Self, OptionFault> {
        let (key, value) = text.split_once('=').unwrap_or((text, ""));
        let number = || {
            let number = value.parse::<u64>().ok().filter(|number| *number > 0);
            number.ok_or_else(|| {
                OptionFault::from(format!("`{value}` must be a whole number above zero"))
            })
        };
        let bytes = |least: u64, most: u64, range: &str| {
            let bytes = memory(value)? as u64;
            if (least..=most).contains(&bytes) {
                Ok(bytes)
            } else {
                Err(format!("`{value}` must be {range}").into())
            }
        };
        match key {
            "time" => at_most_a_day(value).map(Self::Time),
            "rows" => number().map(Self::Rows),
            "size" => bytes(1_000_000, 10_000_000_000, "from 1MB to 10GB").map(Self::Size),
            "memory" => {
                bytes(100_000_000, 1_000_000_000_000, "from 100MB to 1000GB").map(Self::Memory)
            }
            "processes" => number()?
                .try_into()
                .map(Self::Processes)
                .map_err(|_| format!("`{value}` is too large").into()),
            _ => Err(did_you_mean(key, Self::KEYS).into()),
        }
    }
}

fn at_most_a_day(text: &str) -> Result<f64, OptionFault> {
    duration(text).and_then(|secs| {
        if secs <= 86_400.0 {
            Ok(secs)
        } else {
            Err(format!("`{text}` must be at most a day (24h)").into())
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
        "http://{address}/ serves the report of {}, with a query page at http://{address}/query and SPARQL at http://{address}/sparql; Ctrl-C stops it\n",
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

/// Prints the report for the server, or the replay of a run.
pub fn serve_report(args: &ServeReportArgs) -> Result<(), Diagnostics> {
    let history = args.chosen.open()?;
    restore::allow(&history, false);
    let text = match &args.run {
        Some(run) => report_html::replay(&history, &args.chosen.ontology()?, run)?,
        None => {
            let asked = Question {
                chosen: &args.chosen,
                property: &[],
                by: &[],
                usual_maps: true,
            };
            report_html::served(&analysed(&asked, &history, &HTML_COLUMNS)?, &history)?
        }
    };
    output::print(&text);
    Ok(())
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
    let mut options = ServeOptions {
        history: folder.to_owned(),
        program,
        query_arguments: with_history(&["serve-query", "--history"]),
        report_arguments: with_history(&["serve-report", "--history"]),
        address: args.port.ip(),
        port: args.port.port(),
        hosts: args.allow_host.clone(),
        most_secs: 10.0,
        most_rows: 100_000,
        most_bytes: 50_000_000,
        most_memory: 2_000_000_000,
        most_queries: 4,
        examples: named.into_iter().map(example).collect(),
    };
    for limit in &args.limits {
        match *limit {
            Limit::Time(secs) => options.most_secs = secs,
            Limit::Rows(rows) => options.most_rows = rows,
            Limit::Size(bytes) => options.most_bytes = bytes,
            Limit::Memory(bytes) => options.most_memory = bytes,
            Limit::Processes(number) => options.most_queries = number,
        }
    }
    Ok(options)
}

fn unheard(args: &ServeArgs, error: &std::io::Error) -> Diagnostics {
    Diagnostic::error("X053", format!("can't listen on {}: {error}", args.port))
        .help("name another port with `--port`, or 0 for any")
        .into()
}
