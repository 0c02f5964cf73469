//! Information gain of the newest image about the calibration, and its attribution to motions.

use super::allocation::allocated_bytes;

/// A motion: of the body along or about an axis of the IMU, or of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// A translation along an axis of the IMU, 0 to 2.
    Translation(usize),
    /// A rotation about an axis of the IMU, 0 to 2.
    Rotation(usize),
    /// A joint, from 0.
    Joint(usize),
}

impl Motion {
    /// All motions of a body with this number of joints, in table order.
    pub fn all(joints: usize) -> impl Iterator<Item = Self> {
        (0..3).map(Self::Translation).chain((0..3).map(Self::Rotation)).chain((0..joints).map(Self::Joint))
    }

    /// Name of the motion in tables and files; joints by their names, if known.
    pub fn name(self, joint_names: &[String]) -> String {
        let axis = |axis: usize, names: [&str; 3]| names.get(axis).copied().unwrap_or("?").to_owned();
        match self {
            Self::Translation(along) => axis(along, ["move x", "move y", "move z"]),
            Self::Rotation(about) => axis(about, ["turn x", "turn y", "turn z"]),
            Self::Joint(joint) => joint_names.get(joint).cloned().unwrap_or_else(|| format!("joint {}", joint + 1)),
        }
    }

    /// Label of the motion on the screen: `trans x`, `rot z`; joints as in [`Self::name`].
    pub fn label(self, joint_names: &[String]) -> String {
        self.name(joint_names).replace("move ", "trans ").replace("turn ", "rot ")
    }
}

/// Information gain of the newest image about each parameter, and its attribution to the motions of the window.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationGain {
    /// Time since the previous image, in seconds.
    pub interval_s: f64,
    /// Number of joints.
    pub joints: usize,
    /// Gain per free calibration column: `log₂` of the ratio of the standard deviations without and with the image.
    bits: Box<[f32]>,
    /// Contribution of each motion per column, in the order of [`Motion::all`].
    by_motion: Box<[f32]>,
}

impl InformationGain {
    /// From the gain per free calibration column and the contribution of each motion, in the order of
    /// [`Motion::all`].
    pub(crate) fn new(interval_s: f64, joints: usize, bits: Vec<f32>, by_motion: Vec<f32>) -> Self {
        Self { interval_s, joints, bits: bits.into(), by_motion: by_motion.into() }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.bits.len()
    }

    /// Gain about a parameter in bits per second: one bit halves the standard deviation.
    pub fn bits_per_s(&self, column: usize) -> f64 {
        f64::from(self.bits[column]) / self.interval_s
    }

    /// Contribution of each motion to [`Self::bits_per_s`]. A negative one reduces the contributions of others, as
    /// the joints of a stabilized gimbal do.
    pub fn by_motion_per_s(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        let motions = 6 + self.joints;
        let parts = self.by_motion.get(motions * column..motions * (column + 1)).unwrap_or_default();
        parts.iter().map(|part| f64::from(*part) / self.interval_s)
    }

    /// Remaining contribution: from confirming images that have left the window.
    pub fn earlier_per_s(&self, column: usize) -> f64 {
        self.bits_per_s(column) - self.by_motion_per_s(column).sum::<f64>()
    }

    /// Bytes on the heap.
    pub(crate) fn heap_bytes(&self) -> usize {
        allocated_bytes(size_of_val(&*self.bits)) + allocated_bytes(size_of_val(&*self.by_motion))
    }
}
