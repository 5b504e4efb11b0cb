//! Targets that leave and come back, anywhere in the image and in another size: real targets, cut out of the sequences
//! in the folder that `SEQUENCES_DIR` names, on the real video of others. Where it is not set the test says that it is
//! skipped. `RETURNS=200 cargo test --release --test returns -- --nocapture` makes that many; `PRESET` names a preset
//! or a file of parameters.

#[path = "support/sequences.rs"]
mod sequences;

use std::ops::AddAssign;
use std::path::{Path, PathBuf};

use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};
use long_term_tracker::params::{self, NodeName, Params, Phase};
use long_term_tracker::replay::truth;
use long_term_tracker::{Encoding, Frame, Rect, Session, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sequences::sequence;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
/// Frames before the target leaves, and after it has come back. Frames that it has to be found again in.
const BEFORE: usize = 45;
const AFTER: usize = 45;
const IN_TIME: usize = 30;
/// Overlap of a box that shows the target.
const SHOWN: f64 = 0.3;
/// Frames that a target may be gone before it is called lost.
const NOTICE: usize = 10;

const TARGETS: [&str; 10] = [
    "David",
    "Crossing",
    "Football1",
    "Woman",
    "TLD-car",
    "bag",
    "VOT14-polarbear",
    "VOT14-sphere",
    "UAV-car14",
    "Couple",
];
const BACKGROUNDS: [&str; 8] = [
    "Jogging-1",
    "TLD-pedestrian3",
    "UAV-person11",
    "VOT14-fernando",
    "Girl",
    "TLD-pedestrian2",
    "VOT14-hand1",
    "UAV-wakeboard4",
];

/// What a tracker made of one or more made sequences.
#[derive(Default, Debug)]
struct Score {
    made: usize,
    found: usize,
    /// Frames in which the target was gone for long enough, and those of them that were called tracking.
    gone: usize,
    wrong: usize,
    /// Times that something else was taken for the target that had been lost.
    false_again: usize,
}

impl AddAssign for Score {
    fn add_assign(&mut self, other: Self) {
        self.made += other.made;
        self.found += other.found;
        self.gone += other.gone;
        self.wrong += other.wrong;
        self.false_again += other.false_again;
    }
}

/// The images of a sequence.
fn images(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder.join("img")).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    files
}

/// A target, as it looks from frame to frame, cut out with what surrounds it inside its box.
struct Cutouts(Vec<RgbImage>);

impl Cutouts {
    fn new(folder: &Path, count: usize) -> Self {
        let boxes = truth::read(&folder.join(truth::FILE_NAME)).unwrap();
        let cut = |(file, rect): (&PathBuf, Option<Rect>)| {
            let Rect { x, y, w, h } = rect?;
            let image = image::open(file).unwrap().to_rgb8();
            let inside = x >= 0.0 && y >= 0.0 && x + w <= image.width().into() && y + h <= image.height().into();
            inside.then(|| crop_imm(&image, x as u32, y as u32, w as u32, h as u32).to_image())
        };
        Self(images(folder).iter().zip(boxes).take(count).filter_map(cut).collect())
    }

    /// The look of frame `i`, so that it covers `side` squared pixels; it goes back and forth where it ends.
    fn look(&self, i: usize, side: f64) -> RgbImage {
        let look = &self.0[there_and_back(i, self.0.len())];
        let factor = side / f64::from(look.width() * look.height()).sqrt();
        let size = |v: u32| ((f64::from(v) * factor).round() as u32).max(6);
        resize(look, size(look.width()), size(look.height()), FilterType::Triangle)
    }
}

fn there_and_back(i: usize, count: usize) -> usize {
    let at = i % (2 * count - 1);
    if at < count { at } else { 2 * count - 1 - at }
}

/// Puts the look into the image around `centre`, within an ellipse with a soft rim, and tells its box.
fn put(image: &mut RgbImage, look: &RgbImage, centre: [f64; 2]) -> Rect {
    let (w, h) = (look.width(), look.height());
    let left = (centre[0] - f64::from(w) / 2.0).round();
    let top = (centre[1] - f64::from(h) / 2.0).round();
    for (x, y, pixel) in look.enumerate_pixels() {
        let r = |v: u32, side: u32| (2.0 * (f64::from(v) + 0.5) / f64::from(side) - 1.0).powi(2);
        let share = ((1.1 - (r(x, w) + r(y, h)).sqrt()) / 0.2).clamp(0.0, 1.0);
        let (x, y) = (left + f64::from(x), top + f64::from(y));
        if x >= 0.0 && y >= 0.0 && x < f64::from(image.width()) && y < f64::from(image.height()) {
            let under = image.get_pixel_mut(x as u32, y as u32);
            for (under, over) in under.0.iter_mut().zip(pixel.0) {
                *under = (f64::from(*under) + share * (f64::from(over) - f64::from(*under))).round() as u8;
            }
        }
    }
    Rect::new(left, top, f64::from(w), f64::from(h))
}

/// Plays one made sequence.
fn play(params: &Params, cutouts: &Cutouts, background: &[RgbImage], seed: u64) -> Score {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let side = rng.random_range(24.0..80.0);
    let gone = rng.random_range(30..=300);
    let factor = 1.5f64.powf(rng.random_range(-1.0..=1.0));
    let place = |rng: &mut ChaCha8Rng| [rng.random_range(80.0..560.0), rng.random_range(80.0..400.0)];
    let (mut at, back) = (place(&mut rng), place(&mut rng));
    let velocity = [(); 2].map(|()| rng.random_range(-1.5..=1.5));
    // Half of them leave by the nearer side, the others vanish.
    let leaves = rng.random_bool(0.5);
    let mut session = Session::new(params.clone()).unwrap();
    let mut score = Score { made: 1, ..Score::default() };
    let mut found = false;
    for i in 0..BEFORE + gone + AFTER {
        let mut image = background[there_and_back(i, background.len())].clone();
        let is_there = i < BEFORE || i >= BEFORE + gone;
        if i == BEFORE + gone {
            at = back;
        }
        let leaving = leaves && (BEFORE..BEFORE + gone).contains(&i);
        let step = if leaving { [if at[0] < 320.0 { -12.0 } else { 12.0 }, 0.0] } else { velocity };
        at = [at[0] + step[0], at[1] + step[1]];
        let scale = if i >= BEFORE + gone { factor } else { 1.0 };
        let rect = (is_there || leaving).then(|| put(&mut image, &cutouts.look(i, scale * side), at));
        let frame = Frame::new(&image, WIDTH, HEIGHT, WIDTH as usize * 3, Encoding::Rgb8, None).unwrap();
        if i == 0 {
            session.start(&frame, rect.unwrap(), &mut ()).unwrap();
            continue;
        }
        session.step(&frame, &mut ());
        let target = &session.output().targets[0];
        let shows = rect.is_some_and(|rect| target.rect.iou(&rect) > SHOWN);
        let tracks = target.state == State::Tracking;
        if !is_there && i >= BEFORE + NOTICE && !leaving_is_in_view(leaving, rect) {
            score.gone += 1;
            score.wrong += usize::from(tracks);
        }
        score.false_again += usize::from(target.reacquired && !shows);
        found |= i >= BEFORE + gone && i < BEFORE + gone + IN_TIME && tracks && shows;
    }
    score.found = usize::from(found);
    score
}

/// Whether something of a target that leaves is still to be seen.
fn leaving_is_in_view(leaving: bool, rect: Option<Rect>) -> bool {
    leaving && rect.is_some_and(|r| r.x < f64::from(WIDTH) && r.x + r.w > 0.0)
}

#[test]
fn a_target_that_comes_back_anywhere_is_found_within_a_second() {
    let Some(_) = sequence("David") else { return };
    let count: usize = std::env::var("RETURNS").map_or(12, |count| count.parse().unwrap());
    let preset = std::env::var("PRESET").unwrap_or_else(|_| "fast".to_owned());
    let set = params::preset_or_file(Path::new(&preset), &NodeName::default()).unwrap();
    let params =
        Params::default().with(set.iter().map(|(name, value)| (name.as_str(), value)), Phase::StartUp).unwrap();
    let cutouts: Vec<Cutouts> = TARGETS.iter().map(|name| Cutouts::new(&sequence(name).unwrap(), 60)).collect();
    let open = |file: &PathBuf| resize(&image::open(file).unwrap().to_rgb8(), WIDTH, HEIGHT, FilterType::Triangle);
    let background = |name: &&str| images(&sequence(name).unwrap()).iter().take(60).map(open).collect();
    let backgrounds: Vec<Vec<RgbImage>> = BACKGROUNDS.iter().map(background).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let made = |k: usize| play(&params, &cutouts[k % cutouts.len()], &backgrounds[k / 3 % backgrounds.len()], k as u64);
    let sum = |scores: &mut dyn Iterator<Item = Score>| {
        scores.fold(Score::default(), |mut sum, next| {
            sum += next;
            sum
        })
    };
    let part = |t: usize| sum(&mut (t..count).step_by(threads).map(made));
    let score = std::thread::scope(|scope| {
        let parts: Vec<_> = (0..threads).map(|t| scope.spawn(move || part(t))).collect();
        sum(&mut parts.into_iter().map(|part| part.join().unwrap()))
    });
    println!("{score:?}");
    assert!(score.found * 10 >= score.made * 8, "{score:?}");
    assert!(score.wrong * 25 <= score.gone, "{score:?}");
}
