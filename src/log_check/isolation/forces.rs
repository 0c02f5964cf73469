//! Specific forces of the accelerometer against the accelerations of the ground truth.

use nalgebra::{Matrix3, Matrix3xX, UnitQuaternion, Vector3};

use super::compared::{Compared, Poses};
use super::comparison::{Change, Comparison, Fit, Parameter, Row};
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns, standard_deviation};
use crate::log_check::ground_truth::{HALF_VELOCITY_NS, around};
use crate::log_check::imu::axes::WINDOW_NS;
use crate::log_check::report::FindingInterval;
use crate::log_check::statistics::{median, white_sigma};

/// Misfits below this part of the accelerations' scatter are tolerated, and below this in m/s².
const TOLERATED_RATIO: f64 = 0.05;
const TOLERATED_M_PER_S2: f64 = 0.05;
/// Largest time between poses whose accelerations are compared, in seconds: a quarter of the length of a velocity.
const MAX_SPACING_S: f64 = 0.05;

const PARAMETERS: [Parameter; 6] = [
    Parameter::Gravity,
    Parameter::ForceBias,
    Parameter::Lever,
    Parameter::PositionScale,
    Parameter::Transport,
    Parameter::AxisScales,
];
/// Number of the parameters that sound sources have, and the first columns of all but the first one.
const SOUND: usize = 3;
const BIAS: usize = 3;
const LEVER: usize = 6;
const POSITION_SCALE: usize = 9;
const TRANSPORT: usize = 10;
const AXIS_SCALES: usize = 11;
const COLUMNS: usize = 14;
/// Error of the scale of an axis of the accelerometer that sound ones do not have, and the number of standard deviations from
/// which it is one.
const WRONG_AXIS: f64 = 0.1;
const SIGNIFICANT_SIGMAS: f64 = 8.0;

/// Means over a window, in the world of the ground truth.
struct Window {
    time_s: f64,
    force: Vector3<f64>,
    acceleration: Vector3<f64>,
    /// `world_from_imu`.
    orientation: Matrix3<f64>,
    /// Second derivative of `world_from_imu`, in 1/s².
    turning: Matrix3<f64>,
    /// Cross product of angular rate and velocity, in m/s².
    transport: Vector3<f64>,
    /// Part of the force that each axis of the accelerometer measures.
    by_axis: Matrix3<f64>,
}

/// Compares the accelerometer with poses whose body has the axes `body_from_imu`, and whose stamps are those of the IMU less
/// `delay_s`.
pub(super) fn compare(compared: &Compared<'_>, body_from_imu: &UnitQuaternion<f64>, delay_s: f64) -> Option<Fit> {
    let poses = compared.poses;
    let steps_s: Vec<f64> = poses.windows(2).map(|pair| seconds_from_ns(pair[1].0 - pair[0].0)).collect();
    let (first, last) = (poses.first()?, poses.last()?);
    if median(&steps_s) > MAX_SPACING_S {
        return None;
    }
    let starts = (1..).map(|number| first.0 + number * WINDOW_NS);
    let windows: Vec<Window> = starts
        .take_while(|start_ns| start_ns + WINDOW_NS + HALF_VELOCITY_NS <= last.0)
        .filter_map(|start_ns| window(compared, start_ns, body_from_imu, ns_from_seconds(delay_s)))
        .collect();
    let accelerations: Vec<Vector3<f64>> = windows.iter().map(|window| window.acceleration).collect();
    let tolerated = TOLERATED_RATIO * standard_deviation(&accelerations).norm();
    let noise = compared.rig.imu.noise.accelerometer_noise_density.powi(2) / seconds_from_ns(WINDOW_NS);
    let variance = tolerated.powi(2) + TOLERATED_M_PER_S2.powi(2) + noise + acceleration_variance(poses);
    let row = |window: &Window| {
        let mut jacobian = Matrix3xX::zeros(COLUMNS);
        jacobian.fixed_columns_mut::<3>(0).copy_from(&Matrix3::identity());
        jacobian.fixed_columns_mut::<3>(BIAS).copy_from(&window.orientation);
        jacobian.fixed_columns_mut::<3>(LEVER).copy_from(&window.turning);
        jacobian.set_column(POSITION_SCALE, &window.acceleration);
        jacobian.set_column(TRANSPORT, &-window.transport);
        jacobian.fixed_columns_mut::<3>(AXIS_SCALES).copy_from(&window.by_axis);
        let residual = window.force - window.acceleration;
        let signal = window.acceleration.norm();
        Row { time_s: window.time_s, residual, jacobian, variance, signal }
    };
    let rows: Vec<Row> = windows.iter().map(row).collect();
    let comparison =
        Comparison { rows: &rows, parameters: &PARAMETERS, sound: SOUND, changing: &[Parameter::ForceBias] };
    let mut fit = comparison.fit()?;
    if fit.disagrees.is_none()
        && let Some(scales) = comparison.further(Parameter::AxisScales, fit.misfit)
    {
        let is_wrong = |[value, sigma]: &[f64; 2]| value.abs() > WRONG_AXIS.max(SIGNIFICANT_SIGMAS * sigma);
        if scales.iter().any(is_wrong) {
            // The force is the measured one less the column times its value.
            let ratio = |scale: &[f64; 2]| if is_wrong(scale) { 1.0 / (1.0 - scale[0]) - 1.0 } else { 0.0 };
            let values = scales.iter().map(ratio).collect();
            fit.disagrees = Some(FindingInterval::default());
            fit.change = Some(Change { parameter: Parameter::AxisScales, values });
        }
    }
    Some(fit)
}

/// Variance of an acceleration by the white noise of positions, in m²/s⁴.
fn acceleration_variance(poses: &Poses) -> f64 {
    let sigma_m =
        |axis: usize| white_sigma(&poses.iter().map(|(_, pose)| pose.translation_m[axis]).collect::<Vec<_>>(), false);
    let largest_m = [0, 1, 2].map(sigma_m).into_iter().fold(0.0, f64::max);
    (largest_m * 2.0 / (2.0 * seconds_from_ns(HALF_VELOCITY_NS)) / seconds_from_ns(WINDOW_NS)).powi(2)
}

fn window(
    compared: &Compared<'_>,
    start_ns: i64,
    body_from_imu: &UnitQuaternion<f64>,
    delay_ns: i64,
) -> Option<Window> {
    let (poses, samples) = (compared.poses, &compared.imu_facts.samples);
    let end_ns = start_ns + WINDOW_NS;
    let orientation = |pose: &RigidTransform| (pose.rotation * body_from_imu).to_rotation_matrix().into_inner();
    let derivatives = |at_ns: i64| {
        let [(from_ns, from), (to_ns, to)] = around(poses, at_ns)?;
        let interval_s = seconds_from_ns(to_ns - from_ns);
        let velocity = (to.translation_m - from.translation_m) / interval_s;
        (interval_s > 0.0).then(|| (velocity, (orientation(to) - orientation(from)) / interval_s))
    };
    let (before, after) = (derivatives(start_ns)?, derivatives(end_ns)?);
    // Velocities are means, so forces are weighted with the window that the difference of two such means has.
    let [from, to] = [start_ns - HALF_VELOCITY_NS, end_ns + HALF_VELOCITY_NS]
        .map(|at_ns| samples.partition_point(|sample| sample.stamp_ns < at_ns + delay_ns));
    let (mut by_axis, mut turned, mut transport, mut total) =
        (Matrix3::zeros(), Matrix3::zeros(), Vector3::zeros(), 0.0);
    for sample in samples.get(from..to)? {
        let at_ns = sample.stamp_ns - delay_ns;
        let inside_ns = (at_ns + HALF_VELOCITY_NS).min(end_ns) - (at_ns - HALF_VELOCITY_NS).max(start_ns);
        let weight = seconds_from_ns(inside_ns.max(0));
        let place = poses.partition_point(|(pose_ns, _)| *pose_ns < at_ns);
        let world_from_imu = orientation(&poses.get(place)?.1);
        by_axis += world_from_imu * Matrix3::from_diagonal(&sample.specific_force_m_per_s2) * weight;
        turned += world_from_imu * weight;
        let fraction = seconds_from_ns(at_ns - start_ns) / seconds_from_ns(WINDOW_NS);
        let velocity = before.0.lerp(&after.0, fraction);
        transport += (world_from_imu * sample.angular_velocity_rad_per_s).cross(&velocity) * weight;
        total += weight;
    }
    (total > 0.0).then(|| Window {
        time_s: seconds_from_ns(start_ns.midpoint(end_ns)),
        force: by_axis.column_sum() / total,
        by_axis: by_axis / total,
        acceleration: (after.0 - before.0) / seconds_from_ns(WINDOW_NS),
        orientation: turned / total,
        turning: (after.1 - before.1) / seconds_from_ns(WINDOW_NS),
        transport: transport / total,
    })
}
