//! A table of kinds of names, and names made of increasing numbers by the usual formats.

use proptest::prelude::*;

use super::*;

/// Sorts the names from the wrong end; gives them in order, and the notes.
fn sorted(names: &[impl AsRef<str>]) -> (Vec<String>, Vec<String>) {
    let mut paths: Vec<PathBuf> = names.iter().rev().map(|n| Path::new("folder").join(n.as_ref())).collect();
    let notes = sort(&mut paths);
    (paths.iter().map(|p| p.file_name().unwrap().to_str().unwrap().to_owned()).collect(), notes)
}

/// Names in their order, which need no word.
#[test]
fn names_that_are_clear_are_sorted_without_a_word() {
    for kind in [
        "f1.JPEG f9.jpg f10.png f100.png",
        "left.0001.png left.0002.png left.0010.png",
        "cam.1.png cam.2.png cam.10.png",
        "cam1_0.5.png cam1_0.75.png cam2_0.25.png cam10_0.125.png",
        // Decimals.
        "0.067.png 0.1.png",
        "0.0.png 0.0333.png 0.0667.png 0.1.png 0.1333.png",
        "9.5.png 10.0333.png 10.1.png 10.25.png",
        "1700000000.0333.jpg 1700000000.1.jpg 1700000000.25.jpg 1700000001.0.jpg",
        "12.png 12.0333.png 12.1.png 13.png 13.05.png",
        "frame_0.png frame_0.033.png frame_0.1.png frame_0.15.png",
        "frame-9.75s.png frame-10s.png frame-10.05s.png frame-10.5s.png",
        "0,067.png 0,1.png",
        "2024-01-02T10.11.12.05.jpg 2024-01-02T10.11.12.5.jpg 2024-01-02T10.11.13.png",
        "9.5367431640625e-07.png 0.0334.png 0.1.png 0.12.png 1.5e+01.png",
        // One length, one order.
        "1.050000.png 1.100000.png 1.150000.png 2.000000.png",
        "1.033333333.png 1.099999999.png 2.133333332.png",
        "1.1.png 1.2.png 1.9.png 2.1.png",
        "00012.500.png 00012.750.png 00013.000.png",
        // After these, whole numbers.
        "1_2.png 1_10.png 2_1.png",
        "2024-1-2.png 2024-1-10.png 2024-2-1.png",
        "1_33333333.png 1_66666666.png 1_99999999.png 1_133333332.png",
        // Numbers of any length, and no numbers.
        "99999999999999999999999999.png 100000000000000000000000000.png",
        "a.png b.png c.png",
        "left.png left1.png left2.png right.png",
        "a3e-05.png a4e-05.png a10e-05.png",
        // Minus where others have none.
        "-1.5.png -1.25.png -1.05.png -0.5.png 0.0.png 0.5.png",
        "t_-10.png t_-9.png t_0.png t_9.png t_10.png",
        "img-1.png img-2.png img-10.png",
    ] {
        let names: Vec<&str> = kind.split(' ').collect();
        let (order, notes) = sorted(&names);
        assert_eq!(order, names);
        assert_eq!(notes, [] as [&str; 0], "{kind}");
    }
}

#[test]
fn an_order_that_could_be_another_is_told() {
    for (kind, told) in [
        (
            "1.0.png 1.1.png 1.2.png 1.9.png 1.10.png 1.11.png",
            "the digits after the dot are read as whole numbers: '1.9.png' comes before '1.10.png'",
        ),
        ("1.9.png 1.10.png", "read as whole numbers: '1.9.png' comes before '1.10.png'"),
        (
            "1.33333333.png 1.66666666.png 1.99999999.png 1.133333332.png 1.333333330.png",
            "read as whole numbers: '1.99999999.png' comes before '1.133333332.png'",
        ),
        // Both may be meant. Evenly spaced are the decimals here,
        ("0.25.png 0.5.png 0.75.png", "as decimals, which the names leave open: '0.25.png' comes before '0.5.png'"),
        // the whole numbers there,
        (
            "1.8.png 1.9.png 1.11.png 1.12.png",
            "as whole numbers, which the names leave open: '1.9.png' comes before '1.11.png'",
        ),
        // and two names tell nothing.
        ("1.25.png 1.5.png", "as decimals, which the names leave open: '1.25.png' comes before '1.5.png'"),
        // Neither fits.
        ("1.0.png 1.05.png 1.10.png 1.15.png 1.2.png 1.25.png", "as decimals, which the names leave open"),
        ("1700000000_0333.png 1700000000_1.png", "the digits after the last sign are read as decimals"),
        ("-1.png -2.png -3.png", "the '-' before every number is read as a dash, not as a minus"),
        ("a_-1.png a_-2.png", "the '-' before every number is read as a dash, not as a minus"),
        (
            "0001.jpg 0001.png 0002.jpg 0002.png",
            "'0001.jpg' and '0001.png' have the same number (and 1 more such pairs)",
        ),
        ("01.png 1.png 2.png", "'01.png' and '1.png' have the same number: both are used"),
    ] {
        let names: Vec<&str> = kind.split(' ').collect();
        let (order, notes) = sorted(&names);
        assert_eq!(order, names);
        assert!(notes.len() == 1 && notes[0].contains(told), "{kind}: {notes:?}");
    }
}

/// Seconds, as a camera of so many frames a second gives them, early or late by up to a third of a period.
fn seconds() -> impl Strategy<Value = Vec<f64>> {
    let (start, rate) = (prop_oneof![Just(0.0), 0.0..2000.0, 1.6e9..1.8e9], 5.0..60.0);
    let late = prop::collection::vec(0.0..0.33, 90..150);
    (start, rate, late).prop_map(|(start, rate, late)| {
        late.iter().enumerate().map(|(i, late)| start + (i as f64 + late) / rate).collect()
    })
}

/// The usual ways to make a name of a time.
const FORMATS: [fn(f64) -> String; 11] = [
    |s| format!("{s:?}"),
    |s| format!("{s}"),
    |s| format!("{s:.3}"),
    |s| format!("{s:.6}"),
    |s| format!("{:?}", (s * 1e3).round() / 1e3),
    |s| format!("{}", (s * 1e4).round() / 1e4),
    |s| format!("{}.{:09}", s as u64, nanos(s)),
    |s| format!("{}.{}", s as u64, nanos(s)),
    |s| format!("{}_{}", s as u64, nanos(s)),
    // Without the exponents of small numbers, which are not to be told from digits here.
    |s| format!("{:?}", s + 1.0).replace('.', "_"),
    |s| format!("{}", (s * 1e9) as u64),
];

fn nanos(seconds: f64) -> u64 {
    (seconds.fract() * 1e9) as u64
}

proptest! {
    #[test]
    fn increasing_times_are_sorted_back(
        seconds in seconds(),
        format in 0..FORMATS.len(),
        around in prop::sample::select(vec![("", ""), ("frame_", ""), ("cam1-", "s"), ("a.", ".rgb"), ("t=", "")]),
    ) {
        let name = |s: &f64| format!("{}{}{}.png", around.0, FORMATS[format](*s), around.1);
        let mut names: Vec<String> = seconds.iter().map(name).collect();
        names.dedup();
        prop_assert_eq!(sorted(&names).0, names);
    }

    #[test]
    fn increasing_counts_are_sorted_back(start in 0_u32..2000, step in 1_u32..9, width in 0_usize..8) {
        for make in [
            |n: u32, w: usize| format!("{n:0w$}.png"),
            |n, w| format!("img{n:0w$}.png"),
            |n, w| format!("left.{n:0w$}.png"),
            |n, w| format!("2_{n:0w$}.png"),
            |n, w| format!("shot-3-{n:0w$}_rgb.png"),
        ] {
            let names: Vec<String> = (0..60).map(|i| make(start + i * step, width)).collect();
            prop_assert_eq!(sorted(&names).0, names);
        }
    }

    /// Whatever the names, none is lost.
    #[test]
    fn any_names_are_kept(names in prop::collection::hash_set("[-_.,0-9ae+ ]{1,12}x", 1..12)) {
        let mut names: Vec<String> = names.into_iter().collect();
        let (mut order, _) = sorted(&names);
        names.sort();
        order.sort();
        prop_assert_eq!(order, names);
    }
}
