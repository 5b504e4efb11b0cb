//! What the programs know of themselves wherever they are installed: their presets and their version.

use std::fs;
use std::path::Path;
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const VERSION: &str = env!("CARGO_PKG_VERSION");

const PROGRAMS: &[(&str, &str)] = &[
    ("track", env!("CARGO_BIN_EXE_track")),
    ("evaluate", env!("CARGO_BIN_EXE_evaluate")),
    #[cfg(feature = "ros")]
    ("tracker_node", env!("CARGO_BIN_EXE_tracker_node")),
    #[cfg(feature = "ros")]
    ("tracker_demo", env!("CARGO_BIN_EXE_tracker_demo")),
];

/// Exit code, standard output and standard error of a program that is started in a folder of its own.
fn run(program: &str, args: &[&str]) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(program).current_dir(folder.path()).args(args).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_presets_name_stands_for_its_file() {
    let clip = format!("{ROOT}/assets/demo");
    let track = |preset: &str| {
        let args = [clip.as_str(), "--init", "528,182,31,101", "--params", preset];
        let (code, rows, said) = run(env!("CARGO_BIN_EXE_track"), &args);
        assert_eq!(code, Some(0), "{said}");
        rows
    };
    let rows = track("fast");
    assert_eq!(rows, track(&format!("{ROOT}/params/fast.yaml")));
    assert_ne!(rows, track("etepf"));
}

#[test]
fn presets_are_listed_without_other_arguments() {
    for (name, program) in PROGRAMS.iter().filter(|(name, _)| *name != "tracker_demo") {
        let (code, list, said) = run(program, &["--list-presets"]);
        assert_eq!(code, Some(0), "{name}: {said}");
        let presets: Vec<_> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
        assert_eq!(presets, ["default", "fast", "matching", "paper", "etepf", "maptrack", "maptrack_near"], "{name}");
    }
}

#[test]
fn a_preset_that_there_is_not_is_answered_with_those_there_are() {
    let args = |name| if name == "tracker_node" { &["--params", "fsat"][..] } else { &[".", "--params", "fsat"] };
    for (name, program) in PROGRAMS.iter().filter(|(name, _)| *name != "tracker_demo") {
        let (code, _, said) = run(program, args(*name));
        assert_eq!(code, Some(2), "{name}: {said}");
        let why = "error: 'fsat' is neither a file nor a preset; presets are default, fast, ";
        assert!(said.starts_with(why) && said.lines().count() == 1, "{name}: {said}");
    }
}

#[test]
fn the_version_tells_the_commit_and_the_features() {
    let wanted = [
        ("humble", cfg!(all(feature = "humble", not(feature = "jazzy")))),
        ("jazzy", cfg!(all(feature = "jazzy", not(feature = "kilted")))),
        ("no ros", cfg!(not(feature = "ros"))),
        ("onnxruntime", cfg!(feature = "onnxruntime")),
        ("viewer", cfg!(feature = "viewer")),
    ];
    for (name, program) in PROGRAMS {
        let (code, said, _) = run(program, &["--version"]);
        assert_eq!(code, Some(0), "{name}");
        let rest = said.strip_prefix(&format!("{name} {VERSION} (commit ")).and_then(|rest| rest.strip_suffix(")\n"));
        let (commit, features) =
            rest.and_then(|rest| rest.split_once("; features: ")).unwrap_or_else(|| panic!("{said}"));
        let hash = commit.trim_end_matches("-dirty");
        assert!(hash == "unknown" || hash.len() >= 12 && hash.chars().all(|c| c.is_ascii_hexdigit()), "{said}");
        for (feature, is_on) in wanted {
            assert_eq!(features.split(", ").any(|word| word == feature), is_on, "{feature}: {said}");
        }
    }
}

#[test]
fn the_package_has_one_version() {
    let read = |file| fs::read_to_string(Path::new(ROOT).join(file)).unwrap();
    assert!(read("package.xml").contains(&format!("<version>{VERSION}</version>")));
    assert!(read("CITATION.cff").contains(&format!("\nversion: {VERSION}\n")));
    let changes = read("CHANGELOG.md");
    let released = changes.lines().find_map(|line| line.strip_prefix("## [")?.split_once("] - ")).unwrap();
    assert_eq!(released.0, VERSION);
    assert!(released.1.len() == "2026-11-30".len(), "{}", released.1);
}

#[test]
fn every_file_that_the_debian_package_takes_is_there() {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(ROOT).args(["metadata", "--no-deps", "--offline", "--format-version=1"]);
    let metadata: serde_json::Value = serde_json::from_slice(&cargo.output().unwrap().stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let package = packages.iter().find(|package| package["name"] == "long_term_tracker").unwrap();
    let assets = package["metadata"]["deb"]["assets"].as_array().unwrap();
    let sources: Vec<&str> = assets.iter().map(|asset| asset[0].as_str().unwrap()).collect();
    for source in &sources {
        let path = match source.strip_prefix("target/release/") {
            Some(program) => format!("src/bin/{program}.rs"),
            None => source.trim_end_matches("/*").to_owned(),
        };
        assert!(Path::new(ROOT).join(&path).exists(), "{path}");
    }
    // What the ROS package is made of.
    let cmake = fs::read_to_string(Path::new(ROOT).join("CMakeLists.txt")).unwrap();
    for part in ["msg/*", "launch/*", "params/*", "examples/follow.py", "LICENSE", "NOTICE", "THIRD_PARTY.md"] {
        assert!(sources.contains(&part) && cmake.contains(part.trim_end_matches("/*")), "{part}");
    }
}
