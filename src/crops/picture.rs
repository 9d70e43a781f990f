//! Pictures of bytes, wherever they lie in memory.

/// Bytes of a pixel: red, green, blue.
///
/// ```
/// assert_eq!(groundpose::crops::picture::CHANNELS, 3);
/// ```
pub const CHANNELS: usize = 3;
/// Colour of what lies outside a picture; the normalisation of the networks turns it to nearly zero.
///
/// ```
/// use groundpose::crops::picture::{CHANNELS, FILL};
///
/// assert_eq!(FILL.len(), CHANNELS);
/// ```
pub const FILL: [u8; CHANNELS] = [124, 116, 104];

/// A picture, row by row.
///
/// ```
/// use groundpose::crops::picture::{CHANNELS, Picture};
///
/// /// All of one colour, without a byte in memory.
/// struct Wall([u8; CHANNELS]);
///
/// impl Picture for Wall {
///     fn size(&self) -> [usize; 2] {
///         [640, 480]
///     }
///     fn row(&self, _: usize) -> Option<&[u8]> {
///         None
///     }
///     fn pixel(&self, _: usize, _: usize) -> [u8; CHANNELS] {
///         self.0
///     }
/// }
/// assert_eq!(Wall([9; 3]).pixel(3, 4), [9; 3]);
/// ```
pub trait Picture: Sync {
    /// Pixels of a row, and rows.
    fn size(&self) -> [usize; 2];

    /// The bytes of a row and of what lies behind it; `None` where they lie apart: then pixels are asked for.
    fn row(&self, y: usize) -> Option<&[u8]>;

    /// One pixel.
    fn pixel(&self, x: usize, y: usize) -> [u8; CHANNELS];
}

/// Rows that follow each other without gaps.
///
/// ```
/// use groundpose::crops::picture::{Picture, Rows};
///
/// let bytes = [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3];
/// let picture = Rows::new(&bytes, 2).expect("two rows of two pixels");
/// assert_eq!((picture.size(), picture.pixel(1, 1)), ([2, 2], [3; 3]));
/// assert!(Rows::new(&bytes, 3).is_none());
/// ```
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
