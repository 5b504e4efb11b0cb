//! How good a tracker is: sequences with ground truth, runs over them, and scores.

pub mod dataset;
pub mod losses;
pub mod otb;
pub mod report;
pub mod run;
