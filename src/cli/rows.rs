//! The rows of `track`: one a frame for a target that was marked, or one a target and frame where targets are found.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::Path;

use super::Error;
use crate::geometry::Rect;
use crate::params::Algorithm;
use crate::tracker::{Output, State};

/// The first line of rows of a single target.
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

/// The rows of a frame, counted from 1, in the format of MOTChallenge: frame, id, x, y, w, h, confidence and three
/// fields that are not used. Lost targets have none, for every row says that a target is in sight there.
pub fn write_mot(out: &mut dyn Write, frame: usize, output: &Output) -> io::Result<()> {
    output.targets.iter().filter(|target| target.state != State::Lost).try_for_each(|target| {
        let (r, confidence) = (&target.rect, target.confidence);
        writeln!(out, "{frame},{},{},{},{},{},{confidence},-1,-1,-1", target.id, r.x, r.y, r.w, r.h)
    })
}

/// Where the rows of a recording go.
pub struct Rows<'a> {
    out: Box<dyn Write + 'a>,
    name: String,
    /// Whether there is a row for each target of a frame.
    many: bool,
}

impl<'a> Rows<'a> {
    /// To a new file, or to standard output.
    pub fn create(path: Option<&Path>, algorithm: Algorithm) -> Result<Self, Error> {
        let Some(path) = path else {
            return Self::to(Box::new(io::stdout().lock()), "standard output".to_owned(), algorithm);
        };
        let file = File::create(path).map_err(|source| Error::Create { path: path.to_owned(), source })?;
        Self::to(Box::new(BufWriter::new(file)), path.display().to_string(), algorithm)
    }

    /// To a writer that messages call by this name. The rows of a single target begin with the header.
    pub fn to(out: Box<dyn Write + 'a>, name: String, algorithm: Algorithm) -> Result<Self, Error> {
        let many = algorithm == Algorithm::Maptrack;
        let mut rows = Self { out, name, many };
        if !many {
            let header = writeln!(rows.out, "{HEADER}");
            rows.check(header)?;
        }
        Ok(rows)
    }

    /// Writes the rows of a frame, counted from 1. `false`: nobody reads on.
    pub fn write(&mut self, frame: usize, output: &Output) -> Result<bool, Error> {
        let written = if self.many {
            write_mot(&mut self.out, frame, output)
        } else {
            write(&mut self.out, output).and_then(|()| writeln!(self.out))
        };
        self.check(written)
    }

    /// Writes what is left.
    pub fn finish(mut self) -> Result<(), Error> {
        let flushed = self.out.flush();
        self.check(flushed).map(drop)
    }

    /// A closed pipe is a reader who has seen enough (`track ... | head`).
    fn check(&self, result: io::Result<()>) -> Result<bool, Error> {
        match result {
            Ok(()) => Ok(true),
            Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(false),
            Err(e) => Err(Error::Write { to: self.name.clone(), why: e.to_string() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::Target;

    #[test]
    fn rows_of_many_targets_are_those_of_motchallenge_without_lost_ones() {
        let target = |id: &str, x: f64, state| Target::standing(id, Rect::new(x, 2.5, 30.0, 60.0), state);
        let targets =
            vec![target("0", 1.0, State::Tracking), target("1", 5.0, State::Lost), target("7", 9.0, State::Uncertain)];
        let mut out = Vec::new();
        write_mot(&mut out, 12, &Output { targets }).unwrap();
        let want = "12,0,1,2.5,30,60,0.5,-1,-1,-1\n12,7,9,2.5,30,60,0.5,-1,-1,-1\n";
        assert_eq!(String::from_utf8(out).unwrap(), want);
    }
}
