//! The benchmark sequences, which may not be shipped.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The folder of a sequence, below the one that `SEQUENCES_DIR` names. Where that is not set, `None` and a line that
/// tells of the test as skipped; but where `SEQUENCES_MUST_RUN` is, as in CI that has them, what needs them must run.
///
/// The line goes to standard error itself: what tests print is shown of those that fail only.
pub fn sequence(name: &str) -> Option<PathBuf> {
    if let Some(root) = std::env::var_os("SEQUENCES_DIR") {
        return Some(Path::new(&root).join(name));
    }
    let must_run = std::env::var_os("SEQUENCES_MUST_RUN").is_some();
    assert!(!must_run, "SEQUENCES_MUST_RUN is set, but SEQUENCES_DIR is not");
    let test = std::thread::current();
    // Whether it can be told is not what is tested.
    let _ = writeln!(std::io::stderr(), "{} ({name}): skipped: no SEQUENCES_DIR", test.name().unwrap_or_default());
    None
}
