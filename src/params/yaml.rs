//! Parameters as text: ROS parameter files, `NAME:=VALUE` arguments, and presets to be read by people.

use std::fmt::Write as _;
use std::path::Path;

use serde_yaml_ng::Value as Yaml;

use super::value::Value;
use super::{Params, descriptors};
use crate::error::ParamsError;

/// A parameter's name and the value it is to take.
pub type Assignment = (String, Value);

/// The key under which a node's parameters stand.
const PARAMETERS_KEY: &str = "ros__parameters";

/// The full name of a node, by which it finds its own part of a parameter file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeName {
    /// Absolute, without a slash at its end; `/` for the root.
    pub namespace: String,
    /// The node's own name.
    pub name: String,
}

impl Default for NodeName {
    fn default() -> Self {
        Self { namespace: "/".to_owned(), name: "tracker".to_owned() }
    }
}

impl NodeName {
    /// `/namespace/name`.
    pub fn full(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }

    /// Whether a key of a parameter file means this node: `**` stands for any number of names, `*` for one; a key
    /// without a leading slash is taken from the root.
    fn matches(&self, key: &str) -> bool {
        let names =
            |path: &str| -> Vec<String> { path.split('/').filter(|s| !s.is_empty()).map(str::to_owned).collect() };
        fn fits(pattern: &[String], path: &[String]) -> bool {
            match pattern.split_first() {
                None => path.is_empty(),
                Some((first, rest)) if first == "**" => (0..=path.len()).any(|skip| fits(rest, &path[skip..])),
                Some((first, rest)) => {
                    path.split_first().is_some_and(|(p, tail)| (first == "*" || first == p) && fits(rest, tail))
                }
            }
        }
        fits(&names(key), &names(&self.full()))
    }
}

/// Reads `NAME:=VALUE`, the value as YAML.
pub fn assignment(text: &str) -> Result<Assignment, ParamsError> {
    let wrong = |why: String| ParamsError::Assignment { text: text.to_owned(), why };
    let (name, value) = text.split_once(":=").ok_or_else(|| wrong("it must read NAME:=VALUE".to_owned()))?;
    if name.is_empty() {
        return Err(wrong("the name is empty".to_owned()));
    }
    let yaml: Yaml = serde_yaml_ng::from_str(value).map_err(|e| wrong(e.to_string()))?;
    let value = scalar_or_list(&yaml).map_err(wrong)?;
    Ok((name.to_owned(), value))
}

/// Reads the parameters that a ROS parameter file holds for the node, in the order of the file.
pub fn file(path: &Path, node: &NodeName) -> Result<Vec<Assignment>, ParamsError> {
    let wrong = |why: String| ParamsError::File { path: path.to_owned(), why };
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    parse(&text, node).map_err(wrong)
}

fn parse(text: &str, node: &NodeName) -> Result<Vec<Assignment>, String> {
    let root: Yaml = serde_yaml_ng::from_str(text).map_err(|e| e.to_string())?;
    let mut found = Vec::new();
    match &root {
        Yaml::Null => {}
        Yaml::Mapping(_) => nodes(&root, "", node, &mut found)?,
        _ => return Err(format!("it must hold node names with '{PARAMETERS_KEY}' below them")),
    }
    Ok(found)
}

/// Walks down the node names, which may be nested by namespace.
fn nodes(yaml: &Yaml, path: &str, node: &NodeName, out: &mut Vec<Assignment>) -> Result<(), String> {
    let Yaml::Mapping(map) = yaml else {
        return Err(format!("'{path}' must hold '{PARAMETERS_KEY}' or further node names"));
    };
    for (key, value) in map {
        let key = name_of(key)?;
        if key == PARAMETERS_KEY {
            if path.is_empty() {
                return Err(format!("'{PARAMETERS_KEY}' must stand below a node name, such as '/**'"));
            }
            if node.matches(path) {
                flatten(value, "", out)?;
            }
        } else {
            let below = format!("{}/{}", path.trim_end_matches('/'), key.trim_start_matches('/'));
            nodes(value, &below, node, out)?;
        }
    }
    Ok(())
}

/// Turns nested maps into names with dots.
fn flatten(yaml: &Yaml, prefix: &str, out: &mut Vec<Assignment>) -> Result<(), String> {
    match yaml {
        Yaml::Mapping(map) => {
            for (key, value) in map {
                let key = name_of(key)?;
                let name = if prefix.is_empty() { key } else { format!("{prefix}.{key}") };
                flatten(value, &name, out)?;
            }
            Ok(())
        }
        Yaml::Null if prefix.is_empty() => Ok(()),
        _ if prefix.is_empty() => Err(format!("'{PARAMETERS_KEY}' must hold names with values")),
        _ => {
            let value = scalar_or_list(yaml).map_err(|why| format!("'{prefix}': {why}"))?;
            out.push((prefix.to_owned(), value));
            Ok(())
        }
    }
}

fn name_of(key: &Yaml) -> Result<String, String> {
    key.as_str().map(str::to_owned).ok_or_else(|| format!("{key:?} is no name"))
}

fn scalar_or_list(yaml: &Yaml) -> Result<Value, String> {
    match yaml {
        Yaml::Bool(v) => Ok(Value::Bool(*v)),
        Yaml::Number(n) => match (n.as_i64(), n.as_f64()) {
            (Some(v), _) => Ok(Value::Integer(v)),
            (None, Some(v)) if n.is_f64() => Ok(Value::Double(v)),
            _ => Err(format!("{n} does not fit 64 bits")),
        },
        Yaml::String(v) => Ok(Value::String(v.clone())),
        Yaml::Sequence(items) => list(items),
        Yaml::Null => Err("it has no value".to_owned()),
        Yaml::Mapping(_) | Yaml::Tagged(_) => Err("it is neither a value nor a list".to_owned()),
    }
}

fn list(items: &[Yaml]) -> Result<Value, String> {
    fn all<T>(items: &[Yaml], one: impl Fn(&Yaml) -> Option<T>) -> Option<Vec<T>> {
        items.iter().map(one).collect()
    }
    if let Some(v) = all(items, |y| y.as_str().map(str::to_owned)) {
        return Ok(Value::StringArray(v));
    }
    all(items, Yaml::as_bool)
        .map(Value::BoolArray)
        .or_else(|| all(items, Yaml::as_i64).map(Value::IntegerArray))
        .or_else(|| all(items, Yaml::as_f64).map(Value::DoubleArray))
        .ok_or_else(|| "the items of a list must be of one type".to_owned())
}

/// A parameter file for every node that sets each parameter to its value in `params`, with what the parameter
/// means above each.
pub fn preset(params: &Params, title: &str) -> String {
    let mut text = format!("# {title}\n/**:\n  {PARAMETERS_KEY}:\n");
    let mut open: Vec<&str> = Vec::new();
    for d in descriptors() {
        let mut groups: Vec<&str> = d.name.split('.').collect();
        let Some(leaf) = groups.pop() else { continue };
        let shared = open.iter().zip(&groups).take_while(|(a, b)| a == b).count();
        for (depth, group) in groups.iter().enumerate().skip(shared) {
            let _ = writeln!(text, "{}{group}:", "  ".repeat(depth + 2));
        }
        let indent = "  ".repeat(groups.len() + 2);
        let about = about(d);
        let value = params.get(d.name).unwrap_or_else(|| d.default.clone());
        let _ = writeln!(text, "{indent}# {}{about}", d.description);
        let _ = writeln!(text, "{indent}{leaf}: {value}");
        open = groups;
    }
    text
}

/// What a reader must know besides the description: ` (range, unit, fixed)`.
fn about(d: &super::Descriptor) -> String {
    let mut notes: Vec<String> = d.range.iter().map(ToString::to_string).collect();
    if !d.choices.is_empty() {
        notes.push(d.choices.join(" | "));
    }
    if !d.unit.is_empty() {
        notes.push(d.unit.to_owned());
    }
    if !d.live {
        notes.push("read-only".to_owned());
    }
    if notes.is_empty() { String::new() } else { format!(" [{}]", notes.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::super::Phase;
    use super::*;

    fn node(namespace: &str, name: &str) -> NodeName {
        NodeName { namespace: namespace.to_owned(), name: name.to_owned() }
    }

    #[test]
    fn node_keys_match_as_rcl_matches_them() {
        let n = node("/robot/front", "tracker");
        for key in
            ["/**", "/robot/front/tracker", "robot/front/tracker", "/**/tracker", "/robot/*/tracker", "/robot/**"]
        {
            assert!(n.matches(key), "{key}");
        }
        for key in ["tracker", "/*", "/robot/tracker", "/**/other", "/robot/front"] {
            assert!(!n.matches(key), "{key}");
        }
        assert!(node("/", "tracker").matches("tracker"));
        assert!(node("/", "tracker").matches("/*"));
    }

    #[test]
    fn a_file_gives_the_parameters_of_its_node_in_order() {
        let text = "
/**:
  ros__parameters:
    seed: 4
    debug: {max_side: 100}
    debug.jpeg_quality: 50
robot:
  tracker:
    ros__parameters: {seed: 5}
other:
  ros__parameters: {seed: 6}
";
        let got = parse(text, &node("/robot", "tracker")).unwrap();
        let want = [("seed", 4), ("debug.max_side", 100), ("debug.jpeg_quality", 50), ("seed", 5)];
        let want: Vec<Assignment> = want.iter().map(|(n, v)| ((*n).to_owned(), Value::Integer(*v))).collect();
        assert_eq!(got, want);
    }

    #[test]
    fn text_that_is_no_parameter_file_says_why() {
        let n = NodeName::default();
        for (text, why) in [
            ("just words", "node names"),
            ("ros__parameters: {seed: 1}", "below a node name"),
            ("/**: {ros__parameters: [1]}", "names with values"),
            ("/**: {ros__parameters: {seed: }}", "'seed': it has no value"),
            ("/**: {ros__parameters: {seed: [1, a]}}", "of one type"),
            ("/**: {seed: 1}", "'/**/seed' must hold"),
            ("a: [", "did not find"),
        ] {
            let got = parse(text, &n).unwrap_err();
            assert!(got.contains(why), "{text}: {got}");
        }
        assert!(parse("", &n).unwrap().is_empty());
        let missing = file(Path::new("/no/such.yaml"), &n).unwrap_err().to_string();
        assert!(missing.contains("/no/such.yaml"), "{missing}");
    }

    #[test]
    fn assignments_are_yaml() {
        assert_eq!(assignment("a.b:=1.5").unwrap(), ("a.b".to_owned(), Value::Double(1.5)));
        assert_eq!(assignment("a:=[1, 2]").unwrap().1, Value::IntegerArray(vec![1, 2]));
        assert_eq!(assignment("a:=yes it is").unwrap().1, Value::String("yes it is".into()));
        for text in ["a", "a=1", ":=1", "a:=", "a:=[", "a:={b: 1}"] {
            assert!(assignment(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_preset_reads_back_as_the_parameters_it_was_made_from() {
        let changed = Params::default().with([("seed", &Value::Integer(9))], Phase::StartUp).unwrap();
        let rows = parse(&preset(&changed, "Test."), &NodeName::default()).unwrap();
        assert_eq!(rows.len(), descriptors().len());
        let back = Params::default().with(rows.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp).unwrap();
        assert_eq!(back, changed);
    }
}
