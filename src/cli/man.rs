//! `actcheck new man`

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_mangen::Man;

use crate::{output, output_file};
use actcheck_base::{Diagnostic, Diagnostics};

/// `actcheck new man`
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Write a page for each command into this folder, such as `actcheck-run.1`, instead of
    /// printing one with all of them
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Prints the manual, or writes its pages. `root` is the program with all commands.
pub fn man(args: &ManArgs, mut root: Command) -> Result<(), Diagnostics> {
    // Gives every command its full name.
    root.build();
    match &args.out {
        None => {
            output::print_bytes(&page_of_all(&root).map_err(unrendered)?);
            Ok(())
        }
        Some(folder) => write_pages(&root, folder),
    }
}

/// One page: the program, then a section for each command.
fn page_of_all(root: &Command) -> io::Result<Vec<u8>> {
    let man = manual(root);
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    for command in below(root)
        .into_iter()
        .filter(|command| !command.has_subcommands())
    {
        let name = command.get_bin_name().unwrap_or(command.get_name());
        writeln!(page, ".SH \"{}\"", name.replace('-', "\\-"))?;
        page.extend(section_of(command)?);
    }
    Ok(page)
}

/// Synopsis, description, options and examples of a command, as parts of its section.
fn section_of(command: &Command) -> io::Result<Vec<u8>> {
    let man = manual(command);
    let mut page = Vec::new();
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    man.render_options_section(&mut page)?;
    man.render_extra_section(&mut page)?;
    // A line of text never begins with a dot.
    Ok(format!("\n{}", with_examples(&page))
        .replace("\n.SH ", "\n.SS ")
        .into_bytes())
}

/// Renames the section after the options to EXAMPLES.
fn with_examples(page: &[u8]) -> String {
    let page = String::from_utf8_lossy(page);
    page.replace(".SH EXTRA\nExamples:\n", ".SH EXAMPLES\n")
        .replace(".SH EXTRA\nExample:\n", ".SH EXAMPLES\n")
}

fn write_pages(root: &Command, folder: &Path) -> Result<(), Diagnostics> {
    let pages = output_file::folder(folder)?;
    let commands: Vec<&Command> = std::iter::once(root).chain(below(root)).collect();
    for command in &commands {
        let man = manual(command);
        let mut page = Vec::new();
        man.render(&mut page).map_err(unrendered)?;
        let file = folder.join(man.get_filename());
        let written = pages.write_quickly(&file, with_examples(&page).as_bytes());
        written.map_err(|error| output_file::cannot_write(&file, error))?;
    }
    let first = folder.join("actcheck.1");
    output::print_prose(&format!(
        "wrote {} pages: man -l {}\n",
        commands.len(),
        first.display()
    ));
    Ok(())
}

fn manual(command: &Command) -> Man {
    Man::new(command.clone())
        .manual("actcheck")
        .source(concat!("actcheck ", env!("CARGO_PKG_VERSION")))
}

/// All subcommands of a command, each before its own subcommands.
fn below(command: &Command) -> Vec<&Command> {
    let each = command
        .get_subcommands()
        .map(|command| std::iter::once(command).chain(below(command)));
    each.flatten().collect()
}

fn unrendered(error: io::Error) -> Diagnostics {
    Diagnostic::error("X001", format!("the manual could not be written: {error}"))
        .help("report this bug: the manual is rendered in memory")
        .into()
}
