//! Step inputs as bytes, exact to the bit, for those that are kept outside of the memory.

use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};

use super::step_inputs::{InputImage, OwnedStepInput};
use crate::frontend::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
use crate::geometry::RigidTransform;
use crate::sensors::{ImuSample, JointAngles, JointMotionFit};

impl OwnedStepInput {
    /// The input as bytes.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.write(&mut bytes);
        bytes
    }

    /// The input of [`Self::to_bytes`]; `None` for other bytes.
    pub(super) fn from_bytes(mut bytes: &[u8]) -> Option<Self> {
        let input = Self::read(&mut bytes)?;
        bytes.is_empty().then_some(input)
    }
}

/// A value as bytes, little-endian.
trait Stored: Sized {
    fn write(&self, bytes: &mut Vec<u8>);

    /// Reads the value from the start of the bytes and removes it there.
    fn read(bytes: &mut &[u8]) -> Option<Self>;
}

macro_rules! stored_numbers {
    ($($number:ty),*) => {$(
        impl Stored for $number {
            fn write(&self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }

            fn read(bytes: &mut &[u8]) -> Option<Self> {
                let (number, rest) = bytes.split_first_chunk()?;
                *bytes = rest;
                Some(Self::from_le_bytes(*number))
            }
        }
    )*};
}

stored_numbers!(u8, u32, u64, i64, usize, f64);

/// Stores all fields of a type, one after the other.
macro_rules! stored_fields {
    ($($stored:ident { $($field:ident),* })*) => {$(
        impl Stored for $stored {
            fn write(&self, bytes: &mut Vec<u8>) {
                let Self { $($field),* } = self;
                $($field.write(bytes);)*
            }

            fn read(bytes: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: Stored::read(bytes)?),* })
            }
        }
    )*};
}

stored_fields! {
    OwnedStepInput {
        frame_index, stamp_ns, log_time_ns, imu, imu_after, image_times_s, gimbal_imu, joint_angles, images, ground_truth,
        frontend_ms
    }
    ImuSample { stamp_ns, angular_velocity_rad_per_s, specific_force_m_per_s2, unmeasured_s }
    JointAngles { angles_rad, sigmas_rad, lasting_sigmas_rad, rates_rad_per_s, motion_fits }
    JointMotionFit { rate_sigma_rad_per_s, acceleration_rad_per_s2, acceleration_sigma_rad_per_s2 }
    InputImage { index, tracks }
    TrackedFrame { stamp_ns, features, matched, statistics }
    TrackedFeature { id, age, uv_px, previous_uv_px, bearing }
    FrontEndStatistics { tracked, detected, lost, rejected, mean_parallax_px, median_flow_px }
    RigidTransform { rotation, translation_m }
}

impl Stored for FeatureId {
    fn write(&self, bytes: &mut Vec<u8>) {
        self.0.write(bytes);
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        Stored::read(bytes).map(Self)
    }
}

impl Stored for Vector2<f64> {
    fn write(&self, bytes: &mut Vec<u8>) {
        for value in self {
            value.write(bytes);
        }
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self::new(Stored::read(bytes)?, Stored::read(bytes)?))
    }
}

impl Stored for Vector3<f64> {
    fn write(&self, bytes: &mut Vec<u8>) {
        for value in self {
            value.write(bytes);
        }
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self::new(Stored::read(bytes)?, Stored::read(bytes)?, Stored::read(bytes)?))
    }
}

impl Stored for UnitQuaternion<f64> {
    fn write(&self, bytes: &mut Vec<u8>) {
        for value in [self.w, self.i, self.j, self.k] {
            value.write(bytes);
        }
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        let [w, i, j, k] = [Stored::read(bytes)?, Stored::read(bytes)?, Stored::read(bytes)?, Stored::read(bytes)?];
        // Normalizing again would change the last bits.
        Some(Self::new_unchecked(Quaternion::new(w, i, j, k)))
    }
}

impl<T: Stored> Stored for Option<T> {
    fn write(&self, bytes: &mut Vec<u8>) {
        u8::from(self.is_some()).write(bytes);
        if let Some(value) = self {
            value.write(bytes);
        }
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        match u8::read(bytes)? {
            0 => Some(None),
            1 => T::read(bytes).map(Some),
            _ => None,
        }
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn write(&self, bytes: &mut Vec<u8>) {
        self.len().write(bytes);
        for value in self {
            value.write(bytes);
        }
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        let count = usize::read(bytes)?;
        // An element takes a byte at least, which bounds the memory.
        if count > bytes.len() {
            return None;
        }
        (0..count).map(|_| T::read(bytes)).collect()
    }
}

impl<T: Stored> Stored for Arc<T> {
    fn write(&self, bytes: &mut Vec<u8>) {
        (**self).write(bytes);
    }

    fn read(bytes: &mut &[u8]) -> Option<Self> {
        T::read(bytes).map(Self::new)
    }
}
