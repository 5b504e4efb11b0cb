//! Compressed bytes of a recording: what they become is bounded, whatever they claim.

use std::io::Read;

/// Why compressed bytes are not read. `len` is how many there are, `most` what they may become.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum InflateError {
    /// They claim to become more than may be.
    #[error("{len} bytes would decompress to {claimed}, at most {most} are allowed")]
    Claim { len: usize, claimed: u64, most: usize },
    /// They become more than may be.
    #[error("{len} bytes decompress to more than {most}")]
    TooLarge { len: usize, most: usize },
    /// They are no Zstandard, or become more than may be.
    #[error("{len} bytes of zstd, at most {most} are allowed: {source}")]
    Zstd { len: usize, most: usize, source: std::io::Error },
    /// They are no LZ4.
    #[error("{len} bytes of lz4: {source}")]
    Lz4 { len: usize, source: std::io::Error },
}

/// What a Zstandard frame, or several, stands for, which may be `most` bytes.
pub fn zstd(bytes: &[u8], most: usize) -> Result<Vec<u8>, InflateError> {
    let len = bytes.len();
    if let Some(claimed) = zstd::decompressed_size(bytes).filter(|&claimed| claimed > most as u64) {
        return Err(InflateError::Claim { len, claimed, most });
    }
    // At once: by parts, frames of more than 128 MB would be refused for the window they ask for.
    zstd::bulk::decompress(bytes, most).map_err(|source| InflateError::Zstd { len, most, source })
}

/// What an LZ4 frame stands for, which may be `most` bytes.
pub fn lz4(bytes: &[u8], most: usize) -> Result<Vec<u8>, InflateError> {
    let len = bytes.len();
    let failed = |source| InflateError::Lz4 { len, source };
    let mut data = Vec::new();
    let decoder = lz4::Decoder::new(bytes).map_err(failed)?;
    decoder.take((most as u64).saturating_add(1)).read_to_end(&mut data).map_err(failed)?;
    if data.len() > most { Err(InflateError::TooLarge { len, most }) } else { Ok(data) }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn lz4ed(data: &[u8]) -> Vec<u8> {
        let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
        encoder.write_all(data).unwrap();
        encoder.finish().0
    }

    #[test]
    fn what_was_compressed_comes_back_and_no_more_than_may_be() {
        let data: Vec<u8> = (0..40_000_u32).map(|n| (n / 900) as u8).collect();
        let told = zstd::bulk::compress(&data, 3).unwrap();
        // Without its size in its header, and in two frames.
        let untold = zstd::stream::encode_all(&data[..], 3).unwrap();
        let two =
            [zstd::bulk::compress(&data[..100], 3).unwrap(), zstd::bulk::compress(&data[100..], 3).unwrap()].concat();
        for compressed in [&told, &untold, &two] {
            assert_eq!(zstd(compressed, data.len()).unwrap(), data);
            let why = zstd(compressed, data.len() - 1).unwrap_err().to_string();
            assert!(why.contains("at most 39999 are allowed"), "{why}");
            assert!(zstd(&compressed[..compressed.len() / 2], data.len()).is_err());
        }
        let compressed = lz4ed(&data);
        assert_eq!(lz4(&compressed, data.len()).unwrap(), data);
        assert!(lz4(&compressed, data.len() - 1).unwrap_err().to_string().ends_with("decompress to more than 39999"));
        assert!(lz4(b"nothing of the kind", 100).is_err());
    }
}
