//! Finding targets where no tracker has followed them.
//!
//! | file | what it holds |
//! |---|---|
//! | `online.rs` | the detector that learns one target while it is followed and looks for it when it is lost |

pub mod online;
