//! Steps that must not allocate once their buffers have grown, watched by the allocator itself.

#![expect(unsafe_code, reason = "an allocator is unsafe to be one")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use long_term_tracker::crop::{Cropper, Patch};
use long_term_tracker::detect::background::{Background, BackgroundSettings};
use long_term_tracker::detect::blobs::{BlobFinder, Morphology};
use long_term_tracker::detect::camera::warp;
use long_term_tracker::detect::stabilisation::Stabiliser;
use long_term_tracker::filter::Vector;
use long_term_tracker::filter::gm_phd::{GmPhd, GmPhdSettings};
use long_term_tracker::filter::motion::{MotionModel, Noise};
use long_term_tracker::params::{Params, Phase, Value};
use long_term_tracker::{Encoding, Frame, Rect, Session, State};

thread_local! {
    /// Allocations of this thread: tests run side by side.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to `System` as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: the caller's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: the caller's.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often `work` allocates.
fn allocations(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

#[test]
fn the_counter_counts() {
    assert!(allocations(|| drop(std::hint::black_box(vec![1, 2, 3]))) > 0);
}

/// A square that moves over still texture, and a camera that shakes by a pixel.
#[test]
fn motion_is_found_and_a_camera_followed_without_allocating_once_warm() {
    const SIDE: usize = 160;
    let frame = |k: usize| -> Vec<u8> {
        let pixel = |i: usize| {
            let (x, y) = (i % SIDE + k % 2, i / SIDE);
            let square = (20..50).contains(&(x + 160 - 2 * k)) && (60..90).contains(&y);
            if square { 250 } else { ((x / 4 * 7919 + y / 4 * 104_729) % 181) as u8 }
        };
        (0..SIDE * SIDE).map(pixel).collect()
    };
    let frames: Vec<Vec<u8>> = (70..100).map(frame).collect();
    let (mut cropper, mut patch) = (Cropper::default(), Patch::default());
    let (mut stabiliser, mut still, mut covered) = (Stabiliser::default(), Patch::default(), Vec::new());
    let (mut background, mut mask) = (Background::new(BackgroundSettings::default()), Vec::new());
    let (mut morphology, mut finder, mut blobs) = (Morphology::default(), BlobFinder::default(), Vec::new());
    let mut round = || {
        for data in &frames {
            let frame = Frame::new(data, SIDE as u32, SIDE as u32, SIDE, Encoding::Mono8, None).unwrap();
            cropper.crop_luma(&frame, &frame.bounds(), SIDE, SIDE, &mut patch);
            let motion = stabiliser.step(&patch).expect("a still scene");
            warp(&patch, &motion, &mut still, &mut covered);
            background.apply(&still, &mut mask);
            morphology.open_close(&mut mask, SIDE, SIDE, 3);
            finder.find(&mask, SIDE, &mut blobs);
        }
    };
    round();
    assert_eq!(allocations(&mut round), 0);
    assert!(!blobs.is_empty(), "it looked at something");
}

/// A tracked box in most frames, five proposals in some.
#[test]
fn gm_phd_steps_allocate_nothing_once_warm() {
    let noise = Noise { process: [0.5, 0.5, 1.0, 1.0], measurement: [4.0, 4.0, 9.0, 9.0] };
    let model = MotionModel::centre_size(noise);
    let birth = model.diagonal(&Vector::repeat(25.0), &Vector::repeat(25.0));
    let mut filter = GmPhd::new(model, GmPhdSettings::new(640.0 * 480.0 * 20.0 * 40.0, birth));
    let round = |filter: &mut GmPhd<6, 4>| {
        for frame in 0..40 {
            let t = f64::from(frame);
            let target = Vector::from([100.0 + 3.0 * t, 200.0, 30.0, 60.0]);
            let proposals =
                [-80.0, -31.0, 0.0, 44.0, 90.0].map(|shift| target + Vector::from([shift, shift, 0.0, 0.0]));
            filter.predict(1.0);
            filter.update(if frame % 3 == 2 { &proposals } else { std::slice::from_ref(&target) });
        }
    };
    assert!(allocations(|| round(&mut filter)) > 0);
    filter.reset(&[]);
    assert_eq!(allocations(|| round(&mut filter)), 0);
    assert!(filter.components().len() > 1);
}

/// The left edge of a square that goes 60 px forth and back, a pixel a frame.
fn left(frame: usize) -> usize {
    40 + 60 - (frame % 120).abs_diff(60)
}

/// A textured square of 32 px that moves over noise.
fn scene(frame: usize) -> Vec<u8> {
    let left = left(frame);
    let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + (x * y) % 97 * 31) % 61) as u8;
    let mut data = Vec::with_capacity(160 * 120 * 3);
    for y in 0usize..120 {
        for x in 0usize..160 {
            let inside = (left..left + 32).contains(&x) && (44..76).contains(&y);
            let [u, v] = [x.wrapping_sub(left), y.wrapping_sub(44)];
            let value = if inside { 40 + ((u / 4 * 53 + v / 5 * 91) % 200) as u8 } else { 80 + noise(x, y) };
            data.extend([value, value / 2, 255 - value]);
        }
    }
    data
}

/// Frames after which all buffers have grown: the detector keeps 100 examples and gets eight in every second frame, and
/// support vectors come and go.
const WARM: usize = 120;

/// Frames in which nothing is learned: what every frame costs.
#[test]
fn following_a_target_allocates_nothing_once_warm() {
    // Without the network: the libraries that run it allocate as they please.
    let (interval, network) = (Value::Integer(100), Value::Bool(false));
    follow_without_allocating(&[("lcmht.filter.interval", &interval), ("lcmht.cnn.enabled", &network)], 0.7);
}

/// Frames in which filter, scale and detector learn.
#[test]
fn learning_a_target_allocates_nothing_once_warm() {
    let network = Value::Bool(false);
    follow_without_allocating(&[("lcmht.cnn.enabled", &network)], 0.7);
}

/// Frames in which the target is looked for in a turned picture as well.
#[test]
fn looking_for_a_turned_target_allocates_nothing_once_warm() {
    // Bare responses stay below what is called a poor one, and above these thresholds.
    let (on, off, least, network) = (Value::Bool(true), Value::Bool(false), Value::Double(0.1), Value::Bool(false));
    let turns = [
        ("lcmht.turn.enabled", &on),
        ("lcmht.confidence.relative", &off),
        ("lcmht.confidence.activate", &least),
        ("lcmht.confidence.lost", &least),
    ];
    follow_without_allocating(&[&turns[..], &[("lcmht.cnn.enabled", &network)]].concat(), 0.7);
}

/// Frames before which the stamps have a gap, so that the target is looked for in two places.
#[test]
fn looking_in_two_places_after_a_gap_allocates_nothing_once_warm() {
    let (interval, network) = (Value::Integer(100), Value::Bool(false));
    let with_gaps = |frame: usize| Some(10_000_000 * (frame + 5 * (frame / 4)) as i64);
    let changes = [("lcmht.filter.interval", &interval), ("lcmht.cnn.enabled", &network)];
    follow_stamped_without_allocating(&changes, with_gaps, 0.7);
}

#[test]
fn following_a_target_by_particles_allocates_nothing_once_warm() {
    let (algorithm, update) = (Value::String("etepf".into()), Value::Bool(false));
    follow_without_allocating(&[("algorithm", &algorithm), ("etepf.update.enabled", &update)], 0.5);
}

/// Nothing is found beside the mark: each new target has buffers of its own. Its pattern holds the square, which has
/// the ground's colours and turns back over its own trail, background by then, so that the paper's images take it for
/// hidden.
#[test]
fn following_a_target_by_its_motion_allocates_nothing_once_warm() {
    let (algorithm, most) = (Value::String("maptrack".into()), Value::Integer(0));
    follow_without_allocating(&[("algorithm", &algorithm), ("maptrack.find.most", &most)], 0.5);
}

/// Frames in which the detector scans for a target that is gone. The library's matrix product takes a buffer for each
/// block of windows: of so small a target, one a frame.
#[test]
fn searching_for_a_lost_target_allocates_nothing_of_ours_once_warm() {
    let network = Value::Bool(false);
    let params = Params::default().with([("lcmht.cnn.enabled", &network)], Phase::StartUp).unwrap();
    let mut session = Session::new(params).unwrap();
    let there: Vec<Vec<u8>> = (0..40).map(scene).collect();
    let frame = |data| Frame::new(data, 160, 120, 480, Encoding::Rgb8, None).unwrap();
    session.start(&frame(&there[0]), Rect::new(40.0, 44.0, 32.0, 32.0), &mut ()).unwrap();
    there[1..].iter().for_each(|data| _ = session.step(&frame(data), &mut ()));
    // Checks: a ground with something in it, but not the square.
    let check = |i: usize| 45 + ((i % 160 / 11 + i / 160 / 9) % 2 * 40) as u8;
    let ground: Vec<u8> = (0..160 * 120).flat_map(|i| [90, check(i), 165]).collect();
    for _ in 0..40 {
        session.step(&frame(&ground), &mut ());
    }
    const SEARCHED: usize = 30;
    let count = allocations(|| {
        for _ in 0..SEARCHED {
            assert_eq!(session.step(&frame(&ground), &mut ()).targets[0].state, State::Lost);
        }
    });
    assert!(count <= SEARCHED, "{count}");
}

/// Follows the square with these parameters to the end, where the box is to overlap it by more than `overlap`.
fn follow_without_allocating(changes: &[(&str, &Value)], overlap: f64) {
    follow_stamped_without_allocating(changes, |_| None, overlap);
}

/// The same with stamps by the number of the frame.
fn follow_stamped_without_allocating(changes: &[(&str, &Value)], stamp: impl Fn(usize) -> Option<i64>, overlap: f64) {
    let params = Params::default().with(changes.iter().copied(), Phase::StartUp).unwrap();
    let mut session = Session::new(params).unwrap();
    let scenes: Vec<Vec<u8>> = (0..WARM + 30).map(scene).collect();
    let frame = |(i, data)| Frame::new(data, 160, 120, 480, Encoding::Rgb8, stamp(i)).unwrap();
    let frames: Vec<Frame> = scenes.iter().map(Vec::as_slice).enumerate().map(frame).collect();
    session.start(&frames[0], Rect::new(40.0, 44.0, 32.0, 32.0), &mut ()).unwrap();
    for frame in &frames[1..WARM] {
        session.step(frame, &mut ());
    }
    let count = allocations(|| {
        for frame in &frames[WARM..] {
            assert_ne!(session.step(frame, &mut ()).targets[0].state, State::Lost);
        }
    });
    assert_eq!(count, 0);
    let found = session.output().targets[0].rect;
    assert!(found.iou(&Rect::new(left(frames.len() - 1) as f64, 44.0, 32.0, 32.0)) > overlap, "{found}");
}
