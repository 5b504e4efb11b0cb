//! Convolutional networks that run on image patches.
//!
//! A network is handed in as bytes, and so is the library that runs it: nothing here reads a file or the environment,
//! or writes to a log. [`loader`](crate::loader) does that.
//!
//! | file | what it holds |
//! |---|---|
//! | `backend.rs` | what a library that runs networks must do |
//! | `engine.rs` | which library runs a network, and what all networks share |
//! | `builtin.rs` | inference by RTen, which is built in |
//! | `stages.rs` | a network cut at its depthwise convolutions, which RTen is slow at |
//! | `depthwise.rs` | depthwise convolutions |
//! | `onnxruntime.rs` | inference by ONNX Runtime |
//! | `cnn.rs` | a network that takes an image, and whose outputs are maps of features |
//! | `matching.rs` | two networks that find a template in a search window |
//! | `declared.rs` | what an ONNX file declares of its inputs, and freeing it of that |

mod backend;
mod builtin;
mod cnn;
mod declared;
mod depthwise;
mod engine;
mod matching;
#[cfg(feature = "onnxruntime")]
mod onnxruntime;
mod stages;

use std::sync::Arc;

pub use backend::{Model, RunError};
pub use cnn::{Cnn, NetworkSettings, SharedCnn};
pub use engine::{Engine, locked};
pub use matching::{Framing, MatchingForm, MatchingNetwork, SharedMatching, TRUNK_OUTPUTS, TRUNK_SIDE};
#[cfg(feature = "onnxruntime")]
pub use onnxruntime::Runtime;

/// The networks that a tracker uses.
#[derive(Clone, Debug, Default)]
pub struct Networks {
    /// Whose outputs become layers.
    pub cnn: Option<SharedCnn>,
    /// Which finds the target as it was marked.
    pub matching: Option<SharedMatching>,
}

impl Networks {
    /// Whether both are the same.
    pub fn are(&self, other: &Self) -> bool {
        same(&self.cnn, &other.cnn) && same(&self.matching, &other.matching)
    }

    /// Why the last run of one of them failed, if it did.
    pub fn failure(&self) -> Option<String> {
        let told = |name: &str, why: &RunError| format!("network {name}: {why}");
        let cnn = || {
            let cnn = locked(self.cnn.as_ref()?);
            cnn.failure().map(|why| told(cnn.name(), why))
        };
        let matching = || {
            let matching = locked(self.matching.as_ref()?);
            matching.failure().map(|why| told(matching.name(), why))
        };
        cnn().or_else(matching)
    }
}

/// Whether both are the same network, or none.
fn same<T>(a: &Option<Arc<T>>, b: &Option<Arc<T>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (a, b) => a.is_none() && b.is_none(),
    }
}
