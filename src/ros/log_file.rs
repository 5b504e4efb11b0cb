//! The log file, which lies where those of rclcpp's and rclpy's nodes do and is named as they are.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What the name begins with where nobody says.
const PROGRAM: &str = "tracker_node";

/// Makes the file; its name begins with `name` or else with the program's. An error is told with the path.
pub fn create(name: Option<&str>) -> Result<File, (PathBuf, io::Error)> {
    let folder = folder(|name| std::env::var(name).ok());
    let program = std::env::current_exe().ok();
    let program = program.as_deref().and_then(Path::file_name).and_then(|name| name.to_str()).unwrap_or(PROGRAM);
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    create_in(&folder, name.unwrap_or(program), std::process::id(), since.as_millis())
}

/// `<name>_<process>_<milliseconds>.log`. The name may hold folders, and always lies below the folder for logs.
fn create_in(folder: &Path, name: &str, process: u32, milliseconds: u128) -> Result<File, (PathBuf, io::Error)> {
    let path = folder.join(format!("{}_{process}_{milliseconds}.log", name.trim_start_matches('/')));
    let made = fs::create_dir_all(path.parent().unwrap_or(folder)).and_then(|()| File::create(&path));
    made.map_err(|e| (path, e))
}

/// `ROS_LOG_DIR`, else `ROS_HOME/log`, else `~/.ros/log`. A variable that is empty counts as not set.
fn folder(variable: impl Fn(&str) -> Option<String>) -> PathBuf {
    let set = |name: &str| variable(name).filter(|v| !v.is_empty());
    let home = PathBuf::from(set("HOME").unwrap_or_default());
    let expanded = |path: String| match path.strip_prefix('~') {
        Some(rest) => home.join(rest.trim_start_matches('/')),
        None => PathBuf::from(path),
    };
    match (set("ROS_LOG_DIR"), set("ROS_HOME")) {
        (Some(folder), _) => expanded(folder),
        (None, Some(ros)) => expanded(ros).join("log"),
        (None, None) => home.join(".ros/log"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_is_that_of_every_node() {
        let of = |variables: &[(&str, &str)]| {
            folder(|name| variables.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned()))
        };
        let home = ("HOME", "/h");
        assert_eq!(of(&[home]), Path::new("/h/.ros/log"));
        assert_eq!(of(&[home, ("ROS_HOME", "/r")]), Path::new("/r/log"));
        assert_eq!(of(&[home, ("ROS_HOME", "/r"), ("ROS_LOG_DIR", "~/l")]), Path::new("/h/l"));
        assert_eq!(of(&[home, ("ROS_HOME", ""), ("ROS_LOG_DIR", "")]), Path::new("/h/.ros/log"));
    }

    #[test]
    fn the_name_holds_the_process_and_the_time() {
        let folder = tempfile::tempdir().unwrap();
        for (name, path) in [("eye", "eye_7_9.log"), ("a/b", "a/b_7_9.log"), ("/abs", "abs_7_9.log")] {
            create_in(folder.path(), name, 7, 9).unwrap();
            assert!(folder.path().join(path).is_file(), "{path}");
        }
        let (path, _) = create_in(Path::new("/proc/nosuch"), "eye", 7, 9).unwrap_err();
        assert_eq!(path, Path::new("/proc/nosuch/eye_7_9.log"));
    }
}
