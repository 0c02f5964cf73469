//! Information gain of the newest image about the calibration, and its attribution to motions.

use super::allocation::allocated_bytes;

/// Motion of the IMU along or about one of its axes, or of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// Translation along an axis of the IMU, 0 to 2.
    Translation(usize),
    /// Rotation about an axis of the IMU, 0 to 2.
    Rotation(usize),
    /// Joint index.
    Joint(usize),
}

impl Motion {
    /// Motions of a vehicle with this number of joints, in table order.
    pub fn all(joints: usize) -> impl Iterator<Item = Self> {
        (0..3).map(Self::Translation).chain((0..3).map(Self::Rotation)).chain((0..joints).map(Self::Joint))
    }

    /// Name in tables and files; joints by their names, if given.
    pub fn name(self, joint_names: &[String]) -> String {
        let axis = |axis: usize, names: [&str; 3]| names.get(axis).copied().unwrap_or("?").to_owned();
        match self {
            Self::Translation(along) => axis(along, ["move x", "move y", "move z"]),
            Self::Rotation(about) => axis(about, ["turn x", "turn y", "turn z"]),
            Self::Joint(joint) => joint_names.get(joint).cloned().unwrap_or_else(|| format!("joint {}", joint + 1)),
        }
    }

    /// Label in the window: `trans x`, `rot z`; joints as in [`Self::name`].
    pub fn label(self, joint_names: &[String]) -> String {
        self.name(joint_names).replace("move ", "trans ").replace("turn ", "rot ")
    }
}

/// Information gain of the newest image about each free calibration parameter, attributed to the motions of the window.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationGain {
    /// Time since the previous image, in seconds.
    pub interval_s: f64,
    pub joints: usize,
    /// Gain per free calibration column: `log₂` of the ratio of the standard deviations without and with the image.
    bits: Box<[f32]>,
    /// Contribution of each motion in bits, column by column, in the order of [`Motion::all`].
    by_motion: Box<[f32]>,
}

impl InformationGain {
    /// `bits` has the gain per free calibration column, `by_motion` the contribution of each motion, column by column
    /// in the
    /// order of [`Motion::all`].
    pub(crate) fn new(interval_s: f64, joints: usize, bits: Vec<f32>, by_motion: Vec<f32>) -> Self {
        Self { interval_s, joints, bits: bits.into(), by_motion: by_motion.into() }
    }

    pub fn columns(&self) -> usize {
        self.bits.len()
    }

    /// Gain about a parameter in bits per second; one bit halves the standard deviation.
    pub fn bits_per_s(&self, column: usize) -> f64 {
        f64::from(self.bits[column]) / self.interval_s
    }

    /// Contribution of each motion to [`Self::bits_per_s`]. A negative value reduces the contribution of other motions,
    /// as
    /// the joints of a stabilized gimbal do.
    pub fn by_motion_per_s(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        let motions = 6 + self.joints;
        let parts = self.by_motion.get(motions * column..motions * (column + 1)).unwrap_or_default();
        parts.iter().map(|part| f64::from(*part) / self.interval_s)
    }

    /// Remainder of [`Self::bits_per_s`]: the newest image confirms information of images that have left the window.
    pub fn earlier_per_s(&self, column: usize) -> f64 {
        self.bits_per_s(column) - self.by_motion_per_s(column).sum::<f64>()
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        allocated_bytes(size_of_val(&*self.bits)) + allocated_bytes(size_of_val(&*self.by_motion))
    }
}
