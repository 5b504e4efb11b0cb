//! Temporal filters: where the target is thought to be, given all that was measured so far.
//!
//! | file | what it holds |
//! |---|---|
//! | `motion.rs` | the constant-velocity models of a box: `F`, `Q`, `H`, `R` at any time step |
//! | `kalman.rs` | prediction and correction of one Gaussian, and the likelihood of a measurement |
//! | `mixture.rs` | Gaussian mixtures: pruning, merging, the cap on components |
//! | `gm_phd.rs` | the Gaussian-mixture probability hypothesis density filter, composed of the three above |
//! | `bounds.rs` | bounds of a state, and noise that is reflected at them |
//! | `particles.rs` | a particle filter with guided proposals |
//!
//! `N` is the length of a state, `M` that of a measurement. All vectors and matrices have their size in their type, so
//! that none of them is on the heap. Time is in frame periods.

pub mod bounds;
pub mod gm_phd;
pub mod kalman;
pub mod mixture;
pub mod motion;
pub mod particles;

/// A column of `N` numbers.
pub type Vector<const N: usize> = nalgebra::SVector<f64, N>;
/// A matrix of `R` rows and `C` columns.
pub type Matrix<const R: usize, const C: usize> = nalgebra::SMatrix<f64, R, C>;
