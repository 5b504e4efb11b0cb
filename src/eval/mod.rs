//! Scores of box sequences against ground truth.

pub mod otb;
