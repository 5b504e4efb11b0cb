//! Discriminative correlation filters: signals alone, whatever features they are of.
//!
//! | file | what it holds |
//! |---|---|
//! | `fft.rs` | the two-dimensional real FFT, planned once |
//! | `window.rs` | Hann window, Gaussian label, target mask |
//! | `sample.rs` | the spectra of all feature channels of one search window |
//! | `kernelised.rs` | the paper's filter: a ridge regression a layer, solved in closed form (eqs 1 to 9) |
//! | `masked.rs` | the default filter: confined to the target, trained on a memory of samples |
//! | `response.rs` | peaks of response maps |

pub mod fft;
pub mod kernelised;
pub mod masked;
pub mod response;
pub mod sample;
pub mod window;
