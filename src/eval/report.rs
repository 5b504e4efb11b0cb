//! The figures of an evaluation: a table a setup, a row a sequence. It serialises to the JSON that programs read;
//! [`text`](super::text) prints it for people.
//!
//! The names in the JSON are those of the fields here and in [`figures`](super::figures), and stay as they are:
//!
//! ```text
//! dataset, starts
//! attributes[]     attribute, rule, sequences[]
//! setups[]         name, peer, parameters{}
//!   mean           frames, precision, auc, held, lost_frames, reacquired, losses, recovered, first_loss,
//!                  seconds, fps
//!     long_term    precision, recall, f, threshold, all{precision, recall, f}
//!     absences     absent_frames, right, wrong, astray, count, due, in_time, returns,
//!                  noticed{count, frames}, regained{count, frames}
//!     calibration  bins[10]{boxes, right, confidence}
//!     calibration_error
//!     honesty      off{count, tracking, lost}, on{count, tracking, lost}
//!     curves       precision[51], success[21]
//!   spread         precision, auc, held, each {runs[], mean, spread}
//!   attributes[]   attribute, sequences, precision, auc, held, long_term{}
//!   sequences[]    name, spread, and all that mean has
//! halves           halves[2][], crossed{SUMMARY}
//!   setups[]       name, groups[]{name, summary{SUMMARY}, against_first{sequences, interval, p}}
//!   choices[]      on, setup, on_other{SUMMARY}
//! SUMMARY          sequences, precision, auc, held, each {mean, low, high}, calibration_error, honesty
//! ```
//!
//! What is not known is null.

use serde::Serialize;

use super::halves::Halves;
use super::table::{Hard, Table};

/// The figures of all setups.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The dataset's folder, as it was given.
    pub dataset: String,
    /// How often each sequence was run by a tracker of ours.
    pub starts: usize,
    /// What makes sequences hard, where that was looked at: for each attribute those that have it.
    pub attributes: Vec<Hard>,
    /// One a set of parameters, then one another tracker.
    pub setups: Vec<Table>,
    /// What holds on the half that it was not chosen on, where that was asked for.
    pub halves: Option<Halves>,
}
