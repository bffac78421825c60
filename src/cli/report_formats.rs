//! `actcheck report` in the formats of other tools: reads one run after another and passes each to
//! the requested formats.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::history_dir::unless_damaged;
use crate::replayed_runs::MOST_RESTORED;
use crate::report::ReportArgs;
use crate::{chosen, output, output_file, replayed_runs, show};
use actcheck_base::{Below, Diagnostics, Outcome, ShellLine};
use actcheck_history::{CampaignRow, History, RunDetail, RunFilter, RunRow, newest_of_alike};
use actcheck_report::{
    Attachment, Caption, Chart, EarlReport, JunitReport, MarkdownReport, Repetitions,
    allure_common, allure_results, markdown, observation, run_picture,
};
use actcheck_rules::{Budget, RuleBook};

/// Formats of other tools.
#[derive(Debug, Args)]
pub struct FormatArgs {
    /// Write results for Allure 2 and 3 into this folder, beside any others: one for each run,
    /// action and property, with steps, parameters, explanations, and pictures of runs in which not
    /// everything passed
    #[arg(long, value_name = "DIR")]
    pub allure: Option<PathBuf>,
    /// Write JUnit XML; `-` prints it
    #[arg(long, value_name = "FILE.xml")]
    pub junit: Option<PathBuf>,
    /// Write outcomes in EARL and their provenance in PROV (Turtle); `-` prints them
    #[arg(long, value_name = "FILE.ttl")]
    pub earl: Option<PathBuf>,
    /// Write one observation for each run, in the schema of Hypothesis's observability (JSON
    /// Lines); `-` prints them
    #[arg(long, value_name = "FILE.jsonl")]
    pub jsonl: Option<PathBuf>,
    /// Print a summary for a pull request (Markdown)
    #[arg(long)]
    pub markdown: bool,
}

impl FormatArgs {
    fn any(&self) -> bool {
        self.markdown
            || [&self.allure, &self.junit, &self.earl, &self.jsonl]
                .iter()
                .any(|file| file.is_some())
    }

    /// Number of formats that go to standard output.
    pub(super) fn printed(&self) -> usize {
        let files = [&self.junit, &self.earl, &self.jsonl];
        files
            .iter()
            .filter(|file| file.as_deref() == Some(Path::new("-")))
            .count()
            + usize::from(self.markdown)
    }
}

/// Writes the requested formats. Returns the messages to print.
pub(super) fn write(args: &ReportArgs, history: &History) -> Result<Vec<String>, Diagnostics> {
    if !args.formats.any() {
        return Ok(Vec::new());
    }
    let (campaigns, rows) = asked_for(args, history)?;
    let mut sinks = Sinks::open(args, history, &campaigns)?;
    let counted = newest_of_alike(&rows);
    let mut judged = BTreeSet::new();
    for row in &rows {
        let mut run = history.newest_run(&row.run)?;
        let judgements = run.actions.iter().flat_map(|action| &action.judgements);
        judged.extend(judgements.map(|judgement| judgement.property.clone()));
        args.keep_wanted(&mut run);
        sinks.take(&run, counted.contains(&row.run))?;
    }
    chosen::all_judged(&args.property, judged.iter().map(String::as_str))?;
    sinks.finish(&args.formats, &campaigns)
}

/// The requested campaigns and runs, in order; shrunk runs, failed runs that ran again, and cases
/// only if their campaign is named.
fn asked_for(
    args: &ReportArgs,
    history: &History,
) -> Result<(Vec<CampaignRow>, Vec<RunRow>), Diagnostics> {
    let filter = args.chosen.filter(history)?;
    let selected = history.selected_campaigns()?;
    let wanted = |id: &String| match &filter.campaigns {
        Some(named) => named.contains(id),
        None => !selected.contains(id),
    };
    let since = filter.since.as_deref().unwrap_or_default();
    let mut rows = history.runs(&RunFilter::default())?;
    rows.retain(|row| wanted(&row.campaign) && row.started.as_str() >= since);
    if rows.is_empty() {
        return Err(chosen::none_of(history).into());
    }
    let met: BTreeSet<&String> = rows.iter().map(|row| &row.campaign).collect();
    let campaigns = history
        .campaigns()?
        .into_iter()
        .filter(|row| met.contains(&row.id))
        .collect();
    Ok((campaigns, rows))
}

/// The output so far in each format.
#[derive(Default)]
struct Sinks<'a> {
    allure: Option<AllureFolder<'a>>,
    junit: Option<JunitReport>,
    earl: Option<EarlReport>,
    jsonl: Option<String>,
    markdown: Option<MarkdownReport>,
    campaigns: Vec<CampaignRow>,
}

impl<'a> Sinks<'a> {
    fn open(
        args: &'a ReportArgs,
        history: &'a History,
        campaigns: &[CampaignRow],
    ) -> Result<Self, Diagnostics> {
        let asked = &args.formats;
        let allure = asked.allure.as_deref();
        Ok(Self {
            allure: allure
                .map(|folder| AllureFolder::open(folder, args, history, campaigns))
                .transpose()?,
            junit: asked.junit.as_ref().map(|_| JunitReport::new()),
            earl: asked.earl.as_ref().map(|_| EarlReport::new()),
            jsonl: asked.jsonl.as_ref().map(|_| String::new()),
            markdown: asked.markdown.then(|| {
                let mut report = MarkdownReport::new();
                report.know(campaigns);
                report
            }),
            campaigns: campaigns.to_vec(),
        })
    }

    /// Adds a run. Formats with rates leave it out if it does not count; the others list every run.
    fn take(&mut self, run: &RunDetail, counts: bool) -> Result<(), Diagnostics> {
        if let Some(report) = &mut self.junit {
            report.add(run);
        }
        if let Some(report) = &mut self.earl {
            report.add(run);
        }
        match &mut self.markdown {
            Some(report) if counts => report.add(run),
            Some(report) => report.add_twin(run),
            None => {}
        }
        if let Some(lines) = &mut self.jsonl {
            let campaign = self.campaigns.iter().find(|row| row.id == run.row.campaign);
            let started = campaign.map_or("", |row| row.started.as_str());
            lines.push_str(&format!("{}\n", observation(run, started)));
        }
        self.allure
            .as_mut()
            .map_or(Ok(()), |folder| folder.take(run))
    }

    fn finish(
        self,
        asked: &FormatArgs,
        campaigns: &[CampaignRow],
    ) -> Result<Vec<String>, Diagnostics> {
        let texts = [
            (
                &asked.junit,
                self.junit.map(|report| report.text()),
                "JUnit XML",
            ),
            (
                &asked.earl,
                self.earl.map(|report| report.text(campaigns)),
                "outcomes in EARL",
            ),
            (&asked.jsonl, self.jsonl, "observations"),
        ];
        let mut told = Vec::new();
        for (file, text, what) in texts {
            let (Some(file), Some(text)) = (file, text) else {
                continue;
            };
            if file.as_os_str() == "-" {
                output::print(&text);
            } else {
                output_file::write(file, text)?;
                told.push(format!("{} holds {what}", file.display()));
            }
        }
        if let Some(report) = &self.markdown {
            output::print(&markdown(report));
        }
        told.extend(self.allure.iter().flat_map(AllureFolder::told));
        Ok(told)
    }
}

/// A folder of Allure's results.
struct AllureFolder<'a> {
    folder: &'a Path,
    history: &'a History,
    rules: Option<RuleBook>,
    budget: Budget,
    repetitions: Repetitions,
    results: usize,
    /// Number of runs whose trace can't be read: it is missing, or another version wrote it.
    untraced: usize,
    /// Runs whose motion is not kept, with a failure.
    restored: usize,
    /// Number of these that would have to be simulated again by a program.
    withheld: usize,
}

impl<'a> AllureFolder<'a> {
    fn open(
        folder: &'a Path,
        args: &ReportArgs,
        history: &'a History,
        campaigns: &[CampaignRow],
    ) -> Result<Self, Diagnostics> {
        let budget = Budget::default();
        // If the current rules can't be read, there are no explanations; the outcomes come from the
        // history.
        let rules = RuleBook::prepare_within(&args.chosen.ontology()?, &budget).ok();
        output_file::folder(folder)?;
        let ids: Vec<String> = campaigns.iter().map(|row| row.id.clone()).collect();
        let made = Self {
            folder,
            history,
            rules,
            budget,
            repetitions: Repetitions::new(),
            results: 0,
            untraced: 0,
            restored: 0,
            withheld: 0,
        };
        made.write(&allure_common(env!("CARGO_PKG_VERSION"), &ids))?;
        Ok(made)
    }

    fn take(&mut self, run: &RunDetail) -> Result<(), Diagnostics> {
        let number = self.repetitions.number(run);
        self.results += run
            .actions
            .iter()
            .map(|action| action.judgements.len())
            .sum::<usize>();
        let attachments = self.attachments(run)?;
        self.write(&allure_results(
            run,
            number,
            &attachments,
            &show::perceived(self.history, run)?,
        ))
    }

    /// Explanations of failures, and a picture unless everything passed.
    fn attachments(&mut self, run: &RunDetail) -> Result<Vec<Attachment>, Diagnostics> {
        let mut judgements = run.actions.iter().flat_map(|action| &action.judgements);
        if judgements.all(|judgement| judgement.outcome == Outcome::Passed) {
            return Ok(Vec::new());
        }
        let is_whole = self.history.is_whole(&run.row.run).unwrap_or(true);
        self.restored += usize::from(!is_whole);
        if !is_whole && self.restored > MOST_RESTORED {
            return Ok(Vec::new());
        }
        let trace = match unless_damaged(self.history.traces().whole_if_allowed(&run.row.run))? {
            Some(Some(trace)) => trace,
            Some(None) => {
                self.withheld += 1;
                return Ok(Vec::new());
            }
            None => {
                self.untraced += 1;
                return Ok(Vec::new());
            }
        };
        let rules = self.rules.as_ref();
        let explained =
            rules.map(|rules| replayed_runs::explained(&trace, rules, run, &self.budget));
        let explained = explained.unwrap_or_default();
        let charts = Chart::all_of(&explained);
        let mut attachments: Vec<Attachment> = explained
            .into_iter()
            .map(|explained| Attachment {
                about: Some((explained.step, explained.property)),
                name: "why it failed".to_owned(),
                media_type: "text/plain",
                ending: "txt",
                bytes: explained.text.into_bytes(),
            })
            .collect();
        // A run that broke before its first state has nothing to draw.
        let picture = run_picture(
            &Caption {
                charts,
                ..Caption::of(run)
            },
            &trace,
        );
        attachments.extend(picture.map(|drawing| Attachment {
            about: None,
            name: "before and after".to_owned(),
            media_type: "image/svg+xml",
            ending: "svg",
            bytes: drawing.to_svg().into_bytes(),
        }));
        Ok(attachments)
    }

    fn write(&self, files: &[(String, Vec<u8>)]) -> Result<(), Diagnostics> {
        for (name, bytes) in files {
            let file = self.folder.join(name);
            let written = Below::new(self.folder).write_quickly(&file, bytes);
            written.map_err(|error| output_file::cannot_write(&file, error))?;
        }
        Ok(())
    }

    fn told(&self) -> Vec<String> {
        let generate = ShellLine::default()
            .fixed("npx allure generate")
            .file(self.folder);
        let mut told = vec![format!(
            "{} holds {} results: {generate}",
            self.folder.display(),
            self.results
        )];
        let others = self.restored.saturating_sub(MOST_RESTORED) + self.withheld;
        if others > 0 {
            told.push(format!(
                "{others} runs have no pictures and explanations: their motion is not kept"
            ));
        }
        if self.untraced > 0 {
            told.push(format!(
                "{} runs have no pictures and explanations: their traces can't be read",
                self.untraced
            ));
        }
        told
    }
}
