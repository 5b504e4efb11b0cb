//! Finding targets where no tracker has followed them.
//!
//! | file | what it holds |
//! |---|---|
//! | `online.rs` | the detector that learns one target while it is followed and looks for it when it is lost |
//! | `mean_shift.rs` | boxes that climb to the tops of a map |
//! | `background.rs` | what moves: each pixel's colours as a mixture of Gaussians |
//! | `blobs.rs` | opening and closing of masks, and the blobs in them |

pub mod background;
pub mod blobs;
pub mod mean_shift;
pub mod online;
