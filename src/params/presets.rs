//! The presets, files in `params/` that the programs hold, so that they have them wherever they are installed.

use std::fmt::Write as _;
use std::path::Path;

use super::NodeName;
use super::rcl::Overrides;
use super::yaml::{self, Assignment};
use crate::error::ParamsError;

/// A set of parameters with a name.
#[derive(Debug, PartialEq)]
pub struct Preset {
    /// The name of its file, without `.yaml`.
    pub name: &'static str,
    /// A ROS parameter file.
    pub text: &'static str,
}

macro_rules! presets {
    ($($name:literal)*) => {
        [$(Preset { name: $name, text: include_str!(concat!("../../params/", $name, ".yaml")) }),*]
    };
}

/// All of them.
pub static PRESETS: [Preset; 7] = presets!["default" "fast" "matching" "paper" "etepf" "maptrack" "maptrack_near"];

impl Preset {
    /// The preset that `--params` names. `None` for what is a file: it has a path or an extension, or is there.
    pub fn named(source: &Path) -> Result<Option<&'static Self>, ParamsError> {
        let found = PRESETS.iter().find(|preset| Path::new(preset.name) == source);
        let is_name = source.file_name() == Some(source.as_os_str()) && source.extension().is_none();
        if found.is_none() && is_name && !source.exists() {
            let known = PRESETS.iter().map(|preset| preset.name).collect::<Vec<_>>().join(", ");
            return Err(ParamsError::Preset { name: source.display().to_string(), known });
        }
        Ok(found)
    }

    /// Adds its parameters to others, which they override.
    pub fn add_to(&self, overrides: &mut Overrides) -> Result<(), ParamsError> {
        overrides.take(Path::new(self.name), self.text).map(drop)
    }

    /// The first sentence of its file.
    pub fn about(&self) -> String {
        let lines = self.text.lines().map_while(|line| line.strip_prefix("# "));
        let header = lines.collect::<Vec<_>>().join(" ");
        header.split_inclusive(". ").next().unwrap_or_default().trim_end().to_owned()
    }
}

/// The parameters that a preset or a parameter file holds for the node, in the order of the file.
pub fn preset_or_file(source: &Path, node: &NodeName) -> Result<Vec<Assignment>, ParamsError> {
    let Some(preset) = Preset::named(source)? else { return yaml::file(source, node) };
    let mut overrides = Overrides::default();
    preset.add_to(&mut overrides)?;
    Ok(yaml::assignments(&overrides, node))
}

/// The names of all presets, each with what it is for.
pub fn list() -> String {
    PRESETS.iter().fold(String::new(), |mut list, preset| {
        let _ = writeln!(list, "{:14} {}", preset.name, preset.about());
        list
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Params, Phase};
    use super::*;

    fn read(source: &str) -> Result<Vec<Assignment>, ParamsError> {
        preset_or_file(Path::new(source), &NodeName::default())
    }

    #[test]
    fn a_preset_is_what_its_file_holds() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), PRESETS.len());
        for preset in &PRESETS {
            let file = folder.join(preset.name).with_extension("yaml");
            let rows = read(preset.name).unwrap();
            assert_eq!(rows, yaml::file(&file, &NodeName::default()).unwrap(), "{}", preset.name);
            Params::default().with(rows.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp).unwrap();
        }
    }

    #[test]
    fn a_path_is_a_file_even_where_it_ends_in_a_presets_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("fast");
        std::fs::write(&path, "/**: {ros__parameters: {seed: 4}}").unwrap();
        assert_eq!(read(path.to_str().unwrap()).unwrap()[0].0, "seed");
        for missing in ["./fast", "fast.yaml"] {
            assert!(matches!(read(missing), Err(ParamsError::File { .. })), "{missing}");
        }
    }

    #[test]
    fn a_name_that_is_neither_is_answered_with_those_there_are() {
        let why = read("fsat").unwrap_err().to_string();
        assert!(why.starts_with("'fsat' is neither a file nor a preset; presets are default, fast, "), "{why}");
    }

    #[test]
    fn each_preset_is_listed_with_a_sentence() {
        let list = list();
        assert_eq!(list.lines().count(), PRESETS.len());
        for (line, preset) in list.lines().zip(&PRESETS) {
            assert!(line.starts_with(&format!("{} ", preset.name)) && line.ends_with('.'), "{line}");
        }
    }
}
