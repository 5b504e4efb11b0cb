//! Stamps that lie, stand still, jump or come in bursts: the same pictures are followed as well, however they are
//! stamped. Where frames are truly skipped, stamps tell how far the target has come.

use std::fmt::Display;

use long_term_tracker::decode::decode;
use long_term_tracker::frame::FrameBuffer;
use long_term_tracker::params::{Params, Phase, Value};
use long_term_tracker::replay::truth;
use long_term_tracker::{Encoding, Rect, Session};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::support::sequence;

/// A frame period in nanoseconds.
const PERIOD: i64 = 33_333_333;
const MS: i64 = 1_000_000;
const SECOND: i64 = 1_000 * MS;
/// When the camera started, but for clocks that are not set yet.
const START: i64 = 1_700_000_000 * SECOND;
/// How many percent of the frames fewer may be on target than with even stamps.
const LESS: f64 = 3.0;
/// Pixels that the made target moves in a frame.
const SPEED: f64 = 6.0;

/// Pictures of a target.
struct Clip {
    name: &'static str,
    pictures: Vec<Picture>,
    truth: Vec<Option<Rect>>,
}

enum Picture {
    File(Vec<u8>),
    Pixels(Vec<u8>),
}

/// Which pictures are shown, and with what stamps.
type Plan = Vec<(usize, Option<i64>)>;

/// What came of a plan.
struct Seen {
    /// Percent of the frames whose box overlaps the target by more than half.
    on_target: f64,
    /// The velocities of the last 20 frames along x, in pixels a second.
    velocities: Vec<f64>,
}

impl Clip {
    /// A textured box that goes evenly to the right before a ground of blocks.
    fn made() -> Self {
        const WIDTH: usize = 640;
        const HEIGHT: usize = 240;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut blocks = |count: usize, low: u8, high: u8| -> Vec<[u8; 3]> {
            (0..count).map(|_| [0; 3].map(|_: u8| rng.random_range(low..=high))).collect()
        };
        let (ground, own) = (blocks(80 * 30, 60, 180), blocks(80, 0, 255));
        let place = |i: usize| (40 + SPEED as usize * i, (100.0 + 10.0 * (i as f64 / 6.0).sin()) as usize);
        let picture = |i: usize| {
            let (left, top) = place(i);
            let pixel = |k: usize| {
                let (x, y) = (k % WIDTH, k / WIDTH);
                let inside = (left..left + 32).contains(&x) && (top..top + 40).contains(&y);
                if inside { own[(y - top) / 4 * 8 + (x - left) / 4] } else { ground[y / 8 * 80 + x / 8] }
            };
            Picture::Pixels((0..WIDTH * HEIGHT).flat_map(pixel).collect())
        };
        let truth = |i: usize| Some(Rect::new(place(i).0 as f64, place(i).1 as f64, 32.0, 40.0));
        Self { name: "made", pictures: (0..90).map(picture).collect(), truth: (0..90).map(truth).collect() }
    }

    /// The beginning of a sequence; `None` where there is no video.
    fn real(name: &'static str, frames: usize) -> Option<Self> {
        let folder = sequence(name)?;
        let entries = std::fs::read_dir(folder.join("img")).unwrap();
        let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        let pictures = files.iter().take(frames).map(|file| Picture::File(std::fs::read(file).unwrap())).collect();
        let mut truth = truth::read(&folder.join(truth::FILE_NAME)).unwrap();
        truth.truncate(frames);
        Some(Self { name, pictures, truth })
    }

    fn frame(&self, i: usize, stamp: Option<i64>) -> FrameBuffer {
        match &self.pictures[i] {
            Picture::File(bytes) => decode(bytes, stamp, u64::MAX).unwrap(),
            Picture::Pixels(data) => FrameBuffer::new(data.clone(), 640, 240, 1920, Encoding::Rgb8, stamp).unwrap(),
        }
    }

    /// Follows the target through the pictures of the plan.
    fn follow(&self, plan: &Plan, params: &Params) -> Seen {
        let mut session = Session::new(params.clone()).unwrap();
        let first = self.truth[plan[0].0].unwrap();
        let (mut good, mut all, mut velocities) = (0, 0, Vec::new());
        for (n, &(i, stamp)) in plan.iter().enumerate() {
            let buffer = self.frame(i, stamp);
            let frame = buffer.frame();
            let output = match n {
                0 => session.start(&frame, first, &mut ()).unwrap(),
                _ => session.step(&frame, &mut ()),
            };
            let target = &output.targets[0];
            velocities.push(target.velocity[0]);
            if let Some(truth) = self.truth[i] {
                all += 1;
                good += usize::from(target.rect.iou(&truth) > 0.5);
            }
        }
        velocities.drain(..plan.len().saturating_sub(20));
        Seen { on_target: 100.0 * f64::from(good as u32) / f64::from(all), velocities }
    }

    /// All pictures, stamped by their number.
    fn stamped(&self, at: impl FnMut(i64) -> i64) -> Plan {
        let mut at = at;
        (0..self.pictures.len()).map(|i| (i, Some(at(i as i64)))).collect()
    }

    /// These pictures with their true stamps.
    fn skipped(&self, mut keep: impl FnMut(usize) -> bool) -> Plan {
        let kept = (0..self.pictures.len()).filter(|&i| i == 0 || keep(i));
        kept.map(|i| (i, Some(START + i as i64 * PERIOD))).collect()
    }

    fn even(&self) -> Plan {
        self.stamped(|i| START + i * PERIOD)
    }
}

/// The stamp of a frame, by its number.
type Stamps = fn(i64) -> i64;

/// Stamps that are not those of a camera, by the name of what is wrong with them.
const LIES: &[(&str, Stamps)] = &[
    ("pairs 1 ms apart", |i| START + in_bursts(i, 2, MS)),
    ("pairs 16 ms apart", |i| START + in_bursts(i, 2, 16 * MS)),
    ("fives 12 ms apart", |i| START + in_bursts(i, 5, 12 * MS)),
    ("fives 8 ms apart", |i| START + in_bursts(i, 5, 8 * MS)),
    ("fives 2 ms apart", |i| START + in_bursts(i, 5, 2 * MS)),
    ("tens 3 ms apart", |i| START + in_bursts(i, 10, 3 * MS)),
    ("one stall", |i| START + if (40..48).contains(&i) { 48 * PERIOD - (48 - i) * MS } else { i * PERIOD }),
    ("a stall each second", |i| {
        let (second, n) = (i - i % 30, i % 30);
        let at = if (15..25).contains(&n) { 24 * PERIOD + (n - 15) * MS } else { n * PERIOD };
        START + second * PERIOD + at
    }),
    ("a step of an hour", |i| START + i * PERIOD + after(40, i, 3600 * SECOND)),
    ("a step of half a second", |i| START + i * PERIOD + after(40, i, SECOND / 2)),
    ("from 1970 to now", |i| 5 + i * PERIOD + after(30, i, START)),
    ("an hour back", |i| START + i * PERIOD - after(40, i, 3600 * SECOND)),
    ("each stamp twice", |i| START + i / 2 * 2 * PERIOD),
    ("each stamp three times", |i| START + i / 3 * 3 * PERIOD),
    ("nanoseconds beyond a second", |i| START + i * PERIOD / SECOND * SECOND + (i * PERIOD) % (1 << 32)),
    ("microseconds for nanoseconds", |i| START + i * PERIOD / SECOND * SECOND + i * PERIOD % SECOND / 1000),
    ("1 ns apart at times", |i| START + i / 3 * 3 * PERIOD + i % 3),
    ("always 1 ns apart", |i| START + i),
    ("always the same", |_| START),
];

/// Frames that come `count` at a time, so far apart.
const fn in_bursts(i: i64, count: i64, apart: i64) -> i64 {
    i / count * count * PERIOD + i % count * apart
}

/// `by` from frame `from` on.
const fn after(from: i64, i: i64, by: i64) -> i64 {
    if i >= from { by } else { 0 }
}

/// Stamps drawn at random, by the way they were drawn.
fn drawn(clip: &Clip, seed: u64) -> Vec<(String, Plan)> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let length = clip.pictures.len() as i64 * PERIOD;
    let mut plans = vec![("anywhere".to_owned(), clip.stamped(|_| START + rng.random_range(0..length)))];
    let mut sorted: Vec<i64> = clip.pictures.iter().map(|_| START + rng.random_range(0..length)).collect();
    sorted.sort_unstable();
    plans.push(("anywhere in order".to_owned(), clip.stamped(|i| sorted[i as usize])));
    for jitter in [5, 10, 20, 60] {
        let mut off = || rng.random_range(-jitter * MS..=jitter * MS);
        plans.push((format!("{jitter} ms of jitter"), clip.stamped(|i| START + i * PERIOD + off())));
    }
    for digits in [0.0..10.0, 6.0..8.5] {
        let mut now = START;
        let mut next = |rng: &mut dyn Rng| {
            now += 10f64.powf(rng.random_range(digits.clone())) as i64;
            now
        };
        plans.push((format!("intervals of any size, {digits:?} digits"), clip.stamped(|_| next(rng))));
    }
    plans
}

/// The parameters of an algorithm; of the default one without the network, which takes most of the time, and of
/// MAPTrack also as its paper has it, without a pattern.
fn params(algorithm: &str) -> Params {
    let (name, off) = (Value::String(algorithm.split(' ').next().unwrap().into()), Value::Bool(false));
    let (pattern, most) = (Value::Bool(algorithm != PAPERS_MAPTRACK), Value::Integer(0));
    let changes = [
        ("algorithm", &name),
        ("lcmht.cnn.enabled", &off),
        ("maptrack.pattern.enabled", &pattern),
        ("maptrack.find.most", &most),
    ];
    Params::default().with(changes, Phase::StartUp).unwrap()
}

const PAPERS_MAPTRACK: &str = "maptrack without a pattern";

/// Follows the target by each plan, and says which are more than [`LESS`] worse than with even stamps, or tell of
/// velocities that nothing has.
fn worse<S: Display>(clip: &Clip, algorithm: &str, plans: impl IntoIterator<Item = (S, Plan)>) -> Vec<String> {
    let params = params(algorithm);
    let even = clip.follow(&clip.even(), &params);
    let mut faults = Vec::new();
    for (kind, plan) in plans {
        let seen = clip.follow(&plan, &params);
        let fastest = seen.velocities.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let sane = seen.velocities.iter().all(|v| v.abs() < FASTEST);
        if seen.on_target < even.on_target - LESS || !sane {
            let Clip { name, .. } = clip;
            let (got, wanted) = (seen.on_target, even.on_target);
            faults.push(format!("{algorithm}, {name}, {kind}: {got:.0} % for {wanted:.0} %, up to {fastest:.0} px/s"));
        }
    }
    faults
}

/// No target of these clips moves faster, in pixels a second.
const FASTEST: f64 = 5_000.0;

fn lies(clip: &Clip) -> impl Iterator<Item = (&'static str, Plan)> {
    LIES.iter().map(|(kind, at)| (*kind, clip.stamped(at)))
}

fn none(faults: Vec<String>) {
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn lcmht_follows_as_well_whatever_the_stamps() {
    let clip = Clip::made();
    none(worse(&clip, "lcmht", lies(&clip)));
}

#[test]
fn etepf_follows_as_well_whatever_the_stamps() {
    let clip = Clip::made();
    none(worse(&clip, "etepf", lies(&clip)));
}

#[test]
fn maptrack_follows_as_well_whatever_the_stamps() {
    let clip = Clip::made();
    none(worse(&clip, "maptrack", lies(&clip)));
    none(worse(&clip, PAPERS_MAPTRACK, lies(&clip)));
}

#[test]
fn stamps_drawn_at_random_do_no_harm() {
    let clip = Clip::made();
    for (seed, algorithm) in ["lcmht", "etepf", "maptrack", PAPERS_MAPTRACK].into_iter().enumerate() {
        none(worse(&clip, algorithm, drawn(&clip, seed as u64)));
    }
}

/// Whether a frame is kept, by its number.
type Keep = Box<dyn FnMut(usize) -> bool>;

/// Ways to skip frames, by seed.
fn skips(seed: u64) -> Vec<(&'static str, Keep)> {
    let [mut half, mut steps, mut gaps] = [1, 2, 3].map(|n| ChaCha8Rng::seed_from_u64(10 * n + seed));
    let (mut next, mut after_gap) = (0, 0);
    vec![
        ("every 2nd", Box::new(|i| i % 2 == 0)),
        ("every 5th", Box::new(|i| i % 5 == 0)),
        ("two of five", Box::new(|i| i % 5 == 0 || i % 5 == 2)),
        ("one half by chance", Box::new(move |_| half.random_range(0..2) == 0)),
        ("one to four frames ahead", Box::new(move |i| keep(i, &mut next, || steps.random_range(1..=4)))),
        ("gaps at times", Box::new(move |i| keep(i, &mut after_gap, || [1, 1, 1, 1, 5, 8][gaps.random_range(0..6)]))),
    ]
}

/// Whether frame `i` is the next to be kept, and then which is after it.
fn keep(i: usize, next: &mut usize, step: impl FnOnce() -> usize) -> bool {
    let is_next = i >= *next;
    if is_next {
        *next = i + step();
    }
    is_next
}

/// Without their stamps the target would be lost behind some of the gaps.
#[test]
fn skipped_frames_are_told_by_their_stamps() {
    let (clip, params) = (Clip::made(), params("lcmht"));
    let mut blind = Vec::new();
    for seed in 0..2 {
        for (kind, keep) in skips(seed) {
            let plan = clip.skipped(keep);
            let unstamped = plan.iter().map(|&(i, _)| (i, None)).collect();
            let seen = clip.follow(&plan, &params).on_target;
            assert!(seen > 95.0, "{kind}, {seed}: {seen:.0} %");
            blind.push(clip.follow(&unstamped, &params).on_target);
        }
    }
    assert!(blind.iter().any(|&on_target| on_target < 90.0), "{blind:?}");
}

/// Velocities come by the mean rate where stamps lie, by the period where frames are skipped.
#[test]
fn velocities_are_those_of_the_target() {
    let (clip, params) = (Clip::made(), params("lcmht"));
    let truth = SPEED * 1e9 / PERIOD as f64;
    let check = |kind: &str, plan: Plan, expected: f64| {
        let seen = clip.follow(&plan, &params);
        let within = |v: &f64| (0.5 * expected..2.0 * expected).contains(v);
        assert!(seen.velocities.iter().all(within), "{kind}: {:?} for {expected}", seen.velocities);
    };
    let kinds =
        ["pairs 1 ms apart", "fives 8 ms apart", "a stall each second", "a step of an hour", "each stamp twice"];
    for (kind, plan) in lies(&clip).filter(|(kind, _)| kinds.contains(kind) || kind.starts_with("always")) {
        // Stamps that do not count time tell pixels an image.
        let expected = if kind.starts_with("always") { SPEED } else { truth };
        check(kind, plan, expected);
    }
    check("gaps", clip.skipped(|i| i % 9 < 6), truth);
    check("no stamps", clip.even().iter().map(|&(i, _)| (i, None)).collect(), SPEED);
}

/// The beginnings of real sequences, long enough for each kind of stamps to do its harm.
#[test]
fn real_targets_are_followed_as_well_whatever_the_stamps() {
    let kinds = ["fives 8 ms apart", "a stall each second", "a step of an hour"];
    for (name, frames) in [("Deer", 50), ("Skiing", 40), ("Couple", 60), ("Crossing", 50)] {
        let Some(clip) = Clip::real(name, frames) else { return };
        let lies = lies(&clip).filter(|(kind, _)| kinds.contains(kind)).map(|(kind, plan)| (kind.to_owned(), plan));
        none(worse(&clip, "lcmht", lies.chain(drawn(&clip, 5).into_iter().take(2))));
    }
}
