//! Joint rates and joint accelerations of a frame: `r = (q − z) / σ` for each of `q = [θ̇; θ̈]`.

use super::encoder::diagonal;
use super::factor::{Factor, JacobianBlock, Point, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::sensors::JointAngles;

/// Standard deviation of the change of a joint angle since the previous frame, without an encoder.
pub(crate) const UNKNOWN_JOINT_SIGMA_RAD: f64 = 1.0;
/// Standard deviation of a joint rate without a measurement, in rad/s: motors of gimbals rotate at up to 200°/s.
const UNKNOWN_RATE_RAD_PER_S: f64 = 2.0;
/// Standard deviation of a joint acceleration without a measurement, in rad/s²: a stabilized joint compensates the
/// vehicle, which reaches 20 rad/s² in agile flight.
const UNKNOWN_ACCELERATION_RAD_PER_S2: f64 = 10.0;
/// Smallest standard deviations of rate and acceleration, in rad/s and rad/s²: over the 0.1 s of the readings, joints
/// deviate from a parabola by this much.
const MIN_MOTION_SIGMAS: [f64; 2] = [0.02, 2.0];

/// Value and standard deviation of a joint rate or joint acceleration, from the encoders or else zero. `place` indexes
/// the rates of all joints, then their accelerations.
pub(crate) fn measured_joint_motion(encoder: Option<&JointAngles>, place: usize, joints: usize) -> (f64, f64) {
    let (joint, derivative) = (place % joints.max(1), place / joints.max(1));
    let unknown = [UNKNOWN_RATE_RAD_PER_S, UNKNOWN_ACCELERATION_RAD_PER_S2][derivative.min(1)];
    let measured = encoder.and_then(|encoder| {
        let fit = encoder.motion_fits.get(joint)?;
        let (value, sigma) = match derivative {
            0 => (*encoder.rates_rad_per_s.get(joint)?, fit.rate_sigma_rad_per_s),
            _ => (fit.acceleration_rad_per_s2, fit.acceleration_sigma_rad_per_s2),
        };
        (value.is_finite() && sigma.is_finite()).then(|| (value, sigma.hypot(MIN_MOTION_SIGMAS[derivative.min(1)])))
    });
    measured.filter(|(_, sigma)| *sigma < unknown).unwrap_or((0.0, unknown))
}

/// Joint rates and joint accelerations of a frame: one row each, relative to the value that the encoders measure, or
/// relative to zero with the motion of a gimbal as standard deviation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointMotionFactor<'a> {
    slot: usize,
    encoder: Option<&'a JointAngles>,
    /// Joint rates in rad/s, then joint accelerations in rad/s².
    motion: &'a [f64],
    /// Column of the first joint rate.
    start: usize,
}

impl<'a> JointMotionFactor<'a> {
    /// Factor of the frame at `slot`, `None` if joint rates are not estimated.
    pub(crate) fn of(point: &Point<'a>, slot: usize) -> Option<Self> {
        let motion = point.at.frames[slot].joint_motion.as_slice();
        (!motion.is_empty()).then(|| Self {
            slot,
            encoder: point.frames[slot].encoder.as_ref(),
            motion,
            start: point.layout.joint_motion(slot).start,
        })
    }
}

impl Factor for JointMotionFactor<'_> {
    /// Label of the frame's encoder readings, which measure the joint motion.
    fn label(&self) -> FactorLabel {
        FactorLabel::Encoder(self.slot as u16)
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let joints = self.motion.len() / 2;
        let terms: Vec<(f64, f64)> = (0..self.motion.len())
            .map(|place| {
                let (measured, sigma) = measured_joint_motion(self.encoder, place, joints);
                ((self.motion[place] - measured) / sigma, 1.0 / sigma)
            })
            .collect();
        let residual: Vec<f64> = terms.iter().map(|(residual, _)| *residual).collect();
        let entries = diagonal(terms.iter().map(|(_, slope)| *slope));
        let blocks = [JacobianBlock { start: self.start, entries: &entries }];
        sink.add(self.label(), &WhitenedRows { residual: &residual, blocks: &blocks, products: None });
    }
}
