//! The CSV of a single target: one row a frame.

use std::io::{self, Write};

use crate::tracker::{Output, State};

/// The first line.
pub const HEADER: &str = "x,y,w,h,confidence,state";

/// The row of a frame, without the end of the line. Numbers are written so that they read back bit for bit. A
/// frame without a target has no box.
pub fn write(out: &mut dyn Write, output: &Output) -> io::Result<()> {
    match output.targets.first() {
        Some(t) => {
            let r = t.rect;
            write!(out, "{},{},{},{},{},{}", r.x, r.y, r.w, r.h, t.confidence, t.state.name())
        }
        None => write!(out, "NaN,NaN,NaN,NaN,0,{}", State::Lost.name()),
    }
}
