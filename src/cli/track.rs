//! `track`: follows a target, or all that move, through recorded frames and writes a row a frame, or a target and
//! frame.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Parser;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageEncoder, RgbImage, imageops};

#[cfg(feature = "viewer")]
use super::player::{Player, Recording};
use super::timing::{StageClock, per_second};
#[cfg(feature = "viewer")]
use super::view;
use super::{Error, params, progress, rows, tell};
use crate::draw::{self, Scene};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::loader::FailureLog;
#[cfg(feature = "viewer")]
use crate::params::Params;
use crate::params::{Algorithm, Assignment, assignment};
use crate::record::Recorder;
use crate::replay::{self, FrameSource, truth};
use crate::session::Session;
use crate::tracker::Output;
#[cfg(feature = "viewer")]
use crate::viewer::Hub;

/// Follow a target through recorded frames.
///
/// Writes CSV: the header x,y,w,h,confidence,state, then one row per frame, starting with the initial box. Boxes are in
/// pixels from the top left corner. The state is tracking, uncertain or lost; the box of a lost target is the best
/// guess. With --algorithm maptrack, which finds targets by itself, rows are in MOTChallenge format without a header:
/// frame (from 1),id,x,y,w,h,confidence,-1,-1,-1; a lost target has no row. The last line on standard error gives the
/// speed. Exit codes: 0 done, 1 failed while running, 2 unusable arguments.
#[derive(Debug, Parser)]
#[command(name = "track", version)]
pub struct Args {
    /// A folder of images (JPEG, PNG, BMP, TIFF, WebP, PGM, PPM; in the order of the numbers in their names), or a
    /// folder with images in img/; or a rosbag2 recording: its folder, or one of its files (.mcap, .db3).
    source: PathBuf,
    /// The image topic of a bag. Not needed if only one topic has images.
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    /// The target's box in the first frame. Default: the first row of a groundtruth_rect.txt beside the images. Not
    /// needed with --algorithm maptrack.
    #[arg(long, value_name = "X,Y,W,H", value_parser = truth::parse, allow_hyphen_values = true)]
    init: Option<Rect>,
    /// The tracker to use; the same as -p algorithm:=NAME.
    #[arg(long, value_name = "NAME")]
    algorithm: Option<String>,
    /// A ROS parameter file. May be given several times; later files override earlier ones.
    #[arg(long, value_name = "FILE.yaml")]
    params: Vec<PathBuf>,
    /// Sets a parameter; overrides files.
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE", value_parser = assignment)]
    set: Vec<Assignment>,
    /// Writes the rows to this file instead of standard output.
    #[arg(long, value_name = "FILE.csv")]
    output: Option<PathBuf>,
    /// Writes each frame to DIR/000001.png and so on: box, search window, prediction, neighbours and proposals on the
    /// left, the response map on the right.
    #[arg(long, value_name = "DIR")]
    annotate: Option<PathBuf>,
    /// Writes a new bag with the original images and the topics /tracker/tracks, /tracker/detections and
    /// /tracker/annotations (for Foxglove's image panel).
    #[arg(long, value_name = "FILE.mcap")]
    bag: Option<PathBuf>,
    /// Opens the frames on the live page instead, at viewer.port or any free port: mark, play, tune and run again in a
    /// browser. The page saves the rows and, with --bag, the bag.
    #[cfg(feature = "viewer")]
    #[arg(long, conflicts_with_all = ["output", "annotate"])]
    view: bool,
}

/// Runs the command to the end of the frames.
pub fn run(args: &Args) -> Result<(), Error> {
    let params = params(&args.params, args.algorithm.as_deref(), &args.set)?;
    let mut source = replay::open(&args.source, args.topic.as_deref(), &params.limits).map_err(Error::Source)?;
    source.notes().iter().for_each(|note| log::warn!("{note}"));
    let finds = params.general.algorithm == Algorithm::Maptrack;
    #[cfg(feature = "viewer")]
    if args.view {
        return view(args, source, params);
    }
    let target = match target(args, source.as_ref()) {
        Err(Error::NoTarget(_)) if finds => None,
        target => Some(target?),
    };
    let first = source.next_frame().map_err(Error::Read)?;
    let mut session = Session::new(params)?;
    let mut watch = (StageClock::default(), Scene::default());
    let mut processing = Duration::ZERO;
    if let Some(buffer) = &first {
        watch.0.begin();
        match target {
            Some((init, from)) => {
                let started = session.start(&buffer.frame(), init, &mut watch);
                started.map_err(|source| Error::Start { from, source })?;
            }
            None => drop(session.step(&buffer.frame(), &mut watch)),
        }
        processing = watch.0.end();
    }
    let mut rows = Rows::create(args.output.as_deref(), finds)?;
    let pictures = args.annotate.as_deref().map(Pictures::create).transpose()?;
    let algorithm = session.params().general.algorithm.name();
    let mut bag = args.bag.as_deref().map(|path| Recorder::create(path, algorithm)).transpose()?;

    let bar = progress(source.remaining().map(|n| n.saturating_add(1)));
    let begun = Instant::now();
    let mut next = first;
    let mut frames = 0;
    let mut failures = FailureLog::default();
    while let Some(buffer) = next {
        let frame = buffer.frame().with_levels(session.params().levels.range());
        if frames > 0 {
            watch.1.clear();
            watch.0.begin();
            session.step(&frame, &mut watch);
            processing = watch.0.end();
            failures.watch(&session);
        }
        frames += 1;
        // Nobody may read the rows any more, but what else was asked for is made to its end.
        if !rows.write(frames, session.output())? && bag.is_none() && pictures.is_none() {
            return Ok(());
        }
        if let Some(bag) = &mut bag {
            bag.write(source.origin(), session.output(), processing)?;
        }
        if let Some(pictures) = &pictures {
            pictures.write(frames, &frame, session.output(), &watch.1)?;
        }
        bar.inc(1);
        next = source.next_frame().map_err(Error::Read)?;
    }
    rows.finish()?;
    bag.map_or(Ok(()), Recorder::finish)?;
    bar.finish_and_clear();
    // Again at the end, for what was said at the beginning is far away by now.
    let noted: String = source.notes().iter().map(|note| format!("; note: {note}")).collect();
    tell(format_args!("{}; {:.1} with reading and writing{noted}", watch.0, per_second(frames, begun.elapsed())));
    Ok(())
}

/// Shows the frames on the live page.
#[cfg(feature = "viewer")]
fn view(args: &Args, source: Box<dyn FrameSource>, params: Params) -> Result<(), Error> {
    let target = match target(args, source.as_ref()) {
        Err(Error::NoTarget(_)) => None,
        target => Some(target?.0),
    };
    let hub = Hub::keeping(view::SAMPLES);
    let recording = Recording { path: args.source.clone(), topic: args.topic.clone() };
    let player = Player::new(recording, source, params, hub.clone())?;
    view::run(player, &hub, &args.source.display().to_string(), target, args.bag.clone())
}

/// The target's box on the first frame, and what it was taken from.
fn target(args: &Args, source: &dyn FrameSource) -> Result<(Rect, String), Error> {
    if let Some(rect) = args.init {
        return Ok((rect, "--init".to_owned()));
    }
    let candidates = source.truth_candidates();
    let path = candidates.iter().find(|p| p.exists()).or(candidates.first());
    let path = path.map_or_else(|| PathBuf::from(truth::FILE_NAME), Clone::clone);
    if !path.exists() {
        return Err(Error::NoTarget(path));
    }
    match truth::read(&path).map_err(Error::Truth)?.first() {
        Some(&Some(rect)) => Ok((rect, path.display().to_string())),
        _ => Err(Error::NoTarget(path)),
    }
}

/// Where the rows go.
struct Rows {
    out: Box<dyn Write>,
    name: String,
    /// Whether there is a row for each target of a frame.
    many: bool,
}

impl Rows {
    fn create(path: Option<&Path>, many: bool) -> Result<Self, Error> {
        let (out, name): (Box<dyn Write>, _) = match path {
            None => (Box::new(io::stdout().lock()), "standard output".to_owned()),
            Some(path) => {
                let file = File::create(path).map_err(|source| Error::Create { path: path.to_owned(), source })?;
                (Box::new(BufWriter::new(file)), path.display().to_string())
            }
        };
        let mut rows = Self { out, name, many };
        if !many {
            let header = writeln!(rows.out, "{}", rows::HEADER);
            rows.check(header)?;
        }
        Ok(rows)
    }

    /// Writes the rows of a frame, counted from 1. `false`: nobody reads on.
    fn write(&mut self, frame: usize, output: &Output) -> Result<bool, Error> {
        let written = if self.many {
            rows::write_mot(&mut self.out, frame, output)
        } else {
            rows::write(&mut self.out, output).and_then(|()| writeln!(self.out))
        };
        self.check(written)
    }

    fn finish(mut self) -> Result<(), Error> {
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

/// The folder of annotated frames.
struct Pictures {
    folder: PathBuf,
}

impl Pictures {
    fn create(folder: &Path) -> Result<Self, Error> {
        std::fs::create_dir_all(folder).map_err(|source| Error::Create { path: folder.to_owned(), source })?;
        Ok(Self { folder: folder.to_owned() })
    }

    fn write(&self, number: usize, frame: &Frame, output: &Output, scene: &Scene) -> Result<(), Error> {
        let (left, right) = (draw::annotated(frame, output, scene, u32::MAX), draw::response(frame, scene, u32::MAX));
        let mut both = RgbImage::new(left.width() + right.width(), left.height());
        imageops::replace(&mut both, &left, 0, 0);
        imageops::replace(&mut both, &right, i64::from(left.width()), 0);
        let path = self.folder.join(format!("{number:06}.png"));
        let failed = |why: String| Error::Write { to: path.display().to_string(), why };
        let mut file = BufWriter::new(File::create(&path).map_err(|e| failed(e.to_string()))?);
        PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
            .write_image(&both, both.width(), both.height(), image::ExtendedColorType::Rgb8)
            .map_err(|e| failed(e.to_string()))?;
        file.flush().map_err(|e| failed(e.to_string()))
    }
}
