//! Feature maps of image patches, on a grid of square cells, and features of pixels and boxes.
//!
//! | file | feature | channels |
//! |---|---|---|
//! | `hog.rs` | Felzenszwalb's histogram of oriented gradients | 31 |
//! | `colour_names.rs` | colour names of van de Weijer et al. | 11 |
//! | `luv.rs` | CIE LUV, and the normalised gradient magnitude | 3 and 1 |
//! | `pca.rs` | projection of channels on to their principal components | as asked |
//! | `resize.rs` | bilinear resampling of a map to another grid | as they are |
//! | `pixelwise.rs` | of each pixel: gradients of its neighbourhood, and its colour | 8 and 3 |
//! | `contrast.rs` | of a picture: whether it shows anything to follow | |
//! | `colour_histogram.rs` | of a box: histogram of HSV colours | 110 bins |

pub mod colour_histogram;
pub mod colour_names;
pub mod contrast;
pub mod hog;
pub mod luv;
pub mod pca;
pub mod pixelwise;
pub mod resize;

/// Side of a cell, in pixels of the patch.
pub const CELL: usize = 4;

/// A feature map: `channels` planes, each row-major `rows x cols`; row 0 is the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureMap {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Number of channels.
    pub channels: usize,
    /// The values, channel after channel.
    pub data: Vec<f32>,
}

impl FeatureMap {
    /// Takes on a shape; the values are then unspecified.
    pub fn resize(&mut self, rows: usize, cols: usize, channels: usize) {
        (self.rows, self.cols, self.channels) = (rows, cols, channels);
        self.data.resize(rows * cols * channels, 0.0);
    }

    /// Cells of a plane.
    pub fn cells(&self) -> usize {
        self.rows * self.cols
    }

    /// The plane of a channel.
    pub fn plane(&self, channel: usize) -> &[f32] {
        &self.data[channel * self.cells()..(channel + 1) * self.cells()]
    }
}
