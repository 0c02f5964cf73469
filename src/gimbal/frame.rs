use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::geometry::RigidTransform;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }
}

/// Frame that moves along the chain: its orientation and origin in the start frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainFrame {
    pub(super) rotation: Matrix3<f64>,
    pub(super) origin: Vector3<f64>,
}

impl ChainFrame {
    pub(super) fn identity() -> Self {
        Self { rotation: Matrix3::identity(), origin: Vector3::zeros() }
    }

    pub(super) fn of(transform: &RigidTransform) -> Self {
        Self { rotation: transform.rotation_matrix(), origin: transform.translation_m }
    }

    /// Direction of one of the frame's axes in the start frame.
    pub(super) fn axis(&self, axis: Axis) -> Vector3<f64> {
        self.rotation.column(axis.index()).into_owned()
    }

    pub(super) fn rotate(&mut self, axis: Axis, angle_rad: f64) {
        let (sine, cosine) = angle_rad.sin_cos();
        let (next, after) = ((axis.index() + 1) % 3, (axis.index() + 2) % 3);
        let first = self.rotation.column(next) * cosine + self.rotation.column(after) * sine;
        let second = self.rotation.column(after) * cosine - self.rotation.column(next) * sine;
        self.rotation.set_column(next, &first);
        self.rotation.set_column(after, &second);
    }

    pub(super) fn translate(&mut self, axis: Axis, distance_m: f64) {
        self.origin += self.rotation.column(axis.index()) * distance_m;
    }

    /// Appends a transform that is given in the axes of the frame.
    pub(super) fn then(&mut self, inner: &RigidTransform) {
        self.origin += self.rotation * inner.translation_m;
        self.rotation *= inner.rotation_matrix();
    }

    pub(super) fn to_transform(self) -> RigidTransform {
        let rotation = Rotation3::from_matrix_unchecked(self.rotation);
        RigidTransform::new(UnitQuaternion::from_rotation_matrix(&rotation), self.origin)
    }
}
