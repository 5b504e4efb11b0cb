//! Marks on what cannot be followed.
