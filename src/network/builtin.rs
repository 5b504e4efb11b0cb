//! Inference by RTen, which is built in; but for depthwise convolutions, which are computed here: by RTen they take
//! three quarters of the time of the embedded network.

use std::collections::HashSet;
use std::fmt::Display;
use std::sync::Arc;

use rten::{Model, NodeId, RunOptions, ThreadPool, Value, ValueOrView, ValueView};
use rten_onnx::onnx::{ModelProto, ValueInfoProto};
use rten_tensor::{Layout, TensorView};

use super::backend::{Backend, Input, Outputs, Refusal, RunError, fill};
use super::declared::{inputs_of, sides_of};
use super::depthwise::Depthwise;
use super::stages::{Graph, Separate, Stage};
use crate::features::FeatureMap;

/// A network in stages. Values are known by their places in `values`.
struct Staged {
    declared: Vec<Vec<Option<usize>>>,
    stages: Vec<Loaded>,
    /// What the last run made. The first places are those of the inputs, which nothing is put in.
    values: Vec<Option<Value>>,
    wanted: Vec<usize>,
    pool: Arc<ThreadPool>,
}

/// A stage that can be run.
struct Loaded {
    model: Option<Model>,
    inputs: Vec<(NodeId, usize)>,
    outputs: Vec<NodeId>,
    made: Vec<usize>,
    convolutions: Vec<(usize, Depthwise, usize)>,
}

/// Loads a model.
pub(super) fn load(model: &[u8], outputs: Outputs, threads: usize) -> Result<Box<dyn Backend>, Refusal> {
    let parsed = ModelProto::parse_buf(model).map_err(|error| Refusal::Format(error.to_string()))?;
    let graph = parsed.graph.as_ref().ok_or_else(|| Refusal::Format("it has no graph".to_owned()))?;
    let name = |value: &ValueInfoProto| value.name.clone().unwrap_or_default();
    let wanted = outputs.among(&graph.output.iter().map(name).collect::<Vec<_>>())?;
    let mut names: Vec<String> = inputs_of(graph).map(name).collect();

    let cut = Graph::of(&parsed).and_then(|graph| {
        let convolutions = depthwise(&graph)?;
        let cuts: Vec<Separate> = convolutions.iter().map(|(cut, _)| cut.clone()).collect();
        Some((graph.stages(&wanted, &cuts)?, convolutions))
    });
    let whole = || Stage {
        model: Some(model.to_vec()),
        inputs: names.clone(),
        outputs: wanted.clone(),
        convolutions: Vec::new(),
    };
    let (stages, convolutions) = cut.unwrap_or_else(|| (vec![whole()], Vec::new()));
    let loaded = stages.into_iter().map(|stage| Loaded::new(stage, &convolutions, &mut names));
    let stages = loaded.collect::<Result<_, _>>()?;
    Ok(Box::new(Staged {
        declared: inputs_of(graph).map(sides_of).collect(),
        stages,
        wanted: wanted.iter().map(|value| place(&mut names, value)).collect(),
        values: names.iter().map(|_| None).collect(),
        pool: Arc::new(ThreadPool::with_num_threads(threads)),
    }))
}

/// The depthwise convolutions of a network; `None` if there is none.
fn depthwise(graph: &Graph) -> Option<Vec<(Separate, Depthwise)>> {
    let found = graph.convolutions();
    let held: HashSet<&str> = found.iter().flat_map(Separate::held).collect();
    let model = Model::load(graph.holding(&Vec::from_iter(held))?).ok()?;
    let value = |name: &str| model.run(Vec::new(), &[model.node_id(name).ok()?], None).ok()?.pop();
    let made: Vec<_> = found.into_iter().filter_map(|c| Depthwise::new(&c, value).map(|made| (c, made))).collect();
    (!made.is_empty()).then_some(made)
}

/// The place of a value, a new one if it has none.
fn place(names: &mut Vec<String>, value: &str) -> usize {
    names.iter().position(|name| name == value).unwrap_or_else(|| {
        names.push(value.to_owned());
        names.len() - 1
    })
}

impl Loaded {
    fn new(stage: Stage, convolutions: &[(Separate, Depthwise)], names: &mut Vec<String>) -> Result<Self, Refusal> {
        let Stage { model, inputs, outputs, convolutions: following } = stage;
        let refused = |why: &dyn Display| Refusal::Format(why.to_string());
        let model = model.map(Model::load).transpose().map_err(|error| refused(&error))?;
        let mut loaded =
            Self { model, inputs: Vec::new(), outputs: Vec::new(), made: Vec::new(), convolutions: Vec::new() };
        if let Some(model) = &loaded.model {
            let id = |name: &String| model.node_id(name).map_err(|error| refused(&error));
            for name in &inputs {
                loaded.inputs.push((id(name)?, place(names, name)));
            }
            for name in &outputs {
                loaded.outputs.push(id(name)?);
                loaded.made.push(place(names, name));
            }
        }
        for (cut, made) in following.into_iter().map(|at| &convolutions[at]) {
            loaded.convolutions.push((place(names, &cut.input), made.clone(), place(names, &cut.output)));
        }
        Ok(loaded)
    }

    /// Computes what it makes of the inputs and of what the stages before it made.
    fn run(&self, inputs: &[Input], values: &mut [Option<Value>], options: &RunOptions) -> Result<(), RunError> {
        if let Some(model) = &self.model {
            let given = self.inputs.iter().map(|&(id, at)| Ok((id, given(inputs, values, at)?)));
            let given = given.collect::<Result<_, RunError>>()?;
            let made = model.run(given, &self.outputs, Some(options.clone())).map_err(failed)?;
            self.made.iter().zip(made).for_each(|(&at, value)| values[at] = Some(value));
        }
        for (from, convolution, to) in &self.convolutions {
            let made = match given(inputs, values, *from)? {
                ValueOrView::View(ValueView::FloatTensor(image)) => convolution.run(image)?,
                _ => return Err(RunError::NoFloats),
            };
            values[*to] = Some(made.into());
        }
        Ok(())
    }
}

/// A value that a run is given, or has made.
fn given<'a>(inputs: &'a [Input], values: &'a [Option<Value>], at: usize) -> Result<ValueOrView<'a>, RunError> {
    match (inputs.get(at), &values[at]) {
        (Some(input), _) => Ok(TensorView::from_data(&input.shape[..], input.data).into()),
        (None, Some(value)) => Ok(value.into()),
        (None, None) => Err(RunError::Library { why: "a value is missing".to_owned() }),
    }
}

fn failed(error: rten::RunError) -> RunError {
    RunError::Library { why: error.to_string() }
}

impl Backend for Staged {
    fn inputs(&self) -> Vec<Vec<Option<usize>>> {
        self.declared.clone()
    }

    fn run(&mut self, inputs: &[Input], maps: &mut [FeatureMap]) -> Result<(), RunError> {
        let Self { stages, values, wanted, pool, .. } = self;
        let options = RunOptions::default().with_thread_pool(Some(pool.clone()));
        pool.run(|| stages.iter().try_for_each(|stage| stage.run(inputs, values, &options)))?;
        for (&at, map) in wanted.iter().zip(maps) {
            let ValueOrView::View(ValueView::FloatTensor(value)) = given(inputs, values, at)? else {
                return Err(RunError::NoFloats);
            };
            fill(map, value.shape().iter().copied(), value.to_contiguous().data())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rten_onnx::onnx::{
        AttributeProto, AttributeType, DataType, GraphProto, NodeProto, OperatorSetIdProto, TensorProto,
    };

    use super::*;

    fn named(name: &str) -> ValueInfoProto {
        ValueInfoProto { name: Some(name.to_owned()), r#type: None }
    }

    fn node(op: &str, inputs: &[&str], output: &str, attributes: &[(&str, &[i64])]) -> NodeProto {
        let attribute = |&(name, ints): &(&str, &[i64])| AttributeProto {
            name: Some(name.to_owned()),
            r#type: Some(if ints.len() == 1 { AttributeType::INT } else { AttributeType::INTS }),
            i: (ints.len() == 1).then(|| ints[0]),
            ints: if ints.len() == 1 { Vec::new() } else { ints.to_vec() },
            ..AttributeProto::default()
        };
        NodeProto {
            op_type: Some(op.to_owned()),
            name: Some(output.to_owned()),
            input: inputs.iter().map(|&input| input.to_owned()).collect(),
            output: vec![output.to_owned()],
            attribute: attributes.iter().map(attribute).collect(),
            ..NodeProto::default()
        }
    }

    fn tensor(name: &str, dims: &[i64]) -> TensorProto {
        let count = dims.iter().product::<i64>();
        TensorProto {
            name: Some(name.to_owned()),
            dims: dims.to_vec(),
            data_type: Some(DataType::FLOAT),
            float_data: (0..count).map(|i| (i * 37 % 19) as f32 / 19.0 - 0.4).collect(),
            ..TensorProto::default()
        }
    }

    /// Convolutions of two channels, most of them depthwise: on the input, one behind the other, with values that are
    /// limited, added later, or wanted, by kernels that are computed, dilated, and in groups.
    fn network() -> ModelProto {
        let shape = ("kernel_shape", &[3i64, 3][..]);
        let depthwise: &[(&str, &[i64])] = &[shape, ("group", &[2]), ("pads", &[1, 1, 1, 1])];
        let dilated: &[(&str, &[i64])] = &[shape, ("group", &[2]), ("dilations", &[2, 2]), ("pads", &[2, 2, 2, 2])];
        let halved: &[(&str, &[i64])] = &[shape, ("group", &[2]), ("strides", &[2, 2])];
        let graph = GraphProto {
            node: vec![
                node("Mul", &["three", "three"], "computed", &[]),
                node("Conv", &["image", "three", "bias"], "first", depthwise),
                node("Conv", &["first", "computed"], "second", depthwise),
                node("Relu", &["second"], "rectified", &[]),
                node("Conv", &["rectified", "three"], "third", depthwise),
                node("Clip", &["third", "low", "high"], "clipped", &[]),
                node("Add", &["clipped", "first"], "sum", &[]),
                node("Conv", &["sum", "three"], "dilated", dilated),
                node("Conv", &["dilated", "wide"], "widened", &[("kernel_shape", &[1, 1]), ("group", &[2])]),
                node("Conv", &["dilated", "three"], "last", halved),
                node("Relu", &["last"], "rectified_last", &[]),
                node("Relu", &["widened"], "unwanted", &[]),
            ],
            initializer: vec![
                tensor("three", &[2, 1, 3, 3]),
                tensor("bias", &[2]),
                tensor("wide", &[4, 1, 1, 1]),
                TensorProto { float_data: vec![0.1], ..tensor("low", &[]) },
                TensorProto { float_data: vec![0.3], ..tensor("high", &[]) },
            ],
            input: vec![named("image"), named("three")],
            output: ["rectified_last", "second", "widened", "unwanted"].map(named).to_vec(),
            value_info: Vec::new(),
        };
        let opset = OperatorSetIdProto { version: Some(13), ..OperatorSetIdProto::default() };
        ModelProto { ir_version: Some(7), graph: Some(graph), opset_import: vec![opset], ..ModelProto::default() }
    }

    /// What RTen computes by itself, and what is computed in stages.
    fn both(model: &[u8], outputs: &[&str], channels: usize, side: usize) -> [Vec<FeatureMap>; 2] {
        let image: Vec<f32> = (0..channels * side * side).map(|i| (i * 7919 % 255) as f32 / 127.0 - 1.0).collect();
        let shape = [1, channels, side, side];
        let whole = Model::load(model.to_vec()).unwrap();
        let ids: Vec<NodeId> = outputs.iter().map(|name| whole.node_id(name).unwrap()).collect();
        let given = (whole.input_ids()[0], TensorView::from_data(&shape[..], image.as_slice()).into());
        let values = whole.run(vec![given], &ids, None).unwrap();
        let whole = values.iter().map(|value| {
            let (mut map, view) = (FeatureMap::default(), value.as_tensor_view::<f32>().unwrap());
            fill(&mut map, view.shape().iter().copied(), view.to_contiguous().data()).unwrap();
            map
        });
        let names: Vec<String> = outputs.iter().map(|&name| name.to_owned()).collect();
        let Ok(mut staged) = load(model, Outputs::Named(&names), 2) else { panic!("it is loaded") };
        let mut maps = vec![FeatureMap::default(); outputs.len()];
        for _ in 0..2 {
            staged.run(&[Input { shape, data: &image }], &mut maps).unwrap();
        }
        [whole.collect(), maps]
    }

    fn assert_alike([whole, staged]: [Vec<FeatureMap>; 2]) {
        for (whole, staged) in whole.iter().zip(&staged) {
            assert_eq!([whole.channels, whole.rows, whole.cols], [staged.channels, staged.rows, staged.cols]);
            let size = (whole.data.iter().map(|v| v * v).sum::<f32>() / whole.data.len() as f32).sqrt();
            assert!(whole.data.iter().zip(&staged.data).all(|(a, b)| (a - b).abs() < 1e-4 * size));
        }
    }

    #[test]
    fn a_network_in_stages_gives_what_it_gives_as_a_whole() {
        let model = network().write_buf().unwrap();
        assert_alike(both(&model, &["widened", "second", "rectified_last"], 2, 9));
        assert_alike(both(crate::loader::EMBEDDED, &["block10", "block4"], 3, 96));
    }

    #[test]
    fn the_depthwise_convolutions_are_those_that_are_computed_here() {
        let taken = |model: &ModelProto| -> Vec<String> {
            let found = depthwise(&Graph::of(model).unwrap()).unwrap_or_default();
            found.into_iter().map(|(cut, _)| cut.output).collect()
        };
        assert_eq!(taken(&network()), ["first", "second", "clipped", "rectified_last"]);
        assert_eq!(taken(&ModelProto::parse_buf(crate::loader::EMBEDDED).unwrap()).len(), 11);
    }

    #[test]
    fn what_is_not_wanted_is_not_computed() {
        let model = network();
        let graph = Graph::of(&model).unwrap();
        let cuts: Vec<Separate> = depthwise(&graph).unwrap().into_iter().map(|(cut, _)| cut).collect();
        let stages = graph.stages(&["second".to_owned()], &cuts).unwrap();
        assert_eq!(stages.iter().map(|stage| stage.convolutions.clone()).collect::<Vec<_>>(), [[0], [1]]);
        assert!(stages.iter().all(|stage| stage.model.is_none()), "nothing stands between them");
    }

    #[test]
    fn a_graph_that_cannot_be_cut_is_left_to_the_library() {
        let mut disordered = network();
        disordered.graph.as_mut().unwrap().node.reverse();
        assert!(Graph::of(&disordered).is_none());
        let mut nested = network();
        let attribute = AttributeProto { g: Some(GraphProto::default()), ..AttributeProto::default() };
        nested.graph.as_mut().unwrap().node[3].attribute.push(attribute);
        assert!(Graph::of(&nested).is_none());
    }
}
