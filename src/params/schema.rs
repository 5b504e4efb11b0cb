//! The table of parameters, group by group. A row is name, type, default, range, unit, what a change of it needs,
//! who meets it, and one sentence.

use super::etepf::EtepfParams;
use super::lcmht::LcmhtParams;
use super::maptrack::MaptrackParams;
use super::table::{choice, group, groups};
use crate::error::ParamsError;
use crate::frame::Levels;

choice! {
    /// The tracker behind the interface.
    pub enum Algorithm {
        /// Long-term correlation tracking with multi-layer hybrid features.
        Lcmht = "lcmht",
        /// Ensemble tracking embedded in a particle filter.
        Etepf = "etepf",
        /// Motion, appearance and position of many targets, found without a mark.
        Maptrack = "maptrack",
    }
}

choice! {
    /// How images arrive.
    pub enum ImageTransport {
        /// `sensor_msgs/msg/Image`.
        Raw = "raw",
        /// `sensor_msgs/msg/CompressedImage`, JPEG or PNG.
        Compressed = "compressed",
    }
}

group! {
    /// What all trackers and ends share.
    pub struct General at "" {
        algorithm: Algorithm = Algorithm::Lcmht, needs Restart, is Basic; "The tracker to use."
        image_transport: ImageTransport = ImageTransport::Raw, needs Restart, is Basic; "How images arrive: `raw` on `image`, or `compressed` (JPEG or PNG) on `image/compressed`."
        max_targets: i64 = 1, in 1..=64, is Basic; "Maximum number of marked targets. With 1, a new mark replaces the target; with more, it adds one until the maximum is reached. Targets found without a mark do not count."
        seed: i64 = 0, in 0..=i64::MAX, needs Restart; "Seed of the random number generator. The same seed gives the same boxes."
    }
}

group! {
    /// How images of 16 bits are read.
    pub struct LevelParams at "levels." {
        black: i64 = 0, in 0..=65535; "Pixel value shown as black in 16-bit images."
        white: i64 = 65535, in 0..=65535; "Pixel value shown as white in 16-bit images. If it is below `levels.black`, the image is inverted."
    }
}

impl LevelParams {
    /// As frames take them.
    pub fn range(&self) -> Levels {
        // Within 16 bits by their ranges.
        Levels { black: self.black as u16, white: self.white as u16 }
    }
}

group! {
    /// Frames that are kept, so that a mark may name one that has passed.
    pub struct HistoryParams at "history." {
        frames: i64 = 30, in 0..=1000; "Number of past frames kept, so that a mark on `~/init_detection` can refer to one of them. 0 keeps none."
        megabytes: i64 = 64, in 1..=4096, unit "MB"; "Maximum memory for the kept frames. The oldest are dropped first."
    }
}

group! {
    /// What images, messages, files and the process may take. A peer cannot raise these: they are fixed at the start.
    pub struct Limits at "limits." {
        image_mb: i64 = 300, in 1..=65536, unit "MB", needs Restart; "Maximum size of a decoded image in memory. The default fits 8K with four 16-bit channels."
        message_mb: i64 = 320, in 1..=65536, unit "MB", needs Restart; "Maximum size of a message in a recording, after decompression."
        file_mb: i64 = 512, in 1..=65536, unit "MB", needs Restart; "Maximum size of a network file."
        memory_mb: i64 = 4096, in 64..=1048576, unit "MB", needs Restart; "Resident memory above which the node exits with an error."
    }
}

impl Limits {
    /// Bytes of a decoded image.
    pub fn image_bytes(&self) -> u64 {
        bytes(self.image_mb)
    }

    /// Bytes of a recorded message.
    pub fn message_bytes(&self) -> u64 {
        bytes(self.message_mb)
    }

    /// Bytes of a network file.
    pub fn file_bytes(&self) -> u64 {
        bytes(self.file_mb)
    }
}

/// Of a value in MB, which its range keeps positive.
fn bytes(megabytes: i64) -> u64 {
    megabytes.unsigned_abs() * 1_000_000
}

group! {
    /// Debug images.
    pub struct Debug at "debug." {
        max_side: i64 = 208, in 16..=4096, unit "px"; "Maximum side of raw debug images; larger frames are scaled down. DDS peers with default settings lose images above about 130 KB."
        compressed_max_side: i64 = 640, in 16..=65536, unit "px"; "Maximum side of compressed debug images; larger frames are scaled down."
        jpeg_quality: i64 = 80, in 1..=100; "JPEG quality of compressed debug images and of the live page."
    }
}

group! {
    /// The live page.
    pub struct ViewerParams at "viewer." {
        port: i64 = 0, in 0..=65535, needs Restart, is Basic; "Port of the live page, where you mark, watch and tune in a browser. 0 switches it off."
        address: String = "127.0.0.1", needs Restart; "IP address the live page listens on. 0.0.0.0 lets other machines connect; they need a token."
        token: String = "", needs Restart; "Token a browser must present to use the live page: at least 16 letters and digits. If empty, no token is needed on loopback; on any other address one is generated and logged."
    }
}

groups! {
    /// Every parameter of the package.
    pub struct Params {
        /// What all trackers and ends share.
        general: General,
        /// How images of 16 bits are read.
        levels: LevelParams,
        /// Frames that are kept.
        history: HistoryParams,
        /// What images, messages, files and the process may take.
        limits: Limits,
        /// Debug images.
        debug: Debug,
        /// The live page.
        viewer: ViewerParams,
        /// LCMHT.
        lcmht: LcmhtParams,
        /// ETEPF.
        etepf: EtepfParams,
        /// MAPTrack.
        maptrack: MaptrackParams,
    }
}

impl Params {
    /// Checks what a range cannot say: values that must fit each other.
    pub(super) fn check(&self) -> Result<(), ParamsError> {
        let LevelParams { black, white } = self.levels;
        if black == white {
            return Err(ParamsError::Conflict(format!("levels.black and levels.white are both {black}")));
        }
        self.lcmht.check()?;
        self.check_order()
    }
}
