//! The map in `lib.rs`, held against the source: a room takes only from rooms that stand before it there, and no two
//! files of the core take from each other, neither by `use` nor by a path in the text. Tests may take from anywhere.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A module: the names below `crate`.
type Module = Vec<String>;

/// Rooms whose files may lean on each other: shells around the core, in which what is opened and what opens it know
/// each other.
const SHELLS: [&str; 2] = ["replay", "ros"];

/// One file, read.
struct Source {
    tokens: Vec<String>,
    /// Paths of `use`, and of `pub use`; the last name is what it is known by, or `*`.
    uses: Vec<Vec<String>>,
    shown: Vec<(Vec<String>, String)>,
    /// What is defined here.
    items: BTreeSet<String>,
}

/// All files below `src`, but for tests and programs.
fn sources() -> BTreeMap<Module, Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = BTreeMap::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let inner = path.strip_prefix(&root).unwrap().with_extension("");
            let mut module: Module = inner.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
            let is_code = path.extension().is_some_and(|ext| ext == "rs") && module[0] != "bin";
            if is_code && module.last().unwrap() != "tests" {
                module.retain(|part| part != "mod" && part != "lib");
                found.insert(module, read(&std::fs::read_to_string(path).unwrap()));
            }
        }
    }
    found
}

fn read(text: &str) -> Source {
    let tokens = tokens(text);
    let (mut uses, mut shown, mut items) = (Vec::new(), Vec::new(), BTreeSet::new());
    let mut at = 0;
    while at < tokens.len() {
        let before = at.checked_sub(1).map_or("", |i| tokens[i].as_str());
        match tokens[at].as_str() {
            "use" => {
                let (paths, end) = tree(&tokens, at + 1, &[]);
                if before == "pub" {
                    shown.extend(paths);
                } else {
                    uses.extend(paths.into_iter().map(|(path, _)| path));
                }
                at = end;
                continue;
            }
            "struct" | "enum" | "fn" | "trait" | "type" | "const" | "static" | "mod" => {
                items.extend(tokens.get(at + 1).cloned());
            }
            "crate" | "super" | "self" if before != "::" && !is_visibility(&tokens[..at]) => {
                let mut path = vec![tokens[at].clone()];
                while tokens.get(at + 1).is_some_and(|t| t == "::") && tokens.get(at + 2).is_some_and(|t| is_name(t)) {
                    path.push(tokens[at + 2].clone());
                    at += 2;
                }
                uses.push(path);
            }
            _ => {}
        }
        at += 1;
    }
    Source { tokens, uses, shown, items }
}

/// The paths of the tree of a `use`, each with the name it is known by, and where the tree ends.
fn tree(tokens: &[String], mut at: usize, prefix: &[String]) -> (Vec<(Vec<String>, String)>, usize) {
    let mut path = prefix.to_vec();
    loop {
        if tokens[at] == "{" {
            let mut paths = Vec::new();
            at += 1;
            while tokens[at] != "}" {
                let (inner, end) = tree(tokens, at, &path);
                paths.extend(inner);
                at = end + usize::from(tokens[end] == ",");
            }
            return (paths, at + 1);
        }
        path.push(tokens[at].clone());
        at += 1;
        match tokens[at].as_str() {
            "::" => at += 1,
            "as" => return (vec![(path, tokens[at + 1].clone())], at + 2),
            _ => {
                let name = path.last().unwrap().clone();
                return (vec![(path, name)], at);
            }
        }
    }
}

/// Whether `pub(` or `pub(in` stands at the end.
fn is_visibility(before: &[String]) -> bool {
    matches!(before, [.., a, b] if a == "pub" && b == "(") || before.last().is_some_and(|token| token == "in")
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Names, `::` and single characters, without comments, texts and the tests at the end of the file.
fn tokens(text: &str) -> Vec<String> {
    let mut rest = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let mut tokens = Vec::new();
    while let Some(c) = rest.chars().next() {
        let raw = rest.strip_prefix('r').map(|r| r.trim_start_matches('#')).filter(|r| r.starts_with('"'));
        let len = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(raw) = raw {
            let end = format!("\"{}", "#".repeat(rest.len() - raw.len() - 1));
            rest.len() - raw.len() + 1 + raw[1..].find(&end).expect("a text ends") + end.len()
        } else if c == '"' {
            quoted(rest, '"')
        } else if c == '\'' && (rest[1..].starts_with('\\') || rest[1..].chars().nth(1) == Some('\'')) {
            quoted(rest, '\'')
        } else if c.is_alphanumeric() || c == '_' {
            rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            c.len_utf8()
        };
        let token = &rest[..len];
        if is_name(token) && raw.is_none() || token == "::" || len == 1 && !c.is_whitespace() {
            tokens.push(token.to_owned());
        }
        rest = &rest[len..];
    }
    tokens
}

/// The length of the text or character that `rest` begins with.
fn quoted(rest: &str, quote: char) -> usize {
    let mut escaped = false;
    let end = rest.char_indices().skip(1).find(|&(_, c)| {
        let ends = c == quote && !escaped;
        escaped = c == '\\' && !escaped;
        ends
    });
    end.expect("a text ends").0 + 1
}

/// The file that a path in a module leads to: through what other files show, to where the thing itself is.
fn resolve(all: &BTreeMap<Module, Source>, from: &Module, path: &[String]) -> Option<Module> {
    let below = |module: &Module, name: &String| [module.as_slice(), std::slice::from_ref(name)].concat();
    let supers = path.iter().take_while(|part| *part == "super").count();
    let (mut module, mut rest) = match path[0].as_str() {
        "crate" => (Vec::new(), &path[1..]),
        "self" => (from.clone(), &path[1..]),
        "super" => (from[..from.len() - supers].to_vec(), &path[supers..]),
        _ => (from.clone(), path),
    };
    let is_foreign =
        !["crate", "self", "super"].contains(&path[0].as_str()) && !all.contains_key(&below(from, &path[0]));
    if is_foreign {
        return None;
    }
    while let [name, more @ ..] = rest
        && all.contains_key(&below(&module, name))
    {
        (module, rest) = (below(&module, name), more);
    }
    let Some(name) = rest.first() else { return Some(module) };
    let source = &all[&module];
    let shown = source.shown.iter().find(|(_, known)| known == name).map(|(path, _)| path);
    if let Some(found) = shown.and_then(|path| resolve(all, &module, path)) {
        return Some(found);
    }
    let globs = source.shown.iter().filter(|(_, known)| known == "*" && !source.items.contains(name));
    let shown = globs.filter_map(|(path, _)| resolve(all, &module, &path[..path.len() - 1]));
    Some(shown.into_iter().find(|found| all[found].items.contains(name)).unwrap_or(module))
}

/// What each file takes from. One that only shows what another holds takes nothing from it.
fn imports(all: &BTreeMap<Module, Source>) -> BTreeMap<Module, BTreeSet<Module>> {
    let mut imports = BTreeMap::new();
    for (module, source) in all.iter().filter(|(module, _)| !module.is_empty()) {
        let is_used = |name: &str| {
            let mentions = source.tokens.windows(2).filter(|pair| pair[1] == name && pair[0] != "mod").count();
            let named = |(path, known): &(Vec<String>, String)| {
                let alias = path.last() != Some(known) && known == name;
                path.iter().filter(|part| *part == name).count() + usize::from(alias)
            };
            let in_paths: usize = source.shown.iter().map(named).sum();
            mentions > in_paths
        };
        let used = source.shown.iter().filter(|(_, known)| is_used(known)).map(|(path, _)| path);
        let taken = source.uses.iter().chain(used).filter_map(|path| resolve(all, module, path));
        imports.insert(module.clone(), taken.filter(|from| from != module && !from.is_empty()).collect());
    }
    imports
}

/// The rooms in the order of the table in `lib.rs`.
fn rooms() -> Vec<String> {
    let map = include_str!("../src/lib.rs");
    let rows = map.lines().filter_map(|line| line.strip_prefix("//! | ")).filter_map(|row| row.split(" | ").next());
    let cells = rows.flat_map(|cell| cell.split(", ").map(str::to_owned).collect::<Vec<_>>());
    let name = |cell: String| cell.split('`').nth(1).map(str::to_owned);
    cells.filter_map(name).collect()
}

#[test]
fn a_room_takes_only_from_rooms_before_it() {
    let (all, rooms) = (sources(), rooms());
    let rank = |room: &String| rooms.iter().position(|other| other == room);
    for module in all.keys().filter(|module| module.len() == 1) {
        assert!(rank(&module[0]).is_some(), "the map in lib.rs lacks {}", module[0]);
    }
    let upwards: Vec<String> = imports(&all)
        .iter()
        .flat_map(|(module, taken)| taken.iter().map(move |from| (module, from)))
        .filter(|(module, from)| module[0] != from[0] && rank(&from[0]) >= rank(&module[0]))
        .map(|(module, from)| format!("{} takes from {}", module.join("/"), from.join("/")))
        .collect();
    assert_eq!(upwards, [""; 0]);
}

#[test]
fn no_files_of_the_core_take_from_each_other() {
    let all = sources();
    let mut left = imports(&all);
    left.retain(|module, _| !SHELLS.contains(&module[0].as_str()));
    // What takes from nothing that is left goes, until only circles and what leads to them are left.
    loop {
        let free: Vec<Module> = left
            .iter()
            .filter(|(_, taken)| taken.iter().all(|from| !left.contains_key(from)))
            .map(|(m, _)| m.clone())
            .collect();
        if free.is_empty() {
            break;
        }
        free.iter().for_each(|module| _ = left.remove(module));
    }
    let circles: Vec<String> = left.keys().map(|module| module.join("/")).collect();
    assert_eq!(circles, [""; 0], "a circle, and what takes from it");
}

#[test]
fn imports_are_read_as_the_compiler_reads_them() {
    let file = |text: &str| read(text);
    let module = |path: &str| path.split('/').filter(|part| !part.is_empty()).map(str::to_owned).collect::<Module>();
    let all: BTreeMap<Module, Source> = [
        ("", "pub mod a; pub mod b;"),
        ("a", "mod x; mod y; pub use x::{Thing, more as other}; pub use y::*; fn own() {}"),
        (
            "a/x",
            "pub struct Thing; // use crate::b::No;\nconst A: &str = \"// \\\" use crate::b::No\"; \
             const B: char = '\"';",
        ),
        ("a/y", "use super::own;\npub(in crate::b) enum Kind {} const C: &str = r#\"use crate::b::No; \"//\"#;"),
        (
            "b",
            "use crate::a::{self, Kind};\nfn f() { g(crate::a::Thing, a::own()) }\n#[cfg(test)]\n\
             mod tests { use crate::c; }",
        ),
    ]
    .into_iter()
    .map(|(path, text)| (module(path), file(text)))
    .collect();
    let taken = imports(&all);
    let of = |path: &str| taken[&module(path)].iter().map(|from| from.join("/")).collect::<Vec<_>>();
    assert_eq!(of("a"), [""; 0]);
    assert_eq!(of("a/x"), [""; 0]);
    assert_eq!(of("a/y"), ["a"]);
    assert_eq!(of("b"), ["a", "a/x", "a/y"]);
}
