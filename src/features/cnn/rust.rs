//! Inference in pure Rust, by rten.

use std::borrow::Cow;
use std::sync::Arc;

use rten::{Dimension, Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value};
use rten_tensor::NdTensorView;
use rten_tensor::prelude::*;

use super::network::{self, Loaded, Network, Refusal, fill};
use crate::features::FeatureMap;

/// Its name in log lines.
pub(super) const NAME: &str = "rten";

struct Rten {
    model: Model,
    input: NodeId,
    outputs: Vec<NodeId>,
    options: RunOptions,
}

/// Loads a model.
pub(super) fn load(model: network::Model, outputs: &[String], threads: usize) -> Result<Loaded, Refusal> {
    let mut options = ModelOptions::with_all_ops();
    options.prepack_weights(true);
    let model = match model {
        Cow::Borrowed(bytes) => options.load_static_slice(bytes),
        Cow::Owned(bytes) => options.load(bytes),
    };
    let model = model.map_err(|error| Refusal::Format(error.to_string()))?;
    let &[input] = model.input_ids() else { return Err(Refusal::Inputs(model.input_ids().len())) };
    let name = |id: NodeId| model.node_info(id).and_then(|info| info.name().map(str::to_owned)).unwrap_or_default();
    let known: Vec<(String, NodeId)> = model.output_ids().iter().map(|&id| (name(id), id)).collect();
    let find = |wanted: &String| {
        known.iter().find(|(name, _)| name == wanted).map(|&(_, id)| id).ok_or_else(|| Refusal::Output {
            name: wanted.clone(),
            known: known.iter().map(|(name, _)| name.clone()).collect(),
        })
    };
    let outputs = outputs.iter().map(find).collect::<Result<_, _>>()?;
    let pool = Arc::new(ThreadPool::with_num_threads(threads));
    let options = RunOptions::default().with_thread_pool(Some(pool));
    Ok(Box::new(Rten { model, input, outputs, options }))
}

impl Network for Rten {
    fn input(&self) -> Vec<Option<usize>> {
        let fixed = |side: &Dimension| match side {
            Dimension::Fixed(side) => Some(*side),
            Dimension::Symbolic(_) => None,
        };
        self.model.input_shape(0).unwrap_or_default().iter().map(fixed).collect()
    }

    fn run(&mut self, image: &[f32], side: usize, maps: &mut [FeatureMap]) -> Result<(), String> {
        let image = NdTensorView::from_data([1, 3, side, side], image);
        let inputs = vec![(self.input, image.into())];
        let values =
            self.model.run(inputs, &self.outputs, Some(self.options.clone())).map_err(|error| error.to_string())?;
        for (value, map) in values.into_iter().zip(maps) {
            let Value::FloatTensor(tensor) = value else {
                return Err("an output holds no floats".to_owned());
            };
            let tensor = tensor.into_contiguous();
            fill(map, tensor.shape().iter().copied(), tensor.data())?;
        }
        Ok(())
    }
}
