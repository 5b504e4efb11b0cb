//! What `--version` says of a build: the package's version, the commit that was checked out, and the cargo features.

use std::env;
use std::process::Command;

/// What the programs are made of. A change of anything else, a commit included, compiles nothing again.
const MADE_OF: [&str; 6] = ["Cargo.lock", "build.rs", "msg", "params", "patches", "src"];
/// Digits of a commit's name.
const DIGITS: &str = "--abbrev=12";
/// Says the commit where the sources are not in git, as in a container or an archive.
const COMMIT: &str = "SOURCE_COMMIT";
/// Cargo's features in which builds differ; of the distributions the last counts, which turns on those before it.
const DISTRIBUTIONS: [&str; 4] = ["lyrical", "kilted", "jazzy", "humble"];
const OTHERS: [&str; 2] = ["onnxruntime", "viewer"];

fn main() {
    MADE_OF.iter().for_each(|path| println!("cargo:rerun-if-changed={path}"));
    println!("cargo:rerun-if-env-changed={COMMIT}");
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let commit = env::var(COMMIT).ok().filter(|commit| !commit.is_empty()).or_else(checked_out);
    let commit = commit.unwrap_or_else(|| "unknown".to_owned());
    let on = env::var("CARGO_CFG_FEATURE").unwrap_or_default();
    let is_on = |name: &&&str| on.split(',').any(|feature| feature == **name);
    let distribution = DISTRIBUTIONS.iter().find(is_on).unwrap_or(&"no ros");
    let features: Vec<&str> = [distribution].into_iter().chain(OTHERS.iter().filter(is_on)).copied().collect();
    println!("cargo:rustc-env=PACKAGE_VERSION={version} (commit {commit}; features: {})", features.join(", "));
}

/// The commit, with `-dirty` where files differ from it; none outside of git, and in a repository that only surrounds
/// the package.
fn checked_out() -> Option<String> {
    git(&["ls-files", "--error-unmatch", "Cargo.toml"])?;
    git(&["describe", "--always", "--dirty", "--exclude=*", DIGITS])
}

fn git(args: &[&str]) -> Option<String> {
    let output = Command::new("git").args(args).output().ok()?;
    let said = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| said.trim().to_owned())
}
