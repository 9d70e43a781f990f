//! Keypoints of an object or of a class of objects, and how they vary.

use crate::error::{Got, InputError, require};
use crate::geometry::footprint::Footprint;

/// Most modes of shape variation a model may have.
///
/// ```
/// use groundpose::{MAX_MODES, ShapeModel};
///
/// let model = ShapeModel::rigid(&[[0.0; 3]], [[-1.0; 3], [1.0; 3]])?;
/// let basis = [[0.1; 3]; MAX_MODES + 1];
/// assert!(model.with_modes(&basis, &[1.0; MAX_MODES + 1]).is_err());
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub const MAX_MODES: usize = 10;

/// Keypoints of an object or of a class of objects, and how they vary (active shape model, paper sec. 3.3). With
/// coefficients $`\lambda_j`$ of modes $`B_j`$, keypoint $`i`$ is at
///
/// ```math
/// X_i = \bar{X}_i + \sum_j \lambda_j B_{ij} .
/// ```
///
/// Borrowed data, checked once.
///
/// ```
/// use groundpose::{Footprint, ShapeModel};
///
/// // Two keypoints on the roof; one mode that lifts both (y points down).
/// let mean = [[-0.5, -1.4, 0.0], [0.5, -1.4, 0.0]];
/// let basis = [[0.0, -0.125, 0.0], [0.0, -0.125, 0.0]];
/// let model = ShapeModel::rigid(&mean, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?.with_modes(&basis, &[1.0])?;
/// assert_eq!(model.keypoint(1, &[2.0]), [0.5, -1.65, 0.0]);
///
/// // What it was made of; the outline is the rectangle of the 3D box until a finer one is given.
/// assert_eq!((model.keypoint_count(), model.eigenvalues()), (2, &[1.0][..]));
/// assert_eq!((model.mean()[1], model.basis(0, 1)), (mean[1], basis[1]));
/// assert_eq!(*model.footprint(), Footprint::rectangle(model.bbox_3d()));
/// assert!(model.bbox_basis().is_empty(), "the box does not follow the shape");
/// let narrow_front = Footprint::new(&[[-0.6, 2.2], [0.6, 2.2], [0.9, -2.2], [-0.9, -2.2]])?;
/// assert_eq!(*model.with_footprint(narrow_front).footprint(), narrow_front);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ShapeModel<'a> {
    mean: &'a [[f64; 3]],
    basis: &'a [[f64; 3]],
    eigenvalues: &'a [f64],
    bbox_3d: [[f64; 3]; 2],
    /// One row per mode, or none.
    bbox_basis: &'a [[[f64; 3]; 2]],
    footprint: Footprint,
}

impl<'a> ShapeModel<'a> {
    /// A model with one known shape: keypoints and 3D box `[min, max]` in the object frame, metres.
    ///
    /// # Errors
    /// No keypoints, numbers that are not finite, a box with min >= max.
    pub fn rigid(keypoints_3d: &'a [[f64; 3]], bbox_3d: [[f64; 3]; 2]) -> Result<Self, InputError> {
        require(!keypoints_3d.is_empty(), "keypoints_3d", "at least one keypoint", Got::Count(0))?;
        require_finite(keypoints_3d, "keypoints_3d")?;
        require_finite(&bbox_3d, "bbox_3d")?;
        for axis in 0..3 {
            let (min, max) = (bbox_3d[0][axis], bbox_3d[1][axis]);
            require(min < max, "bbox_3d", "[min, max] with min < max on every axis", Got::Pair(min, max))?;
        }
        let footprint = Footprint::rectangle(&bbox_3d);
        Ok(Self { mean: keypoints_3d, basis: &[], eigenvalues: &[], bbox_3d, bbox_basis: &[], footprint })
    }

    /// The same model with modes of variation: `basis[j * P + i]` moves keypoint `i` in mode `j`,
    /// and `eigenvalues[j]` is the variance of its coefficient.
    ///
    /// # Errors
    /// Lengths that do not agree, more than [`MAX_MODES`] modes, numbers that are not finite, an
    /// eigenvalue that is not positive.
    pub fn with_modes(mut self, basis: &'a [[f64; 3]], eigenvalues: &'a [f64]) -> Result<Self, InputError> {
        let modes = eigenvalues.len();
        require(modes <= MAX_MODES, "eigenvalues", "at most 10 modes", Got::Count(modes))?;
        require(
            basis.len() == modes * self.mean.len(),
            "basis",
            "one row per mode and keypoint",
            Got::Count(basis.len()),
        )?;
        require_finite(basis, "basis")?;
        for &e in eigenvalues {
            require(e.is_finite() && e > 0.0, "eigenvalues", "positive finite numbers", Got::Number(e))?;
        }
        self.basis = basis;
        self.eigenvalues = eigenvalues;
        self.bbox_basis = &[];
        Ok(self)
    }

    /// The same model with a 3D box that follows its shape: `bbox_basis[j]` moves `[min, max]` in mode `j` of
    /// [`ShapeModel::with_modes`]. A van and a bus are one class; the mean box fits neither.
    ///
    /// ```
    /// use groundpose::ShapeModel;
    ///
    /// let mean = [[-0.5, -1.4, 0.0], [0.5, -1.4, 0.0]];
    /// let lifts_both = [[0.0, -0.125, 0.0], [0.0, -0.125, 0.0]];
    /// let lifts_the_roof = [[[0.0, -0.125, 0.0], [0.0; 3]]];
    /// let model = ShapeModel::rigid(&mean, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?
    ///     .with_modes(&lifts_both, &[1.0])?
    ///     .with_bbox_basis(&lifts_the_roof)?;
    /// assert_eq!(model.bbox_3d_of(&[2.0]), [[-0.9, -1.75, -2.2], [0.9, 0.0, 2.2]]);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    ///
    /// # Errors
    /// Not one row per mode, numbers that are not finite.
    pub fn with_bbox_basis(mut self, bbox_basis: &'a [[[f64; 3]; 2]]) -> Result<Self, InputError> {
        let rows = bbox_basis.len();
        require(rows == self.eigenvalues.len(), "bbox_basis", "one row per mode", Got::Count(rows))?;
        require_finite(bbox_basis.as_flattened(), "bbox_basis")?;
        self.bbox_basis = bbox_basis;
        Ok(self)
    }

    /// A model from parts that were checked when they were first put together.
    #[cfg(feature = "python")]
    pub(crate) fn checked_before(
        mean: &'a [[f64; 3]],
        basis: &'a [[f64; 3]],
        eigenvalues: &'a [f64],
        bbox_3d: [[f64; 3]; 2],
        bbox_basis: &'a [[[f64; 3]; 2]],
        footprint: Footprint,
    ) -> Self {
        Self { mean, basis, eigenvalues, bbox_3d, bbox_basis, footprint }
    }

    /// The same model with an outline finer than the rectangle of its 3D box.
    #[must_use]
    pub fn with_footprint(mut self, footprint: Footprint) -> Self {
        self.footprint = footprint;
        self
    }

    /// Mean keypoints, metres, object frame.
    #[must_use]
    pub fn mean(&self) -> &'a [[f64; 3]] {
        self.mean
    }

    /// Number of keypoints.
    #[must_use]
    pub fn keypoint_count(&self) -> usize {
        self.mean.len()
    }

    /// Variances of the shape coefficients.
    #[must_use]
    pub fn eigenvalues(&self) -> &'a [f64] {
        self.eigenvalues
    }

    /// Displacement of keypoint `i` in mode `j`.
    #[inline]
    #[must_use]
    pub fn basis(&self, j: usize, i: usize) -> [f64; 3] {
        self.basis[j * self.mean.len() + i]
    }

    /// Displacements of the keypoints in mode `j`.
    #[inline]
    pub(crate) fn mode(&self, j: usize) -> &'a [[f64; 3]] {
        &self.basis[j * self.mean.len()..(j + 1) * self.mean.len()]
    }

    /// 3D box `[min, max]` of the mean shape, metres, object frame.
    #[must_use]
    pub fn bbox_3d(&self) -> &[[f64; 3]; 2] {
        &self.bbox_3d
    }

    /// How the 3D box moves in each mode; empty when it does not.
    #[must_use]
    pub fn bbox_basis(&self) -> &'a [[[f64; 3]; 2]] {
        self.bbox_basis
    }

    /// 3D box `[min, max]` of the shape with these coefficients.
    #[inline]
    #[must_use]
    pub fn bbox_3d_of(&self, coefficients: &[f64]) -> [[f64; 3]; 2] {
        let mut bbox_3d = self.bbox_3d;
        for (lambda, row) in coefficients.iter().zip(self.bbox_basis) {
            for (x, b) in bbox_3d.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
                *x += lambda * b;
            }
        }
        bbox_3d
    }

    /// Outline in the bird's-eye view, of the mean shape.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Factor and offset that take the footprint along an axis from the mean shape to the shape of a 3D box: it is
    /// stretched with the box.
    #[inline]
    pub(crate) fn footprint_stretch(&self, [min, max]: &[[f64; 3]; 2], axis: usize) -> (f64, f64) {
        if self.bbox_basis.is_empty() {
            return (1.0, 0.0);
        }
        let [mean_min, mean_max] = &self.bbox_3d;
        let factor = (max[axis] - min[axis]) / (mean_max[axis] - mean_min[axis]);
        (factor, min[axis] - factor * mean_min[axis])
    }

    /// Keypoint `i` of the shape with these coefficients (paper, sec. 3.3).
    #[inline]
    #[must_use]
    pub fn keypoint(&self, i: usize, coefficients: &[f64]) -> [f64; 3] {
        let mut x = self.mean[i];
        for (j, lambda) in coefficients.iter().enumerate().take(self.eigenvalues.len()) {
            let b = self.basis(j, i);
            for axis in 0..3 {
                x[axis] += lambda * b[axis];
            }
        }
        x
    }
}

fn require_finite(points: &[[f64; 3]], argument: &'static str) -> Result<(), InputError> {
    let finite = points.iter().flatten().all(|x| x.is_finite());
    require(finite, argument, "finite numbers", Got::Text("NaN or infinite"))
}
