//! Memory that the caller owns and lends, so that estimating allocates nothing.

use crate::refine::modes::Row;
#[cfg(feature = "std")]
use crate::refine::modes::rows_per_block;
use crate::simd::blocks::Block;
use crate::simd::lanes::LANES;

/// Buffers for one object.
///
/// ```
/// use groundpose::{Buffers, FixedWorkspace, Workspace};
///
/// // Opaque: a workspace of one's own lends what another one made.
/// let mut workspace = FixedWorkspace::<16>::new();
/// let buffers: Option<Buffers> = workspace.buffers(12);
/// assert!(buffers.is_some());
/// ```
pub struct Buffers<'a> {
    /// Points, a multiple of [`LANES`].
    pub(crate) blocks: &'a mut [Block],
    /// Room for the modes of a model beside the points, or none: the answer is the same, later.
    pub(crate) modes: &'a mut [Row],
    /// Index in the model of every visible keypoint.
    pub(crate) visible: &'a mut [u32],
    /// Order of the draws: positions in `visible`.
    pub(crate) order: &'a mut [u32],
    /// Scratch, one number per keypoint.
    pub(crate) scratch: &'a mut [f64],
    /// Residuals of the returned pose, one per keypoint of the model.
    pub(crate) residuals: &'a mut [f64],
    /// Keypoints without the lens's distortion.
    pub(crate) pixels: &'a mut [[f64; 2]],
}

impl Buffers<'_> {
    /// The same buffers for one of several runs.
    pub(crate) fn lend(&mut self) -> Buffers<'_> {
        Buffers {
            blocks: &mut *self.blocks,
            modes: &mut *self.modes,
            visible: &mut *self.visible,
            order: &mut *self.order,
            scratch: &mut *self.scratch,
            residuals: &mut *self.residuals,
            pixels: &mut *self.pixels,
        }
    }
}

/// Something that can lend buffers for `keypoints` keypoints.
///
/// ```
/// use groundpose::{FixedWorkspace, Workspace};
///
/// let mut workspace = FixedWorkspace::<4>::new();
/// assert!(workspace.buffers(3).is_some() && workspace.buffers(5).is_none());
/// assert_eq!(workspace.residuals().len(), 3);
/// ```
pub trait Workspace {
    /// The buffers; `None` when the object is too large for a fixed workspace.
    fn buffers(&mut self, keypoints: usize) -> Option<Buffers<'_>>;

    /// The same for a model with so many modes: room to lay them out saves time, no room changes no number.
    ///
    /// ```
    /// use groundpose::{FixedWorkspace, Workspace};
    ///
    /// // No heap, no room of its own for modes.
    /// assert!(FixedWorkspace::<4>::new().buffers_for(4, 5).is_some());
    /// ```
    fn buffers_for(&mut self, keypoints: usize, _modes: usize) -> Option<Buffers<'_>> {
        self.buffers(keypoints)
    }

    /// Reprojection errors in pixels of the pose returned last, one per keypoint; NaN = not seen.
    fn residuals(&self) -> &[f64];
}

/// Buffers of fixed size for up to `N` keypoints, without a heap.
///
/// ```
/// use groundpose::{FixedWorkspace, Workspace};
///
/// // It may be static: nothing is allocated, ever.
/// let mut workspace = FixedWorkspace::<53>::new();
/// assert!(workspace.buffers(53).is_some());
/// assert!(workspace.buffers(54).is_none());
/// ```
pub struct FixedWorkspace<const N: usize> {
    blocks: [Block; N],
    visible: [u32; N],
    order: [u32; N],
    scratch: [f64; N],
    residuals: [f64; N],
    pixels: [[f64; 2]; N],
    keypoints: usize,
}

impl<const N: usize> FixedWorkspace<N> {
    /// An empty workspace.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            blocks: [Block::EMPTY; N],
            visible: [0; N],
            order: [0; N],
            scratch: [0.0; N],
            residuals: [0.0; N],
            pixels: [[0.0; 2]; N],
            keypoints: 0,
        }
    }
}

impl<const N: usize> Default for FixedWorkspace<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Workspace for FixedWorkspace<N> {
    fn buffers(&mut self, keypoints: usize) -> Option<Buffers<'_>> {
        if keypoints > N {
            return None;
        }
        self.keypoints = keypoints;
        Some(Buffers {
            blocks: &mut self.blocks[..keypoints.div_ceil(LANES)],
            modes: &mut [],
            visible: &mut self.visible[..keypoints],
            order: &mut self.order[..keypoints],
            scratch: &mut self.scratch[..keypoints],
            residuals: &mut self.residuals[..keypoints],
            pixels: &mut self.pixels[..keypoints],
        })
    }

    fn residuals(&self) -> &[f64] {
        &self.residuals[..self.keypoints]
    }
}

/// Buffers that grow to the largest object seen and are then reused.
///
/// ```
/// use groundpose::{GrowingWorkspace, Workspace};
///
/// let mut workspace = GrowingWorkspace::new();
/// assert!(workspace.buffers(53).is_some() && workspace.buffers(1000).is_some());
/// ```
#[cfg(feature = "std")]
#[derive(Default)]
pub struct GrowingWorkspace {
    blocks: Vec<Block>,
    modes: Vec<Row>,
    indices: Vec<u32>,
    numbers: Vec<f64>,
    pixels: Vec<[f64; 2]>,
    keypoints: usize,
}

#[cfg(feature = "std")]
impl GrowingWorkspace {
    /// An empty workspace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Buffers for `keypoints` keypoints of a model with so many modes: there is always room.
    pub(crate) fn grown(&mut self, keypoints: usize, modes: usize) -> Buffers<'_> {
        let blocks = keypoints.div_ceil(LANES);
        let rows = blocks * rows_per_block(modes);
        if self.modes.len() < rows {
            self.modes.resize(rows, Row::default());
        }
        if self.numbers.len() < 2 * keypoints {
            self.blocks.resize(blocks, Block::default());
            self.indices.resize(2 * keypoints, 0);
            self.numbers.resize(2 * keypoints, 0.0);
            self.pixels.resize(keypoints, [0.0; 2]);
        }
        self.keypoints = keypoints;
        let (visible, order) = self.indices.split_at_mut(keypoints);
        let (residuals, scratch) = self.numbers.split_at_mut(keypoints);
        Buffers {
            blocks: &mut self.blocks[..blocks],
            modes: &mut self.modes[..rows],
            visible,
            order: &mut order[..keypoints],
            scratch: &mut scratch[..keypoints],
            residuals,
            pixels: &mut self.pixels[..keypoints],
        }
    }
}

#[cfg(feature = "std")]
impl Workspace for GrowingWorkspace {
    fn buffers(&mut self, keypoints: usize) -> Option<Buffers<'_>> {
        Some(self.grown(keypoints, 0))
    }

    fn buffers_for(&mut self, keypoints: usize, modes: usize) -> Option<Buffers<'_>> {
        Some(self.grown(keypoints, modes))
    }

    fn residuals(&self) -> &[f64] {
        &self.numbers[..self.keypoints]
    }
}
