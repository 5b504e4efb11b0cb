//! Compressed bytes of a recording: what they become is bounded, whatever they claim.

use std::io::Read;

/// What a Zstandard frame, or several, stands for, which may be `most` bytes; or why not.
pub fn zstd(bytes: &[u8], most: usize) -> Result<Vec<u8>, String> {
    if let Some(len) = zstd::decompressed_size(bytes).filter(|&len| len > most as u64) {
        return Err(format!("{} bytes would become {len}, at most {most} are read", bytes.len()));
    }
    // At once: by parts, frames of more than 128 MB would be refused for the window they ask for.
    zstd::bulk::decompress(bytes, most)
        .map_err(|e| format!("{} bytes of zstd, at most {most} are read: {e}", bytes.len()))
}

/// What an LZ4 frame stands for, which may be `most` bytes; or why not.
pub fn lz4(bytes: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let failed = |e: std::io::Error| format!("{} bytes of lz4: {e}", bytes.len());
    let mut data = Vec::new();
    let decoder = lz4::Decoder::new(bytes).map_err(failed)?;
    decoder.take((most as u64).saturating_add(1)).read_to_end(&mut data).map_err(failed)?;
    if data.len() > most { Err(format!("{} bytes become more than {most}", bytes.len())) } else { Ok(data) }
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
            let why = zstd(compressed, data.len() - 1).unwrap_err();
            assert!(why.contains("at most 39999 are read"), "{why}");
            assert!(zstd(&compressed[..compressed.len() / 2], data.len()).is_err());
        }
        let compressed = lz4ed(&data);
        assert_eq!(lz4(&compressed, data.len()).unwrap(), data);
        assert!(lz4(&compressed, data.len() - 1).unwrap_err().ends_with("become more than 39999"));
        assert!(lz4(b"nothing of the kind", 100).is_err());
    }
}
