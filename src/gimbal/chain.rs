use std::f64::consts::PI;

use nalgebra::{DVector, Vector6};

use super::form::Form;
use super::{ClassicalChain, DhLink, ParameterId, ParameterPart, Parameterization, Quantity, conversion};
use crate::geometry::{RigidTransform, so3, wrap_angle};

/// Gimbal chain in one parameterization: its static calibration as named columns.
///
/// Updates follow the rule of [`crate::geometry`]: rigid-transform blocks take `[φ; δt]` on the right, scalars add, and
/// the inner blocks of `poe` take `(wx, wy, vx, vy)`, `R ← R·Exp([wx, wy, 0])`, `t ← t + R·[vx, vy, 0]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    pub(super) parameterization: Parameterization,
    /// True if the joint offsets are excluded from the columns.
    pub(super) offsets_hidden: bool,
    pub(super) form: Form,
}

impl Chain {
    /// Converts a classical chain to `parameterization`. The conversion is exact for every chain, also at a
    /// singularity.
    pub fn from_classical(classical: &ClassicalChain, parameterization: Parameterization) -> Self {
        let form = if parameterization == Parameterization::Classical {
            Form::Classical(classical.clone())
        } else if classical.links.is_empty() {
            Form::Rigid(classical.imu_from_base * classical.effector_from_camera)
        } else if parameterization == Parameterization::Poe {
            Form::Poe(conversion::poe_blocks(classical))
        } else {
            Form::Minimal(conversion::minimal(classical, parameterization))
        };
        Self { parameterization, offsets_hidden: false, form }
    }

    /// Converts to the classical parameterization, with the same forward kinematics.
    pub fn to_classical(&self) -> ClassicalChain {
        match &self.form {
            Form::Classical(chain) => chain.clone(),
            Form::Minimal(chain) => conversion::classical_of_minimal(chain, self.parameterization),
            Form::Poe(blocks) => conversion::classical_of_poe(blocks),
            Form::Rigid(imu_from_camera) => {
                ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() }
            }
        }
    }

    /// Converts to another parameterization; joint offsets stay included or excluded.
    pub fn in_parameterization(&self, parameterization: Parameterization) -> Self {
        if parameterization == self.parameterization {
            return self.clone();
        }
        let chain = Self::from_classical(&self.to_classical(), parameterization);
        if self.offsets_hidden { chain.without_joint_offsets() } else { chain }
    }

    /// Fixes the joint offsets: names, values, derivatives and updates no longer have their columns.
    ///
    /// Without encoders and without a prior on the joint angles, unknown joint angles absorb the offsets, so that
    /// only one of the two can be estimated. No column of `poe` is an offset; it keeps all columns.
    #[must_use]
    pub fn without_joint_offsets(mut self) -> Self {
        self.offsets_hidden = true;
        self
    }

    /// True if the joint offsets are excluded from the columns.
    pub fn hides_joint_offsets(&self) -> bool {
        self.offsets_hidden
    }

    pub fn parameterization(&self) -> Parameterization {
        self.parameterization
    }

    pub fn joint_count(&self) -> usize {
        match &self.form {
            Form::Classical(chain) => chain.links.len(),
            Form::Minimal(chain) => chain.links.len(),
            Form::Poe(blocks) => blocks.len() - 1,
            Form::Rigid(_) => 0,
        }
    }

    /// Number of columns, excluded joint offsets not counted.
    pub fn dof(&self) -> usize {
        let joints = self.joint_count();
        match self.form {
            Form::Classical(_) => 12 + 4 * joints - self.hidden_count(),
            _ => 6 + 4 * joints - self.hidden_count(),
        }
    }

    fn hidden_count(&self) -> usize {
        if self.offsets_hidden && matches!(self.form, Form::Classical(_) | Form::Minimal(_)) {
            self.joint_count()
        } else {
            0
        }
    }

    /// Indices of the columns that remain without the joint offsets.
    pub(super) fn kept_columns(&self) -> Vec<usize> {
        let columns = self.all_parameters();
        (0..columns.len()).filter(|&index| !self.hides(columns[index])).collect()
    }

    fn hides(&self, parameter: ParameterId) -> bool {
        self.offsets_hidden && parameter.is_joint_offset()
    }

    /// Parameters of all columns, excluded joint offsets included.
    fn all_parameters(&self) -> Vec<ParameterId> {
        let of = |part: ParameterPart| move |quantity: Quantity| ParameterId { part, quantity };
        let link = |index: usize| Quantity::LINK.map(of(ParameterPart::Link(index as u8)));
        match &self.form {
            Form::Classical(chain) => {
                let links = (0..chain.links.len()).flat_map(link);
                let base = Quantity::TRANSFORM.map(of(ParameterPart::ImuFromBase));
                let effector = Quantity::TRANSFORM.map(of(ParameterPart::EffectorFromCamera));
                base.into_iter().chain(links).chain(effector).collect()
            }
            Form::Minimal(chain) => {
                let rotations = if self.parameterization.base_yx() {
                    [Quantity::Ry, Quantity::Rx]
                } else {
                    [Quantity::Rx, Quantity::Ry]
                };
                let base = rotations.into_iter().chain([Quantity::Tx, Quantity::Ty]).map(of(ParameterPart::Base));
                let mut columns: Vec<_> = base.chain((0..chain.links.len()).flat_map(link)).collect();
                let last = ParameterPart::Link(chain.links.len().saturating_sub(1) as u8);
                let [beta, y] = [Quantity::Beta, Quantity::Y].map(of(last));
                if self.parameterization.end_swapped() {
                    let alpha = columns.pop();
                    columns.extend([y, beta]);
                    columns.extend(alpha);
                } else {
                    columns.extend([beta, y]);
                }
                columns
            }
            Form::Poe(blocks) => {
                let last = blocks.len() - 1;
                let block = |index: usize| ParameterPart::Exponential(index as u8);
                let inner = (0..last).flat_map(|index| Quantity::EXPONENTIAL.map(of(block(index))));
                inner.chain(Quantity::TRANSFORM.map(of(block(last)))).collect()
            }
            Form::Rigid(_) => Quantity::TRANSFORM.map(of(ParameterPart::ImuFromCamera(0))).into(),
        }
    }

    /// Parameters in the order of the columns; without joints they are the extrinsics of the main camera.
    pub fn parameters(&self) -> Vec<ParameterId> {
        let mut parameters = self.all_parameters();
        parameters.retain(|parameter| !self.hides(*parameter));
        parameters
    }

    /// Value of each column: scalars unchanged, rigid transforms as rotation vector and translation, inner blocks of
    /// `poe` as the x and y parts of the rotation vector and of the translation in the block's own axes.
    pub fn values(&self) -> DVector<f64> {
        let mut values = Vec::with_capacity(self.dof());
        let block = |values: &mut Vec<f64>, transform: &RigidTransform| {
            values.extend(so3::log(&transform.rotation).iter());
            values.extend(transform.translation_m.iter());
        };
        match &self.form {
            Form::Classical(chain) => {
                block(&mut values, &chain.imu_from_base);
                for link in &chain.links {
                    self.push_link(&mut values, link);
                }
                block(&mut values, &chain.effector_from_camera);
            }
            Form::Minimal(chain) => {
                values.extend(chain.base_angles_rad);
                values.extend(chain.base_shift_m);
                for link in &chain.links {
                    self.push_link(&mut values, link);
                }
                if self.parameterization.end_swapped() {
                    let alpha = values.pop();
                    values.extend([chain.y_m, chain.beta_rad]);
                    values.extend(alpha);
                } else {
                    values.extend([chain.beta_rad, chain.y_m]);
                }
            }
            Form::Poe(blocks) => {
                let (last, inner) = blocks.split_last().expect("a product of exponentials has a last block");
                for transform in inner {
                    let rotation_vector = so3::log(&transform.rotation);
                    let shift = transform.rotation.inverse() * transform.translation_m;
                    values.extend([rotation_vector.x, rotation_vector.y, shift.x, shift.y]);
                }
                block(&mut values, last);
            }
            Form::Rigid(transform) => block(&mut values, transform),
        }
        DVector::from_vec(values)
    }

    /// Value of each column relative to another chain in this parameterization: in `poe` the values of `origin` plus the
    /// difference from it, otherwise [`Chain::values`].
    ///
    /// The inner blocks of `poe` are determined up to screws along joint axes that cancel between neighbouring blocks, so
    /// that the values of two chains can be compared only if both are relative to the same one.
    ///
    /// # Panics
    ///
    /// When the numbers of joints differ.
    pub fn values_from(&self, origin: &Self) -> DVector<f64> {
        if self.parameterization == Parameterization::Poe {
            origin.values() + self.minus(origin)
        } else {
            self.values()
        }
    }

    /// Returns the canonical one of all chains of the same mechanism: middle angles of base and end within ±π/2, twists
    /// of the middle links within 0 to π, offsets and other rotations within ±π. Parameterizations that are not minimal
    /// return unchanged.
    ///
    /// Unique away from singularities and from parallel neighbouring axes.
    #[must_use]
    pub fn canonical(&self) -> Self {
        if !matches!(self.form, Form::Minimal(_)) {
            return self.clone();
        }
        let mut canonical = Self::from_classical(&self.to_classical(), self.parameterization);
        canonical.offsets_hidden = self.offsets_hidden;
        if let Form::Minimal(chain) = &mut canonical.form {
            for index in 0..chain.links.len() - 1 {
                let link = &mut chain.links[index];
                link.alpha_rad = wrap_angle(link.alpha_rad);
                if link.alpha_rad < 0.0 {
                    // DH(θ, d, a, α) = DH(θ + π, d, −a, −α)·Rz(−π)
                    link.theta_offset_rad += PI;
                    link.a_m = -link.a_m;
                    link.alpha_rad = -link.alpha_rad;
                    chain.links[index + 1].theta_offset_rad -= PI;
                }
            }
            for link in &mut chain.links {
                link.theta_offset_rad = wrap_angle(link.theta_offset_rad);
                link.alpha_rad = wrap_angle(link.alpha_rad);
            }
        }
        canonical
    }

    fn push_link(&self, values: &mut Vec<f64>, link: &DhLink) {
        if !self.offsets_hidden {
            values.push(link.theta_offset_rad);
        }
        values.extend([link.d_m, link.a_m, link.alpha_rad]);
    }
}

/// Takes the next six entries `[φ; δt]` of a step.
pub(super) fn take_block(delta: &mut impl Iterator<Item = f64>) -> Vector6<f64> {
    Vector6::from_fn(|_, _| delta.next().unwrap_or(0.0))
}
