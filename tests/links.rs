//! The Markdown pages: links lead somewhere, every page is found, and commands name programs, options and parameters
//! that exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use long_term_tracker::params::{self, Phase};
use long_term_tracker::{Params, ParamsError};

/// Clicks from README.md within which every page must be found.
const CLICKS: usize = 3;
/// Words of parameters' names that begin with one of these are checked wherever they stand as code.
const GROUPS: [&str; 8] = ["debug.", "etepf.", "history.", "lcmht.", "levels.", "limits.", "maptrack.", "viewer."];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The pages: those in the root and those in `docs`, by their paths from the root.
fn pages() -> BTreeMap<PathBuf, String> {
    let files = ["", "docs"].into_iter().flat_map(|folder| fs::read_dir(root().join(folder)).unwrap());
    let paths = files.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "md"));
    let pages: BTreeMap<_, _> =
        paths.map(|p| (p.strip_prefix(root()).unwrap().to_owned(), fs::read_to_string(&p).unwrap())).collect();
    assert!(pages.len() > 10, "{:?}", pages.keys());
    pages
}

/// What a page consists of.
#[derive(Default)]
struct Parts<'a> {
    /// Text outside of code blocks, without code spans.
    prose: String,
    /// Code spans.
    spans: Vec<&'a str>,
    /// Commands of code blocks, put together where a line ends in a backslash.
    commands: Vec<String>,
    /// Anchors of headings.
    anchors: BTreeSet<String>,
}

fn parts(text: &str) -> Parts<'_> {
    let mut parts = Parts::default();
    let (mut fenced, mut indented_may_begin, mut goes_on) = (false, true, false);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            continue;
        }
        let indented = line.starts_with("    ") && (indented_may_begin || goes_on);
        if fenced || indented {
            let line = line.trim();
            let (line, more) = line.strip_suffix('\\').map_or((line, false), |l| (l, true));
            match parts.commands.last_mut().filter(|_| goes_on) {
                Some(command) => command.push_str(line),
                None => parts.commands.push(line.to_owned()),
            }
            (goes_on, indented_may_begin) = (more, true);
            continue;
        }
        (goes_on, indented_may_begin) = (false, line.trim().is_empty());
        if let Some(heading) = line.strip_prefix('#') {
            parts.anchors.insert(anchor(heading.trim_start_matches('#')));
        }
        for (i, piece) in line.split('`').enumerate() {
            if i % 2 == 1 {
                parts.spans.push(piece);
            } else {
                parts.prose.push_str(piece);
            }
        }
        parts.prose.push('\n');
    }
    parts
}

/// The anchor that GitHub gives a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Targets of `[...](TARGET)` and `![...](TARGET)`.
fn links(prose: &str) -> impl Iterator<Item = &str> {
    prose.split("](").skip(1).filter_map(|rest| rest.split(')').next())
}

/// A path with `..` taken out.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => assert!(plain.pop(), "{} leaves the package", path.display()),
            part => plain.push(part),
        }
    }
    plain
}

/// Where a relative link of a page leads: a path from the root, and an anchor.
fn target<'a>(page: &Path, link: &'a str) -> Option<(PathBuf, Option<&'a str>)> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (path, anchor) = link.split_once('#').map_or((link, None), |(path, anchor)| (path, Some(anchor)));
    let path = if path.is_empty() { page.to_owned() } else { plain(&page.parent().unwrap().join(path)) };
    Some((path, anchor))
}

#[test]
fn every_link_leads_somewhere() {
    let pages = pages();
    let mut broken = Vec::new();
    let mut count = 0;
    for (page, text) in &pages {
        for link in links(&parts(text).prose) {
            let Some((path, anchor)) = target(page, link) else { continue };
            count += 1;
            let found = root().join(&path).exists();
            let has = |anchor| pages.get(&path).is_some_and(|text| parts(text).anchors.contains(anchor));
            if !found || anchor.is_some_and(|anchor| !has(anchor)) {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(count > 50, "{count} links");
}

#[test]
fn every_page_is_found_within_three_clicks() {
    let pages = pages();
    let mut found = BTreeSet::from([PathBuf::from("README.md")]);
    for _ in 0..CLICKS {
        let from: Vec<PathBuf> = found.iter().filter(|page| pages.contains_key(*page)).cloned().collect();
        for page in from {
            let parts = parts(&pages[&page]);
            found.extend(links(&parts.prose).filter_map(|link| target(&page, link)).map(|(path, _)| path));
        }
    }
    let lost: Vec<_> = pages.keys().filter(|page| !found.contains(*page)).collect();
    assert!(lost.is_empty(), "{lost:?}");
}

/// What a program says of itself.
fn help(program: &str) -> String {
    let output = Command::new(program).arg("--help").output().unwrap();
    assert!(output.status.success(), "{program}");
    String::from_utf8(output.stdout).unwrap()
}

/// The programs by name, with what they say of themselves.
fn programs() -> BTreeMap<&'static str, String> {
    BTreeMap::from([
        ("track", help(env!("CARGO_BIN_EXE_track"))),
        ("evaluate", help(env!("CARGO_BIN_EXE_evaluate"))),
        #[cfg(feature = "ros")]
        ("tracker_demo", help(env!("CARGO_BIN_EXE_tracker_demo"))),
        #[cfg(feature = "ros")]
        ("tracker_node", help(env!("CARGO_BIN_EXE_tracker_node"))),
    ])
}

/// Whether a help text knows an option.
fn knows(help: &str, option: &str) -> bool {
    help.split(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']' | '=')).any(|word| word == option)
}

#[test]
fn commands_name_what_exists() {
    let programs = programs();
    let launch = fs::read_to_string(root().join("launch/tracker.launch.py")).unwrap();
    let mut wrong = Vec::new();
    let mut checked = 0;
    for (page, text) in pages() {
        for command in parts(&text).commands {
            let words: Vec<&str> = command.split_whitespace().collect();
            let mut told = |why: String| wrong.push(format!("{}: {why} in: {command}", page.display()));
            match words.as_slice() {
                ["cargo", "run", "--release", "--bin", name, rest @ ..] => {
                    checked += 1;
                    let Some(help) = programs.get(name) else {
                        if cfg!(feature = "ros") || !["tracker_demo", "tracker_node"].contains(name) {
                            told(format!("no program {name}"));
                        }
                        continue;
                    };
                    let options = rest.iter().filter(|w| w.starts_with('-') && !matches!(**w, "--" | "--ros-args"));
                    options.filter(|o| !knows(help, o)).for_each(|o| told(format!("{name} has no {o}")));
                }
                ["cargo", "run", "--release", "--example", name, ..] => {
                    checked += 1;
                    let file = root().join("examples").join(name);
                    if !file.join("main.rs").exists() && !file.with_extension("rs").exists() {
                        told(format!("no example {name}"));
                    }
                }
                ["cargo", "test", rest @ ..] => {
                    for test in rest.windows(2).filter(|w| w[0] == "--test" && w[1] != "NAME").map(|w| w[1]) {
                        checked += 1;
                        if !["", "/main"].iter().any(|m| root().join(format!("tests/{test}{m}.rs")).exists()) {
                            told(format!("no test {test}"));
                        }
                    }
                }
                ["cargo", "bench", "--bench", name, ..] => {
                    checked += 1;
                    if !root().join(format!("benches/{name}.rs")).exists() {
                        told(format!("no bench {name}"));
                    }
                }
                ["ros2", "launch", "long_term_tracker", "tracker.launch.py", rest @ ..] => {
                    checked += 1;
                    let names = rest.iter().filter_map(|w| w.split_once(":=")).map(|(name, _)| name);
                    names.filter(|n| !launch.contains(&format!("(\"{n}\", "))).for_each(|n| told(format!("no {n}")));
                }
                _ => {}
            }
            for word in &words {
                let word = word.trim_matches(['\'', '"']);
                let is_file =
                    ["params/", "assets/", "benches/", "docs/", "examples/"].iter().any(|f| word.starts_with(f));
                if is_file && !root().join(word).exists() {
                    told(format!("no file {word}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(checked > 40, "{checked} commands");
}

#[test]
fn parameters_exist_and_may_have_the_values_that_are_given() {
    let mut wrong = Vec::new();
    let mut checked = 0;
    for (page, text) in pages() {
        if page.ends_with("CHANGELOG.md") {
            continue;
        }
        let parts = parts(&text);
        let words = parts.commands.iter().flat_map(|c| c.split_whitespace()).chain(parts.spans.iter().copied());
        for word in words {
            let word = word.trim_matches(['\'', '"']);
            if !GROUPS.iter().any(|group| word.starts_with(group)) {
                continue;
            }
            let name = word.split([':', ' ', '=']).next().unwrap();
            let value = word.contains(":=").then(|| word.replace(['\'', '"'], ""));
            checked += 1;
            let known = match name.strip_suffix('*') {
                Some(group) => params::descriptors().iter().any(|d| d.name.starts_with(group)),
                None => params::descriptor(name).is_some() || is_file(name),
            };
            // What depends on other values is left to those who give them together.
            let refused = || match params::assignment(value.as_deref()?) {
                Ok((name, value)) => Params::default().with([(name.as_str(), &value)], Phase::StartUp).err(),
                Err(why) => Some(why),
            };
            if !known {
                wrong.push(format!("{}: no parameter {name}", page.display()));
            } else if let Some(why) = refused().filter(|why| !matches!(why, ParamsError::Conflict(_))) {
                wrong.push(format!("{}: {word}: {why}", page.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(checked > 100, "{checked} parameters");
}

/// Whether what looks like a parameter is the name of a file.
fn is_file(name: &str) -> bool {
    [".md", ".rs", ".yaml", ".js"].iter().any(|extension| name.ends_with(extension))
}
