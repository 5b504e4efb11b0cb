//! The command line: `--ros-args` as rcl reads them, and the few arguments of our own.
//!
//! `--ros-args` opens a block of ROS arguments and `--` closes it; there may be several. What stands outside is
//! ours.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;
use log::LevelFilter;

use super::fault::Fault;
use super::names::{Rule, is_namespace};
use crate::params::{Overrides, Preset};

/// Follows the targets you mark in a camera stream.
#[derive(Parser, Debug)]
#[command(
    name = "tracker_node",
    version = env!("PACKAGE_VERSION"),
    override_usage = "tracker_node [--params PRESET|FILE.yaml]... [--ros-args [ROS ARGUMENTS]... [--]]",
    after_help = "ROS arguments:\n  \
        -r, --remap FROM:=TO           Rename a topic or service; __ns:=/NS and __node:=NAME rename the node\n  \
        -p, --param NAME:=VALUE        Set a parameter\n      \
        --params-file FILE         Read a ROS parameter file\n      \
        --log-level [NAME:=]LEVEL  debug, info, warn, error or fatal\n      \
        --disable-rosout-logs      Do not publish log lines on /rosout\n      \
        --disable-stdout-logs      Do not print log lines\n      \
        --disable-external-lib-logs  Do not write a log file\n      \
        --log-file-name NAME       Prefix of the log file's name"
)]
struct Own {
    /// A preset's name, or a ROS parameter file. May be given several times; later ones override earlier ones, and ROS
    /// arguments override them all.
    #[arg(long, value_name = "PRESET|FILE.yaml")]
    params: Vec<PathBuf>,
    /// Lists the presets that --params knows.
    #[arg(long)]
    list_presets: bool,
}

/// All that the command line says.
#[derive(Debug, Default)]
pub struct Args {
    /// Renamings, in order; the first that matches holds.
    pub rules: Vec<Rule>,
    /// Where parameters come from, in order; the last value holds.
    pub parameters: Vec<ParameterSource>,
    /// Levels of loggers, in order; no name means all of ours.
    pub levels: Vec<(Option<String>, LevelFilter)>,
    /// The security enclave, which is not supported.
    pub enclave: Option<String>,
    /// Whether no log lines go to `/rosout`.
    pub no_rosout: bool,
    /// Whether none go to the terminal.
    pub no_terminal: bool,
    /// Whether none go to a file.
    pub no_file: bool,
    /// Prefix of the log file's name; the program's name where it is not said.
    pub file_name: Option<String>,
}

/// One source of parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterSource {
    /// A preset.
    Preset(&'static Preset),
    /// A ROS parameter file.
    File(PathBuf),
    /// `[NODE:]NAME:=VALUE`.
    Assignment(String),
}

/// Why there are no arguments to go on with.
#[derive(Debug)]
pub enum Stop {
    /// The list of presets was asked for.
    Presets,
    /// Help or version was asked for, or an argument outside `--ros-args` is unknown.
    Clap(clap::Error),
    /// A ROS argument cannot be used.
    Fault(Fault),
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// Reads the arguments of a process, the first being the program's name.
pub fn parse(args: impl IntoIterator<Item = OsString>) -> Result<Args, Stop> {
    let (mut own, mut ros) = (Vec::new(), Vec::new());
    let mut in_block = false;
    for arg in args {
        let arg = arg.to_string_lossy().into_owned();
        match (arg.as_str(), in_block) {
            ("--ros-args", _) => in_block = true,
            ("--", true) => in_block = false,
            (_, true) => ros.push(arg),
            (_, false) => own.push(arg),
        }
    }
    let own = Own::try_parse_from(own).map_err(Stop::Clap)?;
    if own.list_presets {
        return Err(Stop::Presets);
    }
    let mut args = Args { parameters: own.params.into_iter().map(named).collect::<Result<_, _>>()?, ..Args::default() };
    parse_ros(ros, &mut args)?;
    Ok(args)
}

fn named(source: PathBuf) -> Result<ParameterSource, Fault> {
    Ok(Preset::named(&source)?.map_or(ParameterSource::File(source), ParameterSource::Preset))
}

fn parse_ros(words: Vec<String>, args: &mut Args) -> Result<(), Fault> {
    let mut words = words.into_iter();
    while let Some(flag) = words.next() {
        let mut value = || {
            let why = || Fault::Argument { argument: flag.clone(), why: "it needs a value".to_owned() };
            words.next().ok_or_else(why)
        };
        match flag.as_str() {
            "-r" | "--remap" => args.rules.push(Rule::parse(&value()?)?),
            "-p" | "--param" => args.parameters.push(assignment(value()?)?),
            "--params-file" => args.parameters.push(ParameterSource::File(value()?.into())),
            "--log-level" => args.levels.push(level(&value()?)?),
            "--enable-rosout-logs" => args.no_rosout = false,
            "--disable-rosout-logs" => args.no_rosout = true,
            "--enable-stdout-logs" => args.no_terminal = false,
            "--disable-stdout-logs" => args.no_terminal = true,
            // What rcl calls an external library is the one that writes its log files.
            "--enable-external-lib-logs" => args.no_file = false,
            "--disable-external-lib-logs" => args.no_file = true,
            "--log-file-name" => args.file_name = Some(value()?).filter(|name| !name.is_empty()),
            "-e" | "--enclave" => args.enclave = Some(enclave(value()?)?),
            // A configured back end of rcl's logging has no counterpart here; launch files that name one must still
            // work.
            "--log-config-file" => drop(value()?),
            _ => {
                let why = "unknown ROS argument; see --help".to_owned();
                return Err(Fault::Argument { argument: flag, why });
            }
        }
    }
    Ok(())
}

/// An assignment that can be understood; what it means may depend on those before it.
fn assignment(text: String) -> Result<ParameterSource, Fault> {
    Overrides::default().assign(&text)?;
    Ok(ParameterSource::Assignment(text))
}

/// An enclave is named as a namespace is, and as by rcl a name that breaks its rules is refused.
fn enclave(name: String) -> Result<String, Fault> {
    if is_namespace(&name) {
        return Ok(name);
    }
    let why = "an enclave's name must begin with '/' and have valid names between its slashes".to_owned();
    Err(Fault::Argument { argument: format!("--enclave {name}"), why })
}

fn level(text: &str) -> Result<(Option<String>, LevelFilter), Fault> {
    let (logger, name) = match text.split_once(":=") {
        Some((logger, name)) => (Some(logger.to_owned()), name),
        None => (None, text),
    };
    let level = match name.to_ascii_lowercase().as_str() {
        "unset" | "info" => LevelFilter::Info,
        "debug" => LevelFilter::Debug,
        "warn" => LevelFilter::Warn,
        "error" | "fatal" => LevelFilter::Error,
        _ => {
            let why = "the level must be debug, info, warn, error or fatal".to_owned();
            return Err(Fault::Argument { argument: format!("--log-level {text}"), why });
        }
    };
    Ok((logger, level))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(line: &str) -> Result<Args, Stop> {
        parse(line.split(' ').map(OsString::from))
    }

    fn fault(line: &str) -> String {
        match args(line).unwrap_err() {
            Stop::Fault(fault) => fault.to_string(),
            Stop::Clap(error) => error.to_string(),
            Stop::Presets => panic!("{line}: the presets"),
        }
    }

    #[test]
    fn blocks_are_joined_in_order_and_end_at_two_dashes() {
        let got =
            args("node --ros-args -r a:=b -- --ros-args -p n:x:=1 --params-file f.yaml -p y:=true -e /e").unwrap();
        assert_eq!(got.rules, [Rule::parse("a:=b").unwrap()]);
        let of = |text: &str| ParameterSource::Assignment(text.to_owned());
        let want = [of("n:x:=1"), ParameterSource::File("f.yaml".into()), of("y:=true")];
        assert_eq!(got.parameters, want);
        assert_eq!(got.enclave.as_deref(), Some("/e"));
        assert!(fault("node --ros-args -- -r a:=b").contains("-r"), "outside the block");
    }

    #[test]
    fn presets_and_files_stand_before_ros_arguments_and_give_way_to_them() {
        let got = args("node --ros-args -p seed:=1 -- --params fast --params ./fast").unwrap();
        let [ParameterSource::Preset(fast), file, seed] = got.parameters.as_slice() else { panic!("{got:?}") };
        assert_eq!(fast.name, "fast");
        assert_eq!(*file, ParameterSource::File("./fast".into()));
        assert_eq!(*seed, ParameterSource::Assignment("seed:=1".to_owned()));
        assert!(fault("node --params fsat").contains("'fsat' is neither a file nor a preset"));
        assert!(matches!(args("node --list-presets"), Err(Stop::Presets)));
    }

    #[test]
    fn log_levels_may_name_a_logger() {
        let got = args("node --ros-args --log-level DEBUG --log-level rustdds:=warn --disable-rosout-logs").unwrap();
        let want = [(None, LevelFilter::Debug), (Some("rustdds".to_owned()), LevelFilter::Warn)];
        assert_eq!(got.levels, want);
        assert!(got.no_rosout && !got.no_terminal);
    }

    #[test]
    fn log_lines_may_be_kept_from_a_file_or_get_one_of_a_name() {
        let got = args("node --ros-args --disable-external-lib-logs --log-file-name eye").unwrap();
        assert!(got.no_file);
        assert_eq!(got.file_name.as_deref(), Some("eye"));
        let got = args("node --ros-args --disable-external-lib-logs --enable-external-lib-logs").unwrap();
        assert!(!got.no_file && got.file_name.is_none());
    }

    #[test]
    fn arguments_that_cannot_be_used_are_named() {
        for (line, part) in [
            ("node --ros-args --remap", "'--remap': it needs a value"),
            ("node --ros-args --frobnicate", "'--frobnicate': unknown ROS argument"),
            ("node --ros-args -r nonsense", "'nonsense'"),
            ("node --ros-args --enclave e", "'--enclave e': an enclave's name must begin with '/'"),
            ("node --ros-args -e /a//b", "'--enclave /a//b'"),
            ("node --ros-args -p x", "'x' is not a parameter assignment"),
            ("node --ros-args --log-level loud", "debug, info, warn, error or fatal"),
            ("node stray", "unexpected argument 'stray'"),
        ] {
            let got = fault(line);
            assert!(got.contains(part), "{line}: {got}");
        }
    }

    #[test]
    fn help_and_version_are_no_failures() {
        for line in ["node --help", "node --version"] {
            let Stop::Clap(error) = args(line).unwrap_err() else { panic!("{line}") };
            assert_eq!(error.exit_code(), 0, "{line}");
        }
    }
}
