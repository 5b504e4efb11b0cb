//! The clip that the package ships: the default tracker must follow the right person on it, by boxes drawn by hand; and
//! the demo, which shows it over ROS 2, must work as the README tells.

#[path = "../src/bin/tracker_demo/clip.rs"]
mod clip;

use long_term_tracker::params::{self, Phase};
use long_term_tracker::{Encoding, Frame, Params, Session, State, Target};

/// Overlap with the drawn box from which on the right person is followed.
const MIN_OVERLAP: f64 = 0.4;
/// Where at least this share of all frames is answered, she must be followed on this share of those with a drawn box.
#[cfg(feature = "ros")]
const KEPT_UP: f64 = 0.6;
#[cfg(feature = "ros")]
const LEAST_RIGHT: f64 = 0.7;

/// What the tracker says of each frame; the first is the mark itself.
fn follow(params: Params) -> Vec<Target> {
    let mark = clip::marks()[0].rect.expect("the first frame shows the person");
    let mut session = Session::new(params).unwrap();
    let step = |(index, image): (usize, image::RgbImage)| {
        let (width, height) = image.dimensions();
        let frame = Frame::new(&image, width, height, 3 * width as usize, Encoding::Rgb8, None).unwrap();
        let output = match index {
            0 => session.start(&frame, mark, &mut ()).unwrap(),
            _ => session.step(&frame, &mut ()),
        };
        output.targets[0].clone()
    };
    clip::frames().into_iter().enumerate().map(step).collect()
}

/// On every marked frame the box lies on the person, and where she is hidden it is not said to.
fn check(targets: &[Target]) {
    for clip::Mark { frame, rect: mark } in clip::marks() {
        let Target { rect, state, .. } = &targets[frame];
        match mark {
            Some(mark) => {
                let overlap = rect.iou(&mark);
                assert!(overlap > MIN_OVERLAP, "frame {frame}: {rect} overlaps the person at {mark} by {overlap:.2}");
            }
            None => assert_ne!(*state, State::Tracking, "frame {frame}: the person is hidden, the box is at {rect}"),
        }
    }
    assert_eq!(targets.last().unwrap().state, State::Tracking);
}

#[test]
fn the_person_is_followed_through_the_occlusion() {
    check(&follow(Params::default()));
}

#[test]
fn with_little_patience_the_person_is_lost_and_found_again() {
    let (name, value) = params::assignment(clip::PARAMETER).unwrap();
    let targets = follow(Params::default().with([(name.as_str(), &value)], Phase::StartUp).unwrap());
    check(&targets);
    let marks = clip::marks();
    let hidden = marks.iter().find(|m| m.rect.is_none()).unwrap().frame;
    assert!(targets[..hidden].iter().all(|t| t.state != State::Lost), "lost before she is hidden");
    let back = hidden + targets[hidden..].iter().position(|t| t.reacquired).expect("never lost and found again");
    assert!(targets[hidden..back].iter().any(|t| t.state == State::Lost), "found on frame {back}, not lost before");
    assert!(targets[back..].iter().all(|t| t.state != State::Lost), "lost once more after frame {back}");
}

#[cfg(feature = "ros")]
#[test]
fn the_demo_shows_the_node_at_work() {
    let said = demo(&["--in-step", "--rate", "30"]);
    for part in ["100 shown, 100 answered", "re-acquired: 1 x", "the right person: on 14 of 14"] {
        assert!(said.contains(part), "no '{part}' in:\n{said}");
    }
}

/// How many frames are answered is the machine's matter; but the camera keeps its pace, the node takes the frames that
/// it has the time for, and while it keeps up what it says is right.
#[cfg(feature = "ros")]
#[test]
fn the_demo_plays_as_a_camera_would() {
    const RATE: f64 = 10.0;
    let said = demo(&["--rate", "10"]);
    let before = |unit: &str| -> f64 {
        let word = said.split(unit).next().and_then(|before| before.split_whitespace().last()).expect("words");
        word.parse().unwrap_or_else(|_| panic!("'{word}' before '{unit}' in:\n{said}"))
    };
    let [shown, answered, seconds, per_frame] = [" shown", " answered", " s\nstates", " ms a frame"].map(before);
    assert!(seconds >= (shown - 1.0) / RATE, "{said}");
    let possible = shown * (1.0 / (RATE * per_frame * 1e-3)).min(1.0);
    assert!(answered > possible / 3.0, "{said}");
    // Nobody follows her through seconds without images.
    if answered >= KEPT_UP * shown {
        let right = before(&format!(" of {} frames with a box", before(" frames with a box")));
        assert!(right >= LEAST_RIGHT * before(" frames with a box"), "{said}");
    }
}

/// What the demo prints. It must end well, and leave its pictures.
#[cfg(feature = "ros")]
fn demo(args: &[&str]) -> String {
    let output = tempfile::tempdir().unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_tracker_demo"))
        .args(args)
        .arg("--output")
        .arg(output.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{said}{}", String::from_utf8_lossy(&run.stderr));
    let frame = image::open(output.path().join("099.png")).unwrap();
    let sheet = image::open(output.path().join("contact_sheet.png")).unwrap();
    assert!(sheet.width() > 3 * frame.width() && sheet.height() > 4 * frame.height());
    let animation = output.path().join("demo.png");
    assert!(std::fs::metadata(&animation).unwrap().len() < 2_000_000);
    assert_eq!(image::open(&animation).unwrap().width(), frame.width());
    said
}
