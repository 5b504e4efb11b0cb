//! An ONNX network cut into stages at its depthwise convolutions, so that something else can compute these.

use std::collections::{BTreeSet, HashMap, HashSet};

use rten_onnx::onnx::{AttributeProto, GraphProto, ModelProto, NodeProto, ValueInfoProto};

use super::declared::inputs_of;

/// More rows or columns of padding, or a longer step, than any network has.
const MOST: i64 = 1 << 10;
/// More stages than any network has.
const MOST_STAGES: usize = 256;

/// A convolution of each channel by its own kernel, as a file tells of it, with what limits its values right behind it.
/// Pairs are of rows and columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Separate {
    /// Which node it is.
    node: usize,
    /// Which node limits its values, if one does.
    limiter: Option<usize>,
    /// The value that it convolves.
    pub input: String,
    /// The value that it makes.
    pub output: String,
    /// The value that holds the kernels.
    pub kernels: String,
    /// The value that holds a bias for each channel, if there is one.
    pub biases: Option<String>,
    /// As many channels as there are.
    pub groups: usize,
    /// The step from output to output.
    pub stride: [usize; 2],
    /// Zeros before the first and behind the last pixel.
    pub padding: [[usize; 2]; 2],
    /// What its values are limited to.
    pub limits: Limits,
}

/// What values are limited to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Limits {
    /// Nothing.
    None,
    /// Zero at least.
    Positive,
    /// What these two values hold.
    Held([String; 2]),
}

impl Separate {
    /// The values that the file holds for it.
    pub fn held(&self) -> impl Iterator<Item = &str> {
        let limits = match &self.limits {
            Limits::Held(limits) => limits.as_slice(),
            Limits::None | Limits::Positive => &[],
        };
        [Some(&self.kernels), self.biases.as_ref()].into_iter().flatten().chain(limits).map(String::as_str)
    }
}

/// What is computed together, and the depthwise convolutions that follow.
pub(super) struct Stage {
    /// A network in ONNX's format; `None` where there is nothing to compute before the convolutions.
    pub model: Option<Vec<u8>>,
    /// The values that it is given.
    pub inputs: Vec<String>,
    /// The values that it makes.
    pub outputs: Vec<String>,
    /// Which convolutions follow.
    pub convolutions: Vec<usize>,
}

/// The nodes of a stage, and the convolutions that follow.
#[derive(Default)]
struct Members {
    nodes: BTreeSet<usize>,
    convolutions: Vec<usize>,
}

/// A network's nodes, and who makes which value.
pub(super) struct Graph<'a> {
    model: &'a ModelProto,
    graph: &'a GraphProto,
    makers: HashMap<&'a str, usize>,
    /// The values that do not depend on the inputs.
    constants: HashSet<&'a str>,
}

impl<'a> Graph<'a> {
    /// The graph of a model; `None` if it is none that can be cut: with graphs inside of nodes, or in disorder.
    pub fn of(model: &'a ModelProto) -> Option<Self> {
        let graph = model.graph.as_ref()?;
        let mut constants: HashSet<&str> = graph.initializer.iter().filter_map(|t| t.name.as_deref()).collect();
        let mut known = constants.clone();
        known.extend(graph.input.iter().filter_map(|input| input.name.as_deref()));
        let mut makers = HashMap::new();
        for (at, node) in graph.node.iter().enumerate() {
            let has_graph = node.attribute.iter().any(|attribute| attribute.g.is_some());
            if has_graph || !inputs(node).all(|input| known.contains(input)) {
                return None;
            }
            let is_constant = inputs(node).all(|input| constants.contains(input));
            for output in outputs(node) {
                if !known.insert(output) {
                    return None;
                }
                makers.insert(output, at);
                if is_constant {
                    constants.insert(output);
                }
            }
        }
        Some(Self { model, graph, makers, constants })
    }

    /// What may be depthwise convolutions, by what the nodes say; their kernels have the last word.
    pub fn convolutions(&self) -> Vec<Separate> {
        let mut users: HashMap<&str, Vec<usize>> = HashMap::new();
        for (at, node) in self.graph.node.iter().enumerate() {
            inputs(node).for_each(|input| users.entry(input).or_default().push(at));
        }
        let given = self.graph.output.iter().filter_map(|output| output.name.as_deref());
        given.for_each(|output| _ = users.remove(output));
        let nodes = self.graph.node.iter().enumerate();
        nodes.filter_map(|(at, node)| Some(self.limited(self.convolution(at, node)?, &users))).collect()
    }

    /// Takes in the node that limits the values, if that alone uses them.
    fn limited(&self, mut told: Separate, users: &HashMap<&str, Vec<usize>>) -> Separate {
        let Some(&[at]) = users.get(told.output.as_str()).map(Vec::as_slice) else { return told };
        let node = &self.graph.node[at];
        let is_known = |name: &String| self.constants.contains(name.as_str());
        let limits = match (operator(node), node.input.as_slice()) {
            ("Relu", _) => Limits::Positive,
            ("Clip", [_, least, most]) if is_known(least) && is_known(most) => {
                Limits::Held([least.clone(), most.clone()])
            }
            _ => return told,
        };
        if let [output] = node.output.as_slice() {
            told = Separate { limiter: Some(at), output: output.clone(), limits, ..told };
        }
        told
    }

    fn convolution(&self, at: usize, node: &NodeProto) -> Option<Separate> {
        if operator(node) != "Conv" {
            return None;
        }
        let attribute = |name: &str| node.attribute.iter().find(|a| a.name.as_deref() == Some(name));
        let numbers = |name: &str, missing: &[i64]| attribute(name).map_or(missing.to_vec(), |a| a.ints.clone());
        let fixed = |a: &AttributeProto| a.s.as_deref().is_none_or(|s| s.is_empty() || s == "NOTSET");
        let is_plain = attribute("auto_pad").is_none_or(fixed) && numbers("dilations", &[]).iter().all(|&d| d == 1);
        let groups = attribute("group").and_then(|group| group.i).filter(|&groups| groups > 1)?;
        let length = |v: i64, least: i64| (least..=MOST).contains(&v).then_some(v as usize);
        let &[rows, cols] = numbers("strides", &[1, 1]).as_slice() else { return None };
        let &[top, left, bottom, right] = numbers("pads", &[0; 4]).as_slice() else { return None };
        let ([input, kernels, rest @ ..], [output]) = (node.input.as_slice(), node.output.as_slice()) else {
            return None;
        };
        let biases = rest.first().filter(|biases| !biases.is_empty());
        let is_known = |name: &String| self.constants.contains(name.as_str());
        let is_there = is_plain && !is_known(input) && is_known(kernels) && biases.is_none_or(is_known);
        is_there.then_some(Separate {
            node: at,
            limiter: None,
            limits: Limits::None,
            input: input.clone(),
            output: output.clone(),
            kernels: kernels.clone(),
            biases: biases.cloned(),
            groups: usize::try_from(groups).ok()?,
            stride: [length(rows, 1)?, length(cols, 1)?],
            padding: [[length(top, 0)?, length(left, 0)?], [length(bottom, 0)?, length(right, 0)?]],
        })
    }

    /// A network that takes nothing and gives these values, which are constant.
    pub fn holding(&self, values: &[&str]) -> Option<Vec<u8>> {
        self.part(&self.needed(values.iter().copied()), &[], values)
    }

    /// The network that makes the values `wanted`, cut at `convolutions`. A stage takes values from any before it.
    /// `None` if there are too many stages, or one of the values depends on no input.
    pub fn stages(&self, wanted: &[String], convolutions: &[Separate]) -> Option<Vec<Stage>> {
        let cuts: HashMap<usize, usize> = convolutions.iter().enumerate().map(|(at, c)| (c.node, at)).collect();
        let limiters: BTreeSet<usize> = convolutions.iter().filter_map(|c| c.limiter).collect();
        let needed = self.needed(wanted.iter().map(String::as_str));
        // From which stage on there is a value. One that a convolution makes is there for the stage behind it.
        let mut there: HashMap<&str, usize> =
            inputs_of(self.graph).filter_map(|input| Some((input.name.as_deref()?, 0))).collect();
        let mut stages: Vec<Members> = Vec::new();
        for at in needed.difference(&limiters).copied() {
            let node = &self.graph.node[at];
            let Some(stage) = inputs(node).filter_map(|input| there.get(input)).max().copied() else { continue };
            if stage >= MOST_STAGES {
                return None;
            }
            stages.resize_with(stages.len().max(stage + 1), Members::default);
            if let Some(&cut) = cuts.get(&at) {
                stages[stage].convolutions.push(cut);
                there.insert(&convolutions[cut].output, stage + 1);
            } else {
                stages[stage].nodes.insert(at);
                outputs(node).for_each(|output| _ = there.insert(output, stage));
            }
        }
        if !wanted.iter().all(|value| there.contains_key(value.as_str())) {
            return None;
        }
        let given: Vec<BTreeSet<&str>> = stages.iter().map(|stage| self.given_to(stage, &there)).collect();
        let asked = wanted.iter().chain(convolutions.iter().map(|c| &c.input)).map(String::as_str);
        let taken: HashSet<&str> = given.iter().flatten().copied().chain(asked).collect();
        stages.into_iter().zip(given).map(|(stage, given)| self.stage(stage, given, &taken)).collect()
    }

    /// What the nodes of a stage take of what there is from other stages, or from the inputs.
    fn given_to(&self, stage: &Members, there: &HashMap<&str, usize>) -> BTreeSet<&'a str> {
        let nodes = || stage.nodes.iter().map(|&at| &self.graph.node[at]);
        let made: HashSet<&str> = nodes().flat_map(outputs).collect();
        nodes().flat_map(inputs).filter(|value| there.contains_key(value) && !made.contains(value)).collect()
    }

    /// The stage of these members, which takes `given` and makes what is `taken` elsewhere.
    fn stage(&self, members: Members, given: BTreeSet<&str>, taken: &HashSet<&str>) -> Option<Stage> {
        let Members { nodes, convolutions } = members;
        let each = || nodes.iter().map(|&at| &self.graph.node[at]);
        let made: Vec<&str> = each().flat_map(outputs).filter(|value| taken.contains(value)).collect();
        let held = each().flat_map(inputs).filter(|value| self.constants.contains(value));
        let all = nodes.union(&self.needed(held)).copied().collect();
        let given = Vec::from_iter(given);
        let model = if made.is_empty() { None } else { Some(self.part(&all, &given, &made)?) };
        let [inputs, outputs] = [given, made].map(|values| values.into_iter().map(str::to_owned).collect());
        Some(Stage { model, inputs, outputs, convolutions })
    }

    /// The nodes that values are made by, directly or not.
    fn needed<'v>(&self, values: impl Iterator<Item = &'v str>) -> BTreeSet<usize> {
        let mut needed = BTreeSet::new();
        let mut open: Vec<usize> = values.filter_map(|value| self.makers.get(value)).copied().collect();
        while let Some(at) = open.pop() {
            if needed.insert(at) {
                open.extend(inputs(&self.graph.node[at]).filter_map(|input| self.makers.get(input)));
            }
        }
        needed
    }

    /// A network of some of the nodes, in ONNX's format.
    fn part(&self, nodes: &BTreeSet<usize>, inputs: &[&str], outputs: &[&str]) -> Option<Vec<u8>> {
        let value = |name: &&str| {
            let declared = self.graph.input.iter().find(|input| input.name.as_deref() == Some(name));
            declared.cloned().unwrap_or(ValueInfoProto { name: Some((*name).to_owned()), r#type: None })
        };
        let node: Vec<NodeProto> = nodes.iter().map(|&at| self.graph.node[at].clone()).collect();
        let used: HashSet<&str> = node.iter().flat_map(self::inputs).chain(outputs.iter().copied()).collect();
        let held = self.graph.initializer.iter().filter(|t| t.name.as_deref().is_some_and(|name| used.contains(name)));
        let initializer = held.cloned().collect();
        let [input, output] = [inputs, outputs].map(|names| names.iter().map(value).collect());
        let model = ModelProto {
            ir_version: self.model.ir_version,
            graph: Some(GraphProto { node, initializer, input, output, value_info: Vec::new() }),
            opset_import: self.model.opset_import.clone(),
            ..ModelProto::default()
        };
        model.write_buf().ok()
    }
}

/// What a node computes, if it is one of ONNX's own operators.
fn operator(node: &NodeProto) -> &str {
    let is_own = node.domain.as_deref().is_none_or(str::is_empty);
    node.op_type.as_deref().filter(|_| is_own).unwrap_or_default()
}

fn inputs(node: &NodeProto) -> impl Iterator<Item = &str> {
    node.input.iter().map(String::as_str).filter(|name| !name.is_empty())
}

fn outputs(node: &NodeProto) -> impl Iterator<Item = &str> {
    node.output.iter().map(String::as_str).filter(|name| !name.is_empty())
}
