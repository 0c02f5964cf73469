//! Flights along a prescribed motion, with the limits of the simulated vehicle and of its gimbal.

use super::error::SimulationError;
use super::options::SimulationOptions;
use crate::sensors::Joint;
use crate::simulation::gimbal::JointMotion;
use crate::simulation::motion::MotionSplines;
use crate::simulation::motion_samples::PrescribedMotion;
use crate::simulation::route::FlightPoint;
use crate::simulation::scenario::gravity_m_per_s2;
use crate::simulation::trajectory::{Trajectory, VehicleLimits};

/// Angle by which a joint may exceed its stops, for rounding errors of the file.
const TOLERANCE_RAD: f64 = 1e-6;

/// A prescribed motion, checked and interpolated.
pub(super) struct PrescribedFlight<'a> {
    motion: &'a PrescribedMotion,
    splines: MotionSplines,
}

impl<'a> PrescribedFlight<'a> {
    /// Interpolates a motion between its rows.
    ///
    /// # Errors
    /// If the motion has wrong times or values, or a disturbance changes the motion too.
    pub(super) fn new(motion: &'a PrescribedMotion, options: &SimulationOptions) -> Result<Self, SimulationError> {
        let problem = |problem: String| SimulationError::Motion { problem };
        motion.check().map_err(problem)?;
        let disturbances = &options.disturbances;
        let changes_motion = [
            ("slew", disturbances.gimbal_slew_s.is_some()),
            ("spin", disturbances.spin.is_some()),
            ("hold-joint", disturbances.fixed_joint.is_some()),
            ("hover", disturbances.hover_s.is_some()),
            ("stabilize", disturbances.stabilized_s.is_some()),
        ];
        if let Some((name, _)) = changes_motion.iter().find(|(_, is_given)| *is_given) {
            return Err(problem(format!("the disturbance '{name}' changes the motion too; omit it")));
        }
        Ok(Self { motion, splines: MotionSplines::through(motion) })
    }

    /// Flight of the vehicle from the start of the experiment's route.
    ///
    /// # Errors
    /// If the vehicle cannot fly it.
    pub(super) fn trajectory(&self, start: &FlightPoint) -> Result<Trajectory, SimulationError> {
        let trajectory = self.splines.trajectory(start.position_m, start.heading_rad, gravity_m_per_s2());
        let admitted = VehicleLimits::default().admit_flight(&trajectory);
        admitted.map_err(|problem| SimulationError::Motion { problem })?;
        Ok(trajectory)
    }

    /// Motion of the joints of a rig over a flight of this duration.
    ///
    /// # Errors
    /// If the names differ from the rig's joints, or an angle is beyond a stop.
    pub(super) fn joints(&self, joints: &[Joint], duration_s: f64) -> Result<JointMotion, SimulationError> {
        let problem = |problem: String| SimulationError::Motion { problem };
        let list = |names: &[String]| if names.is_empty() { "no joint".to_owned() } else { names.join(", ") };
        let given = &self.motion.joint_names;
        let mut channels = Vec::with_capacity(joints.len());
        for joint in joints {
            let channel = given.iter().position(|name| *name == joint.name);
            channels.extend(channel);
        }
        if channels.len() != joints.len() || given.len() != joints.len() {
            let names: Vec<String> = joints.iter().map(|joint| joint.name.clone()).collect();
            return Err(problem(format!("it moves {}, the rig has {}", list(given), list(&names))));
        }
        for (channel, joint) in channels.iter().zip(joints) {
            for sample in &self.motion.samples {
                let angle_rad = sample.joints_rad[*channel];
                let (low, high) = joint.limits_rad;
                if !(low - TOLERANCE_RAD..=high + TOLERANCE_RAD).contains(&angle_rad) {
                    return Err(problem(format!(
                        "at {:.2} s the joint '{}' is at {:.1}°, its range is {:.0}° to {:.0}°",
                        sample.time_s,
                        joint.name,
                        angle_rad.to_degrees(),
                        low.to_degrees(),
                        high.to_degrees()
                    )));
                }
            }
        }
        let end_s = self.splines.duration_s();
        Ok(JointMotion::prescribed(joints.len(), duration_s, |joint, time_s| {
            [0, 1].map(|order| self.splines.value(channels[joint], time_s.min(end_s), order))
        }))
    }
}
