//! Pictures of bytes, wherever they lie in memory.

/// Bytes of a pixel: red, green, blue.
pub const CHANNELS: usize = 3;
/// Colour of what lies outside a picture; the normalisation of the networks turns it to nearly zero.
pub const FILL: [u8; CHANNELS] = [124, 116, 104];

/// A picture, row by row.
pub trait Picture: Sync {
    /// Pixels of a row, and rows.
    fn size(&self) -> [usize; 2];

    /// The bytes of a row and of what lies behind it; `None` where they lie apart: then pixels are asked for.
    fn row(&self, y: usize) -> Option<&[u8]>;

    /// One pixel.
    fn pixel(&self, x: usize, y: usize) -> [u8; CHANNELS];
}

/// Rows that follow each other without gaps.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    bytes: &'a [u8],
    width: usize,
}

impl<'a> Rows<'a> {
    /// A picture of so many pixels a row; `None` where the bytes are not whole rows of at least one pixel.
    pub fn new(bytes: &'a [u8], width: usize) -> Option<Self> {
        let whole = width > 0 && !bytes.is_empty() && bytes.len().is_multiple_of(width * CHANNELS);
        whole.then_some(Self { bytes, width })
    }
}

impl Picture for Rows<'_> {
    fn size(&self) -> [usize; 2] {
        [self.width, self.bytes.len() / (self.width * CHANNELS)]
    }

    fn row(&self, y: usize) -> Option<&[u8]> {
        Some(&self.bytes[y * self.width * CHANNELS..])
    }

    fn pixel(&self, x: usize, y: usize) -> [u8; CHANNELS] {
        let at = (y * self.width + x) * CHANNELS;
        [self.bytes[at], self.bytes[at + 1], self.bytes[at + 2]]
    }
}
