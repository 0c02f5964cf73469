//! Information gain of a window by parameter and by motion.

use std::fmt;

use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use super::super::analysis::measured_information;
use crate::estimator::{HypotheticalFrame, HypotheticalLandmark, HypotheticalWindow, Motion};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{Chain, ParameterNames};
use crate::table::text::{TextTable, left, right};

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Excitation {
    /// Translations along and rotations about the body's axes, then the joints.
    pub motions: Vec<String>,
    pub parameters: Vec<ParameterExcitation>,
    /// Length of the window, in seconds.
    pub duration_s: f64,
}

/// Information gain of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterExcitation {
    pub name: String,
    /// Gain beyond the prior in bits per second: one bit halves the standard deviation.
    pub bits_per_s: f64,
    /// Decrease of that gain without each motion.
    pub by_motion: Vec<f64>,
}

/// Returns the information gain of a window by parameter and second beyond a prior of 10° and 3 cm, and its decrease
/// without each motion: the window is linearized again without that motion, with the same landmarks and observations.
/// `None` for windows without duration or finite numbers.
///
/// The decreases need not add up to the gain: two motions may each constrain the same parameter, or only both together.
pub fn excitation(
    window: &HypotheticalWindow,
    chain: &Chain,
    joint_names: &[String],
    names: &ParameterNames,
) -> Option<Excitation> {
    let (first, last) = (window.frames.first()?, window.frames.last()?);
    let duration_s = last.time_s - first.time_s;
    if duration_s <= 0.0 {
        return None;
    }
    let joints = chain.joint_count();
    let motions: Vec<Motion> = Motion::all(joints).collect();
    let whole = variances(window, chain)?;
    let without: Vec<Option<Vec<f64>>> =
        motions.par_iter().map(|motion| variances(&without(window, chain, *motion), chain)).collect();
    let without = without.into_iter().collect::<Option<Vec<_>>>()?;
    let bits = |more: f64, less: f64| 0.5 * (more / less).log2() / duration_s;
    let parameters = chain.parameters().into_iter().enumerate().map(|(column, parameter)| ParameterExcitation {
        name: names.name(parameter),
        // In units of the prior the variance starts at 1.
        bits_per_s: bits(1.0, whole[column]),
        by_motion: without.iter().map(|variances| bits(variances[column], whole[column])).collect(),
    });
    Some(Excitation {
        parameters: parameters.collect(),
        motions: motions.iter().map(|motion| motion.name(joint_names)).collect(),
        duration_s,
    })
}

/// Variance of each column after the window, in units of the prior.
fn variances(window: &HypotheticalWindow, chain: &Chain) -> Option<Vec<f64>> {
    let linearization = window.linearize(&chain.to_classical(), chain.parameterization(), !chain.hides_joint_offsets());
    let information = measured_information(&linearization)?;
    let count = information.ncols();
    let covariance = (information + DMatrix::identity(count, count)).cholesky()?.inverse();
    Some(covariance.diagonal().iter().copied().collect())
}

fn without(window: &HypotheticalWindow, chain: &Chain, motion: Motion) -> HypotheticalWindow {
    let middle = &window.frames[window.frames.len() / 2];
    let about = middle.navigation.world_from_imu;
    let frames: Vec<HypotheticalFrame> = window
        .frames
        .iter()
        .map(|frame| {
            let mut frame = frame.clone();
            let pose = &mut frame.navigation.world_from_imu;
            match motion {
                Motion::Translation(axis) => {
                    let axis = about.rotation * Vector3::ith(axis, 1.0);
                    pose.translation_m -= axis * axis.dot(&(pose.translation_m - about.translation_m));
                    let velocity = &mut frame.navigation.velocity_m_per_s;
                    *velocity -= axis * axis.dot(velocity);
                }
                Motion::Rotation(axis) => {
                    let mut rotation_vector = so3::log(&(about.rotation.inverse() * pose.rotation));
                    rotation_vector[axis] = 0.0;
                    pose.rotation = about.rotation * so3::exp(&rotation_vector);
                }
                Motion::Joint(joint) => frame.joints_rad[joint] = middle.joints_rad[joint],
            }
            frame
        })
        .collect();
    let poses = |frames: &[HypotheticalFrame]| -> Vec<RigidTransform> {
        let pose =
            |frame: &HypotheticalFrame| frame.navigation.world_from_imu * chain.imu_from_camera(&frame.joints_rad);
        frames.iter().map(pose).collect()
    };
    let (before, after) = (poses(&window.frames), poses(&frames));
    let landmarks = window.landmarks.iter().filter_map(|landmark| {
        let at = landmark.bearing.normalize() / landmark.inverse_distance_per_m;
        let in_anchor = after[landmark.anchor].inverse().transform(&before[landmark.anchor].transform(&at));
        (in_anchor.z > 0.0).then(|| HypotheticalLandmark {
            bearing: in_anchor.normalize(),
            inverse_distance_per_m: in_anchor.norm().recip(),
            ..landmark.clone()
        })
    });
    HypotheticalWindow { landmarks: landmarks.collect(), frames, ..window.clone() }
}

impl fmt::Display for Excitation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joints = self.motions.len().saturating_sub(6);
        writeln!(
            out,
            "information gain   bit/s (one bit halves σ) over {:.2} s: all, and the loss without one motion of the vehicle\n                   (IMU axes) or of one of {joints} joints",
            self.duration_s
        )?;
        let motions = self.motions.iter().map(|name| right(name.as_str(), name.len().max(6) + 2));
        let rows = self.parameters.iter().map(|parameter| {
            // Rounding errors count as zero.
            let missing = parameter.by_motion.iter().map(|bits| if bits.abs() < 0.005 { 0.0 } else { *bits });
            let bits = [parameter.bits_per_s].into_iter().chain(missing).map(|bits| format!("{bits:.2}"));
            [parameter.name.clone()].into_iter().chain(bits).collect::<Vec<_>>()
        });
        write!(out, "{}", TextTable::new([left("", 12), right("all", 8)].into_iter().chain(motions), rows))
    }
}
