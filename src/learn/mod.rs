//! Classifiers that learn while the target is followed.

pub mod svm;
