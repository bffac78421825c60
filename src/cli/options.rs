//! Options that several commands have: the history's folder, output formats, durations,
//! significance levels.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::option_fault::OptionFault;
use actcheck_config::duration_secs;
use actcheck_report::TableFormat;

/// Millions, not 2^20, as browsers and file listings count them.
pub const BYTES_IN_A_MB: f64 = 1e6;

/// The folder of a history.
#[derive(Debug, Args)]
pub struct HistoryArgs {
    /// Folder of the history [default: `.actcheck` here, or the only one in a subfolder]
    #[arg(long, value_name = "DIR")]
    pub history: Option<PathBuf>,
}

/// Formats of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Format {
    /// Human-readable text
    #[default]
    Text,
    /// Comma-separated values
    Csv,
    /// Machine-readable
    Json,
}

impl From<Format> for TableFormat {
    fn from(format: Format) -> Self {
        match format {
            Format::Text => Self::Table,
            Format::Csv => Self::Csv,
            Format::Json => Self::Json,
        }
    }
}

/// Formats of a query's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum QueryFormat {
    /// Human-readable text
    #[default]
    Text,
    /// Comma-separated values
    Csv,
    /// Machine-readable
    Json,
    /// RDF, for queries whose answer is a graph
    Turtle,
}

/// Formats of an explanation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ProofFormat {
    /// Human-readable text
    #[default]
    Text,
    /// Comma-separated values
    Csv,
    /// Machine-readable
    Json,
    /// For Graphviz
    Dot,
}

/// Parses a duration such as `90s`, `10m` or `1h30m` into seconds. A plain number is a
/// number of seconds.
///
/// # Errors
/// A message if the text is neither, or not above zero.
pub fn duration(text: &str) -> Result<f64, OptionFault> {
    match text.trim().parse::<f64>() {
        Ok(secs) if secs > 0.0 && secs.is_finite() => Ok(secs),
        Ok(_) => {
            Err(format!("`{text}` must be a duration above zero, such as 90s, 10m or 2h").into())
        }
        Err(_) => duration_secs(text).map_err(|fault| fault.to_string().into()),
    }
}

/// Parses an amount of memory such as `512MiB`, `4GiB` or `2GB` into bytes. A plain number is a
/// number of bytes.
///
/// # Errors
/// A message if the text is none of these, or not above zero.
pub fn memory(text: &str) -> Result<usize, OptionFault> {
    const UNITS: [(&str, f64); 7] = [
        ("KiB", 1024.0),
        ("MiB", 1_048_576.0),
        ("GiB", 1_073_741_824.0),
        ("kB", 1e3),
        ("MB", 1e6),
        ("GB", 1e9),
        ("B", 1.0),
    ];
    let text = text.trim();
    let (number, unit) = UNITS
        .iter()
        .find_map(|(unit, bytes)| Some((text.strip_suffix(unit)?, *bytes)))
        .unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(amount) if amount * unit >= 1.0 && amount.is_finite() => Ok((amount * unit) as usize),
        _ => Err(format!(
            "`{text}` must be an amount of memory above zero, such as 512MiB or 4GiB"
        )
        .into()),
    }
}

/// Parses a size of replays. Unit: megabytes.
///
/// # Errors
/// A message if the text is not a number from 0 to 1000.
pub fn megabytes(text: &str) -> Result<f64, OptionFault> {
    match text.parse() {
        Ok(megabytes) if (0.0..=1000.0).contains(&megabytes) => Ok(megabytes),
        _ => Err("must be a number of megabytes from 0 to 1000, such as 5".into()),
    }
}

/// Parses a significance level or false discovery rate.
///
/// # Errors
/// A message if the text is not a number above 0 and below 1.
pub fn level(text: &str) -> Result<f64, OptionFault> {
    match text.parse() {
        Ok(level) if level > 0.0 && level < 1.0 => Ok(level),
        _ => Err("must be a probability above 0 and below 1, such as 0.05".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_probabilities() {
        for wrong in ["0", "1", "-0.1", "NaN", "5 %", ""] {
            assert!(level(wrong).is_err(), "{wrong}");
        }
        assert_eq!(level("0.05"), Ok(0.05));
    }

    #[test]
    fn amounts_of_memory_have_units_and_plain_numbers_are_bytes() {
        for (text, bytes) in [
            ("512MiB", 512 << 20),
            ("4 GiB", 4 << 30),
            ("1.5kB", 1500),
            ("7", 7),
            ("7B", 7),
        ] {
            assert_eq!(memory(text), Ok(bytes), "{text}");
        }
        for wrong in ["", "0", "-1MB", "inf", "NaN", "much", "10 apples"] {
            assert!(
                memory(wrong).is_err_and(|message| message.to_string().contains("GiB")),
                "{wrong}"
            );
        }
    }

    #[test]
    fn durations_have_units_and_plain_numbers_are_seconds() {
        for (text, secs) in [
            ("10m", 600.0),
            ("1.5s", 1.5),
            ("200ms", 0.2),
            ("1h30m", 5400.0),
            ("7", 7.0),
            ("0.5", 0.5),
        ] {
            assert_eq!(duration(text), Ok(secs), "{text}");
        }
        for wrong in [
            "",
            "0",
            "0s",
            "-5",
            "-5s",
            "inf",
            "NaN",
            "soon",
            "10 apples",
        ] {
            assert!(
                duration(wrong).is_err_and(|message| message.to_string().contains("10m")
                    || message.to_string().contains("zero")),
                "{wrong}"
            );
        }
    }
}
