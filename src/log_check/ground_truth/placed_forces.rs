//! Specific forces placed in the world of the ground truth, whose accelerations say which axes the accelerometer has.

use nalgebra::{Matrix3, Vector3};

use crate::faults::{Fault, FaultKind};
use crate::geometry::{RigidTransform, SignedAxes, ns_from_seconds, seconds_from_ns, so3, standard_deviation};
use crate::log_check::clock_alignment::ClockAlignment;
use crate::log_check::imu::axes::{CORRECT_AXES, WINDOW_NS, fits_decisively, other_accelerometer_axes};
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::sensors::ImuSample;

/// Half the time over which a velocity is measured, in nanoseconds.
pub(crate) const HALF_VELOCITY_NS: i64 = 100_000_000;
/// Minimum number of windows.
const MIN_WINDOWS: usize = 20;
/// Largest variance that the best axes leave, as a ratio of the variance of the accelerations.
const LARGEST_REMAINDER: f64 = 0.25;

/// Poses of the ground truth with the specific forces of the IMU.
pub(super) struct PlacedForces<'a> {
    /// Nanoseconds since the log began, and `world_from_body`, ordered by stamp.
    pub(super) poses: &'a [(i64, RigidTransform)],
    /// Alignment of the poses with the gyroscope.
    pub(crate) clock: &'a ClockAlignment,
    /// Samples ordered by stamp.
    pub(crate) samples: &'a [ImuSample],
}

/// Means over an interval, in the world of the ground truth.
struct Window {
    /// By the poses, in m/s².
    acceleration: Vector3<f64>,
    /// Mean of `world_from_imu · e_i · f_j` for the axis `i` of the IMU and the component `j` of the specific force.
    parts: [[Vector3<f64>; 3]; 3],
}

impl Window {
    /// Mean specific force if the accelerometer's components map to the IMU's axes like this.
    fn force(&self, axes: &Matrix3<f64>) -> Vector3<f64> {
        let all = (0..3).flat_map(|to| (0..3).map(move |from| (to, from)));
        all.fold(Vector3::zeros(), |sum, (to, from)| sum + self.parts[to][from] * axes[(to, from)])
    }
}

/// Axes of the accelerometer that fit the accelerations of the ground truth.
pub(super) struct OtherAxes {
    /// Maps specific forces to the axes of the gyroscope.
    pub(super) axes: SignedAxes,
    evidence: String,
}

impl OtherAxes {
    pub(super) fn report(self, findings: &mut Findings) {
        let (title, remedy) = if self.axes.negated().is_identity() {
            let remedy = "reverse all three axes in the driver: at rest an accelerometer measures +9.81 m/s² upwards";
            ("the accelerometer has the opposite sign: it measures gravity, not specific force".to_owned(), remedy)
        } else {
            (other_accelerometer_axes(&self.axes.inverse()), CORRECT_AXES)
        };
        findings.add(Severity::Error, Area::Imu, title, self.evidence, remedy);
        findings.state_faults([Fault::of_axes(FaultKind::AccelerometerAxes, self.axes)]);
        findings.mark_by_pair(&[Measurement::Gyroscope, Measurement::Accelerometer]);
        findings.exclude(Measurement::Accelerometer);
    }
}

impl PlacedForces<'_> {
    /// Axes or a sign of the accelerometer that fit the accelerations of the ground truth much better than the gyroscope's; `None`
    /// if these fit.
    pub(super) fn other_axes(&self) -> Option<OtherAxes> {
        let windows = self.windows();
        if windows.len() < MIN_WINDOWS {
            return None;
        }
        // Gravity and bias are constant.
        let scatter = |of: &dyn Fn(&Window) -> Vector3<f64>| {
            standard_deviation(&windows.iter().map(of).collect::<Vec<_>>()).norm_squared()
        };
        let moved = scatter(&|window| window.acceleration);
        let remainder = |axes: &SignedAxes| {
            let matrix = axes.matrix();
            scatter(&|window| window.acceleration - window.force(&matrix))
        };
        let all: Vec<(SignedAxes, f64)> = SignedAxes::all().map(|axes| (axes, remainder(&axes))).collect();
        let given = all.iter().find(|(axes, _)| axes.is_identity()).map_or(f64::INFINITY, |(_, scatter)| *scatter);
        let (axes, best) = all.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let is_decisive = fits_decisively(windows.len(), best, given);
        if axes.is_identity() || !is_decisive || best > LARGEST_REMAINDER * moved {
            return None;
        }
        let evidence = format!(
            "{} windows of {:.2} s: specific forces differ from the accelerations of the ground truth by {:.2} m/s² (RMS \
             without their mean), by {:.2} m/s² with these axes; the accelerations scatter by {:.2} m/s²",
            windows.len(),
            seconds_from_ns(WINDOW_NS),
            given.sqrt(),
            best.sqrt(),
            moved.sqrt()
        );
        Some(OtherAxes { axes, evidence })
    }

    fn windows(&self) -> Vec<Window> {
        let body_from_imu = so3::exp(&Vector3::from(self.clock.camera_from_body_rad));
        let offset_ns = ns_from_seconds(self.clock.offset_s);
        let (Some(first), Some(last)) = (self.poses.first(), self.poses.last()) else { return Vec::new() };
        let window = |start_ns: i64| {
            let end_ns = start_ns + WINDOW_NS;
            let change = velocity_at(self.poses, end_ns)? - velocity_at(self.poses, start_ns)?;
            let [from, to] = [start_ns, end_ns]
                .map(|at_ns| self.samples.partition_point(|sample| sample.stamp_ns < at_ns + offset_ns));
            let samples = self.samples.get(from..to).filter(|samples| !samples.is_empty())?;
            let mut parts = [[Vector3::zeros(); 3]; 3];
            for sample in samples {
                let after = self.poses.partition_point(|(at, _)| *at < sample.stamp_ns - offset_ns);
                let (_, pose) = self.poses.get(after)?;
                let turned = (pose.rotation * body_from_imu).to_rotation_matrix().into_inner() / samples.len() as f64;
                for (to, row) in parts.iter_mut().enumerate() {
                    for (from, part) in row.iter_mut().enumerate() {
                        *part += turned.column(to) * sample.specific_force_m_per_s2[from];
                    }
                }
            }
            Some(Window { acceleration: change / seconds_from_ns(WINDOW_NS), parts })
        };
        let starts = (0..).map(|number| first.0 + HALF_VELOCITY_NS + number * WINDOW_NS);
        starts.take_while(|start_ns| start_ns + WINDOW_NS + HALF_VELOCITY_NS <= last.0).filter_map(window).collect()
    }
}

/// Mean velocity over [`HALF_VELOCITY_NS`] to both sides of a stamp, in m/s; `None` without poses there.
pub(super) fn velocity_at(poses: &[(i64, RigidTransform)], stamp_ns: i64) -> Option<Vector3<f64>> {
    let [first, last] = around(poses, stamp_ns)?;
    let interval_s = seconds_from_ns(last.0 - first.0);
    (interval_s > 0.0).then(|| (last.1.translation_m - first.1.translation_m) / interval_s)
}

/// First and last pose within [`HALF_VELOCITY_NS`] to both sides of a stamp.
pub(crate) fn around(poses: &[(i64, RigidTransform)], stamp_ns: i64) -> Option<[&(i64, RigidTransform); 2]> {
    let start = poses.partition_point(|(at, _)| *at < stamp_ns - HALF_VELOCITY_NS);
    let end = poses.partition_point(|(at, _)| *at <= stamp_ns + HALF_VELOCITY_NS);
    let within = poses.get(start..end)?;
    Some([within.first()?, within.last()?])
}
