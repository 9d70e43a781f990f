//! The outline of an object on the ground.

use crate::error::{Got, InputError, require};

/// Most corners a footprint may have.
///
/// ```
/// use core::f64::consts::TAU;
///
/// use groundpose::{Footprint, MAX_CORNERS};
///
/// let disc = |n: usize| -> Vec<[f64; 2]> { (0..n).map(|k| (k as f64 / n as f64 * TAU).sin_cos().into()).collect() };
/// assert!(Footprint::new(&disc(MAX_CORNERS)).is_ok());
/// assert!(Footprint::new(&disc(MAX_CORNERS + 1)).is_err());
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub const MAX_CORNERS: usize = 16;

/// Convex outline of an object in the bird's-eye view: corners `[x, z]` in the object frame.
///
/// ```
/// use groundpose::Footprint;
///
/// // A car with a rounded front: closer to its silhouette than the rectangle of its 3D box.
/// let outline = [[-0.6, 2.2], [0.6, 2.2], [0.9, 1.6], [0.9, -2.2], [-0.9, -2.2], [-0.9, 1.6]];
/// assert_eq!(Footprint::new(&outline)?.corners().len(), 6);
/// assert!(Footprint::new(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).is_err(), "a line has no inside");
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    corners: [[f64; 2]; MAX_CORNERS],
    count: usize,
}

impl Footprint {
    /// An outline from its corners in either order of rotation.
    ///
    /// # Errors
    /// Fewer than 3 or more than [`MAX_CORNERS`] corners, a number that is not finite, an outline
    /// that is not strictly convex.
    pub fn new(corners: &[[f64; 2]]) -> Result<Self, InputError> {
        let n = corners.len();
        require((3..=MAX_CORNERS).contains(&n), "footprint", "3 to 16 corners [x, z]", Got::Count(n))?;
        let finite = corners.iter().flatten().all(|x| x.is_finite());
        require(finite, "footprint", "finite numbers", Got::Text("NaN or infinite"))?;
        // Every other corner on the same side of every edge: a star turns the same way at each corner, too.
        let side = |i: usize, k: usize| {
            let [a, b, c] = [corners[i], corners[(i + 1) % n], corners[k]];
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let orientation = side(0, 2);
        let others = |i: usize| (0..n).filter(move |&k| k != i && k != (i + 1) % n);
        let convex = (0..n).all(|i| others(i).all(|k| side(i, k) * orientation > 0.0));
        require(convex, "footprint", "a convex outline", Got::Text("a reflex or straight corner"))?;
        let mut padded = [[0.0; 2]; MAX_CORNERS];
        padded[..n].copy_from_slice(corners);
        Ok(Self { corners: padded, count: n })
    }

    /// Corners of a 3D box, numbered as in the paper's Fig. 2: front left, front right, rear right, rear left.
    #[must_use]
    pub fn rectangle(bbox_3d: &[[f64; 3]; 2]) -> Self {
        let [min, max] = *bbox_3d;
        let mut corners = [[0.0; 2]; MAX_CORNERS];
        corners[..4].copy_from_slice(&[[min[0], max[2]], [max[0], max[2]], [max[0], min[2]], [min[0], min[2]]]);
        Self { corners, count: 4 }
    }

    /// The corners.
    #[must_use]
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners[..self.count]
    }
}
