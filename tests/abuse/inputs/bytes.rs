//! Files made byte by byte, which say more than they hold.

/// Zeros, deflated: as many as asked for and up to 257 more, in fixed codes (RFC 1951, 3.2.6) within zlib's header and
/// checksum.
pub fn zlib_zeros(count: usize) -> Vec<u8> {
    let mut out = vec![0x78, 0x01];
    let (mut word, mut bits) = (0_u64, 0);
    let mut put = |out: &mut Vec<u8>, value: u64, len: u32| {
        word |= value << bits;
        bits += len;
        while bits >= 8 {
            out.push(word as u8);
            word >>= 8;
            bits -= 8;
        }
    };
    put(&mut out, 0b011, 3);
    // The literal 0, then copies of 258 from one back. Codes go in with their first bit first.
    put(&mut out, u64::from(0b0011_0000_u8.reverse_bits()), 8);
    let copies = (count - 1).div_ceil(258);
    for _ in 0..copies {
        put(&mut out, u64::from(0b1100_0101_u8.reverse_bits()), 8);
        put(&mut out, 0, 5);
    }
    let bits = 3 + 8 + 13 * copies + 7;
    put(&mut out, 0, 7 + (bits.next_multiple_of(8) - bits) as u32);
    // Adler-32 of n zeros.
    let n = 1 + copies * 258;
    out.extend((((n % 65521) as u32) << 16 | 1).to_be_bytes());
    out
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

fn chunk(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let named = [kind, body].concat();
    [&(body.len() as u32).to_be_bytes()[..], &named, &crc(&named).to_be_bytes()].concat()
}

/// A PNG file that claims this size, its colour type and depth, with other chunks before its data.
pub fn png(size: [u32; 2], depth: u8, colour: u8, others: &[(&[u8; 4], &[u8])], data: &[u8]) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    out.extend(chunk(
        b"IHDR",
        &[&size[0].to_be_bytes()[..], &size[1].to_be_bytes(), &[depth, colour, 0, 0, 0]].concat(),
    ));
    others.iter().for_each(|(kind, body)| out.extend(chunk(kind, body)));
    out.extend(chunk(b"IDAT", data));
    out.extend(chunk(b"IEND", b""));
    out
}

/// The same JPEG file, but claiming another size.
pub fn claiming(jpeg: &[u8], size: [u16; 2]) -> Vec<u8> {
    let mut out = jpeg.to_vec();
    let at = out.windows(2).position(|pair| matches!(pair, [0xff, 0xc0..=0xc2])).unwrap();
    out[at + 5..at + 7].copy_from_slice(&size[1].to_be_bytes());
    out[at + 7..at + 9].copy_from_slice(&size[0].to_be_bytes());
    out
}

/// The same JPEG file without its Huffman tables.
pub fn without_tables(jpeg: &[u8]) -> Vec<u8> {
    let mut out = jpeg[..2].to_vec();
    let mut at = 2;
    loop {
        let (code, len) = (jpeg[at + 1], u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]) as usize);
        let next = at + 2 + len;
        if code != 0xc4 {
            out.extend(&jpeg[at..next]);
        }
        if code == 0xda {
            out.extend(&jpeg[next..]);
            return out;
        }
        at = next;
    }
}

/// A progressive JPEG file of one component with so many scans.
pub fn progressive(size: [u16; 2], scans: usize) -> Vec<u8> {
    let mut out = vec![0xff, 0xd8, 0xff, 0xdb, 0, 67, 0];
    out.extend([1; 64]);
    out.extend([0xff, 0xc2, 0, 11, 8]);
    out.extend(size[1].to_be_bytes());
    out.extend(size[0].to_be_bytes());
    out.extend([1, 1, 0x11, 0]);
    // A table for means with a code of one bit for no difference, and one for others with a run of blocks of nothing.
    for (class, value) in [(0x00, 0x00), (0x10, 0xe0)] {
        out.extend([0xff, 0xc4, 0, 20, class, 1]);
        out.extend([0; 15]);
        out.push(value);
    }
    let blocks = size.map(|side| usize::from(side).div_ceil(8)).iter().product::<usize>();
    out.extend([0xff, 0xda, 0, 8, 1, 1, 0, 0, 0, 0]);
    out.extend(vec![0; blocks.div_ceil(8)]);
    for _ in 1..scans {
        out.extend([0xff, 0xda, 0, 8, 1, 1, 0, 1, 63, 0]);
        out.extend(vec![0; 2 * blocks.div_ceil(1 << 14) + 2]);
    }
    out.extend([0xff, 0xd9]);
    out
}

/// A Zstandard frame of zeros without their number, in blocks of one repeated byte (RFC 8878, 3.1.1.2).
pub fn zstd_zeros(count: usize) -> Vec<u8> {
    const BLOCK: usize = 128 << 10;
    let mut out = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x38];
    let blocks = count.div_ceil(BLOCK);
    for n in 0..blocks {
        let len = if n + 1 == blocks { count - n * BLOCK } else { BLOCK } as u32;
        let header = len << 3 | 1 << 1 | u32::from(n + 1 == blocks);
        out.extend(&header.to_le_bytes()[..3]);
        out.push(0);
    }
    out
}

/// A record of an MCAP file, whatever its length is said to be.
pub fn record(opcode: u8, claimed: u64, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &claimed.to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A chunk of an MCAP file, and what its index says of it.
pub struct Chunk {
    pub times: [u64; 2],
    pub compression: &'static str,
    /// As it is in the file.
    pub packed: Vec<u8>,
    /// As it is said to be without compression.
    pub claimed: u64,
}

impl Chunk {
    /// With nothing untrue in it.
    pub fn plain(times: [u64; 2], records: Vec<u8>) -> Self {
        Self { times, compression: "", claimed: records.len() as u64, packed: records }
    }

    fn record(&self) -> Vec<u8> {
        let Self { times: [begin, end], compression, packed, claimed } = self;
        let body = [
            &begin.to_le_bytes()[..],
            &end.to_le_bytes(),
            &claimed.to_le_bytes(),
            &[0; 4],
            &text(compression),
            &(packed.len() as u64).to_le_bytes(),
            packed,
        ]
        .concat();
        record(6, body.len() as u64, &body)
    }

    fn index(&self, at: u64) -> Vec<u8> {
        let Self { times: [begin, end], compression, packed, claimed } = self;
        let body = [
            &begin.to_le_bytes()[..],
            &end.to_le_bytes(),
            &at.to_le_bytes(),
            &(self.record().len() as u64).to_le_bytes(),
            &[0; 4],
            &[0; 8],
            &text(compression),
            &(packed.len() as u64).to_le_bytes(),
            &claimed.to_le_bytes(),
        ]
        .concat();
        record(8, body.len() as u64, &body)
    }
}

/// A message on the topic of [`mcap`].
pub fn message(time: u64, data: &[u8]) -> Vec<u8> {
    let body = [&1_u16.to_le_bytes()[..], &[0; 4], &time.to_le_bytes(), &time.to_le_bytes(), data].concat();
    record(5, body.len() as u64, &body)
}

/// An MCAP file of chunks with images on one topic, each listed so many times at the end, and more after that.
pub fn mcap(chunks: &[Chunk], listed: usize, more: &[u8]) -> Vec<u8> {
    let mut out = mcap::MAGIC.to_vec();
    let header = [text("ros2"), text("test")].concat();
    out.extend(record(1, header.len() as u64, &header));
    let mut index = Vec::new();
    for chunk in chunks {
        index.extend(chunk.index(out.len() as u64).repeat(listed));
        out.extend(chunk.record());
    }
    let end = [0; 4];
    out.extend(record(15, 4, &end));
    let summary = out.len() as u64;
    let schema = [&1_u16.to_le_bytes()[..], &text("sensor_msgs/msg/Image"), &text("ros2msg"), &[0; 4]].concat();
    out.extend(record(3, schema.len() as u64, &schema));
    let channel = [&1_u16.to_le_bytes()[..], &1_u16.to_le_bytes(), &text("/eye"), &text("cdr"), &[0; 4]].concat();
    out.extend(record(4, channel.len() as u64, &channel));
    let count = u64::MAX.to_le_bytes();
    let statistics =
        [&count[..], &[1, 0], &[1, 0, 0, 0], &[0; 8], &[1, 0, 0, 0], &[0; 16], &[10, 0, 0, 0, 1, 0], &count].concat();
    out.extend(record(11, statistics.len() as u64, &statistics));
    out.extend(index);
    out.extend(more);
    out.extend(footer(summary));
    out
}

/// The end of an MCAP file whose index begins there.
pub fn footer(summary: u64) -> Vec<u8> {
    [&record(2, 20, &[&summary.to_le_bytes()[..], &[0; 12]].concat()), mcap::MAGIC].concat()
}

/// The start of an MCAP file.
pub fn magic() -> Vec<u8> {
    mcap::MAGIC.to_vec()
}
