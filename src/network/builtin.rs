//! Inference by tract, which is built in.

use std::sync::Arc;

use tract_linalg::multithread::{Executor, multithread_tract_scope};
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::GenericFactoid;
use tract_onnx::tract_hir::internal::DimLike;

use super::backend::{Backend, Model, Refusal, RunError, fill};
use super::depthwise;
use crate::features::FeatureMap;

/// A network, and what was made of it for inputs of one size.
struct Tract {
    model: InferenceModel,
    plan: Option<(usize, Arc<TypedRunnableModel>)>,
    executor: Executor,
}

/// Loads a model.
pub(super) fn load(model: Model, outputs: &[String], threads: usize) -> Result<Box<dyn Backend>, Refusal> {
    let parsed = tract_onnx::onnx().model_for_read(&mut model.as_ref());
    let mut model = parsed.map_err(|error| Refusal::Format(why(&error)))?;
    if model.inputs.len() != 1 {
        return Err(Refusal::Inputs(model.inputs.len()));
    }
    let name = |outlet: &OutletId| {
        let label = model.outlet_label(*outlet);
        label.map_or_else(|| model.node(outlet.node).name.clone(), str::to_owned)
    };
    let known: Vec<(String, OutletId)> = model.outputs.iter().map(|outlet| (name(outlet), *outlet)).collect();
    let find = |wanted: &String| {
        known.iter().find(|(name, _)| name == wanted).map(|&(_, outlet)| outlet).ok_or_else(|| Refusal::Output {
            name: wanted.clone(),
            known: known.iter().map(|(name, _)| name.clone()).collect(),
        })
    };
    model.outputs = outputs.iter().map(find).collect::<Result<_, _>>()?;
    let executor = if threads > 1 { Executor::multithread(threads) } else { Executor::SingleThread };
    Ok(Box::new(Tract { model, plan: None, executor }))
}

impl Backend for Tract {
    fn input(&self) -> Vec<Option<usize>> {
        let Ok(fact) = self.model.input_fact(0) else { return Vec::new() };
        let side = |side: &GenericFactoid<TDim>| match side {
            GenericFactoid::Only(side) => side.to_usize().ok(),
            GenericFactoid::Any => None,
        };
        fact.shape.dims().map(side).collect()
    }

    fn run(&mut self, image: &[f32], side: usize, maps: &mut [FeatureMap]) -> Result<(), RunError> {
        let failed = |error: TractError| RunError::Library { why: why(&error) };
        let shape = [1, 3, side, side];
        let plan = match &self.plan {
            Some((planned, plan)) if *planned == side => plan.clone(),
            _ => {
                let plan = optimised(&self.model, shape).map_err(failed)?;
                self.plan.insert((side, plan)).1.clone()
            }
        };
        let compute = || -> TractResult<_> { plan.run(tvec!(Tensor::from_shape(&shape, image)?.into())) };
        let values = multithread_tract_scope(self.executor.clone(), compute).map_err(failed)?;
        for (value, map) in values.iter().zip(maps) {
            let plain = value.as_plain_ram().ok_or(RunError::NoFloats)?;
            let data = plain.as_slice::<f32>().map_err(failed)?;
            fill(map, value.shape().iter().copied(), data)?;
        }
        Ok(())
    }
}

/// The model, optimised for inputs of a shape.
fn optimised(model: &InferenceModel, shape: [usize; 4]) -> TractResult<Arc<TypedRunnableModel>> {
    let mut model = model.clone().with_input_fact(0, f32::fact(shape).into())?.into_typed()?.into_decluttered()?;
    depthwise::replace(&mut model)?;
    model.into_optimized()?.into_runnable()
}

/// What an error says, with its causes, on one line.
fn why(error: &TractError) -> String {
    format!("{error:#}")
}
