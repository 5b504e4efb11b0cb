//! Which library runs a network, and what all networks share.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::backend::{Backend, Outputs, Refusal};
use super::builtin;
use crate::crop::Patch;
use crate::error::NetworkError;

/// What runs a network.
#[derive(Clone)]
pub enum Engine {
    /// The built-in library.
    Builtin,
    /// ONNX Runtime, which has been opened.
    #[cfg(feature = "onnxruntime")]
    OnnxRuntime(super::onnxruntime::Runtime),
}

impl Engine {
    pub(super) fn load(&self, model: &[u8], outputs: Outputs, threads: usize) -> Result<Box<dyn Backend>, Refusal> {
        match self {
            Self::Builtin => builtin::load(model, outputs, threads),
            #[cfg(feature = "onnxruntime")]
            Self::OnnxRuntime(runtime) => runtime.load(model, outputs, threads),
        }
    }
}

/// The network behind the lock; nobody else uses it while a tracker does.
pub fn locked<T>(network: &Mutex<T>) -> MutexGuard<'_, T> {
    network.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The three planes of a patch in a network's order. A patch without colour is grey.
pub(super) fn planes(patch: &Patch, bgr: bool) -> impl Iterator<Item = &Vec<u8>> {
    let planes = patch.planes();
    (0..3).map(move |channel| planes.get(if bgr { 2 - channel } else { channel }).unwrap_or(&planes[0]))
}

/// A declared shape in messages.
pub(super) fn shape(declared: &[Option<usize>]) -> String {
    let length = |d: &Option<usize>| d.map_or("?".to_owned(), |d| d.to_string());
    declared.iter().map(length).collect::<Vec<_>>().join(" x ")
}

pub(super) fn refused(refusal: Refusal, file: &str) -> NetworkError {
    let file = file.to_owned();
    match refusal {
        Refusal::Format(why) => NetworkError::Format { file, why: why.replace('\n', " ") },
        Refusal::Output { name, known } => NetworkError::Output { file, name, known: known.join(", ") },
        Refusal::Outputs(count) => NetworkError::Matching { file, why: format!("it has {count} outputs") },
    }
}
