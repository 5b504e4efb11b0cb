//! Copies the source of rustdds 0.15.1, as cargo downloaded it, with one line mended.
//!
//! The line writes the inline QoS of a fragment as an `Option`, hence with a byte in front that no reader expects. The
//! answer of a service bears the identity of its request there, so that no ROS 2 client can read an answer of more than
//! about a kilobyte, such as the list of a node's parameters, nor any that follows it. Nothing outside the crate can
//! help, and 0.15.1 is its newest release.
//!
//! Once a release writes `ParameterList` itself (`src/messages/submessages/data_frag.rs`), delete this folder and the
//! `[patch.crates-io]` section of the package.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

const VERSION: &str = "0.15.1";
const FILE: &str = "messages/submessages/data_frag.rs";
const WRONG: &str = "writer.write_value(&self.inline_qos)?;";
const RIGHT: &str = "writer.write_value(self.inline_qos.as_ref().unwrap())?;";

const EXPORTED: &str = "#[macro_export]\nmacro_rules! create_";
const PRIVATE: &str = "macro_rules! create_";
/// Those that other modules import from the root.
const MACROS: &str =
    "create_error_dropped, create_error_internal, create_error_out_of_resources, create_error_poisoned";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let original = original().join("src");
    let copy = folder("OUT_DIR").join("src");
    copy_all(&original, &copy).unwrap_or_else(|e| panic!("copy {} to {}: {e}", original.display(), copy.display()));
    rewrite(&copy.join(FILE), |text| {
        let found = text.matches(WRONG).count();
        assert_eq!(found, 1, "the line to mend, '{WRONG}', must be once in {FILE} of rustdds {VERSION}");
        text.replace(WRONG, RIGHT)
    });
    // The rest only lets `include!` take the place of the crate's root file: it must not begin with documentation and
    // lint levels then, and macros that were exported to the root have to be brought there.
    let import = format!("pub(crate) use {{{MACROS}}};\n");
    rewrite(&copy.join("dds/result.rs"), |text| text.replace(EXPORTED, PRIVATE) + &import);
    rewrite(&copy.join("lib.rs"), |text| {
        let code = &text[text.find("\nmod ").expect("a first module in lib.rs")..];
        format!("{code}pub(crate) use dds::result::{{{MACROS}}};\n")
    });
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

fn rewrite(path: &Path, change: impl FnOnce(&str) -> String) {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    fs::write(path, change(&text)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
