//! Parameters as text, for one node: parameter files, `NAME:=VALUE` arguments, and presets to be read by people.

use std::fmt::Write as _;
use std::path::Path;

use super::node_name::NodeName;
use super::rcl::{Overrides, PARAMETERS_KEY};
use super::value::{Descriptor, Value};
use super::{Group as _, Need, Params, Tier};
use crate::error::{ParamsError, YamlError};

/// A parameter's name and the value it is to take.
pub type Assignment = (String, Value);

/// Reads `NAME:=VALUE`, the value as rcl reads it.
pub fn assignment(text: &str) -> Result<Assignment, ParamsError> {
    let mut overrides = Overrides::default();
    overrides.assign(text)?;
    let of_no_other = || ParamsError::Assignment { text: text.to_owned(), source: YamlError::OtherNode };
    let found = overrides.of(&NodeName::default());
    found.first().map(|o| (o.name.clone(), o.value())).ok_or_else(of_no_other)
}

/// Reads the parameters that a ROS parameter file holds for the node, in the order of the file.
pub fn file(path: &Path, node: &NodeName) -> Result<Vec<Assignment>, ParamsError> {
    let mut overrides = Overrides::default();
    overrides.read(path)?;
    Ok(assignments(&overrides, node))
}

/// The parameters of the node.
pub(super) fn assignments(overrides: &Overrides, node: &NodeName) -> Vec<Assignment> {
    overrides.of(node).into_iter().map(|o| (o.name.clone(), o.value())).collect()
}

/// A parameter file for every node that sets each parameter to its value in `params`, with what the parameter
/// means above each.
pub fn preset(params: &Params, title: &str) -> String {
    written(params, title, |_| true)
}

/// The same with those parameters alone that are not at their default.
pub fn changed_preset(params: &Params, title: &str) -> String {
    written(params, title, |d| params.get(d.name).as_ref() != Some(&d.default))
}

fn written(params: &Params, title: &str, is_wanted: impl Fn(&Descriptor) -> bool) -> String {
    let mut text = format!("# {title}\n/**:\n  {PARAMETERS_KEY}:\n");
    let mut open: Vec<&str> = Vec::new();
    let mut all = Vec::new();
    Params::describe(&mut all);
    for d in all.iter().filter(|d| is_wanted(d)) {
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
    // A mapping without entries would be none.
    if open.is_empty() && text.ends_with(":\n") {
        text.truncate(text.len() - 1);
        text.push_str(" {}\n");
    }
    text
}

/// What a reader must know besides the description: ` [range, unit, what a change needs, ablation]`.
fn about(d: &Descriptor) -> String {
    let mut notes: Vec<String> = d.range.iter().map(ToString::to_string).collect();
    if !d.choices.is_empty() {
        notes.push(d.choices.join(" | "));
    }
    if !d.unit.is_empty() {
        notes.push(d.unit.to_owned());
    }
    if d.need != Need::Nothing {
        notes.push(d.need.name().to_owned());
    }
    if d.tier == Tier::Ablation {
        notes.push(d.tier.name().to_owned());
    }
    if notes.is_empty() { String::new() } else { format!(" [{}]", notes.join(", ")) }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::super::{Phase, descriptors};
    use super::*;

    fn node(namespace: &str, name: &str) -> NodeName {
        NodeName { namespace: namespace.to_owned(), name: name.to_owned() }
    }

    #[test]
    fn a_file_gives_its_node_each_parameter_once() {
        let mut text = tempfile::NamedTempFile::new().unwrap();
        text.write_all(
            b"/**: {ros__parameters: {seed: 4, debug: {max_side: 100}}}\n\
                         robot: {tracker: {ros__parameters: {seed: 5}}}\n",
        )
        .unwrap();
        let got = file(text.path(), &node("/robot", "tracker")).unwrap();
        let want = [("seed", 5), ("debug.max_side", 100)].map(|(n, v)| (n.to_owned(), Value::Integer(v)));
        assert_eq!(got, want);
        let missing = file(Path::new("/no/such.yaml"), &node("/", "tracker")).unwrap_err().to_string();
        assert!(missing.contains("/no/such.yaml"), "{missing}");
    }

    #[test]
    fn assignments_are_read_like_files() {
        assert_eq!(assignment("a.b:=1.5").unwrap(), ("a.b".to_owned(), Value::Double(1.5)));
        assert_eq!(assignment("a:=[1, 2]").unwrap().1, Value::IntegerArray(vec![1, 2]));
        assert_eq!(assignment("a:=yes it is").unwrap().1, Value::String("yes it is".into()));
        assert_eq!(assignment("a:=off").unwrap().1, Value::Bool(false));
        assert_eq!(assignment("lcmht.cnn.weights:=[]").unwrap().1, Value::DoubleArray(vec![]));
        for text in ["a", "a=1", ":=1", "a:=", "a:=[", "a:={b: 1}", "other:a:=1", "a..b:=1"] {
            assert!(assignment(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_preset_reads_back_as_the_parameters_it_was_made_from() {
        let changed = Params::default().with([("seed", &Value::Integer(9))], Phase::StartUp).unwrap();
        let mut text = tempfile::NamedTempFile::new().unwrap();
        text.write_all(preset(&changed, "Test.").as_bytes()).unwrap();
        let rows = file(text.path(), &NodeName::default()).unwrap();
        assert_eq!(rows.len(), descriptors().len());
        let back = Params::default().with(rows.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp).unwrap();
        assert_eq!(back, changed);
    }

    #[test]
    fn what_was_changed_is_written_alone_and_reads_back() {
        let rows = [("seed", Value::Integer(9)), ("debug.max_side", Value::Integer(99))];
        let changed = Params::default().with(rows.iter().map(|(n, v)| (*n, v)), Phase::StartUp).unwrap();
        let mut text = tempfile::NamedTempFile::new().unwrap();
        text.write_all(changed_preset(&changed, "Test.").as_bytes()).unwrap();
        let back = file(text.path(), &NodeName::default()).unwrap();
        assert_eq!(back, rows.map(|(n, v)| (n.to_owned(), v)));
        text.as_file().set_len(0).unwrap();
        std::fs::write(text.path(), changed_preset(&Params::default(), "None.")).unwrap();
        assert_eq!(file(text.path(), &NodeName::default()).unwrap(), []);
    }
}
