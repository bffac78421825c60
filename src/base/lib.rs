//! Types shared by all stages: sources and diagnostics, RDF terms, facts, findings, outcomes, and
//! files.
//!
//! Never: reads a configuration, depends on actions, rules or robots, or prints.

mod below;
mod course;
mod deciding;
mod diagnostic;
mod digest;
mod files;
mod findings;
mod judgement;
mod keep;
mod meaning;
pub mod names;
mod panic_guard;
mod printable;
mod query_texts;
mod rotation;
mod run_facts;
mod scratch;
mod shard;
mod shell;
mod shipped;
mod source;
mod sparql_size;
mod steps;
mod suggest;
mod term;
mod turtle_guard;
mod varint;
mod write_atomic;
mod xml_guard;
mod xml_limits;
mod xml_text;

pub use below::{Below, FileKind, NotPlain, open_regular, read_regular};
pub use course::{Course, Signal, SignalKey, Solid};
pub use deciding::DecidingSignal;
pub use diagnostic::{Diagnostic, Diagnostics, Severity};
pub use digest::{Digest, digest_of, program_digest, set_program_digest};
pub use files::{FileFault, Files};
pub use findings::{Findings, RuleFault, WitnessRow};
pub use judgement::{Judgement, Outcome};
pub use keep::{Keep, Keeping};
pub use panic_guard::guarded;
pub use printable::{printable, printable_in_colour};
pub use query_texts::{
    COUNTED_TEXT, MOST_NESTED_CALLS, TEXT_FUNCTIONS, TextFunction, TextTooLong, bounded_texts,
    check_calls, check_calls_within, string_end,
};
pub use rotation::{tilt_of, yaw_of};
pub use run_facts::{ActionFacts, CONSTANT_PROPERTIES, RunFacts, Triple};
pub use scratch::ScratchFolder;
pub use shard::{ParseShardError, Shard};
pub use shell::ShellLine;
pub use source::{Source, SourceSpan, Span};
pub use sparql_size::{sparql_excess, unclosed_braces};
pub use steps::Steps;
pub use suggest::{did_you_mean, misspelt, nearest};
pub use term::{Term, TermId, Terms};
pub use turtle_guard::{TurtleGuard, check_turtle};
pub use varint::{ByteReader, put_varint, unzigzag, zigzag};
pub use write_atomic::NewFile;
pub use xml_guard::{XmlGuard, XmlProgress};
pub use xml_limits::check_xml;
pub use xml_text::xml_text;
