// experiment runner: exp DIR [-p name:=v]... ; SEQ=comma list
use long_term_tracker::eval::otb::score;
use long_term_tracker::*;
use std::sync::{
    Mutex,
    atomic::{AtomicUsize, Ordering},
};
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let dir = &args[0];
    let mut set = vec![];
    let mut out = None;
    let mut it = args[1..].iter();
    while let Some(a) = it.next() {
        if a == "-p" {
            set.push(params::assignment(it.next().unwrap()).unwrap());
        } else if a == "-o" {
            out = it.next().cloned();
        }
    }
    let p = Params::default().with(set.iter().map(|(n, v)| (n.as_str(), v)), params::Phase::StartUp).unwrap();
    let only: Option<Vec<String>> = std::env::var("SEQ").ok().map(|s| s.split(',').map(String::from).collect());
    let limit: usize = std::env::var("LIMIT").ok().map_or(usize::MAX, |s| s.parse().unwrap());
    let mut seqs: Vec<String> = std::fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|n| {
            std::path::Path::new(dir).join(n).join("groundtruth_rect.txt").exists()
                && only.as_ref().is_none_or(|o| o.contains(n))
        })
        .collect();
    seqs.sort();
    let next = AtomicUsize::new(0);
    let rows = Mutex::new(vec![]);
    std::thread::scope(|s| {
        for _ in 0..2 {
            s.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::SeqCst);
                    if i >= seqs.len() {
                        break;
                    }
                    let d = std::path::Path::new(dir).join(&seqs[i]);
                    let gt: Vec<Option<Rect>> = std::fs::read_to_string(d.join("groundtruth_rect.txt"))
                        .unwrap()
                        .lines()
                        .filter(|l| !l.trim().is_empty())
                        .map(|l| {
                            let v: Vec<f64> = l
                                .split([',', '\t', ' '])
                                .filter(|s| !s.is_empty())
                                .map(|s| s.parse().unwrap())
                                .collect();
                            let r = Rect::new(v[0], v[1], v[2], v[3]);
                            r.is_finite().then_some(r)
                        })
                        .collect();
                    let mut files: Vec<_> =
                        std::fs::read_dir(d.join("img")).unwrap().map(|e| e.unwrap().path()).collect();
                    files.sort();
                    let mut sess = Session::new(p.clone());
                    let mut boxes = vec![];
                    let mut t = 0.0;
                    let mut text = String::new();
                    let mut lost = 0;
                    let mut reac = 0;
                    for (k, f) in files.iter().enumerate().take(gt.len().min(limit)) {
                        let mut f = f.clone();
                        let b = std::fs::read(&f).unwrap();
                        if b.starts_with(b"..") {
                            f = f.parent().unwrap().join(String::from_utf8(b).unwrap().trim());
                        }
                        let im = image::open(&f).unwrap();
                        let (data, w, h, enc, st) = match im {
                            image::DynamicImage::ImageLuma8(g) => {
                                let (w, h) = g.dimensions();
                                (g.into_raw(), w, h, Encoding::Mono8, w)
                            }
                            o => {
                                let g = o.into_rgb8();
                                let (w, h) = g.dimensions();
                                (g.into_raw(), w, h, Encoding::Rgb8, 3 * w)
                            }
                        };
                        let frame = Frame::new(&data, w, h, st as usize, enc, None).unwrap();
                        let t0 = std::time::Instant::now();
                        if k == 0 {
                            let dx: f64 = std::env::var("DX").ok().map_or(0.0, |s| s.parse().unwrap());
                            sess.start(&frame, gt[0].unwrap().shifted(dx, 0.0), &mut ()).unwrap();
                        } else {
                            sess.step(&frame, &mut ());
                        }
                        t += t0.elapsed().as_secs_f64();
                        let o = &sess.output().targets[0];
                        if o.state == State::Lost {
                            lost += 1;
                        }
                        if o.reacquired {
                            reac += 1;
                        }
                        let iou = gt[k].map_or(f64::NAN, |g| o.rect.iou(&g));
                        text += &format!(
                            "{k},{:.1},{:.1},{:.1},{:.1},{:.3},{},{:.3},{:.3}\n",
                            o.rect.x,
                            o.rect.y,
                            o.rect.w,
                            o.rect.h,
                            o.confidence,
                            o.state.name(),
                            iou,
                            o.response
                        );
                        boxes.push(o.rect);
                    }
                    if let Some(o) = &out {
                        std::fs::create_dir_all(o).unwrap();
                        std::fs::write(format!("{o}/{}.csv", seqs[i]), text).unwrap();
                    }
                    let s = score(&boxes, &gt[..boxes.len()]).unwrap();
                    rows.lock().unwrap().push((seqs[i].clone(), s, boxes.len() as f64 / t, lost, reac));
                }
            });
        }
    });
    let mut rows = rows.into_inner().unwrap();
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    for r in &rows {
        println!(
            "{:18} {:.2} / {:.2}  held {:.2}  {:5.0} fps lost {} re {}",
            r.0, r.1.precision, r.1.auc, r.1.held, r.2, r.3, r.4
        );
    }
    let n = rows.len() as f64;
    let m = |f: &dyn Fn(&(String, eval::otb::Score, f64, usize, usize)) -> f64| rows.iter().map(f).sum::<f64>() / n;
    println!(
        "MEAN {:.3} / {:.3} held {:.3} fps {:.0}",
        m(&|r| r.1.precision),
        m(&|r| r.1.auc),
        m(&|r| r.1.held),
        m(&|r| r.2)
    );
    let five = ["PETS-2", "PETS-5", "PETS-7", "Jogging-1", "TLD-jumping"];
    let f: Vec<_> = rows.iter().filter(|r| five.contains(&r.0.as_str())).collect();
    if !f.is_empty() {
        println!("FIVE {:.3}", f.iter().map(|r| r.1.precision).sum::<f64>() / f.len() as f64);
    }
}
