//! rustdds 0.15.1 with some faults mended; see `build.rs`.

// Its style is its authors'.
#![allow(warnings, clippy::all)]

pub mod hooks;

include!(concat!(env!("OUT_DIR"), "/src/lib.rs"));
