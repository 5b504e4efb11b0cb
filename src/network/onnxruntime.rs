//! Inference by ONNX Runtime, whose shared library is opened elsewhere.

use ort::environment::Environment;
use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, Session, SessionInputValue};
use ort::value::{Outlet, TensorRef, ValueType};

use super::backend::{Backend, Input, Outputs, Refusal, RunError, fill};
use crate::features::FeatureMap;

/// The library, opened.
#[derive(Clone)]
pub struct Runtime {
    environment: Environment,
}

struct OnnxRuntime {
    session: Session,
    outputs: Vec<String>,
    options: RunOptions<HasSelectedOutputs>,
}

impl Runtime {
    /// The library that made this environment.
    pub fn new(environment: Environment) -> Self {
        Self { environment }
    }

    /// Loads a model.
    pub(super) fn load(&self, model: &[u8], outputs: Outputs, threads: usize) -> Result<Box<dyn Backend>, Refusal> {
        let format = |error: ort::Error| Refusal::Format(error.to_string());
        let session = Session::builder(&self.environment)
            .and_then(|builder| Ok(builder.with_intra_threads(threads)?))
            .and_then(|mut builder| builder.commit_from_memory(model))
            .map_err(format)?;
        let known: Vec<String> = session.outputs().iter().map(|output| output.name().to_owned()).collect();
        let outputs = outputs.among(&known)?;
        let selector = outputs.iter().fold(OutputSelector::no_default(), |selector, name| selector.with(name));
        let options = RunOptions::new().map_err(format)?.with_outputs(selector);
        Ok(Box::new(OnnxRuntime { session, outputs, options }))
    }
}

impl Backend for OnnxRuntime {
    fn inputs(&self) -> Vec<Vec<Option<usize>>> {
        let declared = |input: &Outlet| match input.dtype() {
            ValueType::Tensor { shape, .. } => shape.iter().map(|&side| usize::try_from(side).ok()).collect(),
            _ => Vec::new(),
        };
        self.session.inputs().iter().map(declared).collect()
    }

    fn run(&mut self, inputs: &[Input], maps: &mut [FeatureMap]) -> Result<(), RunError> {
        let failed = |error: ort::Error| RunError::Library { why: error.to_string() };
        let given: Vec<SessionInputValue> = inputs.iter().map(tensor).collect::<ort::Result<_>>().map_err(failed)?;
        let values = self.session.run_with_options(given.as_slice(), &self.options).map_err(failed)?;
        for (name, map) in self.outputs.iter().zip(maps) {
            let (shape, data) = values[name.as_str()].try_extract_tensor::<f32>().map_err(failed)?;
            fill(map, shape.iter().map(|&side| side as usize), data)?;
        }
        Ok(())
    }
}

fn tensor<'a>(input: &Input<'a>) -> ort::Result<SessionInputValue<'a>> {
    Ok(TensorRef::from_array_view((input.shape, input.data))?.into())
}
