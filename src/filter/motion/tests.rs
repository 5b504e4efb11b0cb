//! Matrices written out by hand at `dt = 2` and `dt = 0.5`, `F` and `Q` rebuilt from the scalar equations, conversions.

use proptest::prelude::*;

use super::*;

/// A variance for each noise, none equal to another.
const NOISE: Noise<4> = Noise { process: [3.0, 5.0, 7.0, 11.0], measurement: [13.0, 17.0, 19.0, 23.0] };

#[test]
fn centre_size_at_two_frames() {
    let model = MotionModel::centre_size(NOISE);
    #[rustfmt::skip]
    let f = Matrix::<6, 6>::from_row_slice(&[
        1.0, 0.0, 2.0, 0.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 2.0, 0.0, 0.0,
        0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ]);
    // dt^4/4 = 4, dt^3/2 = 4, dt^2 = 4.
    #[rustfmt::skip]
    let q = Matrix::<6, 6>::from_row_slice(&[
        12.0,  0.0, 12.0,  0.0, 0.0,  0.0,
         0.0, 20.0,  0.0, 20.0, 0.0,  0.0,
        12.0,  0.0, 12.0,  0.0, 0.0,  0.0,
         0.0, 20.0,  0.0, 20.0, 0.0,  0.0,
         0.0,  0.0,  0.0,  0.0, 7.0,  0.0,
         0.0,  0.0,  0.0,  0.0, 0.0, 11.0,
    ]);
    #[rustfmt::skip]
    let h = Matrix::<4, 6>::from_row_slice(&[
        1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ]);
    #[rustfmt::skip]
    let r = Matrix::<4, 4>::from_row_slice(&[
        13.0,  0.0,  0.0,  0.0,
         0.0, 17.0,  0.0,  0.0,
         0.0,  0.0, 19.0,  0.0,
         0.0,  0.0,  0.0, 23.0,
    ]);
    assert_eq!(model.transition(2.0), f);
    assert_eq!(model.process_noise(2.0), q);
    assert_eq!(model.measurement(), h);
    assert_eq!(model.measurement_noise(), r);
}

#[test]
fn centre_moving_size_at_half_a_frame() {
    let model = MotionModel::centre_moving_size(NOISE);
    #[rustfmt::skip]
    let f = Matrix::<8, 8>::from_row_slice(&[
        1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ]);
    // dt^4/4 = 1/64, dt^3/2 = 1/16, dt^2 = 1/4.
    #[rustfmt::skip]
    let q = Matrix::<8, 8>::from_row_slice(&[
        0.046875, 0.0,      0.1875, 0.0,    0.0,      0.0,      0.0,    0.0,
        0.0,      0.078125, 0.0,    0.3125, 0.0,      0.0,      0.0,    0.0,
        0.1875,   0.0,      0.75,   0.0,    0.0,      0.0,      0.0,    0.0,
        0.0,      0.3125,   0.0,    1.25,   0.0,      0.0,      0.0,    0.0,
        0.0,      0.0,      0.0,    0.0,    0.109375, 0.0,      0.4375, 0.0,
        0.0,      0.0,      0.0,    0.0,    0.0,      0.171875, 0.0,    0.6875,
        0.0,      0.0,      0.0,    0.0,    0.4375,   0.0,      1.75,   0.0,
        0.0,      0.0,      0.0,    0.0,    0.0,      0.6875,   0.0,    2.75,
    ]);
    #[rustfmt::skip]
    let h = Matrix::<4, 8>::from_row_slice(&[
        1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,
    ]);
    assert_eq!(model.transition(0.5), f);
    assert_eq!(model.process_noise(0.5), q);
    assert_eq!(model.measurement(), h);
}

#[test]
fn centre_area_aspect_at_two_frames() {
    let model = MotionModel::centre_area_aspect(NOISE);
    #[rustfmt::skip]
    let f = Matrix::<7, 7>::from_row_slice(&[
        1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0,
        0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0,
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ]);
    #[rustfmt::skip]
    let q = Matrix::<7, 7>::from_row_slice(&[
        12.0,  0.0,  0.0,  0.0, 12.0,  0.0,  0.0,
         0.0, 20.0,  0.0,  0.0,  0.0, 20.0,  0.0,
         0.0,  0.0, 28.0,  0.0,  0.0,  0.0, 28.0,
         0.0,  0.0,  0.0, 11.0,  0.0,  0.0,  0.0,
        12.0,  0.0,  0.0,  0.0, 12.0,  0.0,  0.0,
         0.0, 20.0,  0.0,  0.0,  0.0, 20.0,  0.0,
         0.0,  0.0, 28.0,  0.0,  0.0,  0.0, 28.0,
    ]);
    #[rustfmt::skip]
    let h = Matrix::<4, 7>::from_row_slice(&[
        1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
    ]);
    assert_eq!(model.transition(2.0), f);
    assert_eq!(model.process_noise(2.0), q);
    assert_eq!(model.measurement(), h);
}

#[test]
fn centre_aspect_height_at_two_frames() {
    let model = MotionModel::centre_aspect_height(NOISE);
    #[rustfmt::skip]
    let f = Matrix::<8, 8>::from_row_slice(&[
        1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0,
        0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0,
        0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0,
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0,
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ]);
    #[rustfmt::skip]
    let q = Matrix::<8, 8>::from_row_slice(&[
        12.0,  0.0,  0.0,  0.0, 12.0,  0.0,  0.0,  0.0,
         0.0, 20.0,  0.0,  0.0,  0.0, 20.0,  0.0,  0.0,
         0.0,  0.0, 28.0,  0.0,  0.0,  0.0, 28.0,  0.0,
         0.0,  0.0,  0.0, 44.0,  0.0,  0.0,  0.0, 44.0,
        12.0,  0.0,  0.0,  0.0, 12.0,  0.0,  0.0,  0.0,
         0.0, 20.0,  0.0,  0.0,  0.0, 20.0,  0.0,  0.0,
         0.0,  0.0, 28.0,  0.0,  0.0,  0.0, 28.0,  0.0,
         0.0,  0.0,  0.0, 44.0,  0.0,  0.0,  0.0, 44.0,
    ]);
    assert_eq!(model.transition(2.0), f);
    assert_eq!(model.process_noise(2.0), q);
    assert_eq!(model.measurement(), Matrix::<4, 8>::identity());
}

/// Checks `F` and `Q` of `model` against `step`, the model's scalar equations with the noises as an argument.
///
/// `Q` is the expectation of the outer product of what the noises add to a state. It is taken exactly, over noises of
/// plus or minus one standard deviation, each with probability 1/2: they have the right mean, variance and
/// independence.
fn check_expectation<const N: usize>(
    model: &MotionModel<N, 4>,
    dt: f64,
    step: impl Fn(&Vector<N>, [f64; 4]) -> Vector<N>,
) {
    let state = Vector::<N>::from_fn(|i, _| [31.0, -7.0, 0.3, 12.0, 5.5, -2.0, 0.8, 4.0][i]);
    let quiet = step(&state, [0.0; 4]);
    assert!((model.transition(dt) * state - quiet).amax() < 1e-13);
    let mut q = Matrix::<N, N>::zeros();
    for signs in 0..16 {
        let w = std::array::from_fn(|i| NOISE.process[i].sqrt() * if signs >> i & 1 == 1 { 1.0 } else { -1.0 });
        let added = step(&state, w) - quiet;
        q += added * added.transpose() / 16.0;
    }
    assert!((model.process_noise(dt) - q).amax() < 1e-11, "{} is not {q}", model.process_noise(dt));
}

#[test]
fn noise_is_the_expected_outer_product_of_the_scalar_equations() {
    let dt = 1.7;
    let (d, a) = (dt, dt * dt / 2.0);
    check_expectation(&MotionModel::centre_size(NOISE), dt, |s, w| {
        let [x, y, vx, vy, width, height] = (*s).into();
        let centre = [x + d * vx + a * w[0], y + d * vy + a * w[1]];
        [centre[0], centre[1], vx + d * w[0], vy + d * w[1], width + w[2], height + w[3]].into()
    });
    check_expectation(&MotionModel::centre_moving_size(NOISE), dt, |s, w| {
        let [x, y, vx, vy, width, height, vw, vh] = (*s).into();
        let centre = [x + d * vx + a * w[0], y + d * vy + a * w[1]];
        let size = [width + d * vw + a * w[2], height + d * vh + a * w[3]];
        let velocity = [vx + d * w[0], vy + d * w[1], vw + d * w[2], vh + d * w[3]];
        [centre[0], centre[1], velocity[0], velocity[1], size[0], size[1], velocity[2], velocity[3]].into()
    });
    check_expectation(&MotionModel::centre_area_aspect(NOISE), dt, |s, w| {
        let [x, y, area, aspect, vx, vy, vs] = (*s).into();
        let moved = [x + d * vx + a * w[0], y + d * vy + a * w[1], area + d * vs + a * w[2]];
        [moved[0], moved[1], moved[2], aspect + w[3], vx + d * w[0], vy + d * w[1], vs + d * w[2]].into()
    });
    check_expectation(&MotionModel::centre_aspect_height(NOISE), dt, |s, w| {
        Vector::from_fn(|i, _| if i < 4 { s[i] + d * s[i + 4] + a * w[i] } else { s[i] + d * w[i - 4] })
    });
}

#[test]
fn states_are_taken_apart_and_put_together() {
    let model = MotionModel::centre_size(NOISE);
    let state = Vector::from([10.0, 20.0, 1.0, -2.0, 30.0, 60.0]);
    assert_eq!(model.values(&state), Vector::from([10.0, 20.0, 30.0, 60.0]));
    assert_eq!(model.values(&state), model.measurement() * state);
    assert_eq!(model.velocities(&state), Vector::from([1.0, -2.0, 0.0, 0.0]));
    assert_eq!(model.at_rest(&model.values(&state)), Vector::from([10.0, 20.0, 0.0, 0.0, 30.0, 60.0]));
    let covariance = model.diagonal(&Vector::from([1.0, 2.0, 3.0, 4.0]), &Vector::from([5.0, 6.0, 7.0, 8.0]));
    assert_eq!(covariance, Matrix::from_diagonal(&Vector::from([1.0, 2.0, 5.0, 6.0, 3.0, 4.0])));
}

#[test]
#[should_panic(expected = "do not fill a state of 6 numbers")]
fn a_layout_with_a_gap_is_refused() {
    MotionModel::<6, 4>::new(places([0, 1, 4, 5], [Some(2), None, None, None]), NOISE);
}

#[test]
fn boxes_are_written_as_each_form_says() {
    let rect = Rect::new(10.0, 20.0, 30.0, 60.0);
    assert_eq!(BoxForm::CentreSize.measurement(&rect), Vector::from([25.0, 50.0, 30.0, 60.0]));
    assert_eq!(BoxForm::CentreAreaAspect.measurement(&rect), Vector::from([25.0, 50.0, 1800.0, 0.5]));
    assert_eq!(BoxForm::CentreAspectHeight.measurement(&rect), Vector::from([25.0, 50.0, 0.5, 60.0]));
}

#[test]
fn impossible_sizes_give_empty_boxes() {
    let empty = Rect::new(5.0, 6.0, 0.0, 0.0);
    for form in [BoxForm::CentreSize, BoxForm::CentreAreaAspect, BoxForm::CentreAspectHeight] {
        assert_eq!(form.rect(&Vector::from([5.0, 6.0, -1.0, -2.0])), empty, "{form:?}");
    }
    assert_eq!(BoxForm::CentreAreaAspect.rect(&Vector::from([5.0, 6.0, 100.0, 0.0])), empty);
    assert_eq!(BoxForm::CentreAreaAspect.rect(&Vector::from([5.0, 6.0, -100.0, 2.0])), empty);
}

proptest! {
    #[test]
    fn boxes_come_back(x in -1e4..1e4, y in -1e4..1e4, w in 0.5..4e3, h in 0.5..4e3) {
        let rect = Rect::new(x, y, w, h);
        for form in [BoxForm::CentreSize, BoxForm::CentreAreaAspect, BoxForm::CentreAspectHeight] {
            let back = form.rect(&form.measurement(&rect));
            let error = [back.x - x, back.y - y, back.w - w, back.h - h].iter().fold(0.0_f64, |m, e| m.max(e.abs()));
            prop_assert!(error < 1e-10, "{form:?} turns {rect} into {back}");
        }
    }
}
