//! Published matching networks, which users download and the project does not ship.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The files of backbone and head of NanoTrack's version `version` in the folder that `MODELS_DIR` names. Where that is
/// not set, `None` and a line that tells of the test as skipped; but where `MODELS_MUST_RUN` is, as in CI that has
/// them, what needs them must run.
pub fn nanotrack(version: u32) -> Option<[PathBuf; 2]> {
    if let Some(root) = std::env::var_os("MODELS_DIR") {
        let file = |part: &str| Path::new(&root).join(format!("nanotrackv{version}_{part}.onnx"));
        return Some([file("backbone"), file("head")]);
    }
    let must_run = std::env::var_os("MODELS_MUST_RUN").is_some();
    assert!(!must_run, "MODELS_MUST_RUN is set, but MODELS_DIR is not");
    let test = std::thread::current();
    // Whether it can be told is not what is tested.
    let _ = writeln!(std::io::stderr(), "{}: skipped: no MODELS_DIR", test.name().unwrap_or_default());
    None
}
