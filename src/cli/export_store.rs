//! `actcheck export store`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::options::HistoryArgs;
use crate::{history_dir, output, remote, stop};
use actcheck_base::{Diagnostics, digest_of};
use actcheck_history::History;
use actcheck_remote::{Address, Part, Protocol, Sent, Upload, UploadOptions};

/// Folder in a history with the records of uploads.
const RECORDS: &str = "sent";

/// `actcheck export store`
#[derive(Debug, Args)]
pub struct ExportStoreArgs {
    /// Address of the store
    pub url: String,
    /// How statements are sent
    #[arg(long, value_name = "PROTOCOL", value_enum, default_value_t)]
    pub protocol: ProtocolName,
    /// Number of statements in a request; runs are not divided unless the server asks for it
    #[arg(long, value_name = "N", hide = true, default_value_t = 5_000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub batch: u32,
    /// All facts from the traces, not only those in the history
    #[arg(long)]
    pub complete: bool,
    /// Send everything again, for a store that was emptied
    #[arg(long)]
    pub from_start: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
}

/// Protocols, as they are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ProtocolName {
    /// SPARQL 1.1 Update: INSERT DATA, sent to the address for updates
    #[default]
    Update,
    /// SPARQL 1.1 Graph Store HTTP Protocol: N-Triples, a request for each graph; only adds
    /// statements
    GraphStore,
    /// N-Quads, which many stores accept at the address for graphs; only adds statements
    Quads,
}

/// Sends the history. Returns the exit code.
pub fn store(args: &ExportStoreArgs) -> Result<u8, Diagnostics> {
    let address = Address::parse(&args.url)?;
    let history = history_dir::open_to_read(&args.history)?;
    stop::interruptible(|flag| {
        let client = remote::client(flag)?;
        let (upload, warning) = Upload::new(
            &client,
            &address,
            options(args),
            &record(&history, &address),
        );
        if let Some(warning) = warning {
            output::print_diagnostics(&warning.into());
        }
        let bar = bar(history.rdf().parts()? as u64);
        let sent = all(upload, args.complete, &history, &bar);
        bar.finish_and_clear();
        output::print_prose(&summary(&sent?, &address));
        Ok(0)
    })
}

fn all(
    mut upload: Upload<'_>,
    complete: bool,
    history: &History,
    bar: &ProgressBar,
) -> Result<Sent, Diagnostics> {
    history.rdf().each_part(complete, &mut |part| {
        let replaced = part.is_replaced.then(|| part.node.clone());
        bar.inc(1);
        upload.add(Part {
            name: part.node,
            replaced,
            statements: part.statements,
        })
    })?;
    upload.finish()
}

fn options(args: &ExportStoreArgs) -> UploadOptions {
    let protocol = match args.protocol {
        ProtocolName::Update => Protocol::Update,
        ProtocolName::GraphStore => Protocol::GraphStore,
        ProtocolName::Quads => Protocol::Quads,
    };
    UploadOptions {
        protocol,
        batch: args.batch as usize,
        from_start: args.from_start,
    }
}

/// The file with the parts that the store at an address has accepted.
fn record(history: &History, address: &Address) -> PathBuf {
    history
        .dir()
        .join(RECORDS)
        .join(digest_of(&address.to_string()))
}

fn bar(parts: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(parts), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{bar:24} {pos}/{len} runs read  {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

fn summary(sent: &Sent, address: &Address) -> String {
    let Sent {
        statements,
        known,
        requests,
    } = sent;
    match (statements, known) {
        (0, 0) => format!("the history is empty: {address} received no statements\n"),
        (0, known) => format!("{address} has all {known} statements since earlier uploads\n"),
        (_, 0) => format!("{address} accepted {statements} statements in {requests} requests\n"),
        _ => format!(
            "{address} accepted {statements} statements in {requests} requests, and has {known} since earlier uploads\n"
        ),
    }
}
