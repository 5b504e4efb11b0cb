//! The parameters in force: the package's one table and the few that every ROS node has.

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use log::warn;

use super::args::ParameterSource;
use super::fault::Fault;
use super::image_qos::ImageQos;
use crate::error::ParamsError;
use crate::loader::Loaded;
use crate::network::Networks;
use crate::params::{
    self, Assignment, Need, NodeName, Origin, Override, Overrides, Params, Phase, Range, Tier, Value, ValueKind,
};

/// Names below which every node accepts parameters that concern only some of its topics.
const QOS_OVERRIDES: &str = "qos_overrides.";
const USE_SIM_TIME: &str = "use_sim_time";
/// How many images may be kept, at most.
const MAX_DEPTH: i64 = 1000;

/// How many of the nodes are told that a parameter file is for.
const TOLD: usize = 5;

/// A parameter that is no part of the package's table.
#[derive(Debug, Clone)]
struct NodeParameter {
    name: String,
    description: &'static str,
    choices: &'static [&'static str],
    range: Option<Range>,
    need: Need,
    value: Value,
}

/// What a tool is told of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Full name.
    pub name: String,
    /// Type of the value.
    pub kind: ValueKind,
    /// What it does.
    pub description: String,
    /// What a range cannot say.
    pub constraints: String,
    /// Whether it is fixed.
    pub read_only: bool,
    /// Interval of a number.
    pub range: Option<Range>,
}

/// A checked set of values.
#[derive(Debug, Clone)]
pub struct NodeSettings {
    /// The package's own.
    pub params: Params,
    /// Every node's.
    own: Vec<NodeParameter>,
    /// What the names of the parameters for the image topic begin with.
    qos_prefix: String,
}

impl NodeSettings {
    /// The defaults of a node that reads images from `image_topic`.
    pub fn new(image_topic: &str) -> Self {
        let qos_prefix = format!("{QOS_OVERRIDES}{image_topic}.subscription.");
        let fixed = |policy, description, choices, range, value| NodeParameter {
            name: format!("{qos_prefix}{policy}"),
            description,
            choices,
            range,
            need: Need::Restart,
            value,
        };
        let choice = |policy, choices: &'static [&'static str], description| {
            fixed(policy, description, choices, None, Value::String(choices[0].to_owned()))
        };
        let sim_time =
            "Whether /diagnostics and /rosout use the time of /clock. Tracking always uses the images' stamps.";
        let depth = "Maximum number of images that wait to be read. Only the newest is tracked.";
        let own = vec![
            NodeParameter {
                name: USE_SIM_TIME.to_owned(),
                description: sim_time,
                choices: &[],
                range: None,
                need: Need::Nothing,
                value: Value::Bool(false),
            },
            choice(
                ImageQos::RELIABILITY,
                &ImageQos::RELIABILITIES,
                "Whether lost parts of images are requested again.",
            ),
            choice(
                ImageQos::DURABILITY,
                &ImageQos::DURABILITIES,
                "Whether images published before the node started are requested.",
            ),
            choice(ImageQos::HISTORY, &ImageQos::HISTORIES, "Whether up to `depth` images are kept, or all."),
            fixed(ImageQos::DEPTH, depth, &[], Some((1..=MAX_DEPTH).into()), Value::Integer(1)),
        ];
        Self { params: Params::default(), own, qos_prefix }
    }

    /// How images are to be read.
    pub fn image_qos(&self) -> ImageQos {
        let value = |policy: &str| self.own(&format!("{}{policy}", self.qos_prefix)).map(|p| &p.value);
        let other = |policy, choices: [&str; 2]| value(policy) == Some(&Value::String(choices[1].to_owned()));
        let depth = match value(ImageQos::DEPTH) {
            Some(Value::Integer(depth)) => i32::try_from(*depth).unwrap_or(i32::MAX),
            _ => 1,
        };
        ImageQos {
            reliable: other(ImageQos::RELIABILITY, ImageQos::RELIABILITIES),
            transient_local: other(ImageQos::DURABILITY, ImageQos::DURABILITIES),
            keep_all: other(ImageQos::HISTORY, ImageQos::HISTORIES),
            depth,
        }
    }

    /// Whether time comes from a simulator.
    pub fn use_sim_time(&self) -> bool {
        self.own(USE_SIM_TIME).is_some_and(|p| p.value == Value::Bool(true))
    }

    /// All names, in the order in which rqt shows them: those that are met first in front, those for ablation last.
    pub fn names(&self) -> Vec<&str> {
        let (ablation, table): (Vec<_>, Vec<_>) = params::descriptors().iter().partition(|d| d.tier == Tier::Ablation);
        let own = self.own.iter().map(|p| p.name.as_str());
        table.into_iter().map(|d| d.name).chain(own).chain(ablation.into_iter().map(|d| d.name)).collect()
    }

    /// The value of a parameter.
    pub fn get(&self, name: &str) -> Option<Value> {
        self.params.get(name).or_else(|| self.own(name).map(|p| p.value.clone()))
    }

    /// What is known of a parameter besides its value.
    pub fn describe(&self, name: &str) -> Option<Description> {
        let (kind, description, choices, need, range, unit) = match (params::descriptor(name), self.own(name)) {
            (Some(d), _) => (d.default.kind(), d.description, d.choices, d.need, d.range, d.unit),
            (None, Some(p)) => (p.value.kind(), p.description, p.choices, p.need, p.range, ""),
            (None, None) => return None,
        };
        let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
        let mut constraints = Vec::new();
        if !choices.is_empty() {
            constraints.push(format!("one of {}", choices.join(", ")));
        }
        // What is read-only has a field of its own.
        if !matches!(need, Need::Nothing | Need::Restart) {
            constraints.push(format!("a change {}", need.about()));
        }
        let description = format!("{description}{unit}");
        if params::descriptor(name).is_some_and(|d| d.tier == Tier::Ablation) {
            constraints.push("for ablation".to_owned());
        }
        Some(Description {
            name: name.to_owned(),
            kind,
            description,
            constraints: constraints.join("; "),
            read_only: need == Need::Restart,
            range,
        })
    }

    /// This set with the changes made, or the first reason why not.
    pub fn with(&self, changes: &[Assignment], phase: Phase) -> Result<Self, ParamsError> {
        let mut changed = self.clone();
        let mut table = Vec::new();
        for (name, value) in changes {
            match changed.own.iter_mut().find(|p| p.name == *name) {
                Some(own) => own.set(value, phase)?,
                None => table.push((name.as_str(), value)),
            }
        }
        changed.params = self.params.with(table, phase)?;
        Ok(changed)
    }

    /// The values that `sources` give this node. Names that no parameter bears are told and passed over, for a file
    /// may be shared with other nodes; a value that cannot be used is a fault.
    pub fn load(&self, sources: &[ParameterSource], node: &NodeName) -> Result<Self, Fault> {
        let mut overrides = Overrides::default();
        for source in sources {
            match source {
                ParameterSource::File(path) => {
                    let named = overrides.read(path)?;
                    if !named.iter().any(|key| node.matches(key)) {
                        warn!("{}", nothing_for(node, path, &named));
                    }
                }
                ParameterSource::Preset(preset) => preset.add_to(&mut overrides)?,
                ParameterSource::Assignment(text) => overrides.assign(text)?,
            }
        }
        let mut all = Vec::new();
        for given in overrides.of(node) {
            if given.kinds.len() > 1 {
                warn!("{}", several_types(&given));
            }
            let row = (given.name.clone(), given.value());
            // Each row is tried by itself, so that the message can name its file.
            match self.with(std::slice::from_ref(&row), Phase::StartUp) {
                Err(why @ ParamsError::Unknown { .. }) => {
                    if !row.0.starts_with(QOS_OVERRIDES) {
                        warn!("{why}{}; it is ignored", given.origin);
                    }
                }
                // Values that do not fit each other may do so once all are there.
                Ok(_) | Err(ParamsError::Conflict(_)) => all.push(row),
                Err(why) => return Err(in_source(&given.origin, why).into()),
            }
        }
        Ok(self.with(&all, Phase::StartUp)?)
    }

    fn own(&self, name: &str) -> Option<&NodeParameter> {
        self.own.iter().find(|p| p.name == name)
    }
}

fn in_source(origin: &Origin, why: ParamsError) -> ParamsError {
    match (&origin.file, origin.place) {
        (Some(file), place @ Some(_)) => ParamsError::InFile { path: file.to_path_buf(), place, source: Box::new(why) },
        _ => why,
    }
}

/// What is told of a parameter file that does not concern the node.
fn nothing_for(node: &NodeName, path: &Path, named: &[String]) -> String {
    let others = match named {
        [] => "it names no node".to_owned(),
        _ if named.len() > TOLD => format!("it is for {} and {} more", named[..TOLD].join(", "), named.len() - TOLD),
        _ => format!("it is for {}", named.join(", ")),
    };
    format!("parameter file {}: it holds nothing for {}; {others}", path.display(), node.full())
}

/// What is told of a parameter whose last value need not be the one that holds.
fn several_types(given: &Override) -> String {
    let kinds: Vec<_> = given.kinds.iter().map(|k| k.name()).collect();
    let (name, value) = (&given.name, given.value());
    format!(
        "parameter '{name}' is given values of several types ({}); as in every node, {value} is used",
        kinds.join(", ")
    )
}

impl NodeParameter {
    fn set(&mut self, value: &Value, phase: Phase) -> Result<(), ParamsError> {
        let name = self.name.clone();
        if value.extent() > params::MOST_VALUES {
            return Err(ParamsError::Long { name, len: value.extent(), most: params::MOST_VALUES });
        }
        if value.kind() != self.value.kind() {
            let got = format!("{} {value}", value.kind().name());
            return Err(ParamsError::Type { name, expected: self.value.kind().name(), got });
        }
        if let Value::String(got) = value
            && !self.choices.contains(&got.as_str())
        {
            return Err(ParamsError::Choice { name, choices: self.choices.join(", "), got: got.clone() });
        }
        if let Some(range) = self.range.filter(|r| !r.contains(value)) {
            return Err(ParamsError::Range { name, range: range.to_string(), got: value.to_string() });
        }
        if phase == Phase::Running && self.need == Need::Restart && *value != self.value {
            return Err(ParamsError::ReadOnly { name });
        }
        self.value = value.clone();
        Ok(())
    }
}

/// The set in force, shared by the threads: whoever reads it gets one whole set.
#[derive(Debug)]
pub struct Store(Mutex<InForce>);

#[derive(Debug)]
struct InForce {
    settings: Arc<NodeSettings>,
    /// The networks that they ask for.
    loaded: Loaded,
}

/// A change that was made.
#[derive(Debug)]
pub struct Change {
    /// The new set.
    pub settings: Arc<NodeSettings>,
    /// The networks that it asks for.
    pub networks: Networks,
    /// What differs from the set before.
    pub different: Vec<Assignment>,
}

impl Store {
    /// Puts a set in force, with the networks that it asks for.
    pub fn new(settings: NodeSettings, loaded: Loaded) -> Self {
        Self(Mutex::new(InForce { settings: Arc::new(settings), loaded }))
    }

    /// The set in force.
    pub fn current(&self) -> Arc<NodeSettings> {
        self.lock().settings.clone()
    }

    /// Checks changes, and loads the networks that they ask for, which may take seconds: nobody waits for it meanwhile.
    pub fn prepare(&self, changes: &[Assignment]) -> Result<Loaded, ParamsError> {
        let changed = self.current().with(changes, Phase::Running)?;
        Ok(Loaded::new(&changed.params)?)
    }

    /// Makes the changes as a whole, or none of them. `None` where the new set asks for another network than that in
    /// force and than what was `prepared`: then it is to be prepared, and changed, once more.
    pub fn change(&self, changes: &[Assignment], prepared: Option<Loaded>) -> Result<Option<Change>, ParamsError> {
        let mut current = self.lock();
        let settings = Arc::new(current.settings.with(changes, Phase::Running)?);
        let candidates = [Some(current.loaded.clone()), prepared];
        let Some(loaded) = candidates.into_iter().flatten().find(|loaded| loaded.suits(&settings.params)) else {
            return Ok(None);
        };
        let mut different: Vec<Assignment> = Vec::new();
        for (name, _) in changes {
            if let Some(value) = settings.get(name).filter(|v| current.settings.get(name).as_ref() != Some(v))
                && !different.iter().any(|(n, _)| n == name)
            {
                different.push((name.clone(), value));
            }
        }
        let networks = loaded.networks();
        *current = InForce { settings: settings.clone(), loaded };
        Ok(Some(Change { settings, networks, different }))
    }

    fn lock(&self) -> MutexGuard<'_, InForce> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn settings() -> NodeSettings {
        NodeSettings::new("/cam")
    }

    fn row(name: &str, value: Value) -> Assignment {
        (name.to_owned(), value)
    }

    fn assigned(text: &str) -> ParameterSource {
        ParameterSource::Assignment(text.to_owned())
    }

    #[test]
    fn every_name_has_a_value_and_a_description() {
        let s = settings();
        assert!(s.names().contains(&"qos_overrides./cam.subscription.reliability"));
        for name in s.names() {
            let d = s.describe(name).unwrap();
            assert_eq!(d.kind, s.get(name).unwrap().kind());
            assert!(!d.description.is_empty());
        }
        assert_eq!(s.describe("algorithm").unwrap().constraints, "one of lcmht, etepf, maptrack");
        let waits =
            "one of masked, kernelised; a change rebuilds the filters once the target is TRACKING; for ablation";
        assert_eq!(s.describe("lcmht.filter.kind").unwrap().constraints, waits);
        let names = s.names();
        let place = |name: &str| names.iter().position(|n| *n == name).unwrap();
        assert!(place("algorithm") == 0 && place(USE_SIM_TIME) > place("lcmht.cnn.file"));
        assert!(place("lcmht.filter.kind") > place(USE_SIM_TIME), "ablation is last");
        assert_eq!(s.describe("lcmht.filter.recrop").unwrap().constraints, "for ablation");
        assert!(s.describe("nonsense").is_none() && s.get("nonsense").is_none());
    }

    #[test]
    fn the_nodes_own_parameters_are_checked_like_the_others() {
        let s = settings();
        let with = |name: &str, value, phase| s.with(&[row(name, value)], phase);
        let qos = "qos_overrides./cam.subscription.reliability";
        let reliable = || Value::String("reliable".into());
        assert!(matches!(with(USE_SIM_TIME, Value::Integer(1), Phase::Running), Err(ParamsError::Type { .. })));
        assert_eq!(
            with(USE_SIM_TIME, Value::Bool(true), Phase::Running).unwrap().get(USE_SIM_TIME),
            Some(Value::Bool(true))
        );
        assert!(matches!(with(qos, Value::String("x".into()), Phase::StartUp), Err(ParamsError::Choice { .. })));
        assert!(matches!(with(qos, reliable(), Phase::Running), Err(ParamsError::ReadOnly { .. })));
        let policy = |name: &str| format!("qos_overrides./cam.subscription.{name}");
        assert!(matches!(with(&policy("depth"), Value::Integer(0), Phase::StartUp), Err(ParamsError::Range { .. })));
        let set = s.with(
            &[
                row(qos, reliable()),
                row(&policy("durability"), Value::String("transient_local".into())),
                row(&policy("history"), Value::String("keep_all".into())),
                row(&policy("depth"), Value::Integer(7)),
            ],
            Phase::StartUp,
        );
        let all = ImageQos { reliable: true, transient_local: true, keep_all: true, depth: 7 };
        assert_eq!(set.unwrap().image_qos(), all);
        let none = ImageQos { reliable: false, transient_local: false, keep_all: false, depth: 1 };
        assert_eq!(s.image_qos(), none);
    }

    #[test]
    fn later_sources_win_and_foreign_names_are_passed_over() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, "/**: {{ros__parameters: {{seed: 4, other_nodes_parameter: 1, debug: {{max_side: 99}}}}}}")
            .unwrap();
        let sources = [
            assigned("seed:=1"),
            ParameterSource::File(file.path().to_owned()),
            assigned("other:seed:=7"),
            assigned("debug.max_side:=100"),
        ];
        let got = settings().load(&sources, &NodeName::default()).unwrap();
        assert_eq!(got.params.general.seed, 4);
        assert_eq!(got.params.debug.max_side, 100);
    }

    #[test]
    fn files_for_others_and_values_of_several_types_are_told() {
        let named: Vec<String> = ["/a", "/b", "/c", "/d", "/e", "/f", "/g"].map(str::to_owned).into();
        let told = |named: &[String]| nothing_for(&NodeName::default(), Path::new("f.yaml"), named);
        assert_eq!(told(&[]), "parameter file f.yaml: it holds nothing for /tracker; it names no node");
        assert!(told(&named[..2]).ends_with("it is for /a, /b"));
        assert!(told(&named).ends_with("it is for /a, /b, /c, /d, /e and 2 more"));
        let mut overrides = Overrides::default();
        for text in ["seed:=2.5", "seed:=2"] {
            overrides.assign(text).unwrap();
        }
        let told = several_types(&overrides.of(&NodeName::default())[0]);
        assert!(told.contains("'seed' is given values of several types (integer, double)"), "{told}");
        assert!(told.ends_with("2 is used"), "{told}");
    }

    #[test]
    fn a_value_in_a_file_that_cannot_be_used_is_told_with_the_file() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, "/**: {{ros__parameters: {{debug: {{max_side: 1}}}}}}").unwrap();
        let sources = [ParameterSource::File(file.path().to_owned())];
        let message = settings().load(&sources, &NodeName::default()).unwrap_err().to_string();
        assert!(message.contains(file.path().to_str().unwrap()), "{message}");
        assert!(
            message.contains("line 1, column 43: parameter 'debug.max_side' must be from 16 to 4096, got 1"),
            "{message}"
        );
    }

    #[test]
    fn a_change_is_made_as_a_whole_and_told_once() {
        let store = Store::new(without_network(), Loaded::default());
        let good = row("debug.max_side", Value::Integer(100));
        let bad = row("debug.jpeg_quality", Value::Integer(0));
        assert!(store.change(&[good.clone(), bad], None).is_err());
        assert_ne!(store.current().params.debug.max_side, 100);
        let change = |changes: &[Assignment]| store.change(changes, None).unwrap().unwrap().different;
        assert_eq!(change(&[good.clone(), good.clone()]), std::slice::from_ref(&good));
        assert!(change(&[good]).is_empty(), "nothing changed");
    }

    fn without_network() -> NodeSettings {
        let changes =
            [row("lcmht.cnn.enabled", Value::Bool(false)), row("lcmht.cnn.inference", Value::String("builtin".into()))];
        settings().with(&changes, Phase::StartUp).unwrap()
    }

    #[test]
    fn a_change_of_network_waits_until_it_is_loaded_and_hands_that_very_one_on() {
        let store = Store::new(without_network(), Loaded::default());
        let on = [row("lcmht.cnn.enabled", Value::Bool(true))];
        assert!(store.change(&on, None).unwrap().is_none(), "nothing is loaded under the lock");
        assert!(!store.current().params.lcmht.cnn.enabled);
        let prepared = store.prepare(&on).unwrap();
        // Somebody else was faster, and asks for another one.
        store.change(&[row("lcmht.cnn.side", Value::Integer(128))], None).unwrap().unwrap();
        assert!(store.change(&on, Some(prepared)).unwrap().is_none(), "it has another side");
        let prepared = store.prepare(&on).unwrap();
        let network = prepared.networks().cnn.unwrap();
        let change = store.change(&on, Some(prepared)).unwrap().unwrap();
        assert!(Arc::ptr_eq(&network, &change.networks.cnn.unwrap()));
        // What leaves it alone keeps it.
        let change = store.change(&[row("lcmht.cnn.share", Value::Double(0.5))], None).unwrap().unwrap();
        assert!(Arc::ptr_eq(&network, &change.networks.cnn.unwrap()));
    }
}
