//! Evaluates leaves over all files of outlines, on all cores, in bounded memory.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::outlines::SheetFile;
use crate::vertical::counts::{Counts, Traced, properties, traced};
use crate::vertical::join::{FileColumns, Rows};
use crate::vertical::leaf::Leaf;
use crate::vertical::reduce::{Gathered, Output, Reduced, reduced};
use crate::vertical::stop::Stop;
use crate::{Cancel, History};

/// Number of files whose results are kept at the same time.
const FILES_AT_ONCE: usize = 64;
/// Number of threads at most.
const MOST_THREADS: usize = 8;

/// All files of outlines.
pub(super) struct Files {
    files: Vec<SheetFile>,
    /// Number of statements with each property.
    statements: HashMap<String, u64>,
    cancel: Cancel,
}

impl Files {
    /// Reads the directory of each file.
    pub(super) fn of(history: &History, cancel: &Cancel) -> Result<Self, Stop> {
        let mut all = Self {
            files: history.sheet_files()?,
            statements: HashMap::new(),
            cancel: cancel.clone(),
        };
        let mut statements: HashMap<String, u64> = HashMap::new();
        let of_file = |file: &SheetFile| {
            let sheet = file.open()?;
            Ok(sheet
                .properties()
                .map(|(property, count)| (property.to_owned(), count))
                .collect::<Vec<_>>())
        };
        all.each(&of_file, &mut |found: Vec<(String, u64)>| {
            for (property, count) in found {
                match statements.get_mut(&property) {
                    Some(known) => *known += count,
                    None => drop(statements.insert(property, count)),
                }
            }
            Ok(true)
        })?;
        all.statements = statements;
        Ok(all)
    }

    /// Number of statements with a property.
    pub(super) fn statements(&self, property: &str) -> u64 {
        self.statements.get(property).copied().unwrap_or_default()
    }

    /// Number of all statements.
    pub(super) fn all_statements(&self) -> u64 {
        self.statements.values().sum()
    }

    /// The reduced rows of a leaf.
    pub(super) fn rows(
        &self,
        leaf: &Leaf,
        output: &Output,
        counts: Option<&Counts>,
    ) -> Result<Vec<Reduced>, Stop> {
        let mut gathered = Gathered::default();
        let of_file = |file: &SheetFile| {
            let required = |property: &str| leaf.steps.iter().any(|step| step.property == property);
            let Some(columns) = columns(file, &leaf.properties(), &required)? else {
                return Ok(Vec::new());
            };
            let counts = counts.map(|counts| counts.of_base(&columns.nodes.base).unwrap_or(&NONE));
            let without: HashSet<u64> = file.there.iter().map(|index| index + 1).collect();
            reduced(&Rows::of(leaf, &columns, counts, &without)?, output)
        };
        self.each(&of_file, &mut |rows| {
            gathered.add(rows, output)?;
            Ok(!gathered.is_enough(output))
        })?;
        gathered.into_rows(output)
    }

    /// The runs of all outlines with their traces.
    pub(super) fn traced(&self, each: &mut dyn FnMut(Vec<Traced>)) -> Result<(), Stop> {
        let wanted = properties();
        let wanted: Vec<&str> = wanted.iter().map(String::as_str).collect();
        let of_file = |file: &SheetFile| {
            let Some(columns) = columns(file, &wanted, &|_| true)? else {
                return Ok(Vec::new());
            };
            let there: &BTreeSet<u64> = &file.there;
            traced(&columns, |number| {
                number
                    .checked_sub(1)
                    .is_some_and(|index| there.contains(&index))
            })
        };
        self.each(&of_file, &mut |runs| {
            each(runs);
            Ok(true)
        })
    }

    /// Calls `each` with the results of all files, in their order, until it returns `false`.
    fn each<T: Send>(
        &self,
        of_file: &(dyn Fn(&SheetFile) -> Result<T, Stop> + Sync),
        each: &mut dyn FnMut(T) -> Result<bool, Stop>,
    ) -> Result<(), Stop> {
        let threads = std::thread::available_parallelism()
            .map_or(1, usize::from)
            .min(MOST_THREADS);
        for files in self.files.chunks(FILES_AT_ONCE) {
            if self.cancel.is_cancelled() {
                return Err(Stop::Cancelled);
            }
            let next = AtomicUsize::new(0);
            let results: Vec<Mutex<Option<Result<T, Stop>>>> =
                files.iter().map(|_| Mutex::new(None)).collect();
            let work = || {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(file) = files.get(at) else { return };
                    let found = of_file(file);
                    if let Ok(mut result) = results[at].lock() {
                        *result = Some(found);
                    }
                }
            };
            if files.len() == 1 || threads == 1 {
                work();
            } else {
                std::thread::scope(|scope| {
                    for _ in 0..threads.min(files.len()) {
                        scope.spawn(work);
                    }
                });
            }
            for result in results {
                let result = result
                    .into_inner()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                if !each(result.unwrap_or(Err(Stop::Crashed))?)? {
                    return Ok(());
                }
            }
        }
        Ok(())
    }
}

static NONE: std::sync::LazyLock<crate::vertical::counts::RunBits> =
    std::sync::LazyLock::new(Default::default);

/// The columns of a file; `None` if it lacks a required property.
fn columns(
    file: &SheetFile,
    properties: &[&str],
    is_required: &dyn Fn(&str) -> bool,
) -> Result<Option<FileColumns>, Stop> {
    let sheet = file.open()?;
    let has = |wanted: &str| sheet.properties().any(|(property, _)| property == wanted);
    if properties
        .iter()
        .any(|property| is_required(property) && !has(property))
    {
        return Ok(None);
    }
    let read = || {
        let (nodes, count) = sheet.nodes()?;
        let columns = sheet.columns(&nodes, count, properties)?;
        let names = properties
            .iter()
            .map(|property| (*property).to_owned())
            .collect();
        Ok(FileColumns::new(nodes, count, names, columns))
    };
    read()
        .map(Some)
        .map_err(|why: String| Stop::Damaged(file.path.clone(), why))
}
