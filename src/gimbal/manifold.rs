//! `⊞` and `⊟` of a chain in its columns.

use nalgebra::{DVector, UnitQuaternion, Vector3};

use crate::geometry::{RigidTransform, so3};

use super::chain::take_block;
use super::form::Form;
use super::{Chain, DhLink};

impl Chain {
    /// Returns `chain ⊞ δ`, one entry of `delta` per column (dof).
    ///
    /// # Panics
    ///
    /// When the length of `delta` is not the number of columns.
    #[must_use]
    pub fn plus(&self, delta: &DVector<f64>) -> Self {
        self.plus_slice(delta.as_slice())
    }

    /// [`Chain::plus`] for a slice, such as a segment of a larger step.
    ///
    /// # Panics
    ///
    /// When the length of `delta` is not the number of columns.
    #[must_use]
    pub fn plus_slice(&self, delta: &[f64]) -> Self {
        assert_eq!(delta.len(), self.dof(), "one number per column");
        let mut moved = self.clone();
        let offsets = !self.offsets_hidden;
        let delta = &mut delta.iter().copied();
        match &mut moved.form {
            Form::Classical(chain) => {
                chain.imu_from_base = chain.imu_from_base.plus(&take_block(delta));
                for link in &mut chain.links {
                    move_link(link, offsets, delta);
                }
                chain.effector_from_camera = chain.effector_from_camera.plus(&take_block(delta));
            }
            Form::Minimal(chain) => {
                for value in chain.base_angles_rad.iter_mut().chain(&mut chain.base_shift_m) {
                    add(value, delta);
                }
                let (last, middle) = chain.links.split_last_mut().expect("a minimal chain has a joint");
                for link in middle {
                    move_link(link, offsets, delta);
                }
                if self.parameterization.end_swapped() {
                    let alpha_rad = last.alpha_rad;
                    move_link(last, offsets, &mut delta.by_ref().take(2 + usize::from(offsets)));
                    last.alpha_rad = alpha_rad;
                    add(&mut chain.y_m, delta);
                    add(&mut chain.beta_rad, delta);
                    add(&mut last.alpha_rad, delta);
                } else {
                    move_link(last, offsets, delta);
                    add(&mut chain.beta_rad, delta);
                    add(&mut chain.y_m, delta);
                }
            }
            Form::Poe(blocks) => {
                let (last, inner) = blocks.split_last_mut().expect("a product of exponentials has a last block");
                for block in inner {
                    let mut next = || delta.next().unwrap_or(0.0);
                    let (rotation_vector, shift) =
                        (Vector3::new(next(), next(), 0.0), Vector3::new(next(), next(), 0.0));
                    let step = RigidTransform::new(so3::exp(&rotation_vector), shift);
                    *block = normalized(*block * step);
                }
                *last = last.plus(&take_block(delta));
            }
            Form::Rigid(transform) => *transform = transform.plus(&take_block(delta)),
        }
        moved
    }

    /// Returns `self ⊟ origin` (dof), the step with `origin.plus(self.minus(origin)) = self`.
    ///
    /// A chain in another parameterization is first converted to the parameterization of `origin`. In `poe` the two
    /// sides may differ by screws along joint axes that cancel between neighbouring transforms; the equality then holds
    /// for the forward kinematics.
    ///
    /// # Panics
    ///
    /// When the numbers of joints differ.
    pub fn minus(&self, origin: &Self) -> DVector<f64> {
        assert_eq!(self.joint_count(), origin.joint_count(), "chains of as many joints");
        if self.parameterization != origin.parameterization {
            return self.in_parameterization(origin.parameterization).minus(origin);
        }
        match (&self.form, &origin.form) {
            (Form::Poe(blocks), Form::Poe(origins)) => DVector::from_vec(poe_difference(blocks, origins)),
            (Form::Rigid(transform), Form::Rigid(origin)) => {
                DVector::from_iterator(6, transform.minus(origin).iter().copied())
            }
            (Form::Classical(chain), Form::Classical(before)) => {
                let mut difference = Vec::with_capacity(origin.dof());
                difference.extend(chain.imu_from_base.minus(&before.imu_from_base).iter());
                let first_link = difference.len();
                let (values, values_before) = (self.with_offsets_as(origin).values(), origin.values());
                let links = origin.dof() - 12;
                difference.extend((first_link..first_link + links).map(|index| values[index] - values_before[index]));
                difference.extend(chain.effector_from_camera.minus(&before.effector_from_camera).iter());
                DVector::from_vec(difference)
            }
            _ => self.with_offsets_as(origin).values() - origin.values(),
        }
    }

    fn with_offsets_as(&self, other: &Self) -> Self {
        Self { offsets_hidden: other.offsets_hidden, ..self.clone() }
    }
}

fn add(value: &mut f64, delta: &mut impl Iterator<Item = f64>) {
    *value += delta.next().unwrap_or(0.0);
}

fn move_link(link: &mut DhLink, offsets: bool, delta: &mut impl Iterator<Item = f64>) {
    if offsets {
        add(&mut link.theta_offset_rad, delta);
    }
    add(&mut link.d_m, delta);
    add(&mut link.a_m, delta);
    add(&mut link.alpha_rad, delta);
}

fn normalized(transform: RigidTransform) -> RigidTransform {
    RigidTransform::new(UnitQuaternion::new_normalize(transform.rotation.into_inner()), transform.translation_m)
}

/// Returns the local updates between two products of exponentials.
///
/// Each inner transform reaches its counterpart up to a screw along its own z axis. That screw commutes with
/// the next joint and moves on to the next transform.
fn poe_difference(blocks: &[RigidTransform], origins: &[RigidTransform]) -> Vec<f64> {
    let mut difference = Vec::with_capacity(4 * blocks.len() + 2);
    let mut handed_on = RigidTransform::identity();
    let last = blocks.len() - 1;
    for (block, origin) in blocks[..last].iter().zip(origins) {
        let step = origin.inverse() * (handed_on * *block);
        // The rotation about z is split off on the right: the remaining rotation vector has no z component.
        let twist =
            UnitQuaternion::new_normalize(nalgebra::Quaternion::new(step.rotation.w, 0.0, 0.0, step.rotation.k));
        let swing = step.rotation * twist.inverse();
        let axis = swing * Vector3::z();
        let slide = step.translation_m.z / axis.z;
        let shift = step.translation_m - axis * slide;
        let rotation_vector = so3::log(&swing);
        difference.extend([rotation_vector.x, rotation_vector.y, shift.x, shift.y]);
        handed_on = RigidTransform::new(twist, Vector3::z() * slide);
    }
    difference.extend((handed_on * blocks[last]).minus(&origins[last]).iter());
    difference
}
