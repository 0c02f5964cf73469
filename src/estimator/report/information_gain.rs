//! Information gain of the newest image about the calibration, and the motion that it comes from.

use super::allocation::allocated_bytes;

/// Something that moves: the body along or about an axis of the IMU, or a joint.
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
    /// All motions of a body with so many joints, in the order of the tables.
    pub fn all(joints: usize) -> impl Iterator<Item = Self> {
        (0..3).map(Self::Translation).chain((0..3).map(Self::Rotation)).chain((0..joints).map(Self::Joint))
    }

    /// What it is called; joints by their names, where these are known.
    pub fn name(self, joint_names: &[String]) -> String {
        let axis = |axis: usize, names: [&str; 3]| names.get(axis).copied().unwrap_or("?").to_owned();
        match self {
            Self::Translation(along) => axis(along, ["move x", "move y", "move z"]),
            Self::Rotation(about) => axis(about, ["turn x", "turn y", "turn z"]),
            Self::Joint(joint) => joint_names.get(joint).cloned().unwrap_or_else(|| format!("joint {}", joint + 1)),
        }
    }
}

/// Information gain of the newest image about each parameter, and the motion of the window that it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationGain {
    /// Time since the image before, in seconds.
    pub interval_s: f64,
    /// Number of joints.
    pub joints: usize,
    /// By free calibration column: `log₂` of the standard deviation without the image over that with it.
    bits: Box<[f32]>,
    /// Of these, by column: the part of each motion in the order of [`Motion::all`].
    by_motion: Box<[f32]>,
}

impl InformationGain {
    /// From the bits by free calibration column, and those of each motion by column in the order of [`Motion::all`].
    pub(crate) fn new(interval_s: f64, joints: usize, bits: Vec<f32>, by_motion: Vec<f32>) -> Self {
        Self { interval_s, joints, bits: bits.into(), by_motion: by_motion.into() }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.bits.len()
    }

    /// How fast the images narrow a parameter now, in bits per second: one bit halves the standard deviation.
    pub fn bits_per_s(&self, column: usize) -> f64 {
        f64::from(self.bits[column]) / self.interval_s
    }

    /// The part of each motion in [`Self::bits_per_s`]. A negative one takes away what others bring, as the joints of a
    /// stabilized gimbal do.
    pub fn by_motion_per_s(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        let motions = 6 + self.joints;
        let parts = self.by_motion.get(motions * column..motions * (column + 1)).unwrap_or_default();
        parts.iter().map(|part| f64::from(*part) / self.interval_s)
    }

    /// The rest: what the image adds by confirming images that have left the window.
    pub fn earlier_per_s(&self, column: usize) -> f64 {
        self.bits_per_s(column) - self.by_motion_per_s(column).sum::<f64>()
    }

    /// Bytes on the heap.
    pub(crate) fn heap_bytes(&self) -> usize {
        allocated_bytes(size_of_val(&*self.bits)) + allocated_bytes(size_of_val(&*self.by_motion))
    }
}
