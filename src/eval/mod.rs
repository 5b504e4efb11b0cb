//! How good a tracker is: sequences with ground truth, runs over them, and scores.
//!
//! ```text
//! dataset   sequences: true boxes, and how much of each is hidden
//!   -> run | peers     an answer a frame: by a tracker that is run here, or read from another one's file
//!   -> otb, long_term, absences, losses, calibration, honesty     one figure each
//!   -> figures         all of one sequence, and of several; attributes say which sequences are hard in what
//!   -> table, spread   all of one setup; the same started several times
//!   -> halves          what holds on video that it was not chosen on, by bootstrap; worlds name kinds of video
//!   -> report          all of that
//!   -> text            for the terminal; JSON comes by serde
//!   -> page            for a browser: diagrams, tables, and the worst moments in pictures
//! ```

pub mod absences;
pub mod answer;
pub mod attributes;
pub mod bootstrap;
pub mod calibration;
pub mod dataset;
pub mod figures;
pub mod halves;
pub mod honesty;
pub mod long_term;
pub mod losses;
pub mod moments;
pub mod otb;
pub mod page;
pub mod peers;
pub mod report;
pub mod run;
pub mod spread;
pub mod table;
pub mod text;
pub mod trajectory;
pub mod worlds;
