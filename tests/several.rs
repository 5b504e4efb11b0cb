//! Several targets in one session.

use long_term_tracker::loader::Loaded;
use long_term_tracker::params::{Phase, Value};
use long_term_tracker::trace::{Event, Trace};
use long_term_tracker::{Encoding, Frame, Params, Rect, RenameError, Session, StartError, Target};

const SIDE: usize = 32;
const WIDTH: usize = 240;
const HEIGHT: usize = 160;

/// Where the two targets are: they pass each other.
fn targets(frame: usize) -> [Rect; 2] {
    let t = frame as f64;
    [[40.0 + t, 30.0], [150.0 - t, 100.0]].map(|[x, y]| Rect::new(x, y, SIDE as f64, SIDE as f64))
}

/// Two squares, each with a pattern of its own, over noise.
fn scene(frame: usize) -> Vec<u8> {
    let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + (x * y) % 97 * 31) % 61) as u8;
    let mut data = vec![0; WIDTH * HEIGHT * 3];
    for (i, pixel) in data.chunks_exact_mut(3).enumerate() {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let value = 80 + noise(x, y);
        pixel.copy_from_slice(&[value, value / 2, 255 - value]);
    }
    for (which, rect) in targets(frame).iter().enumerate() {
        for (u, v) in (0..SIDE).flat_map(|v| (0..SIDE).map(move |u| (u, v))) {
            let value = 40 + ((u / 4 * (53 + 20 * which) + v / 5 * (91 - 30 * which)) % 200) as u8;
            let at = ((rect.y as usize + v) * WIDTH + rect.x as usize + u) * 3;
            data[at..at + 3].copy_from_slice(&if which == 0 { [value, value / 2, 90] } else { [60, value, value / 3] });
        }
    }
    data
}

fn scenes() -> Vec<Vec<u8>> {
    (0..30).map(scene).collect()
}

fn frame(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH * 3, Encoding::Rgb8, None).unwrap()
}

fn session(most: i64) -> Session {
    let (most, network) = (Value::Integer(most), Value::Bool(false));
    let changes = [("max_targets", &most), ("lcmht.cnn.enabled", &network)];
    Session::new(Params::default().with(changes, Phase::StartUp).unwrap()).unwrap()
}

fn ids(session: &Session) -> Vec<&str> {
    session.output().targets.iter().map(|target| &*target.id).collect()
}

#[test]
fn each_target_is_followed_as_if_it_were_alone() {
    let scenes = scenes();
    let mut both = session(2);
    let alone: Vec<Vec<Target>> = (0..2)
        .map(|which| {
            let mut session = session(1);
            session.start(&frame(&scenes[which * 5]), targets(which * 5)[which], &mut ()).unwrap();
            let step = |data: &Vec<u8>| session.step(&frame(data), &mut ()).targets[0].clone();
            scenes[which * 5 + 1..].iter().map(step).collect()
        })
        .collect();
    both.start(&frame(&scenes[0]), targets(0)[0], &mut ()).unwrap();
    for (index, data) in scenes.iter().enumerate().skip(1) {
        both.step(&frame(data), &mut ());
        if index == 5 {
            both.start_as(Some("second"), &frame(data), targets(5)[1], &mut ()).unwrap();
        }
        let said = &both.output().targets;
        assert_eq!(said[0], alone[0][index - 1]);
        if index > 5 {
            assert_eq!(said[1], Target { id: "second".into(), ..alone[1][index - 6].clone() });
            assert!(said[1].rect.iou(&targets(index)[1]) > 0.6, "{:?}", said[1]);
        }
    }
    assert_eq!(ids(&both), ["0", "second"]);
}

#[test]
fn a_full_session_refuses_and_goes_on_and_a_known_id_begins_anew() {
    let scenes = scenes();
    let first = frame(&scenes[0]);
    let [a, b] = targets(0);
    let mut session = session(2);
    session.start_as(Some("a"), &first, a, &mut ()).unwrap();
    session.start_as(Some("b"), &first, b, &mut ()).unwrap();
    let refused = session.start_as(Some("c"), &first, b, &mut ()).unwrap_err();
    assert_eq!(refused, StartError::Full { most: 2 });
    assert_eq!(refused.to_string(), "2 targets are already followed, and max_targets is 2");
    assert_eq!(ids(&session), ["a", "b"]);

    session.step(&frame(&scenes[1]), &mut ());
    session.start_as(Some("a"), &frame(&scenes[1]), targets(1)[0], &mut ()).unwrap();
    assert_eq!(ids(&session), ["b", "a"]);
    assert_eq!(session.output().targets.iter().map(|t| t.age).collect::<Vec<_>>(), [1, 0]);

    assert!(session.stop_target("b") && !session.stop_target("b"));
    assert_eq!(ids(&session), ["a"]);
    let automatic = session.start(&frame(&scenes[1]), b, &mut ()).unwrap();
    assert_eq!(&*automatic.targets[1].id, "0");
}

#[test]
fn a_single_target_is_replaced_by_a_new_mark() {
    let scenes = scenes();
    let first = frame(&scenes[0]);
    let [a, b] = targets(0);
    let mut session = session(1);
    session.start(&first, a, &mut ()).unwrap();
    session.start_as(Some("door"), &first, b, &mut ()).unwrap();
    assert_eq!(ids(&session), ["door"]);
    assert!(session.step(&frame(&scenes[1]), &mut ()).targets[0].rect.iou(&targets(1)[1]) > 0.6);
}

#[test]
fn a_restart_takes_up_all_that_were_followed() {
    let scenes = scenes();
    let first = frame(&scenes[0]);
    let [a, b] = targets(0);
    let mut session = session(2);
    assert_eq!(session.restart(&first, &mut ()).unwrap_err(), StartError::NoMark);
    session.start(&first, a, &mut ()).unwrap();
    session.start_as(Some("b"), &first, b, &mut ()).unwrap();
    scenes[1..4].iter().for_each(|data| _ = session.step(&frame(data), &mut ()));
    session.stop();
    assert!(session.step(&frame(&scenes[4]), &mut ()).targets.is_empty());
    let again = session.restart(&first, &mut ()).unwrap();
    assert_eq!(again.targets.iter().map(|t| (&*t.id, t.rect, t.age)).collect::<Vec<_>>(), [("1", a, 0), ("b", b, 0)]);

    let small = vec![0; 24 * 16 * 3];
    let small = Frame::new(&small, 24, 16, 24 * 3, Encoding::Rgb8, None).unwrap();
    assert!(matches!(session.restart(&small, &mut ()), Err(StartError::TooSmall { .. })));
    assert_eq!(ids(&session), ["1", "b"], "what cannot be followed changes nothing");
}

#[test]
fn a_renamed_target_goes_on_under_its_new_name_alone() {
    let scenes = scenes();
    let first = frame(&scenes[0]);
    let [a, b] = targets(0);
    let mut session = session(3);
    session.start(&first, a, &mut ()).unwrap();
    session.start(&first, b, &mut ()).unwrap();
    assert_eq!(session.rename("7", "x").unwrap_err(), RenameError::NoTarget("7".to_owned()));
    assert_eq!(session.rename("0", "1").unwrap_err(), RenameError::Taken("1".to_owned()));
    session.rename("0", "walker").unwrap();
    session.rename("1", "1").unwrap();
    assert_eq!(ids(&session), ["walker", "1"]);
    let before = session.output().targets[0].clone();
    session.step(&frame(&scenes[1]), &mut ());
    assert_eq!((ids(&session), session.output().targets[0].age), (vec!["walker", "1"], before.age + 1));

    // The old name is free for another, and the new one begins its own target anew.
    session.start_as(Some("0"), &frame(&scenes[1]), targets(1)[0], &mut ()).unwrap();
    assert_eq!(ids(&session), ["walker", "1", "0"]);
    session.start_as(Some("walker"), &frame(&scenes[1]), targets(1)[0], &mut ()).unwrap();
    assert_eq!(ids(&session), ["1", "0", "walker"]);
    assert!(session.stop_target("0") && !session.stop_target("0"));
    assert_eq!(ids(&session), ["1", "walker"]);
    session.stop();
    session.restart(&first, &mut ()).unwrap();
    assert!(ids(&session).contains(&"walker"), "{:?}", ids(&session));
}

/// Wants to see each step, which keeps the targets in order.
struct Watching;

impl Trace for Watching {
    fn event(&mut self, _: Event) {}
}

#[test]
fn targets_followed_at_once_are_where_they_are_one_after_the_other() {
    let scenes = scenes();
    let [on, off] = [true, false].map(Value::Bool);
    let builtin = Value::String("builtin".into());
    let (etepf, most) = (Value::String("etepf".into()), Value::Integer(4));
    let setups: [&[(&str, &Value)]; 3] = [
        &[("lcmht.cnn.enabled", &off)],
        &[("lcmht.cnn.inference", &builtin), ("lcmht.matching.enabled", &on)],
        &[("algorithm", &etepf)],
    ];
    for setup in setups {
        let changes = setup.iter().copied().chain([("max_targets", &most)]);
        let params = Params::default().with(changes, Phase::StartUp).unwrap();
        let networks = Loaded::new(&params).unwrap();
        // Of networks of their own, so that a mix-up of what they made would not be the same in both.
        let [mut at_once, mut in_order] =
            [&networks, &Loaded::new(&params).unwrap()].map(|n| Session::with_networks(params.clone(), n.networks()));
        let first = frame(&scenes[0]);
        let [a, b] = targets(0);
        for mark in [a, b, a.shifted(8.0, 5.0), b.shifted(-6.0, 9.0)] {
            at_once.start(&first, mark, &mut ()).unwrap();
            in_order.start(&first, mark, &mut Watching).unwrap();
        }
        for (k, data) in scenes[1..8].iter().enumerate() {
            at_once.step(&frame(data), &mut ());
            in_order.step(&frame(data), &mut Watching);
            assert_eq!(at_once.output().targets, in_order.output().targets, "frame {k} of {setup:?}");
        }
    }
}
