//! Specific forces of the accelerometer against the accelerations of the ground truth.

use nalgebra::{Matrix3, Matrix3xX, Rotation3, UnitQuaternion, Vector3};

use super::compared::{Compared, Poses};
use super::comparison::{AGREEING_MISFIT, Change, Comparison, Fit, Parameter, Row, counted_square, root_mean_square};
use crate::faults::{Fault, FaultKind};
use crate::geometry::{
    RigidTransform, SignedAxes, best_rotation, mean, ns_from_seconds, seconds_from_ns, standard_deviation,
};
use crate::log_check::ground_truth::{HALF_VELOCITY_NS, around};
use crate::log_check::imu::axes::{WINDOW_NS, fits_decisively};
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

/// Times at which a fault of the accelerometer may begin.
const TIMES: usize = 12;
/// Misfit below which no fault of the accelerometer is searched, and the smallest one that is believed.
const SMALL_MISFIT: f64 = 0.3;
const SMALLEST_MISFIT: f64 = 0.1;
/// Ratio of the misfit of a fault that begins at a time to the misfit of one that acts in the whole log up to which it precedes.
const BEGINS_RATIO: f64 = 0.8;
/// Delays of the accelerometer that are tried, in seconds.
const DELAYS_S: [f64; 8] = [-0.1, -0.075, -0.05, -0.03, 0.03, 0.05, 0.075, 0.1];

/// Means over a window, in the world of the ground truth.
struct Window {
    time_s: f64,
    acceleration: Vector3<f64>,
    /// `world_from_imu`.
    orientation: Matrix3<f64>,
    /// Second derivative of `world_from_imu`, in 1/s².
    turning: Matrix3<f64>,
    /// Cross product of angular rate and velocity, in m/s².
    transport: Vector3<f64>,
    /// Means of the axis `i` of the IMU in the world times the component `j` of the specific force.
    parts: [[Vector3<f64>; 3]; 3],
}

impl Window {
    /// Part of the mean specific force that each component of the accelerometer measures, which `axes` maps to the IMU's axes.
    fn by_component(&self, axes: &Matrix3<f64>) -> Matrix3<f64> {
        let column = |from: usize| (0..3).map(|to| self.parts[to][from] * axes[(to, from)]).sum::<Vector3<f64>>();
        Matrix3::from_columns(&[column(0), column(1), column(2)])
    }
}

/// Frame of the recorded specific forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Frame {
    Imu,
    /// A world, which may differ from the world of the poses.
    World,
    /// The heading: level, with the yaw of the vehicle.
    Level,
}

impl Frame {
    /// Axes of the frame in the world of the poses.
    fn axes(self, world_from_imu: &Matrix3<f64>) -> Matrix3<f64> {
        match self {
            Self::Imu => *world_from_imu,
            Self::World => Matrix3::identity(),
            Self::Level => {
                let heading_rad = world_from_imu[(1, 0)].atan2(world_from_imu[(0, 0)]);
                Rotation3::from_axis_angle(&Vector3::z_axis(), heading_rad).into_inner()
            }
        }
    }
}

/// Explanation of a misfit with what it leaves.
struct Explained {
    misfit: f64,
    change: Option<Change>,
    fault: Option<Fault>,
}

/// Windows of a log with the variance of a difference per axis.
struct Forces {
    windows: Vec<Window>,
    variance: f64,
    /// Rotation of the forces to the world of the poses.
    world_from_other: Matrix3<f64>,
}

/// Compares the accelerometer with poses whose body has the axes `body_from_imu`, and whose stamps are those of the IMU less
/// `delay_s`. The fit has a fault of the accelerometer, or another frame or delay of it, if it explains the differences far better.
pub(super) fn compare(compared: &Compared<'_>, body_from_imu: &UnitQuaternion<f64>, delay_s: f64) -> Option<Fit> {
    let with = |delay_s: f64, frame: Frame| Forces::of(compared, body_from_imu, delay_s, frame);
    let forces = with(delay_s, Frame::Imu)?;
    let mut fit = forces.fit()?;
    let given = forces.misfit(&as_recorded, &Matrix3::identity())?;
    if given < SMALL_MISFIT && fit.disagrees.is_none() {
        return Some(fit);
    }
    let of_frame = |(frame, parameter): (Frame, Parameter)| {
        let misfit = with(delay_s, frame)?.misfit(&as_recorded, &Matrix3::identity())?;
        Some(Explained { misfit, change: Some(Change { parameter, values: Vec::new() }), fault: None })
    };
    let of_delay = |later_s: f64| {
        let misfit = with(delay_s + later_s, Frame::Imu)?.misfit(&as_recorded, &Matrix3::identity())?;
        let change = Change { parameter: Parameter::Delay, values: vec![-later_s] };
        Some(Explained { misfit, change: Some(change), fault: None })
    };
    let frames = [(Frame::World, Parameter::WorldAxes), (Frame::Level, Parameter::LevelAxes)];
    let all = frames.into_iter().filter_map(of_frame).chain(DELAYS_S.into_iter().filter_map(of_delay));
    let best = least(all.chain(forces.fault(&fit)));
    // At a constant heading, other axes of positions and of the accelerometer are the same.
    let largest = best.as_ref().map_or(f64::INFINITY, |best| BEGINS_RATIO * best.misfit);
    let best = forces.axes_of_positions().filter(|it| it.misfit < largest).or(best);
    let windows = forces.windows.len();
    let is_better = |it: &Explained| {
        let [left, given] = [it.misfit, given].map(|misfit| misfit.max(SMALLEST_MISFIT).powi(2));
        it.misfit < AGREEING_MISFIT && fits_decisively(windows, left, given)
    };
    if let Some(best) = best.filter(is_better) {
        let since_s = best.fault.as_ref().and_then(|fault| fault.since_s);
        fit.disagrees = Some(FindingInterval { since_s, until_s: None });
        (fit.change, fit.fault) = (best.change, best.fault);
    }
    Some(fit)
}

/// The explanation that leaves least.
fn least(all: impl Iterator<Item = Explained>) -> Option<Explained> {
    all.min_by(|one, other| one.misfit.total_cmp(&other.misfit))
}

fn as_recorded(_: f64) -> Matrix3<f64> {
    Matrix3::identity()
}

impl Forces {
    /// Windows with the specific forces of a frame, whose stamps are the stamps of the poses plus `delay_s`.
    fn of(compared: &Compared<'_>, body_from_imu: &UnitQuaternion<f64>, delay_s: f64, frame: Frame) -> Option<Self> {
        let poses = compared.poses;
        let steps_s: Vec<f64> = poses.windows(2).map(|pair| seconds_from_ns(pair[1].0 - pair[0].0)).collect();
        let (first, last) = (poses.first()?, poses.last()?);
        if median(&steps_s) > MAX_SPACING_S {
            return None;
        }
        let delay_ns = ns_from_seconds(delay_s);
        let starts = (1..).map(|number| first.0 + number * WINDOW_NS);
        let windows: Vec<Window> = starts
            .take_while(|start_ns| start_ns + WINDOW_NS + HALF_VELOCITY_NS <= last.0)
            .filter_map(|start_ns| window(compared, start_ns, body_from_imu, delay_ns, frame))
            .collect();
        let accelerations: Vec<Vector3<f64>> = windows.iter().map(|window| window.acceleration).collect();
        let mut world_from_other = Matrix3::identity();
        if frame == Frame::World {
            let forces: Vec<Vector3<f64>> =
                windows.iter().map(|it| it.by_component(&Matrix3::identity()).column_sum()).collect();
            let (force, acceleration) = (mean(&forces), mean(&accelerations));
            let moved = forces.iter().zip(&accelerations).map(|(one, other)| (one - force, other - acceleration));
            let (rotation, _) = best_rotation(&moved.collect::<Vec<_>>())?;
            world_from_other = rotation.to_rotation_matrix().into_inner();
        }
        let tolerated = TOLERATED_RATIO * standard_deviation(&accelerations).norm();
        let noise = compared.rig.imu.noise.accelerometer_noise_density.powi(2) / seconds_from_ns(WINDOW_NS);
        let variance = tolerated.powi(2) + TOLERATED_M_PER_S2.powi(2) + noise + acceleration_variance(poses);
        Some(Self { windows, variance, world_from_other })
    }

    /// Rows with the axes of the accelerometer at a time and the axes of the positions.
    fn rows(&self, axes_at: &dyn Fn(f64) -> Matrix3<f64>, world_from_positions: &Matrix3<f64>) -> Vec<Row> {
        let row = |window: &Window| {
            let acceleration = world_from_positions * window.acceleration;
            let by_component = self.world_from_other * window.by_component(&axes_at(window.time_s));
            let mut jacobian = Matrix3xX::zeros(COLUMNS);
            jacobian.fixed_columns_mut::<3>(0).copy_from(&Matrix3::identity());
            jacobian.fixed_columns_mut::<3>(BIAS).copy_from(&window.orientation);
            jacobian.fixed_columns_mut::<3>(LEVER).copy_from(&window.turning);
            jacobian.set_column(POSITION_SCALE, &acceleration);
            jacobian.set_column(TRANSPORT, &-window.transport);
            jacobian.fixed_columns_mut::<3>(AXIS_SCALES).copy_from(&by_component);
            let residual = by_component.column_sum() - acceleration;
            let signal = acceleration.norm();
            Row { time_s: window.time_s, residual, jacobian, variance: self.variance, signal }
        };
        self.windows.iter().map(row).collect()
    }

    fn fit(&self) -> Option<Fit> {
        let rows = self.rows(&as_recorded, &Matrix3::identity());
        let comparison =
            Comparison { rows: &rows, parameters: &PARAMETERS, sound: SOUND, changing: &[Parameter::ForceBias] };
        let mut fit = comparison.fit()?;
        if fit.disagrees.is_none()
            // Other causes can explain differences within the tolerated ones, however well a scale fits them.
            && let Some(scales) = comparison.further(Parameter::AxisScales, fit.misfit.max(1.0))
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

    fn misfit(&self, axes_at: &dyn Fn(f64) -> Matrix3<f64>, world_from_positions: &Matrix3<f64>) -> Option<f64> {
        Some(root_mean_square(&self.misfits(axes_at, world_from_positions)?))
    }

    /// Misfits with the axes of the accelerometer at a time and the axes of the positions, whatever the constant parameters of sound
    /// sources.
    fn misfits(&self, axes_at: &dyn Fn(f64) -> Matrix3<f64>, world_from_positions: &Matrix3<f64>) -> Option<Vec<f64>> {
        let rows = self.rows(axes_at, world_from_positions);
        Comparison { rows: &rows, parameters: &PARAMETERS, sound: SOUND, changing: &[] }.least_misfits()
    }

    /// Axes of the positions, other than the axes of the orientations, that leave least.
    fn axes_of_positions(&self) -> Option<Explained> {
        let explained = |axes: SignedAxes| {
            let matrix = axes.matrix();
            let change = Change { parameter: Parameter::PositionAxes, values: matrix.iter().copied().collect() };
            Some(Explained { misfit: self.misfit(&as_recorded, &matrix)?, change: Some(change), fault: None })
        };
        least(SignedAxes::all().skip(1).filter_map(explained))
    }

    /// Axes or unit of the accelerometer that leave least, in the whole log or from a time on.
    fn fault(&self, fit: &Fit) -> Option<Explained> {
        let count = self.windows.len();
        let times = (1..=TIMES).filter_map(|number| self.windows.get(number * count / (TIMES + 1))).map(|it| it.time_s);
        let times_s: Vec<f64> = times.chain(fit.disagrees.and_then(|interval| interval.since_s)).collect();
        let axes = SignedAxes::all().skip(1).map(|axes| Fault::of_axes(FaultKind::AccelerometerAxes, axes));
        let faults: Vec<Fault> = axes.chain(FaultKind::AccelerometerScale.trials(&[])).collect();
        let misfits = |fault: &Fault, since_s: Option<f64>| {
            let correction =
                Matrix3::from_columns(&[0, 1, 2].map(|axis| fault.specific_force(&Vector3::ith(axis, 1.0))));
            let acts = |time_s: f64| since_s.is_none_or(|since_s| time_s >= since_s);
            let axes_at = |time_s: f64| if acts(time_s) { correction } else { Matrix3::identity() };
            self.misfits(&axes_at, &Matrix3::identity())
        };
        let explained = |fault: &Fault, since_s: Option<f64>| {
            let misfit = root_mean_square(&misfits(fault, since_s)?);
            Some(Explained { misfit, change: None, fault: Some(Fault { since_s, ..fault.clone() }) })
        };
        let whole = least(faults.iter().filter_map(|fault| explained(fault, None)));
        let begun = least(
            faults
                .iter()
                .flat_map(|fault| times_s.iter().map(move |at_s| (fault, *at_s)))
                .filter_map(|(fault, at_s)| explained(fault, Some(at_s))),
        );
        let begun = match (whole, begun) {
            (Some(whole), Some(begun)) if begun.misfit > BEGINS_RATIO * whole.misfit => return Some(whole),
            (whole, begun) => begun.or(whole)?,
        };
        let Some((fault, at_s)) = begun.fault.as_ref().and_then(|fault| Some((fault.clone(), fault.since_s?))) else {
            return Some(begun);
        };
        // Between two of the times that were tried.
        let spacing_s = (self.windows.last()?.time_s - self.windows.first()?.time_s) / TIMES as f64;
        let near = self.windows.iter().map(|it| it.time_s).filter(|time_s| (time_s - at_s).abs() < spacing_s);
        let squares = near.filter_map(|near_s| Some((counted_square(&misfits(&fault, Some(near_s))?), near_s)));
        let (_, best_s) = squares.min_by(|one, other| one.0.total_cmp(&other.0))?;
        explained(&fault, Some(best_s))
    }
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
    frame: Frame,
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
    let mut parts = [[Vector3::zeros(); 3]; 3];
    let (mut turned, mut transport, mut total) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for sample in samples.get(from..to)? {
        let at_ns = sample.stamp_ns - delay_ns;
        let inside_ns = (at_ns + HALF_VELOCITY_NS).min(end_ns) - (at_ns - HALF_VELOCITY_NS).max(start_ns);
        let weight = seconds_from_ns(inside_ns.max(0));
        let place = poses.partition_point(|(pose_ns, _)| *pose_ns < at_ns);
        let world_from_imu = orientation(&poses.get(place)?.1);
        let axes = frame.axes(&world_from_imu) * weight;
        for (to, row) in parts.iter_mut().enumerate() {
            for (from, part) in row.iter_mut().enumerate() {
                *part += axes.column(to) * sample.specific_force_m_per_s2[from];
            }
        }
        turned += world_from_imu * weight;
        let fraction = seconds_from_ns(at_ns - start_ns) / seconds_from_ns(WINDOW_NS);
        let velocity = before.0.lerp(&after.0, fraction);
        transport += (world_from_imu * sample.angular_velocity_rad_per_s).cross(&velocity) * weight;
        total += weight;
    }
    (total > 0.0).then(|| Window {
        time_s: seconds_from_ns(start_ns.midpoint(end_ns)),
        parts: parts.map(|row| row.map(|part| part / total)),
        acceleration: (after.0 - before.0) / seconds_from_ns(WINDOW_NS),
        orientation: turned / total,
        turning: (after.1 - before.1) / seconds_from_ns(WINDOW_NS),
        transport: transport / total,
    })
}
