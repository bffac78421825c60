//! The git repository of a bisection. Its folder and index are only read: revisions are written
//! into a temporary folder.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::versions::Version;
use actcheck_base::{Diagnostic, Diagnostics, Source};

/// A repository, and the temporary folder with the files of one revision at a time.
pub struct Repository {
    /// The folder of git's database.
    git: PathBuf,
    /// The folder of the checkout.
    top: PathBuf,
    /// The present folder, below `top`.
    prefix: PathBuf,
    /// The files of a revision.
    tree: PathBuf,
    /// Git's list of the files in `tree`.
    index: PathBuf,
}

impl Repository {
    /// Finds the repository of the present folder.
    pub fn find(scratch: &Path) -> Result<Self, Diagnostics> {
        let asked = [
            "rev-parse",
            "--absolute-git-dir",
            "--show-toplevel",
            "--show-prefix",
        ];
        let output = start(Command::new("git").args(asked))?;
        if !output.status.success() {
            let message = format!(
                "`actcheck bisect` needs a git repository: {}",
                last_line(&output.stderr)
            );
            return Err(Diagnostic::error("X061", message)
                .help("start it in the checkout of a repository, or name versions of the program with `--programs`")
                .into());
        }
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let mut lines = text.lines().map(PathBuf::from);
        let mut next = || lines.next().unwrap_or_default();
        let (git, top, prefix) = (next(), next(), next());
        Ok(Self {
            git,
            top,
            prefix,
            tree: scratch.join("tree"),
            index: scratch.join("index"),
        })
    }

    /// The commit that a name means.
    pub fn revision(&self, name: &str, option: &str) -> Result<Version, Diagnostics> {
        let commit = format!("{name}^{{commit}}");
        let output = start(self.git(&[
            "rev-parse",
            "--verify",
            "--quiet",
            "--end-of-options",
            &commit,
        ]))?;
        if !output.status.success() {
            return Err(Diagnostic::error(
                "X062",
                format!("`{option} {name}`: the repository has no such revision"),
            )
            .help("name a commit, a tag or a branch; `git log --oneline` lists commits")
            .into());
        }
        self.version(String::from_utf8_lossy(&output.stdout).trim())
    }

    fn version(&self, id: &str) -> Result<Version, Diagnostics> {
        let name = self.ask(&["show", "--no-patch", "--format=%h %s", id])?;
        Ok(Version {
            id: id.to_owned(),
            name: name.trim().to_owned(),
        })
    }

    /// Whether one revision is contained in the history of another.
    pub fn is_ancestor(&self, older: &Version, newer: &Version) -> Result<bool, Diagnostics> {
        let output = start(self.git(&["merge-base", "--is-ancestor", &older.id, &newer.id]))?;
        Ok(output.status.success())
    }

    /// The fault of two revisions on different branches.
    pub fn unrelated(&self, good: &Version, bad: &Version) -> Diagnostic {
        let message = format!(
            "neither of `{}` and `{}` is an ancestor of the other",
            good.name, bad.name
        );
        let base = self
            .ask(&["merge-base", &good.id, &bad.id])
            .ok()
            .and_then(|id| self.version(id.trim()).ok());
        Diagnostic::error("X063", message).help(match base {
            Some(base) => format!(
                "begin at their last common revision: `--good {}` ({})",
                short(&base),
                base.name
            ),
            None => "their histories have no revision in common; name two revisions of one branch"
                .to_owned(),
        })
    }

    /// The revisions that `new` contains and none of `olds` does, without `new`; those that halve
    /// the rest first, and the newest of those that halve it equally well: git orders these by
    /// their hashes, which differ in every clone of a rebased branch.
    pub fn between(&self, olds: &[Version], new: &Version) -> Result<Vec<Version>, Diagnostics> {
        let without: Vec<String> = olds.iter().map(|old| format!("^{}", old.id)).collect();
        let ask = |order| {
            let mut asked = vec!["rev-list", order, &new.id];
            asked.extend(without.iter().map(String::as_str));
            self.ask(&asked)
        };
        let (halving, newest) = (ask("--bisect-all")?, ask("--topo-order")?);
        let places: HashMap<&str, usize> = newest
            .lines()
            .enumerate()
            .map(|(place, id)| (id, place))
            .collect();
        let mut ids: Vec<(Reverse<usize>, Option<usize>, &str)> = halving
            .lines()
            .filter_map(|line| {
                line.split_whitespace()
                    .next()
                    .map(|id| (Reverse(distance(line)), places.get(id).copied(), id))
            })
            .filter(|(.., id)| *id != new.id)
            .collect();
        ids.sort_unstable();
        Ok(ids
            .into_iter()
            .map(|(.., id)| Version {
                id: id.to_owned(),
                name: String::new(),
            })
            .collect())
    }

    /// Returns the version with its name.
    pub fn named(&self, version: &Version) -> Result<Version, Diagnostics> {
        if version.name.is_empty() {
            self.version(&version.id)
        } else {
            Ok(version.clone())
        }
    }

    /// The author and the date of a revision.
    pub fn author(&self, version: &Version) -> Result<String, Diagnostics> {
        let line = self.ask(&[
            "show",
            "--no-patch",
            "--format=%an, %ad",
            "--date=short",
            &version.id,
        ])?;
        Ok(line.trim().to_owned())
    }

    /// Writes the files of a revision into the temporary folder, and returns the folder that
    /// corresponds to the present one. Files of builds remain there, so that the next build is
    /// incremental.
    pub fn extract(&self, version: &Version) -> Result<PathBuf, Diagnostics> {
        let create = std::fs::create_dir_all(&self.tree);
        create.map_err(|error| {
            Diagnostic::error("X066", format!("{}: {error}", self.tree.display()))
        })?;
        let tree = format!("--work-tree={}", self.tree.display());
        let plain = [
            "core.sparseCheckout=false",
            "core.splitIndex=false",
            "core.fsmonitor=false",
        ];
        let mut command = Command::new("git");
        command
            .arg(format!("--git-dir={}", self.git.display()))
            .arg(tree)
            .current_dir(&self.tree);
        plain.iter().for_each(|setting| {
            command.args(["-c", setting]);
        });
        command
            .args(["read-tree", "--reset", "-u", &version.id])
            .env("GIT_INDEX_FILE", &self.index);
        let output = start(&mut command)?;
        if !output.status.success() {
            let message = format!(
                "the files of {} can't be written: {}",
                version.name,
                last_line(&output.stderr)
            );
            return Err(Diagnostic::error("X066", message).into());
        }
        Ok(self.tree.join(&self.prefix))
    }

    /// The path of a file of the checkout, relative to the present folder; `None` if it is
    /// elsewhere.
    pub fn inside(&self, path: &Path) -> Option<PathBuf> {
        if path.is_relative() {
            return Some(path.to_owned());
        }
        let below = path.strip_prefix(&self.top).ok()?;
        let up: PathBuf = self.prefix.components().map(|_| "..").collect();
        Some(up.join(below))
    }

    /// A text in which the temporary folder of the files is removed from paths.
    pub fn without_folder(&self, text: &str) -> String {
        text.replace(&format!("{}/", self.tree.join(&self.prefix).display()), "")
            .replace(&format!("{}/", self.tree.display()), "")
    }

    /// The same for the names of the faults' files.
    pub fn faults_without_folder(&self, faults: Diagnostics) -> Diagnostics {
        let mut shown = Diagnostics::new();
        for mut fault in faults {
            fault.message = self.without_folder(&fault.message);
            if let Some(source) = &mut fault.source {
                *source = Source::new(self.without_folder(&source.name), source.text.to_string());
            }
            shown.push(fault);
        }
        shown
    }

    fn git(&self, args: &[&str]) -> Command {
        let mut command = Command::new("git");
        command
            .arg(format!("--git-dir={}", self.git.display()))
            .args(args);
        command
    }

    fn ask(&self, args: &[&str]) -> Result<String, Diagnostics> {
        let output = start(self.git(args))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        Err(Diagnostic::error(
            "X060",
            format!(
                "`git {}` failed: {}",
                args.join(" "),
                last_line(&output.stderr)
            ),
        )
        .into())
    }
}

/// The number of revisions that a test of this one excludes in the worse case, from a line such as
/// `HASH (dist=4)`.
fn distance(line: &str) -> usize {
    let rest = line.rsplit("dist=").next().unwrap_or_default();
    let digits = rest
        .split(|character: char| !character.is_ascii_digit())
        .next();
    digits.and_then(|digits| digits.parse().ok()).unwrap_or(0)
}

/// The short hash of a revision.
pub fn short(version: &Version) -> &str {
    version.id.get(..10).unwrap_or(&version.id)
}

fn start(mut command: impl std::borrow::BorrowMut<Command>) -> Result<Output, Diagnostics> {
    // Messages of git are matched nowhere, but their language should be that of the other messages.
    command
        .borrow_mut()
        .env("LC_ALL", "C")
        .stdin(std::process::Stdio::null())
        .output()
        .map_err(|error| {
            Diagnostic::error("X060", format!("git can't be started: {error}"))
                .help("install git, or name versions of the program with `--programs`")
                .into()
        })
}

/// The last line of an error stream.
pub(super) fn last_line(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let line = text
        .lines()
        .rev()
        .map(str::trim)
        .find(|line| !line.is_empty());
    line.unwrap_or("no message").to_owned()
}
