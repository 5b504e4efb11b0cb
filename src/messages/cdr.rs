//! The bytes of a message, on the wire and in bags: four bytes that tell the representation, then plain CDR (OMG
//! DDS-XTypes 1.3, 7.4 and 7.6.3.1.2).

use byteorder::{BigEndian, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Topic;

/// Bytes before the fields; alignment counts from behind them.
const HEADER: usize = 4;
/// Plain CDR, the low byte first.
const LITTLE_ENDIAN: [u8; HEADER] = [0, 1, 0, 0];

/// Why bytes and messages do not go into each other.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum CdrError {
    /// Too short to say how it is laid out.
    #[error("{0} bytes are not a message")]
    Short(usize),
    /// Laid out in another way.
    #[error("representation {0:#06x} is not plain CDR")]
    Representation(u16),
    /// The fields do not hold what the type says.
    #[error("{len} bytes are not a {kind}: {why}")]
    Fields { len: usize, kind: String, why: String },
}

/// The message in the bytes.
pub fn decode<T: Topic + DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let (header, fields) = bytes.split_at_checked(HEADER).ok_or(CdrError::Short(bytes.len()))?;
    let message = match u16::from_be_bytes([header[0], header[1]]) {
        0 => cdr_encoding::from_bytes::<T, BigEndian>(fields),
        1 => cdr_encoding::from_bytes::<T, LittleEndian>(fields),
        other => return Err(CdrError::Representation(other)),
    };
    let failed = |why: String| CdrError::Fields { len: bytes.len(), kind: T::full_name(), why };
    message.map(|(message, _)| message).map_err(|e| failed(e.to_string()))
}

/// The bytes of the message.
pub fn encode<T: Topic + Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    let failed = |why: String| CdrError::Fields { len: HEADER, kind: T::full_name(), why };
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message).map_err(|e| failed(e.to_string()))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::{Header, Time};
    use super::*;

    fn header() -> Header {
        Header { stamp: Time { sec: -2, nanosec: 0x0102_0304 }, frame_id: "eye".to_owned() }
    }

    #[test]
    fn both_byte_orders_are_read_and_the_low_byte_first_is_written() {
        let little = [0, 1, 0, 0, 0xfe, 0xff, 0xff, 0xff, 4, 3, 2, 1, 4, 0, 0, 0, b'e', b'y', b'e', 0];
        let big = [0, 0, 0, 0, 0xff, 0xff, 0xff, 0xfe, 1, 2, 3, 4, 0, 0, 0, 4, b'e', b'y', b'e', 0];
        assert_eq!(encode(&header()).unwrap(), little);
        assert_eq!(decode::<Header>(&little).unwrap(), header());
        assert_eq!(decode::<Header>(&big).unwrap(), header());
    }

    #[test]
    fn what_is_no_message_is_told_with_its_values() {
        let message = |bytes: &[u8]| decode::<Header>(bytes).unwrap_err().to_string();
        assert_eq!(message(&[0, 1]), "2 bytes are not a message");
        assert_eq!(message(&[0, 7, 0, 0, 1]), "representation 0x0007 is not plain CDR");
        let whole = encode(&header()).unwrap();
        assert!(message(&whole[..15]).starts_with("15 bytes are not a std_msgs/msg/Header: "));
    }
}
