//! Keeps the worst English out of comments, messages, test names, Markdown and ontology labels: a
//! short list of patterns that once made the project hard to read, each with a better way to write
//! it. It does not check grammar.

use std::path::{Path, PathBuf};

use regex::Regex;

use crate::support::root;

/// A pattern, the advice for it, and an example.
const PATTERNS: [(&str, &str, &str); 8] = [
    (
        r"(?i)\bwhat\b",
        "write a noun (\"duplicates\" instead of \"what is met twice\"); a real question ends with `?`",
        "what is met twice is kept once",
    ),
    (
        r"(?i)\b(stands?|stood)\b",
        "files and values do not stand anywhere: write \"is in\", \"is beside\", \"means\"",
        "a file stands beside the others",
    ),
    (
        r"(?i)\b(told|tells?)\b",
        "write \"reports\", \"prints\", \"shows\" or \"receives\"",
        "the fault is told once",
    ),
    (
        r"(?i)\b(nothing|none) where\b",
        "name the value and the condition: \"returns `None` if …\"",
        "the mean; nothing where there are no runs",
    ),
    (
        r"(?i)\b(some|no|every)body\b",
        "name the role: \"the caller\", \"a user\", \"another process\"",
        "somebody has the history open",
    ),
    (
        r"(?i)\bfor want of\b",
        "write \"because … is missing\"",
        "it fails for want of memory",
    ),
    (
        r"(?i)\b(is|are|was|were) no [a-z]",
        "negate the verb: \"must be a number\", \"is not a number\"",
        "`x` is no number",
    ),
    (
        r"(?i)\b(whoever|lest|till)\b",
        "write \"a caller that\", \"so that … not\", \"until\"",
        "it waits till the end",
    ),
];

/// Good English that a pattern would match, with the reason. These phrases are blanked out before
/// the search.
const ALLOWED: [(&str, &str); 7] = [
    (
        r"(?i)\bthere (is|are|was|were) no\b",
        "the usual way to say that something is missing",
    ),
    (
        r"(?i)\b(is|are|was|were) no (longer|more|less|fewer|wider|larger|smaller|faster|slower|better|worse|evidence)\b",
        "comparisons and fixed phrases",
    ),
    (
        r"(?i)\b(objects?|things?|body|bodies|robot|location)( at this location)?( can| would not| does not)? (stands?|stood)\b",
        "objects and robots do stand somewhere",
    ),
    (
        r"(?i)\b(stands|stood) (upright|at)\b",
        "poses of objects, and the robot's report of its location",
    ),
    (r"(?i)\bon a stand\b", "furniture"),
    (
        r"(?i)\bask-and-tell\b|\btell the results\b",
        "the usual name of a search's interface, and its second call",
    ),
    (
        r"(?i)\bwhat to\b",
        "\"what to do\": an instruction, not a noun",
    ),
];

/// A passage of prose: its lines with their numbers.
type Passage = Vec<(usize, String)>;

/// The comments and string literals of a Rust file, and the names of its functions in words.
fn rust(text: &str) -> Vec<Passage> {
    let chars: Vec<char> = text.chars().collect();
    let (mut at, mut line) = (0, 1);
    let mut comments: Passage = Vec::new();
    let mut literals = Vec::new();
    while at < chars.len() {
        let rest = &chars[at..];
        let raw = raw_quotes(&chars, at);
        if rest.starts_with(&['/', '/']) {
            let comment: String = rest.iter().take_while(|c| **c != '\n').collect();
            at += comment.chars().count();
            comments.push((
                line,
                comment.trim_start_matches(['/', '!']).trim().to_owned(),
            ));
        } else if rest[0] == '"' || raw.is_some() {
            let (open, close) = raw.unwrap_or((1, String::from("\"")));
            let (literal, length) = literal(&rest[open..], &close, open > 1);
            literals.push(
                literal
                    .split('\n')
                    .enumerate()
                    .map(|(n, part)| (line + n, part.trim().to_owned()))
                    .collect(),
            );
            line += literal.matches('\n').count();
            at += open + length;
        } else if rest[0] == '\'' {
            // A character, or the quote of a lifetime.
            let escaped = rest.get(1) == Some(&'\\');
            let end = rest
                .iter()
                .skip(2 + usize::from(escaped))
                .position(|c| *c == '\'');
            at += match end {
                Some(n) if escaped => n + 4,
                Some(0) => 3,
                _ => 1,
            };
        } else {
            line += usize::from(rest[0] == '\n');
            at += 1;
        }
    }
    let names = Regex::new(r"(?m)^\s*fn ([a-z0-9]+(?:_[a-z0-9]+){3,})\(").unwrap();
    let names = names.captures_iter(text).map(|found| {
        let name = found.get(1).unwrap();
        vec![(
            1 + text[..name.start()].matches('\n').count(),
            name.as_str().replace('_', " "),
        )]
    });
    let prose = |passage: &Passage| {
        passage
            .iter()
            .map(|(_, part)| part.split_whitespace().count())
            .sum::<usize>()
            > 2
    };
    literals.retain(prose);
    paragraphs(comments)
        .into_iter()
        .chain(literals)
        .chain(names)
        .collect()
}

/// The length of the opening of a raw string at a position, and its closing quotes.
fn raw_quotes(chars: &[char], at: usize) -> Option<(usize, String)> {
    let in_word =
        at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_') && chars[at - 1] != 'b';
    if chars[at] != 'r' || in_word {
        return None;
    }
    let hashes = chars[at + 1..].iter().take_while(|c| **c == '#').count();
    (chars.get(at + 1 + hashes) == Some(&'"'))
        .then(|| (hashes + 2, format!("\"{}", "#".repeat(hashes))))
}

/// The contents of a string literal, and its length with the closing quotes.
fn literal(chars: &[char], close: &str, raw: bool) -> (String, usize) {
    let close: Vec<char> = close.chars().collect();
    let (mut contents, mut at) = (String::new(), 0);
    while at < chars.len() && !chars[at..].starts_with(&close) {
        let escaped = !raw && chars[at] == '\\';
        match chars.get(at + 1) {
            Some('\n') if escaped => contents.push('\n'),
            Some(_) if escaped => contents.push(' '),
            _ => contents.push(chars[at]),
        }
        at += 1 + usize::from(escaped);
    }
    (contents, at + close.len())
}

/// Lines of comments, joined where they follow each other; fenced code and empty lines end a
/// passage.
fn paragraphs(lines: Passage) -> Vec<Passage> {
    let mut passages: Vec<Passage> = Vec::new();
    let (mut fenced, mut last) = (false, 0);
    for (line, text) in lines {
        let fence = text.starts_with("```");
        fenced = fenced != fence;
        if !fenced && !fence && !text.is_empty() {
            match passages.last_mut() {
                Some(passage) if last + 1 == line => passage.push((line, text)),
                _ => passages.push(vec![(line, text)]),
            }
            last = line;
        }
    }
    passages
}

/// The prose of a file, by its extension. Literals of Turtle and Python are read if they are on one
/// line, and Python's docstrings.
fn passages(path: &Path, text: &str) -> Vec<Passage> {
    let numbered = || {
        text.lines()
            .map(str::trim)
            .enumerate()
            .map(|(n, line)| (n + 1, line))
    };
    let comments = |mark: char| {
        let line = |(n, line): (usize, &str)| {
            line.starts_with(mark)
                .then(|| (n, line.trim_start_matches(mark).trim().to_owned()))
        };
        paragraphs(numbered().filter_map(line).collect())
    };
    let quoted = Regex::new("\"((?:[^\"\\\\]|\\\\.)*)\"").unwrap();
    let literals = || {
        let found = numbered().flat_map(|(n, line)| {
            quoted
                .captures_iter(line)
                .map(move |found| (n, found[1].to_owned()))
        });
        found
            .filter(|(_, literal)| literal.split_whitespace().count() > 2)
            .map(|one| vec![one])
            .collect::<Vec<_>>()
    };
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("rs") => rust(text),
        Some("md") => paragraphs(numbered().map(|(n, line)| (n, line.to_owned())).collect()),
        Some("ttl") => [comments('#'), literals()].concat(),
        Some("py" | "pyi") => [comments('#'), literals(), docstrings(text)].concat(),
        Some("toml" | "rq") => comments('#'),
        Some("js") => comments('/'),
        Some("rls") => comments('%'),
        _ => Vec::new(),
    }
}

/// The docstrings of a Python file that take several lines.
fn docstrings(text: &str) -> Vec<Passage> {
    let mut inside = false;
    let lines = text.lines().enumerate().filter_map(|(n, line)| {
        let part = inside;
        inside ^= line.matches("\"\"\"").count() == 1;
        (part || inside).then(|| (n + 1, line.trim().trim_matches('"').to_owned()))
    });
    paragraphs(lines.collect())
}

/// The matches of the patterns in a passage: line, found words and advice. Code, placeholders and
/// allowed phrases do not count, and neither do questions.
fn faults(
    passage: &Passage,
    patterns: &[(Regex, &'static str)],
    ignored: &[Regex],
) -> Vec<(usize, String)> {
    let mut text = passage
        .iter()
        .map(|(_, part)| part.as_str())
        .collect::<Vec<_>>()
        .join("\n");
    for code in ignored {
        // Line breaks are kept, so that reported lines are right.
        text = code
            .replace_all(&text, |found: &regex::Captures<'_>| {
                found[0].replace(|c| c != '\n', "·")
            })
            .into_owned();
    }
    let flat = text.replace('\n', " ");
    let mut found = Vec::new();
    for (pattern, advice) in patterns {
        for hit in pattern.find_iter(&flat) {
            let sentence_end = flat[hit.end()..]
                .find(['.', '?', '!', ';'])
                .map(|end| &flat[hit.end() + end..]);
            if sentence_end.is_some_and(|end| end.starts_with('?')) {
                continue;
            }
            let (line, _) = passage[flat_line(&text, hit.start())];
            found.push((line, format!("\"{}\": {advice}", hit.as_str())));
        }
    }
    found
}

fn flat_line(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count()
}

fn compiled() -> (Vec<(Regex, &'static str)>, Vec<Regex>) {
    let patterns = PATTERNS
        .iter()
        .map(|(pattern, advice, _)| (Regex::new(pattern).unwrap(), *advice))
        .collect();
    let code = [r"(?s)`[^`]*`", r"\{[^{}]*\}", r"<[^<>\s]*>", r"'\.[a-z]+'"];
    let ignored = code
        .into_iter()
        .chain(ALLOWED.map(|(phrase, _)| phrase))
        .map(|one| Regex::new(one).unwrap())
        .collect();
    (patterns, ignored)
}

/// All files below a folder, or the file itself, sorted; build output and installed packages left
/// out.
fn files(path: &Path, found: &mut Vec<PathBuf>) {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if path.is_dir()
        && !path.is_symlink()
        && !name.starts_with('.')
        && !["target", "node_modules", "__pycache__"].contains(&&*name)
    {
        let mut entries: Vec<PathBuf> = std::fs::read_dir(path)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        entries.sort();
        entries.iter().for_each(|entry| files(entry, found));
    } else if path.is_file() && !path.is_symlink() && name != "english.rs" {
        found.push(path.to_path_buf());
    }
}

#[test]
fn comments_messages_and_documents_avoid_the_listed_patterns() {
    let (patterns, ignored) = compiled();
    let mut paths = Vec::new();
    let places = "src benches tests clients fuzz ontology rules configs models notebooks docs build.rs README.md CONTRIBUTING.md CHANGELOG.md";
    places
        .split(' ')
        .for_each(|place| files(&root().join(place), &mut paths));
    let mut found = Vec::new();
    for path in paths {
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        for passage in passages(&path, &text) {
            for (line, fault) in faults(&passage, &patterns, &ignored) {
                found.push(format!(
                    "{}:{line}: {fault}",
                    path.strip_prefix(root()).unwrap().display()
                ));
            }
        }
    }
    assert!(
        found.is_empty(),
        "{} passages to write in plainer English:\n{}",
        found.len(),
        found.join("\n")
    );
}

/// Each pattern matches its example in every kind of file, and reports the line.
#[test]
fn planted_sentences_are_found() {
    let (patterns, ignored) = compiled();
    let lines = |name: &str, text: &str| -> Vec<usize> {
        let passages = passages(Path::new(name), text);
        passages
            .iter()
            .flat_map(|passage| faults(passage, &patterns, &ignored))
            .map(|(line, _)| line)
            .collect()
    };
    for (pattern, _, example) in PATTERNS {
        assert_eq!(
            lines(
                "a.rs",
                &format!("/// Good.\n/// And {example}.\nfn a() {{}}")
            ),
            [2],
            "{pattern}"
        );
        assert_eq!(
            lines(
                "a.rs",
                &format!("fn a<'a>() {{\n    panic!(\"so {example}\");\n}}")
            ),
            [2],
            "{pattern}"
        );
        assert_eq!(
            lines("a.rs", &format!("const A: &str = r#\"\"\nso {example}\"#;")),
            [2],
            "{pattern}"
        );
        assert_eq!(
            lines("a.md", &format!("# Title\n\nIn general, {example}.")),
            [3],
            "{pattern}"
        );
        assert_eq!(
            lines("a.ttl", &format!("act:a rdfs:label \"so {example}\" .")),
            [1],
            "{pattern}"
        );
        assert_eq!(
            lines("a.py", &format!("# So {example}.\nx = 1")),
            [1],
            "{pattern}"
        );
        assert_eq!(
            lines("a.py", &format!("\"\"\"Good.\n\nAnd {example}.\n\"\"\"")),
            [3],
            "{pattern}"
        );
    }
    assert_eq!(lines("a.rs", "fn what_is_met_twice_is_kept_once() {}"), [1]);
    assert_eq!(
        lines("a.rs", "// It waits for what\n// is ready."),
        [1],
        "across lines"
    );
}

#[test]
fn questions_code_and_allowed_phrases_are_not_found() {
    let (patterns, ignored) = compiled();
    for good in [
        "// What did it not cover? `told` has the runs that {told} names.",
        "// There is no pattern, and it is no longer searched.",
        "/// ```\n/// told(?a) :- stands(?a) .\n/// ```",
        "fn f(c: char) -> bool { c == '\"' || c == '\\'' } // Fine.",
    ] {
        let found: Vec<_> = passages(Path::new("a.rs"), good)
            .iter()
            .flat_map(|one| faults(one, &patterns, &ignored))
            .collect();
        assert!(found.is_empty(), "{good}: {found:?}");
    }
}
