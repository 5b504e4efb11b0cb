//! The CSV of a single target: one row a frame.

use std::io::{self, Write};

use crate::geometry::Rect;
use crate::tracker::{Output, State};

/// The first line.
pub const HEADER: &str = "x,y,w,h,confidence,state";

/// The row of a frame, without the end of the line. A frame without a target has no box.
pub fn write(out: &mut dyn Write, output: &Output) -> io::Result<()> {
    match output.targets.first() {
        Some(t) => write_box(out, &t.rect, t.confidence, t.state),
        None => write!(out, "NaN,NaN,NaN,NaN,0,{}", State::Lost.name()),
    }
}

/// The row of a box. Numbers are written so that they read back bit for bit.
pub fn write_box(out: &mut dyn Write, r: &Rect, confidence: f32, state: State) -> io::Result<()> {
    write!(out, "{},{},{},{},{confidence},{}", r.x, r.y, r.w, r.h, state.name())
}
