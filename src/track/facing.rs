//! Which end of a vehicle is its front: log odds from all frames together.
//!
//! The filter knows the axis of a vehicle. Pictures and motion say which way along it the vehicle faces. A network that
//! takes a rear for a front does so again in the next frame: pictures a tenth of a second apart count as a fraction of
//! one. Motion counts once, by the fastest it was seen: a vehicle that drove forward and then stops still faces there. One
//! that later drives the other way, faster than anybody reverses, faces that way.

use crate::geometry::math::{exp, log};

/// Pictures are never surer than this, log odds.
const MOST_FROM_PICTURES: f64 = 5.0;
/// Log odds of vehicles that drive forward, not backward, when they move at all.
const FORWARD: f64 = 3.9;
/// Speeds, m/s: below the first nothing is said, beyond the last nobody reverses.
const SPEEDS: [f64; 3] = [0.5, 1.5, 4.0];
/// Log odds for each m/s beyond the last of them.
const FASTER: f64 = 2.0;
const MOST_FROM_MOTION: f64 = 12.0;

/// Log odds that a vehicle faces along its axis, not against it.
///
/// ```
/// use groundpose::Facing;
///
/// let mut facing = Facing::default();
/// facing.see(-1.0, 0.1, 1.0); // a picture of it turned round, wrong with a probability of 0.1
/// assert!(facing.probability() < 0.11);
/// facing.drive(8.0, 0.4); // along the axis
/// assert!(facing.probability() > 0.99 && facing.side() == 1.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Facing {
    pictures: f64,
    motion: f64,
}

impl Facing {
    /// A picture of it, facing along (`side` 1) or against (-1) the axis, wrong with probability `turned`; `weight`: how
    /// much of it was not in the pictures before.
    pub fn see(&mut self, side: f64, turned: f64, weight: f64) {
        let p = turned.clamp(0.02, 0.98);
        let said = self.pictures + side * weight * log((1.0 - p) / p);
        self.pictures = said.clamp(-MOST_FROM_PICTURES, MOST_FROM_PICTURES);
    }

    /// It moves along its axis with this velocity, m/s.
    pub fn drive(&mut self, velocity: f64, sigma: f64) {
        let surely = velocity.abs() - 2.0 * sigma;
        let [none, some, fast] = SPEEDS;
        let said = FORWARD * ((surely - none) / (some - none)).clamp(0.0, 1.0) + FASTER * (surely - fast).max(0.0);
        let said = said.min(MOST_FROM_MOTION);
        let reversed = (velocity < 0.0) != (self.motion < 0.0);
        if said > self.motion.abs() || (said > FORWARD && reversed) {
            self.motion = if velocity < 0.0 { -said } else { said };
        }
    }

    /// That it faces along the axis.
    #[must_use]
    pub fn probability(&self) -> f64 {
        1.0 / (1.0 + exp(-(self.pictures + self.motion)))
    }

    /// 1 along the axis, -1 against it.
    #[must_use]
    pub fn side(&self) -> f64 {
        if self.pictures + self.motion < 0.0 { -1.0 } else { 1.0 }
    }

    /// Between -1 and 1: how surely.
    pub(crate) fn expected_side(&self) -> f64 {
        2.0 * self.probability() - 1.0
    }
}
