//! Finding targets where no tracker has followed them, and what of a picture moves.
//!
//! | file | what it holds |
//! |---|---|
//! | `online.rs` | the detector that learns one target while it is followed and looks for it when it is lost |
//! | `mean_shift.rs` | boxes that climb to the tops of a map |
//! | `background.rs` | what moves: each pixel's colours as a mixture of Gaussians |
//! | `blobs.rs` | opening and closing of masks, and the blobs in them |
//! | `stabilisation.rs` | how the camera moves: corners followed from a reference picture |
//! | `corners.rs`, `optical_flow.rs` | places that can be followed; where they went |
//! | `mode.rs` | the motion that most places share |
//! | `camera.rs` | that motion, and pictures put back by it |

pub mod background;
pub mod blobs;
pub mod camera;
pub mod corners;
pub mod mean_shift;
pub mod mode;
pub mod online;
pub mod optical_flow;
pub mod stabilisation;
