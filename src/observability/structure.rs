//! Null directions of the chain in closed form: steps of its columns that leave the camera pose unchanged at all joint
//! angles, each with its reason.
//!
//! The paper claims six degenerate columns of the classical chain (§4.5): `d`, `a`, `α` and `θ` of the last link and
//! `d` and `θ` of the first one. It proves the degeneracy of `d` (Eqs. 11–17) and fixes the others by the forms of Eqs.
//! 19 and
//! 20. Errors of the print do not affect the claim (docs/mathematics.md, section 2): Eq. 12 has a minus before the
//!     lever-arm block where a plus belongs (left convention; the proof uses other columns only), and Eq. 18 has `−cos
//!     β` in the lower right corner of a rotation, while Eq. 19 needs `+cos β`. Exchanging the rotations of α and β to
//!     avoid the singularity of Eq. 19 works only when `y` is moved together with β (docs/mathematics.md, section 4):
//!     [`crate::gimbal::Parameterization::MinimalSwapped`]. The paper perturbs rotations on the left; the directions
//!     here use the right convention, as the rest of the program.

use nalgebra::{DMatrix, DMatrixView, DVector};

use crate::gimbal::{
    Chain, ParameterId, ParameterNames, ParameterPart, Parameterization, Quantity, redundant_directions,
};

/// A null direction that follows from the structure of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum KnownLoss {
    /// The first link's joint offset against a rotation of `imu_from_base`.
    BaseTheta,
    /// The first link's `d` against a translation of `imu_from_base`.
    BaseD,
    /// The last link's joint offset against `effector_from_camera`.
    EndTheta,
    /// The last link's `d` against a translation of `effector_from_camera`.
    EndD,
    /// The last link's `a` against a translation of `effector_from_camera`.
    EndA,
    /// The last link's `α` against a rotation of `effector_from_camera`.
    EndAlpha,
    /// Without joints: a rotation of `imu_from_base` about this axis against `effector_from_camera`.
    RigidRotation(usize),
    /// Without joints: a translation of `imu_from_base` along this axis against `effector_from_camera`.
    RigidShift(usize),
    /// A link's joint offset (counted from 0) against its joint's angles, when these are unknown.
    FreeAngle(usize),
    /// The `d` of this link and of the next one, whose axes are parallel.
    ParallelD(usize),
    /// The offsets of this link and of the next one, whose axes are the same line.
    CoaxialTheta(usize),
}

/// A closed-form null direction, compared with a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownDirection {
    pub loss: KnownLoss,
    /// Scaled response of the window to the direction, relative to the reference of the rank rule: a rounding error
    /// when the measurement agrees.
    pub response: f64,
    /// Fraction of the scaled direction inside the measured null space, 1 when the measurement agrees.
    pub null_space_fraction: f64,
    /// True if the measurement confirms the direction.
    pub agrees: bool,
    /// Square root of the information along the direction beyond the rig's prior, in units of the scale (1: σ = 10° or
    /// 3 cm).
    ///
    /// The direction is unobservable, so that any value but zero is spurious: marginalization prior and window were
    /// linearized at different values of the calibration. First-estimate Jacobians keep it at zero. Zero for offsets of
    /// free joint angles: encoder readings before a fork may constrain them.
    pub spurious_gain: f64,
}

/// A [`KnownDirection::spurious_gain`] below this is negligible.
pub const MIN_SPURIOUS_GAIN: f64 = 0.01;

impl KnownDirection {
    /// True if the spurious information exceeds [`MIN_SPURIOUS_GAIN`].
    pub fn is_claimed(&self) -> bool {
        self.spurious_gain > MIN_SPURIOUS_GAIN
    }
}

/// Sine of a twist below which axes are parallel, and length of a link below which parallel axes are coaxial,
/// in metres: far below manufacturing tolerances, far above rounding errors.
const PARALLEL: f64 = 1e-12;

/// Smallest fraction inside the null space of a confirmed direction.
const INSIDE: f64 = 1.0 - 1e-6;

/// Returns all closed-form null directions of a chain in its columns (dof), in radians and metres.
pub fn known_losses(chain: &Chain, joints_free: bool) -> Vec<(KnownLoss, DVector<f64>)> {
    let mut losses = Vec::new();
    if chain.parameterization() == Parameterization::Classical {
        redundant(chain, joints_free, &mut losses);
    }
    links(chain, joints_free, &mut losses);
    losses
}

/// Adds the six redundant directions of the classical parameterization.
fn redundant(chain: &Chain, joints_free: bool, losses: &mut Vec<(KnownLoss, DVector<f64>)>) {
    let classical = chain.to_classical();
    let directions = redundant_directions(&classical);
    let rigid = [0, 1, 2].map(KnownLoss::RigidRotation).into_iter().chain([0, 1, 2].map(KnownLoss::RigidShift));
    let jointed = [
        KnownLoss::BaseTheta,
        KnownLoss::BaseD,
        KnownLoss::EndTheta,
        KnownLoss::EndD,
        KnownLoss::EndA,
        KnownLoss::EndAlpha,
    ];
    let names: Vec<KnownLoss> = if classical.links.is_empty() { rigid.collect() } else { jointed.into() };
    let hidden = chain.hides_joint_offsets();
    // Without columns, the offsets are absorbed by unknown joint angles, but not by known ones.
    let whole = chain.dof();
    let kept: Vec<usize> = if hidden {
        let link = |row: usize| row.checked_sub(6).filter(|row| *row < 4 * classical.links.len());
        (0..directions.nrows()).filter(|row| link(*row).is_none_or(|row| row % 4 != 0)).collect()
    } else {
        (0..directions.nrows()).collect()
    };
    debug_assert_eq!(kept.len(), whole, "a row per column");
    for (loss, direction) in names.into_iter().zip(directions.column_iter()) {
        let by_offset = matches!(loss, KnownLoss::BaseTheta | KnownLoss::EndTheta);
        if !hidden || joints_free || !by_offset {
            losses.push((loss, DVector::from_iterator(kept.len(), kept.iter().map(|row| direction[*row]))));
        }
    }
}

/// Adds the directions between links: joint offsets against free angles, and neighbours on parallel axes.
fn links(chain: &Chain, joints_free: bool, losses: &mut Vec<(KnownLoss, DVector<f64>)>) {
    let parameters = chain.parameters();
    let column = |link: usize, quantity: Quantity| {
        let wanted = ParameterId { part: ParameterPart::Link(link as u8), quantity };
        parameters.iter().position(|parameter| *parameter == wanted)
    };
    let direction = |entries: &[(usize, f64)]| {
        let mut direction = DVector::zeros(parameters.len());
        for (column, weight) in entries {
            direction[*column] = *weight;
        }
        direction
    };
    if joints_free {
        for joint in 0..chain.joint_count() {
            if let Some(theta) = column(joint, Quantity::Theta) {
                losses.push((KnownLoss::FreeAngle(joint), direction(&[(theta, 1.0)])));
            }
        }
    }
    if chain.parameterization() == Parameterization::Poe {
        return;
    }
    let classical = chain.to_classical();
    for link in 0..classical.links.len().saturating_sub(1) {
        let (sine, cosine) = classical.links[link].alpha_rad.sin_cos();
        if sine.abs() > PARALLEL {
            continue;
        }
        let pair =
            |quantity| Some(direction(&[(column(link, quantity)?, 1.0), (column(link + 1, quantity)?, -cosine)]));
        losses.extend(pair(Quantity::D).map(|direction| (KnownLoss::ParallelD(link), direction)));
        if classical.links[link].a_m.abs() <= PARALLEL {
            losses.extend(pair(Quantity::Theta).map(|direction| (KnownLoss::CoaxialTheta(link), direction)));
        }
    }
}

/// Information about the calibration; columns scaled, all other unknowns projected out.
pub(super) struct Measured<'a> {
    pub(super) scale: &'a DVector<f64>,
    pub(super) block: &'a DMatrix<f64>,
    pub(super) null_space: DMatrixView<'a, f64>,
    pub(super) with_priors: &'a DMatrix<f64>,
    /// Rows of the rig's prior alone.
    pub(super) rig_prior: &'a DMatrix<f64>,
    pub(super) reference: f64,
    pub(super) structural_threshold: f64,
}

impl Measured<'_> {
    /// Compares closed-form null directions with the measurement.
    ///
    /// A direction that moves a parameter outside of `kept` is omitted: that parameter is fixed.
    pub(super) fn compare(&self, losses: Vec<(KnownLoss, DVector<f64>)>, kept: &[usize]) -> Vec<KnownDirection> {
        let scale = self.scale;
        losses
            .into_iter()
            .filter(|(_, direction)| {
                let moves_fixed =
                    (0..direction.len()).any(|column| direction[column] != 0.0 && !kept.contains(&column));
                kept.len() <= scale.len() && !moves_fixed
            })
            .map(|(loss, direction)| {
                let direction = direction.select_rows(kept);
                // The chain's columns come first; columns of other cameras follow and are zero.
                let direction = direction.resize_vertically(scale.len(), 0.0).component_div(scale).normalize();
                let response = (self.block * &direction).norm();
                let null_space_fraction = self.null_space.tr_mul(&direction).norm();
                KnownDirection {
                    loss,
                    response: if self.reference > 0.0 { response / self.reference } else { 0.0 },
                    null_space_fraction,
                    agrees: response <= self.structural_threshold && null_space_fraction >= INSIDE,
                    spurious_gain: if matches!(loss, KnownLoss::FreeAngle(_)) {
                        0.0
                    } else {
                        self.spurious_gain(&direction)
                    },
                }
            })
            .collect()
    }

    fn spurious_gain(&self, direction: &DVector<f64>) -> f64 {
        let known = (self.with_priors * direction).norm_squared();
        (known - (self.rig_prior * direction).norm_squared()).max(0.0).sqrt()
    }
}

impl KnownLoss {
    /// Equations of the paper.
    pub fn equations(self) -> &'static str {
        match self {
            Self::BaseD => "Eqs. 11–17",
            Self::BaseTheta => "§4.5, removed by Eq. 20",
            Self::EndTheta | Self::EndD | Self::EndA | Self::EndAlpha => "§4.5, removed by Eq. 19",
            Self::RigidRotation(_) | Self::RigidShift(_) => "Eq. 5 without links",
            Self::FreeAngle(_) | Self::ParallelD(_) | Self::CoaxialTheta(_) => "Eq. 2",
        }
    }

    /// Reason that the direction is unobservable, as one sentence; `joints` is the chain's number of joints.
    pub fn reason(self, joints: usize, names: &ParameterNames) -> String {
        let link = |link: usize| names.part(ParameterPart::Link(link as u8));
        let (first, last) = (link(0), link(joints.saturating_sub(1)));
        let axis = |axis: usize| ["x", "y", "z"].get(axis).copied().unwrap_or("?");
        let what = match self {
            Self::BaseTheta => {
                format!("{first}.theta and the rotation of imu_from_base about that axis are the same motion")
            }
            Self::BaseD => {
                format!("{first}.d and the translation of imu_from_base along that axis are the same motion")
            }
            Self::EndTheta => {
                format!("{last}.theta and a motion of effector_from_camera about the last axis are the same motion")
            }
            Self::EndD => {
                format!("{last}.d and the translation of effector_from_camera along the last axis are the same motion")
            }
            Self::EndA => {
                format!("{last}.a and the x translation of effector_from_camera are the same motion")
            }
            Self::EndAlpha => {
                format!(
                    "{last}.alpha and a rotation of effector_from_camera about the effector's x axis are the same motion"
                )
            }
            Self::RigidRotation(about) => format!(
                "without joints a rotation of imu_from_base about {} and one of effector_from_camera are the same motion",
                axis(about)
            ),
            Self::RigidShift(along) => format!(
                "without joints a translation of imu_from_base along {} and one of effector_from_camera are the same motion",
                axis(along)
            ),
            Self::FreeAngle(joint) => {
                format!(
                    "{}.theta and the unknown angles of joint {} are observable only as their sum",
                    link(joint),
                    joint + 1
                )
            }
            Self::ParallelD(index) => format!(
                "the axes of joints {} and {} are parallel, so that {}.d and {}.d are the same motion",
                index + 1,
                index + 2,
                link(index),
                link(index + 1)
            ),
            Self::CoaxialTheta(index) => format!(
                "the axes of joints {} and {} are collinear, so that {}.theta and {}.theta are the same motion",
                index + 1,
                index + 2,
                link(index),
                link(index + 1)
            ),
        };
        format!("{what} ({})", self.equations())
    }
}
