//! Named mechanisms, built from the axes of their joints.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use thiserror::Error;

use crate::geometry::{RigidTransform, SplitMix64, so3};
use crate::gimbal::{ClassicalChain, DhLink, JointAxis, ParameterNames};
use crate::sensors::Rig;

#[derive(Clone, Debug, PartialEq)]
pub struct LaboratoryJoint {
    pub name: String,
    /// Lower and upper limit, in radians.
    pub limits_rad: (f64, f64),
}

/// A gimbal of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanism {
    /// Name on the command line, or the rig's.
    pub name: String,
    /// The chain between IMU and camera.
    pub chain: ClassicalChain,
    pub joints: Vec<LaboratoryJoint>,
    pub names: ParameterNames,
}

/// Error: unknown name of a mechanism.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown mechanism '{given}': expected one of {}", Mechanism::NAMES.map(|(name, _)| name).join(", "))]
pub struct UnknownMechanism {
    pub given: String,
}

impl Mechanism {
    /// Names accepted by [`Self::named`], each with its meaning.
    pub const NAMES: [(&'static str, &'static str); 19] = [
        ("yaw-roll-pitch-offset", "axes 2 to 8 cm apart and some degrees from perpendicular, optical camera frame"),
        ("yaw-roll-pitch-ideal", "axes intersect at right angles, optical camera frame"),
        ("yaw-roll-pitch-flu", "body-style camera frame: the last axis is parallel to the camera's y"),
        ("yaw-roll-pitch-flu-centred", "the same with the camera's centre on the last axis"),
        ("pitch-roll-yaw", "yaw last, optical camera frame: the last axis is parallel to the camera's y"),
        ("roll-first", "the first axis is parallel to the IMU's x"),
        ("parallel-axes", "axes 1 and 2 parallel, 6 cm apart"),
        ("parallel-axes-2-3", "axes 2 and 3 parallel, 6 cm apart"),
        ("coaxial-axes", "axes 1 and 2 collinear"),
        ("outer-parallel", "axes 1 and 3 parallel while joint 2 is at zero"),
        ("one-joint", "pan only, optical camera frame: its axis is parallel to the camera's y"),
        ("one-joint-tilted", "pan only, the camera tilted against its axis"),
        ("pan-tilt", "two joints, some degrees from perpendicular"),
        ("rigid", "no joints"),
        ("generic", "three joints, drawn at random"),
        ("generic-1", "one joint, drawn at random"),
        ("generic-2", "two joints, drawn at random"),
        ("generic-4", "four joints, drawn at random"),
        ("generic-5", "five joints, drawn at random"),
    ];

    pub fn named(name: &str) -> Result<Self, UnknownMechanism> {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let chain = match name {
            "yaw-roll-pitch-offset" => chain_of_axes(&out_of_square(&[z, x, y], 1), &out_of_true(&optical(), 2)),
            "yaw-roll-pitch-ideal" => {
                let centre = Vector3::new(0.08, 0.01, -0.06);
                chain_of_axes(&[(z, centre), (x, centre), (y, centre)], &RigidTransform::new(optical(), centre))
            }
            "yaw-roll-pitch-flu" => {
                let camera = RigidTransform::new(UnitQuaternion::identity(), Vector3::new(0.15, 0.02, -0.09));
                chain_of_axes(&apart(&[z, x, y]), &camera)
            }
            "yaw-roll-pitch-flu-centred" => {
                let axes = apart(&[z, x, y]);
                let on_last = axes[2].1 + axes[2].0 * 0.03;
                chain_of_axes(&axes, &RigidTransform::new(UnitQuaternion::identity(), on_last))
            }
            "pitch-roll-yaw" => {
                let camera = RigidTransform::new(optical(), Vector3::new(0.15, 0.02, -0.09));
                chain_of_axes(&apart(&[y, x, z]), &camera)
            }
            "roll-first" => {
                let mut axes = out_of_square(&[x, z, y], 3);
                axes[0].0 = x;
                chain_of_axes(&axes, &out_of_true(&optical(), 4))
            }
            "parallel-axes" => chain_of_axes(
                &[(z, Vector3::zeros()), (z, x * 0.06), (y, Vector3::new(0.09, 0.0, -0.04))],
                &out_of_true(&optical(), 5),
            ),
            "parallel-axes-2-3" => chain_of_axes(
                &[(z, Vector3::zeros()), (y, Vector3::new(0.03, 0.0, -0.04)), (y, Vector3::new(0.09, 0.0, -0.05))],
                &out_of_true(&optical(), 6),
            ),
            "coaxial-axes" => chain_of_axes(
                &[(z, x * 0.05), (z, Vector3::new(0.05, 0.0, -0.03)), (y, Vector3::new(0.09, 0.0, -0.04))],
                &out_of_true(&optical(), 7),
            ),
            "outer-parallel" => chain_of_axes(
                &[(z, Vector3::zeros()), (y, Vector3::new(0.03, 0.0, -0.04)), (z, Vector3::new(0.08, 0.02, -0.07))],
                &out_of_true(&optical(), 8),
            ),
            "one-joint" => {
                let camera = RigidTransform::new(optical(), Vector3::new(0.09, 0.01, -0.05));
                chain_of_axes(&[(z, Vector3::new(0.05, 0.0, -0.02))], &camera)
            }
            "one-joint-tilted" => chain_of_axes(&[(z, Vector3::new(0.05, 0.0, -0.02))], &out_of_true(&optical(), 9)),
            "pan-tilt" => chain_of_axes(&out_of_square(&[z, y], 10), &out_of_true(&optical(), 11)),
            "rigid" => chain_of_axes(&[], &out_of_true(&optical(), 12)),
            "generic" => random_chain(3, 13),
            "generic-1" => random_chain(1, 14),
            "generic-2" => random_chain(2, 15),
            "generic-4" => random_chain(4, 16),
            "generic-5" => random_chain(5, 17),
            _ => return Err(UnknownMechanism { given: name.to_owned() }),
        };
        let joints = (1..=chain.joint_count())
            .map(|joint| LaboratoryJoint { name: format!("joint {joint}"), limits_rad: (-PI, PI) })
            .collect();
        Ok(Self { name: name.to_owned(), chain, joints, names: ParameterNames::default() })
    }

    /// Returns the mechanism of a rig's camera; `None` when the rig has no such camera.
    pub fn of_rig(rig: &Rig, camera_key: &str) -> Option<Self> {
        let chain = rig.chain_of_camera(camera_key)?;
        let joints = rig.gimbal.iter().flat_map(|gimbal| &gimbal.joints).take(chain.joint_count());
        let joints =
            joints.map(|joint| LaboratoryJoint { name: joint.name.clone(), limits_rad: joint.limits_rad }).collect();
        Some(Self { name: rig.name.clone(), chain, joints, names: rig.parameter_names() })
    }
}

/// Orientation of the optical frame of a camera along the IMU's x axis: x right, y down, z forward.
fn optical() -> UnitQuaternion<f64> {
    let matrix = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

fn within(random: &mut SplitMix64, bound: f64) -> f64 {
    (2.0 * random.next_unit() - 1.0) * bound
}

fn vector_within(random: &mut SplitMix64, bound: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| within(random, bound))
}

/// Skew axes at right angles, centimetres apart.
fn apart(directions: &[Vector3<f64>]) -> Vec<JointAxis> {
    let step = Vector3::new(0.05, 0.02, -0.035);
    let far = Vector3::new(0.003, 0.025, 0.011);
    directions
        .iter()
        .enumerate()
        .map(|(index, direction)| (*direction, step * (index + 1) as f64 + far * (index * index) as f64))
        .collect()
}

/// The same axes with errors of up to four degrees.
fn out_of_square(directions: &[Vector3<f64>], seed: u64) -> Vec<JointAxis> {
    let mut random = SplitMix64::new(seed);
    let mut axes = apart(directions);
    for (direction, point) in &mut axes {
        *direction = so3::exp(&vector_within(&mut random, 0.07)) * *direction;
        *point += vector_within(&mut random, 0.01);
    }
    axes
}

/// A camera about 16 cm from the IMU, rotated from a nominal orientation by up to a quarter of a radian about
/// each axis.
fn out_of_true(nominal: &UnitQuaternion<f64>, seed: u64) -> RigidTransform {
    let mut random = SplitMix64::new(seed);
    let rotation_vector = Vector3::repeat(0.15) + vector_within(&mut random, 0.1);
    RigidTransform::new(
        nominal * so3::exp(&rotation_vector),
        Vector3::new(0.14, 0.03, -0.08) + vector_within(&mut random, 0.02),
    )
}

fn random_chain(joints: usize, seed: u64) -> ClassicalChain {
    let mut random = SplitMix64::new(seed);
    let links = (0..joints)
        .map(|_| DhLink {
            theta_offset_rad: within(&mut random, 3.0),
            d_m: within(&mut random, 0.1),
            a_m: within(&mut random, 0.1),
            alpha_rad: 0.6 + 0.5 * (1.0 + within(&mut random, 1.0)),
        })
        .collect();
    let mut transform =
        || RigidTransform::new(so3::exp(&vector_within(&mut random, 1.5)), vector_within(&mut random, 0.15));
    ClassicalChain { imu_from_base: transform(), links, effector_from_camera: transform() }
}

/// Returns the classical chain with these joint axes and this `imu_from_camera` at encoder angles zero, with a last
/// link whose parameters are not zero.
fn chain_of_axes(axes: &[JointAxis], imu_from_camera: &RigidTransform) -> ClassicalChain {
    let last = DhLink { theta_offset_rad: 0.2, d_m: 0.02, a_m: 0.03, alpha_rad: -0.5 * PI };
    ClassicalChain::from_axes(axes, last, imu_from_camera)
}
