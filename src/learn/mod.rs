//! Classifiers that learn while the target is followed.
//!
//! | file | what it holds |
//! |---|---|
//! | `svm.rs` | the incremental and exact support vector machine of LCMHT |
//! | `adaboost.rs` | ensembles of linear classifiers, of ETEPF |

pub mod adaboost;
pub mod svm;
