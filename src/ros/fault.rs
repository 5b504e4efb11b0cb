//! What keeps the node from starting, or ends it.

use std::io::{self, Write};
use std::process::ExitCode;

use crate::error::{NetworkError, ParamsError};
use crate::viewer::ListenError;

/// A reason to end the process. Each message is one line that holds the value at fault.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum Fault {
    /// A command line that cannot be understood.
    #[error("argument '{argument}': {why}")]
    Argument { argument: String, why: String },
    /// A name that breaks the rules of ROS 2.
    #[error("name '{name}': {why}")]
    Name { name: String, why: String },
    /// An environment variable that cannot be understood.
    #[error("environment variable {variable}={value}: {why}")]
    Environment { variable: &'static str, value: String, why: String },
    /// A parameter, or a file of parameters.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// The network that the parameters name cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The live page cannot be served.
    #[error(transparent)]
    Viewer(#[from] ListenError),
    /// DDS or the operating system refused something.
    #[error("cannot {what}: {why}")]
    System { what: String, why: String },
    /// A thread of the node or of the DDS library came to its end by itself.
    #[error("the {name} thread ended unexpectedly: {why}")]
    Thread { name: String, why: String },
    /// The process takes more memory than it may.
    #[error(
        "resident memory of {resident_mb} MB is more than the {limit_mb} MB that parameter 'limits.memory_mb' allows: \
         the node exits"
    )]
    Memory { resident_mb: u64, limit_mb: u64 },
    /// The process did not come to its end when it should.
    #[error("still running {seconds:.1} s after shutdown began, so the process is ended: {threads}")]
    Hung { seconds: f64, threads: String },
}

impl Fault {
    /// A failure of DDS or the operating system at doing `what`.
    pub fn system(what: impl Into<String>, why: impl ToString) -> Self {
        Self::System { what: what.into(), why: why.to_string() }
    }

    /// Writes the line to standard error and gives the exit code: 1 for a failure while running, 2 for what the
    /// caller must change.
    pub fn report(&self) -> ExitCode {
        // Where it cannot be written, the exit code is left.
        let _ = writeln!(io::stderr(), "error: {}", self.to_string().replace('\n', " "));
        match self {
            Self::System { .. } | Self::Thread { .. } | Self::Memory { .. } | Self::Hung { .. } => ExitCode::from(1),
            _ => ExitCode::from(2),
        }
    }
}
