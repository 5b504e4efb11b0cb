//! Copies the source of rustdds 0.15.1, as cargo downloaded it, with the changes of some patches.
//!
//! Those in `upstream` mend faults. Each says what is wrong and how to see it, and can be sent to the makers of RustDDS
//! as it stands; 0.15.1 is their newest release. `hooks.patch` is for this package alone: it asks `src/hooks.rs` for
//! what the original has no setting for. A patch that does not fit the original stops the build.
//!
//! Once a release holds a change, delete its patch; once it holds all of `upstream`, see whether the hooks are worth
//! this folder and the `[patch.crates-io]` section of the package.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

const VERSION: &str = "0.15.1";
/// The folder of the patches that mend faults, and the one of our own.
const FAULTS: &str = "upstream";
const HOOKS: &str = "hooks.patch";

const EXPORTED: &str = "#[macro_export]\nmacro_rules! create_";
const PRIVATE: &str = "macro_rules! create_";
/// Those that other modules import from the root.
const MACROS: &str =
    "create_error_dropped, create_error_internal, create_error_out_of_resources, create_error_poisoned";

fn main() {
    let package = folder("CARGO_MANIFEST_DIR");
    let (faults, hooks) = (package.join(FAULTS), package.join(HOOKS));
    for part in ["build.rs", FAULTS, HOOKS] {
        println!("cargo::rerun-if-changed={part}");
    }
    let original = original().join("src");
    let copy = folder("OUT_DIR").join("src");
    copy_all(&original, &copy).unwrap_or_else(|e| panic!("copy {} to {}: {e}", original.display(), copy.display()));
    let patches = read_folder(&faults).into_iter().chain([hooks]);
    for patch in patches {
        apply(&patch, copy.parent().expect("the copy lies in a folder"));
    }
    // The rest only lets `include!` take the place of the crate's root file: it must not begin with documentation and
    // lint levels then, and macros that were exported to the root have to be brought there.
    let import = format!("pub(crate) use {{{MACROS}}};\n");
    rewrite(&copy.join("dds/result.rs"), |text| text.replace(EXPORTED, PRIVATE) + &import);
    rewrite(&copy.join("lib.rs"), |text| {
        let code = &text[text.find("\nmod ").expect("a first module in lib.rs")..];
        format!("{code}pub(crate) use dds::result::{{{MACROS}}};\n")
    });
}

/// Applies a unified diff to the files below `root`. What a hunk takes away, with the lines around it, must be there
/// just once; line numbers mean nothing.
fn apply(patch: &Path, root: &Path) {
    let text = fs::read_to_string(patch).unwrap_or_else(|e| panic!("{}: {e}", patch.display()));
    let (_, files) = text.split_once("\ndiff ").unwrap_or_else(|| panic!("{} changes nothing", patch.display()));
    for file in files.split("\ndiff ") {
        let (header, hunks) = file.split_once("\n@@").unwrap_or_else(|| panic!("{}: no hunk", patch.display()));
        let name = header.rsplit_once("\n+++ b/").unwrap_or_else(|| panic!("{}: no file", patch.display())).1;
        rewrite(&root.join(name), |mut text| {
            for hunk in hunks.split("\n@@") {
                // The rest of the first line tells where.
                let lines = || hunk.lines().skip(1).map(|line| line.split_at(line.len().min(1)));
                let side = |mark: &str| -> String {
                    lines().filter(|(m, _)| [mark, " ", ""].contains(m)).map(|(_, rest)| format!("{rest}\n")).collect()
                };
                let (wrong, right) = (side("-"), side("+"));
                let found = text.matches(&wrong).count();
                let place = format!("{name} of rustdds {VERSION}");
                assert_eq!(found, 1, "{}: must be once in {place}:\n{wrong}", patch.display());
                text = text.replace(&wrong, &right);
            }
            text
        });
    }
}

fn read_folder(path: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut paths: Vec<_> = entries.map(|e| e.unwrap_or_else(|e| panic!("{}: {e}", path.display())).path()).collect();
    paths.sort();
    paths
}

/// The folder of the original. Cargo downloads it here if it is not there yet.
fn original() -> PathBuf {
    let mut command = Command::new(env::var_os("CARGO").expect("CARGO is set by cargo"));
    command.args(["metadata", "--format-version=1", "--locked"]);
    command.arg("--manifest-path").arg(folder("CARGO_MANIFEST_DIR").join("Cargo.toml"));
    command.arg("--filter-platform").arg(env::var_os("TARGET").expect("TARGET is set by cargo"));
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON from cargo metadata");
    let mut packages = metadata["packages"].as_array().into_iter().flatten();
    let manifest = packages
        .find(|p| p["name"] == "rustdds" && p["version"] == VERSION)
        .and_then(|p| p["manifest_path"].as_str())
        .unwrap_or_else(|| panic!("cargo metadata names no rustdds {VERSION}"));
    Path::new(manifest).parent().expect("a manifest lies in a folder").to_owned()
}

fn folder(variable: &str) -> PathBuf {
    env::var_os(variable).unwrap_or_else(|| panic!("{variable} is set by cargo")).into()
}

fn copy_all(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_all(&entry.path(), &target)?;
        } else {
            fs::write(target, fs::read(entry.path())?)?;
        }
    }
    Ok(())
}

fn rewrite(path: &Path, change: impl FnOnce(String) -> String) {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    fs::write(path, change(text)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
