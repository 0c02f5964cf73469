//! Flights along a prescribed motion, with the limits of the simulated vehicle and of its gimbal.

use super::error::SimulationError;
use super::gimbal::JointMotion;
use super::motion::MotionSplines;
use super::motion_samples::PrescribedMotion;
use super::options::SimulationOptions;
use super::route::FlightPoint;
use super::scenario::{Scenario, gravity_m_per_s2};
use super::trajectory::{Trajectory, VehicleLimits};

/// Number of joints of the simulated gimbal.
const JOINTS: usize = 3;
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
    /// If the motion has wrong times, values or joints, or a disturbance changes the motion too.
    pub(super) fn new(motion: &'a PrescribedMotion, options: &SimulationOptions) -> Result<Self, SimulationError> {
        let problem = |problem: String| SimulationError::Motion { problem };
        motion.check().map_err(problem)?;
        if motion.joint_names.len() != JOINTS {
            return Err(problem(format!(
                "it has the joints {}, the simulated gimbal has yaw, roll and pitch",
                if motion.joint_names.is_empty() { "none".to_owned() } else { motion.joint_names.join(", ") }
            )));
        }
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
        let limits = VehicleLimits::default();
        limits.admit_flight(&trajectory).map_err(|time_s| SimulationError::Motion {
            problem: format!(
                "at {time_s:.2} s the vehicle would exceed {:.0} m/s, a tilt of {:.0}°, a rate of {:.0}°/s or its thrust",
                limits.speed_m_per_s,
                limits.tilt_rad.to_degrees(),
                limits.rate_rad_per_s.to_degrees()
            ),
        })?;
        Ok(trajectory)
    }

    /// Motion of the joints.
    ///
    /// # Errors
    /// If the names are not those of the gimbal, or an angle is beyond a stop.
    pub(super) fn joints(&self, scenario: &Scenario) -> Result<JointMotion, SimulationError> {
        let problem = |problem: String| SimulationError::Motion { problem };
        let joints = scenario.true_rig.gimbal.as_ref().map_or(&[][..], |gimbal| gimbal.joints.as_slice());
        let mut channels = [0; JOINTS];
        for (channel, joint) in channels.iter_mut().zip(joints) {
            let found = self.motion.joint_names.iter().position(|name| *name == joint.name);
            *channel = found.ok_or_else(|| {
                problem(format!("it has no joint '{}', only {}", joint.name, self.motion.joint_names.join(", ")))
            })?;
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
        Ok(JointMotion::prescribed(scenario.trajectory.duration_s(), |time_s| {
            let time_s = time_s.min(end_s);
            let values = |order: usize| channels.map(|channel| self.splines.value(channel, time_s, order));
            (values(0), values(1))
        }))
    }
}
