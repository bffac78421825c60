//! A folder like a checkout after `make`, in which the commands of documents are run, with physics
//! so coarse and campaigns so small that a campaign takes a second.

use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use super::{COARSEST, copy, edit, project_with, root, script, stderr};

/// Commands for which exit code 1 is an answer: a failed property, a warning, a gap.
const ANSWERS_WITH_1: [&str; 5] = ["run", "recheck", "health", "check-oracles", "import"];

/// The folder; it is removed when this is dropped.
pub struct Checkout {
    folder: tempfile::TempDir,
    path: String,
}

impl Checkout {
    /// A checkout in which nothing was run.
    pub fn fresh() -> Self {
        let project = project_with(COARSEST);
        let folder = project.path();
        for (config, count) in [("pick", 15), ("varied_light", 60)] {
            edit(
                &folder.join("configs").join(config).with_extension("toml"),
                &format!("test_count = {count}"),
                "test_count = 6",
            );
        }
        std::fs::copy(root().join("Makefile"), folder.join("Makefile")).unwrap();
        copy(&root().join("clients"), &folder.join("clients"));
        let episodes = "tests/data/episodes";
        copy(&root().join(episodes), &folder.join(episodes));
        // The program as documents call it. The exit codes of its commands are recorded, and
        // queries without an answer.
        let program = env!("CARGO_BIN_EXE_actcheck");
        let wrapper = format!(
            "#!/bin/sh\n\
             [ \"$1\" = query ] || {{ {program} \"$@\"; code=$?; echo \"$code $1\" >> \"{codes}\"; exit $code; }}\n\
             case \"$*\" in *--format?csv*) head=1 ;; *) head=2 ;; esac\n\
             {program} \"$@\" > \"{folder}/answer.$$\"; code=$?\n\
             [ \"$(wc -l < \"{folder}/answer.$$\")\" -gt $head ] || echo \"no rows: $*\" >> \"{codes}\"\n\
             cat \"{folder}/answer.$$\"; echo \"$code $1\" >> \"{codes}\"; exit $code\n",
            codes = folder.join("codes").display(),
            folder = folder.display(),
        );
        script(&folder.join("actcheck"), &wrapper);
        // `make` compiles for half an hour; here it only checks that the target exists.
        std::fs::create_dir(folder.join("bin")).unwrap();
        script(
            &folder.join("bin/make"),
            "#!/bin/sh\nPATH=${PATH#*:}\nmake -n \"$@\" > /dev/null; code=$?; echo \"$code make $1\" >> codes; exit $code\n",
        );
        std::os::unix::fs::symlink("../actcheck", folder.join("bin/actcheck")).unwrap();
        let path = format!(
            "{}:{}",
            folder.join("bin").display(),
            std::env::var("PATH").unwrap()
        );
        Self {
            folder: project,
            path,
        }
    }

    /// A checkout after README's first command: `configs/.actcheck` has the campaign of
    /// `configs/pick.toml`, which was run once for all documents.
    pub fn after_first_run() -> Self {
        static MADE: OnceLock<Checkout> = OnceLock::new();
        let made = MADE.get_or_init(|| {
            let checkout = Self::fresh();
            checkout.run("./actcheck run configs/pick.toml", &[]);
            checkout
        });
        let checkout = Self::fresh();
        copy(
            &made.path().join("configs/.actcheck"),
            &checkout.path().join("configs/.actcheck"),
        );
        checkout
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Runs commands in a shell.
    pub fn shell(&self, commands: &str, environment: &[(&str, &str)]) -> Output {
        // Long campaigns are for people.
        let commands = commands
            .replace("--runs 300", "--runs 12")
            .replace("--runs 30 ", "--runs 6 ")
            .replace("--trials 40", "--trials 12")
            .replace(
                "check-oracles configs/pick.toml",
                "check-oracles configs/pick.toml --runs 2",
            );
        Command::new("sh")
            .args(["-c", &commands])
            .current_dir(self.path())
            .env("PATH", &self.path)
            .env("NO_COLOR", "1")
            .envs(environment.iter().copied())
            .output()
            .unwrap()
    }

    /// Runs commands in a shell, and returns their outputs. Panics if the last one fails, one of
    /// actcheck has an unexpected exit code, or a query has an empty answer.
    pub fn run(&self, commands: &str, environment: &[(&str, &str)]) -> String {
        let codes = self.path().join("codes");
        let _ = std::fs::remove_file(&codes);
        let output = self.shell(commands, environment);
        let printed = format!(
            "{}{}",
            String::from_utf8_lossy(&output.stdout),
            stderr(&output)
        );
        assert!(
            output.status.code().is_some_and(|code| code <= 1),
            "{commands}\n{printed}"
        );
        let codes = std::fs::read_to_string(codes).unwrap_or_default();
        let is_wrong = |line: &&str| match line.split_once(' ') {
            Some(("0", _)) => false,
            Some(("1", command)) => !ANSWERS_WITH_1.contains(&command),
            _ => true,
        };
        let wrong: Vec<&str> = codes.lines().filter(is_wrong).collect();
        assert!(wrong.is_empty(), "{wrong:#?}\n{commands}\n{printed}");
        printed
    }
}

/// The texts of the fenced blocks in a language, from a Markdown text.
pub fn blocks(text: &str, language: &str) -> Vec<String> {
    let open = format!("```{language}\n");
    text.split(&open)
        .skip(1)
        .map(|rest| rest.split("\n```").next().unwrap().to_owned())
        .collect()
}
