//! `track`: follows a target, or all that move, through recorded frames and writes a row a frame, or a target and
//! frame.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Parser;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageEncoder, RgbImage, imageops};

use super::fleet::{self, Fleet};
use super::following::{Following, Mark};
#[cfg(feature = "viewer")]
use super::player::{Player, Recording};
use super::rows::Rows;
use super::timing::per_second;
#[cfg(feature = "viewer")]
use super::view;
use super::{Error, params, progress, tell};
use crate::draw::{self, Scene};
use crate::frame::Frame;
use crate::geometry::Rect;
#[cfg(feature = "viewer")]
use crate::params::Params;
use crate::params::{Assignment, assignment};
use crate::record::Recorder;
#[cfg(feature = "viewer")]
use crate::replay::FrameSource;
use crate::replay::{self, truth};
use crate::session::Session;
use crate::tracker::Output;
#[cfg(feature = "viewer")]
use crate::viewer::Hub;

/// Follow a target through recorded frames, or through many recordings at once.
///
/// Writes CSV: the header x,y,w,h,confidence,state, then one row per frame, starting with the initial box. Boxes are in
/// pixels from the top left corner. The state is tracking, uncertain or lost; the box of a lost target is the best
/// guess. With --algorithm maptrack, which finds targets by itself, rows are in MOTChallenge format without a header:
/// frame (from 1),id,x,y,w,h,confidence,-1,-1,-1; a lost target has no row. The last line on standard error gives the
/// speed. Exit codes: 0 done, 1 failed while running, 2 unusable arguments.
#[derive(Debug, Parser)]
#[command(name = "track", version = env!("PACKAGE_VERSION"))]
pub struct Args {
    /// A folder of images (JPEG, PNG, BMP, TIFF, WebP, PGM, PPM; in the order of the numbers in their names), or a
    /// folder with images in img/; or a rosbag2 recording: its folder, or one of its files (.mcap, .db3). Several
    /// recordings need --out.
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<PathBuf>,
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
    /// A preset's name, or a ROS parameter file. May be given several times; later ones override earlier ones.
    #[arg(long, value_name = "PRESET|FILE.yaml")]
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
    /// Tracks each SOURCE by itself, several at once, and writes its rows to DIR/NAME.csv, where NAME is the name of
    /// its file or folder. Recordings whose rows are there already are skipped; one that fails does not stop the
    /// others, and the exit code is 1. Also writes DIR/summary.json, the result of each recording, and
    /// DIR/parameters.yaml, with which all rows in DIR are made.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "annotate", "bag"])]
    out: Option<PathBuf>,
    /// The target's box in the first frame of each recording: rows of name,x,y,w,h. A recording without a row falls
    /// back on its groundtruth_rect.txt. --init gives all recordings the same box.
    #[arg(long, value_name = "FILE.csv", requires = "out", conflicts_with = "init")]
    marks: Option<PathBuf>,
    /// Number of recordings to track at once. Default: the number of cores.
    #[arg(long, value_name = "N", requires = "out")]
    threads: Option<NonZeroUsize>,
    /// Only prints the recordings that have no rows in DIR yet, one per line.
    #[arg(long, requires = "out")]
    pending: bool,
    /// Opens the frames on the live page instead, at viewer.port or any free port: mark, play, tune and run again in a
    /// browser. The page saves the rows and, with --bag, the bag.
    #[cfg(feature = "viewer")]
    #[arg(long, conflicts_with_all = ["output", "annotate", "out"])]
    view: bool,
}

/// Runs the command to the end of the frames.
pub fn run(args: &Args) -> Result<(), Error> {
    let params = params(&args.params, args.algorithm.as_deref(), &args.set)?;
    if let Some(out) = &args.out {
        let (topic, marks) = (args.topic.as_deref(), args.marks.as_deref());
        let fleet = Fleet { sources: &args.sources, topic, init: args.init, marks, out, threads: args.threads };
        return if args.pending { fleet::print_pending(&fleet, &params) } else { fleet::run(&fleet, &params) };
    }
    let [path] = args.sources.as_slice() else { return Err(Error::NeedsFolder(args.sources.len())) };
    let source = replay::open(path, args.topic.as_deref(), &params.limits).map_err(Error::Source)?;
    source.notes().iter().for_each(|note| log::warn!("{note}"));
    let algorithm = params.general.algorithm;
    #[cfg(feature = "viewer")]
    if args.view {
        return view(args, path, source, params);
    }
    let mark = match args.init {
        Some(rect) => Some(Mark { rect, from: "--init".to_owned() }),
        None => Mark::beside(source.as_ref(), algorithm)?,
    };
    let bar = progress(source.remaining());
    let mut following = Following::new(source, Session::new(params)?, mark);
    let mut scene = Scene::default();
    let mut next = following.step(&mut scene)?;
    let mut rows = Rows::create(args.output.as_deref(), algorithm)?;
    let pictures = args.annotate.as_deref().map(Pictures::create).transpose()?;
    let mut bag = args.bag.as_deref().map(|path| Recorder::create(path, algorithm.name())).transpose()?;

    let begun = Instant::now();
    while let Some(buffer) = next {
        let frame = buffer.frame().with_levels(following.session.params().levels.range());
        // Nobody may read the rows any more, but what else was asked for is made to its end.
        if !rows.write(following.frames, following.output())? && bag.is_none() && pictures.is_none() {
            return Ok(());
        }
        if let Some(bag) = &mut bag {
            bag.write(following.source.origin(), following.output(), following.processing)?;
        }
        if let Some(pictures) = &pictures {
            pictures.write(following.frames, &frame, following.output(), &scene)?;
        }
        bar.inc(1);
        scene.clear();
        next = following.step(&mut scene)?;
    }
    rows.finish()?;
    bag.map_or(Ok(()), Recorder::finish)?;
    bar.finish_and_clear();
    // Again at the end, for what was said at the beginning is far away by now.
    let noted: String = following.source.notes().iter().map(|note| format!("; note: {note}")).collect();
    let rate = per_second(following.frames, begun.elapsed());
    tell(format_args!("{}; {rate:.1} with reading and writing{noted}", following.clock));
    Ok(())
}

/// Shows the frames on the live page.
#[cfg(feature = "viewer")]
fn view(args: &Args, path: &Path, source: Box<dyn FrameSource>, params: Params) -> Result<(), Error> {
    let target = match (args.init, Mark::beside(source.as_ref(), params.general.algorithm)) {
        (Some(rect), _) => Some(rect),
        (None, Err(Error::NoTarget(_))) => None,
        (None, mark) => mark?.map(|mark| mark.rect),
    };
    let hub = Hub::keeping(view::SAMPLES);
    let recording = Recording { path: path.to_owned(), topic: args.topic.clone() };
    let player = Player::new(recording, source, params, hub.clone())?;
    view::run(player, &hub, &path.display().to_string(), target, args.bag.clone())
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
