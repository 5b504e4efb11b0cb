//! Keeps answers of services within one datagram.
//!
//! RustDDS 0.15.1 writes one byte too many into each fragment of a larger answer, so that no client can read it, nor any
//! later answer. What does not fit is therefore left out, with a line in the log: a client that asks for less at a time
//! gets all of it.

use byteorder::LittleEndian;
use log::warn;
use rustdds::cdr_encoding;
use serde::Serialize;

/// Most bytes of an answer: measured against rclpy on loopback, where 900 arrive and 1300 do not.
const MOST_BYTES: usize = 900;

/// Whether the answer fits.
pub fn fits(answer: &impl Serialize) -> bool {
    cdr_encoding::to_vec::<_, LittleEndian>(answer).is_ok_and(|bytes| bytes.len() <= MOST_BYTES)
}

/// The answer for these names if it fits; else that for none, as for names that nobody knows.
pub fn whole_or_empty<A: Serialize>(names: &[String], answer: impl Fn(&[String]) -> A) -> A {
    let whole = answer(names);
    if fits(&whole) {
        return whole;
    }
    warn!(
        "the answer for {} parameters would exceed {MOST_BYTES} bytes and is left empty; ask for fewer at a time",
        names.len()
    );
    answer(&[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_is_answered_whole_and_the_rest_not_at_all() {
        let names: Vec<String> = (0..100).map(|i| format!("group.parameter_{i}")).collect();
        let answer = |names: &[String]| names.to_vec();
        assert_eq!(whole_or_empty(&names[..10], answer), names[..10]);
        assert!(whole_or_empty(&names, answer).is_empty());
        assert!(fits(&vec![0u8; MOST_BYTES - 4]) && !fits(&vec![0u8; MOST_BYTES - 3]));
    }
}
