//! A fault of the measurements or of the rig with its values.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, UnitVector3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::table::{Change, FaultKind, LONGEST_SHIFT_S, Parameter, Part};
use crate::geometry::{SignedAxes, so3};
use crate::sensors::STANDARD_GRAVITY_M_PER_S2;
use crate::text::Named;

/// Size of a degree in radians.
const DEGREE_RAD: f64 = PI / 180.0;
/// Largest factor by which a range setting or a gear changes the scale of a sensor in its unit.
const LARGEST_SCALE: f64 = 5.0;

/// One of a few changes that have no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Choice {
    Flip(ImageFlip),
    Half(ImageHalf),
    /// Axes of the rig's IMU as axes of the recording.
    Axes(SignedAxes),
}

/// Fault of the measurements or of the rig.
///
/// Its values undo it: they are the factors on what is recorded or given by the rig, or the additions to it, that give the
/// true value. [`Fault::inverse`] plants it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    pub kind: FaultKind,
    /// Key of the faulty camera; `None` for the main camera of a run and for other sensors.
    pub camera: Option<String>,
    /// Names of the faulty joints; empty for all of them and for other sensors.
    pub joints: Vec<String>,
    /// As [`FaultKind`] says; fewer if they are unknown.
    pub values: Vec<f64>,
    pub choice: Option<Choice>,
    /// Time since the log began in seconds from which on the fault acts; `None` for the whole log.
    pub since_s: Option<f64>,
}

/// Image operation that undoes a camera mounted or recorded the other way around.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ImageFlip {
    /// Left and right exchanged.
    Mirrored,
    /// Top and bottom exchanged.
    Flipped,
    /// Rotated by 180°.
    UpsideDown,
}

impl ImageFlip {
    /// Axis about which the rotations of the images are rotated by 180°, camera frame (x right, y down).
    pub fn axis(self) -> UnitVector3<f64> {
        match self {
            Self::Mirrored => Vector3::x_axis(),
            Self::Flipped => Vector3::y_axis(),
            Self::UpsideDown => Vector3::z_axis(),
        }
    }
}

impl Named for ImageFlip {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Mirrored, "mirrored"), (Self::Flipped, "flipped"), (Self::UpsideDown, "upside-down")];
}

/// Half of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ImageHalf {
    Left,
    Right,
    Top,
    Bottom,
}

impl Named for ImageHalf {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Left, "left"), (Self::Right, "right"), (Self::Top, "top"), (Self::Bottom, "bottom")];
}

impl ImageHalf {
    /// True for a pixel in this half of an image of this resolution.
    pub fn contains(self, uv_px: &Vector2<f64>, resolution_px: [usize; 2]) -> bool {
        let [width, height] = resolution_px.map(|size| size as f64);
        match self {
            Self::Left => uv_px.x < 0.5 * width,
            Self::Right => uv_px.x >= 0.5 * width,
            Self::Top => uv_px.y < 0.5 * height,
            Self::Bottom => uv_px.y >= 0.5 * height,
        }
    }
}

impl From<FaultKind> for Fault {
    fn from(kind: FaultKind) -> Self {
        Self { kind, camera: None, joints: Vec::new(), values: Vec::new(), choice: None, since_s: None }
    }
}

impl Fault {
    pub fn new(kind: FaultKind, values: &[f64]) -> Self {
        Self { values: values.to_vec(), ..kind.into() }
    }

    /// Fault of the axes of an IMU.
    pub fn of_axes(kind: FaultKind, axes: SignedAxes) -> Self {
        Self { choice: Some(Choice::Axes(axes)), ..kind.into() }
    }

    /// The fault of a camera with this key.
    #[must_use]
    pub fn of_camera(self, key: &str) -> Self {
        Self { camera: Some(key.to_owned()), ..self }
    }

    #[must_use]
    pub fn of_joints<'a>(self, names: impl IntoIterator<Item = &'a String>) -> Self {
        Self { joints: names.into_iter().cloned().collect(), ..self }
    }

    /// Value with a number in the order of its kind; the value of a fault without effect if it is unknown.
    pub fn value(&self, number: usize) -> f64 {
        self.values.get(number).copied().unwrap_or_else(|| self.kind.row().change(number).neutral())
    }

    pub fn axes(&self) -> Option<SignedAxes> {
        if let Some(Choice::Axes(axes)) = self.choice { Some(axes) } else { None }
    }

    /// Rotation of the mount of a camera against its orientation by the rig, camera frame. Images that are mirrored or
    /// upside down rotate like the images of a camera that is rotated by 180°: rotations are axial vectors.
    pub fn mount(&self) -> UnitQuaternion<f64> {
        let rotation = match (self.kind, self.choice) {
            (FaultKind::Mount, _) => Vector3::from_fn(|axis, _| self.value(axis)),
            (FaultKind::ImageFlip, Some(Choice::Flip(flip))) => flip.axis().into_inner() * PI,
            _ => return UnitQuaternion::identity(),
        };
        so3::exp(&rotation)
    }

    /// Size of the fault, zero without one: in the unit of its value, relative for a factor, radians for a mount.
    fn size(&self) -> f64 {
        match self.kind {
            FaultKind::CameraDrift => self.value(1),
            FaultKind::Mount => self.mount().angle(),
            FaultKind::ImageOrder => self.values.iter().copied().map(f64::abs).fold(0.0, f64::max),
            FaultKind::PrincipalPoint | FaultKind::Intrinsics => {
                let lens = self.lens();
                (lens.focal - 1.0).abs().max(lens.centre[0].hypot(lens.centre[1]))
            }
            kind => self.value(0) - kind.row().change(0).neutral(),
        }
    }

    /// True if the fault is larger than the faults of sound sensors and rigs, [`Row::noticeable`](super::Row).
    pub fn is_noticeable(&self) -> bool {
        self.kind.row().noticeable.is_none_or(|noticeable| self.size().abs() > noticeable)
    }

    /// True for a value that hardware can have: the scale of a sensor is near one, or near the size of another unit.
    pub fn is_possible(&self) -> bool {
        let units: &[f64] = match self.kind {
            FaultKind::GyroscopeScale => &[1.0, DEGREE_RAD, 1.0 / DEGREE_RAD, 1e-3, 1e3],
            FaultKind::AccelerometerScale => {
                &[1.0, STANDARD_GRAVITY_M_PER_S2, 1.0 / STANDARD_GRAVITY_M_PER_S2, 1e-3, 1e3]
            }
            FaultKind::JointScale if !self.joints.is_empty() => &[1.0, DEGREE_RAD, 1.0 / DEGREE_RAD],
            _ => return true,
        };
        let possible = 1.0 / LARGEST_SCALE..LARGEST_SCALE;
        units.iter().any(|unit| possible.contains(&(self.value(0) / unit)))
    }

    /// True if the fault makes results useless, [`Row::useless`](super::Row).
    pub fn is_useless(&self) -> bool {
        self.kind.row().useless.is_some_and(|useless| self.size().abs() >= useless)
    }

    /// True if this fault has the other one as a special case, or differs from it in values only.
    pub fn contains(&self, other: &Self) -> bool {
        match (self.kind, other.kind) {
            (FaultKind::Mount, FaultKind::JointOffset) => self.since_s.is_some() && other.since_s.is_some(),
            // Two axes reversed are half a turn about the third: other signs with an offset can be the same mechanism.
            (FaultKind::JointReversed, FaultKind::JointReversed) => {
                other.joints.iter().all(|joint| self.joints.contains(joint))
            }
            (mine, others) if mine == others => self.is_alike(other),
            (mine, others) => mine.contains(others),
        }
    }

    /// True for faults that differ only in values and time.
    pub fn is_alike(&self, other: &Self) -> bool {
        self.kind == other.kind && (self.joints == other.joints || self.kind == FaultKind::JointsSwapped)
    }

    /// Faults of one joint, or of one pair of joints, which are one after the other the same as this one.
    pub fn of_single_joints(&self) -> Vec<Self> {
        let size = match self.kind {
            FaultKind::JointReversed => 1,
            FaultKind::JointsSwapped => 2,
            _ => return vec![self.clone()],
        };
        self.joints.chunks(size).map(|joints| Self::from(self.kind).of_joints(joints)).collect()
    }

    /// True if a correction of a fork undoes this fault on a rig with a number of joints: a fork has the samples of a short
    /// time around an image, and scales the readings of all joints alike.
    pub fn can_be_corrected(&self, joints: usize) -> bool {
        let is_possible = match self.kind {
            FaultKind::CameraClock | FaultKind::EncoderClock => self.value(0).abs() <= LONGEST_SHIFT_S,
            FaultKind::JointScale => self.joints.is_empty() || joints <= 1,
            _ => true,
        };
        is_possible && self.kind.row().correction.is_some()
    }

    /// Parameter of the value with a number; `None` if it is not fitted.
    pub fn parameter(&self, number: usize) -> Option<&'static Parameter> {
        let parameters = self.kind.row().parameters;
        parameters.get(number).or_else(|| parameters.last())
    }

    /// Changes the value with a number, as its parameter says.
    pub fn change(&mut self, number: usize, change: f64) {
        match self.kind.row().change(number) {
            Change::Ratio => self.values[number] *= 1.0 + change,
            Change::Sum => self.values[number] += change,
            Change::Rotation => {
                let rotation = self.mount() * so3::exp(&Vector3::ith(number, change));
                self.values = so3::log(&rotation).iter().copied().collect();
            }
        }
    }

    /// Faults of a kind from which a fit of some values starts, for a joint or several.
    pub fn starts(kind: FaultKind, joints: &[&String], values: usize) -> Vec<Self> {
        let row = kind.row();
        let start = |first: &f64| {
            let others = (1..values).map(|number| row.change(number).neutral());
            let values: Vec<f64> = std::iter::once(*first).chain(others).collect();
            Self::new(kind, &values).of_joints(joints.iter().copied())
        };
        row.starts.iter().map(start).collect()
    }

    /// Left-handed frame of a gyroscope: its rotations are reversed.
    pub fn left_handed() -> Self {
        let identity = SignedAxes::all().next().expect("the identity is the first one");
        Self::of_axes(FaultKind::GyroscopeAxes, identity.negated())
    }
}

impl FaultKind {
    /// Faults of this kind with the values of its row, for each of the joints or pairs of them.
    pub fn trials(self, joints: &[String]) -> Vec<Fault> {
        let row = self.row();
        let chosen = |choice: Choice| Fault { choice: Some(choice), ..self.into() };
        match row.correction.as_ref().map_or(&[][..], |correction| correction.parts) {
            [Part::Joint] => joints.iter().map(|joint| Fault::from(self).of_joints([joint])).collect(),
            [Part::Joint, Part::Joint] => {
                let pairs =
                    (0..joints.len()).flat_map(|first| (first + 1..joints.len()).map(move |second| (first, second)));
                pairs.map(|(first, second)| Fault::from(self).of_joints([&joints[first], &joints[second]])).collect()
            }
            [Part::Flip] => ImageFlip::all().map(|flip| chosen(Choice::Flip(flip))).collect(),
            [Part::Half] => ImageHalf::all().map(|half| chosen(Choice::Half(half))).collect(),
            _ => row.trials.iter().map(|value| Fault::new(self, &[*value])).collect(),
        }
    }
}
