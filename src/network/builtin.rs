//! Inference by tract, which is built in.

use std::sync::Arc;

use tract_linalg::multithread::{Executor, multithread_tract_scope};
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::GenericFactoid;
use tract_onnx::tract_hir::internal::DimLike;

use super::backend::{Backend, Input, Outputs, Refusal, RunError, fill};
use super::depthwise;
use crate::features::FeatureMap;

/// Shapes of the inputs that plans are kept for: those of a template and of a search window.
const PLANS: usize = 2;

/// A network, and what was made of it for inputs of some shapes.
struct Tract {
    model: InferenceModel,
    plans: Vec<Plan>,
    executor: Executor,
}

/// A network made for inputs of these shapes.
struct Plan {
    shapes: Vec<[usize; 4]>,
    model: Arc<TypedRunnableModel>,
}

/// Loads a model.
pub(super) fn load(model: &[u8], outputs: Outputs, threads: usize) -> Result<Box<dyn Backend>, Refusal> {
    let parsed = tract_onnx::onnx().model_for_read(&mut &*model);
    let mut model = parsed.map_err(|error| Refusal::Format(why(&error)))?;
    let name = |outlet: &OutletId| {
        let label = model.outlet_label(*outlet);
        label.map_or_else(|| model.node(outlet.node).name.clone(), str::to_owned)
    };
    let known: Vec<String> = model.outputs.iter().map(name).collect();
    let wanted = outputs.among(&known)?;
    let outlets = wanted.iter().filter_map(|name| known.iter().position(|known| known == name));
    model.outputs = outlets.map(|at| model.outputs[at]).collect();
    let executor = if threads > 1 { Executor::multithread(threads) } else { Executor::SingleThread };
    Ok(Box::new(Tract { model, plans: Vec::with_capacity(PLANS), executor }))
}

impl Tract {
    /// The plan for inputs of such shapes, made if there is none.
    fn plan(&mut self, inputs: &[Input]) -> TractResult<&Plan> {
        let fits = |plan: &Plan| plan.shapes.iter().eq(inputs.iter().map(|input| &input.shape));
        let at = match self.plans.iter().position(fits) {
            Some(at) => at,
            None => {
                let shapes: Vec<[usize; 4]> = inputs.iter().map(|input| input.shape).collect();
                let model = optimised(&self.model, &shapes)?;
                if self.plans.len() == PLANS {
                    self.plans.remove(0);
                }
                self.plans.push(Plan { shapes, model });
                self.plans.len() - 1
            }
        };
        Ok(&self.plans[at])
    }
}

impl Backend for Tract {
    fn inputs(&self) -> Vec<Vec<Option<usize>>> {
        let side = |side: &GenericFactoid<TDim>| match side {
            GenericFactoid::Only(side) => side.to_usize().ok(),
            GenericFactoid::Any => None,
        };
        let declared = |index| self.model.input_fact(index).map(|fact| fact.shape.dims().map(side).collect());
        (0..self.model.inputs.len()).map(|index| declared(index).unwrap_or_default()).collect()
    }

    fn run(&mut self, inputs: &[Input], maps: &mut [FeatureMap]) -> Result<(), RunError> {
        let failed = |error: TractError| RunError::Library { why: why(&error) };
        let executor = self.executor.clone();
        let plan = self.plan(inputs).map_err(failed)?;
        let tensor = |input: &Input| Ok(Tensor::from_shape(&input.shape, input.data)?.into());
        let compute = || plan.model.run(inputs.iter().map(tensor).collect::<TractResult<_>>()?);
        let values = multithread_tract_scope(executor, compute).map_err(failed)?;
        for (value, map) in values.iter().zip(maps) {
            let plain = value.as_plain_ram().ok_or(RunError::NoFloats)?;
            let data = plain.as_slice::<f32>().map_err(failed)?;
            fill(map, value.shape().iter().copied(), data)?;
        }
        Ok(())
    }
}

/// The model, optimised for inputs of these shapes.
fn optimised(model: &InferenceModel, shapes: &[[usize; 4]]) -> TractResult<Arc<TypedRunnableModel>> {
    let mut model = model.clone();
    for (input, shape) in shapes.iter().enumerate() {
        model.set_input_fact(input, f32::fact(shape).into())?;
    }
    let mut model = model.into_typed()?.into_decluttered()?;
    depthwise::replace(&mut model)?;
    model.into_optimized()?.into_runnable()
}

/// What an error says, with its causes, on one line.
fn why(error: &TractError) -> String {
    format!("{error:#}")
}
