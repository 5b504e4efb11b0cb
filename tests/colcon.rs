//! The package as a workspace builds and installs it, and as a user of the installed one meets it.

#![cfg(feature = "ros")]

mod support;

use std::path::Path;
use std::{fs, os::unix::fs::symlink};

use support::{Environment, Peer, domain};

#[test]
fn a_workspace_is_built_and_its_programs_follow_a_target() {
    let environment = Environment::get();
    let workspace = Path::new(env!("CARGO_TARGET_TMPDIR")).join("workspace");
    if workspace.exists() {
        fs::remove_dir_all(&workspace).expect("the old workspace removed");
    }
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = workspace.join("src");
    fs::create_dir_all(&source).expect("a workspace");
    for (name, from) in
        [("vision_msgs", repository.join("tests/peer/vision_msgs")), ("long_term_tracker", repository.to_owned())]
    {
        symlink(from, source.join(name)).expect("a package in the workspace");
    }
    // Cargo finds there what it has compiled for the tests.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder").display();
    environment.colcon(&workspace, &[&format!("-DCARGO_TARGET_DIR={target}")]);

    let setup = workspace.join("install/setup.sh");
    let script = repository.join("tests/peer/installed.py");
    let mut shell = environment.command(Path::new("sh"), None);
    shell.args(["-c", r#". "$0" && exec python "$@""#]).arg(setup);
    Peer::spawn(&mut shell, domain(), &script, &[]).succeed_alone();
}
