//! The benchmark sequences, which may not be shipped.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The folder of a sequence, below the one that `SEQUENCES_DIR` names. Where that is not set, `None` and a line that
/// tells of the test as skipped; but where a check-out has the sequences beside it, CI must run what needs them.
///
/// The line goes to standard error itself: what tests print is shown of those that fail only.
pub fn sequence(name: &str) -> Option<PathBuf> {
    if let Some(root) = std::env::var_os("SEQUENCES_DIR") {
        return Some(Path::new(&root).join(name));
    }
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/sequences");
    let is_ci = std::env::var_os("CI").is_some();
    assert!(!(is_ci && beside.is_dir()), "SEQUENCES_DIR is not set, but there is {}", beside.display());
    let test = std::thread::current();
    // Whether it can be told is not what is tested.
    let _ = writeln!(std::io::stderr(), "{} ({name}): skipped: no SEQUENCES_DIR", test.name().unwrap_or_default());
    None
}
