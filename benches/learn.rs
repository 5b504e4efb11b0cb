//! Time of the support vector machine at the sizes that re-detection meets.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use long_term_tracker::learn::svm::{Svm, SvmParams};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Of a template of 20 cells with HOG, LUV and gradient magnitude.
const DIM: usize = 700;

/// Unit vectors of two classes that overlap: a quarter is positive.
fn examples(rng: &mut ChaCha8Rng, count: usize) -> Vec<(Vec<f32>, bool)> {
    (0..count)
        .map(|i| {
            let positive = i % 4 == 0;
            let mut x: Vec<f32> = (0..DIM)
                .map(|k| rng.random_range(0.0..1.0) + if positive && k % 5 == 0 { 0.25 } else { 0.0 })
                .collect();
            let norm = x.iter().map(|v| v * v).sum::<f32>().sqrt();
            x.iter_mut().for_each(|v| *v /= norm);
            (x, positive)
        })
        .collect()
}

fn trained(rng: &mut ChaCha8Rng, count: usize) -> Svm {
    let mut svm = Svm::new(DIM, SvmParams { c: 2.0, gamma: 1.0, max_support: count });
    for (x, positive) in examples(rng, 2 * count) {
        svm.add(&x, positive);
    }
    svm
}

fn benches(c: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut svm = trained(&mut rng, 100);
    let support = (0..svm.len()).filter(|&i| svm.example(i).alpha > 0.0).count();
    eprintln!("{} kept, {support} support vectors, {} solved from scratch", svm.len(), svm.resolves());
    for count in [400, 1000] {
        let xs: Vec<f32> = examples(&mut rng, count).into_iter().flat_map(|(x, _)| x).collect();
        let mut out = vec![0.0; count];
        c.bench_function(&format!("svm/margins/{count}x{support}x{DIM}"), |b| {
            b.iter(|| svm.margins(black_box(&xs), &mut out))
        });
    }
    let batch = examples(&mut rng, 40);
    c.bench_function("svm/add/40_to_100", |b| {
        b.iter_batched_ref(
            || svm.clone(),
            |svm| batch.iter().for_each(|(x, positive)| svm.add(x, *positive)),
            BatchSize::LargeInput,
        )
    });
}

criterion_group!(learn, benches);
criterion_main!(learn);
