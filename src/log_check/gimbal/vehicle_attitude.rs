//! Attitude of the vehicle, from which joint angles are computed, compared with the gyroscope: a heading that steps
//! against it shifts all joint angles from then on.

use nalgebra::{UnitQuaternion, Vector3};

use crate::faults::FaultKind;
use crate::flight_log::joints::attitude::MAX_VEHICLE_GAP_NS;
use crate::geometry::{SIGMA_PER_MEDIAN, best_rotation, seconds_from_ns, so3};
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::statistics::median;
use crate::log_check::survey::Survey;
use crate::sensors::{AttitudeFrame, Rig};

/// Larger steps of the heading make joint angles useless, in radians.
const USELESS_STEP_RAD: f64 = 0.09;
/// Time over which a change of the heading counts as one step, in nanoseconds.
const STEP_NS: i64 = 500_000_000;
/// Smallest reported step of the heading, in radians.
const STEP_TOLERANCE_RAD: f64 = 0.035;
/// Number of standard deviations, from the median change, of a reported step.
const STEP_SIGMAS: f64 = 8.0;
/// Minimum number of intervals.
const MIN_INTERVALS: usize = 40;
/// Minimum median rotation over [`STEP_NS`] with which the axes are found.
const MIN_ROTATION_RAD: f64 = 0.01;
/// Rotations whose misfit exceeds the median by this factor are not used for the axes.
const OUTLIER_RATIO: f64 = 3.0;
/// Maximum number of listed steps.
const LISTED: usize = 4;

/// Difference between the rotations of attitude and gyroscope from one message to the next.
struct Interval {
    from_ns: i64,
    to_ns: i64,
    /// Rotation of the vehicle by its attitude, world frame (z up), minus that by the gyroscope, as a rotation vector.
    difference: Vector3<f64>,
}

/// Step of the heading against the gyroscope.
#[derive(Clone, Copy, Debug)]
struct HeadingStep {
    at_ns: i64,
    change_rad: f64,
}

/// Compares the attitude of the vehicle in the rig's `gimbal.source` with the gyroscope.
pub(crate) fn check_vehicle_attitude(survey: &Survey, rig: &Rig, imu_facts: &ImuFacts, findings: &mut Findings) {
    let Some(source) = rig.gimbal.as_ref().and_then(|gimbal| gimbal.attitude.as_ref()) else { return };
    // The heading of the vehicle cancels where the gimbal's heading is relative to it.
    if matches!(source.frame, AttitudeFrame::Body | AttitudeFrame::Vehicle) {
        return;
    }
    let Some(attitude) = survey.attitude.as_ref() else { return };
    let Some(topic) = rig.vehicle_topic() else { return };
    let vehicle = attitude.vehicle_in_enu(source);
    let intervals = intervals(&vehicle, imu_facts);
    if intervals.len() < MIN_INTERVALS {
        return;
    }
    let steps = heading_steps(&intervals);
    let sigma_rad = SIGMA_PER_MEDIAN * median(&intervals.iter().map(|it| it.difference.z.abs()).collect::<Vec<_>>());
    let scatter = format!(
        "{} intervals of {:.0} ms, whose heading differs from the gyroscope's by {:.3}° (1σ)",
        intervals.len(),
        median(&intervals.iter().map(|it| seconds_from_ns(it.to_ns - it.from_ns)).collect::<Vec<_>>()) * 1e3,
        sigma_rad.to_degrees()
    );
    if steps.is_empty() {
        let title = format!("the heading of {topic} follows the gyroscope");
        findings.good(Area::Encoders, title, scatter);
    } else {
        let listed: Vec<String> = steps.iter().take(LISTED).map(HeadingStep::to_string).collect();
        let title = match steps.as_slice() {
            [only] => format!("the heading of {topic} steps by {only}"),
            _ => format!("the heading of {topic} steps {} times: {}", steps.len(), listed.join(", ")),
        };
        let remedy = "joint angles that are computed from it are shifted from then on: take an attitude whose heading does \
                      not step (without compass or satellite corrections), or gimbal.source.frame body or vehicle if the \
                      gimbal reports it";
        let largest_rad = steps.iter().map(|step| step.change_rad.abs()).fold(0.0, f64::max);
        let severity = if largest_rad > USELESS_STEP_RAD { Severity::Error } else { Severity::Warning };
        findings.add(severity, Area::Encoders, title, scatter, remedy);
        findings.state_times(steps.first().map(|step| seconds_from_ns(step.at_ns)), None);
        findings.state_faults([FaultKind::UnusableJoints.into()]);
    }
    if source.frame == AttitudeFrame::Earth {
        let title = format!("a constant error of the heading of {topic} is unobservable in the rotations");
        let evidence = "the attitudes of gimbal and vehicle are both relative to the earth; if their headings come from \
                        different sensors, their constant difference shifts the first joint";
        let remedy = "compare the first joint with its true angle, or estimate its offset in a run";
        findings.add(Severity::Note, Area::Encoders, title, evidence, remedy);
    }
}

impl std::fmt::Display for HeadingStep {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{:+.1}° at {:.2} s", self.change_rad.to_degrees(), seconds_from_ns(self.at_ns))
    }
}

/// Differences of consecutive attitudes `enu_from_flu` to the gyroscope, whose axes are found from the rotations.
fn intervals(vehicle: &[(i64, UnitQuaternion<f64>)], imu_facts: &ImuFacts) -> Vec<Interval> {
    let of_imu = |from_ns: i64, to_ns: i64| {
        imu_facts.gyroscope.rotation_between(seconds_from_ns(from_ns), seconds_from_ns(to_ns))
    };
    // Rotations over longer times are larger than the noise of attitudes.
    let mut long: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
    let mut start = 0;
    for end in 1..vehicle.len() {
        let ((from_ns, from), (to_ns, to)) = (vehicle[start], vehicle[end]);
        if to_ns - from_ns < STEP_NS {
            continue;
        }
        if let Some(of_imu) = of_imu(from_ns, to_ns) {
            long.push((so3::log(&of_imu), so3::log(&(to.inverse() * from))));
        }
        start = end;
    }
    let Some(flu_from_imu) = axes(&long) else { return Vec::new() };
    let interval = |pair: &[(i64, UnitQuaternion<f64>)]| {
        let [(from_ns, from), (to_ns, to)] = [pair[0], pair[1]];
        if to_ns - from_ns > MAX_VEHICLE_GAP_NS {
            return None;
        }
        // `second_from_first` of the gyroscope in the axes of the attitude.
        let predicted = flu_from_imu * of_imu(from_ns, to_ns)? * flu_from_imu.inverse();
        let difference = so3::log(&(to * predicted * from.inverse()));
        Some(Interval { from_ns, to_ns, difference })
    };
    vehicle.windows(2).filter_map(interval).collect()
}

/// Rotation `flu_from_imu` of pairs (IMU, vehicle) of rotation vectors; pairs that a step of the heading corrupts are
/// omitted in a second round. `None` with too little rotation.
fn axes(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<UnitQuaternion<f64>> {
    let rotation_rad = median(&pairs.iter().map(|(of_imu, _)| of_imu.norm()).collect::<Vec<_>>());
    if rotation_rad < MIN_ROTATION_RAD {
        return None;
    }
    let (first, _) = best_rotation(pairs)?;
    let misfits: Vec<f64> = pairs.iter().map(|(of_imu, of_vehicle)| (of_vehicle - first * of_imu).norm()).collect();
    let limit = OUTLIER_RATIO * median(&misfits);
    let kept: Vec<_> = pairs.iter().zip(&misfits).filter(|(_, misfit)| **misfit <= limit).map(|(it, _)| *it).collect();
    Some(best_rotation(&kept)?.0)
}

/// Steps of the heading: changes over [`STEP_NS`] that exceed the noise, each at its steepest interval.
fn heading_steps(intervals: &[Interval]) -> Vec<HeadingStep> {
    // A constant difference of the rates is a bias of the gyroscope.
    let bias_rad = median(&intervals.iter().map(|it| it.difference.z).collect::<Vec<_>>());
    let changes: Vec<f64> = intervals.iter().map(|it| it.difference.z - bias_rad).collect();
    let sums: Vec<f64> = (0..intervals.len())
        .map(|first| {
            let until = intervals[first].from_ns + STEP_NS;
            let within = intervals[first..].iter().take_while(|it| it.to_ns <= until).count();
            changes[first..first + within].iter().sum()
        })
        .collect();
    let sigma_rad = SIGMA_PER_MEDIAN * median(&sums.iter().map(|sum| sum.abs()).collect::<Vec<_>>());
    let limit = STEP_TOLERANCE_RAD.max(STEP_SIGMAS * sigma_rad);
    let mut steps = Vec::new();
    let mut first = 0;
    while first < sums.len() {
        if sums[first].abs() <= limit {
            first += 1;
            continue;
        }
        // The largest of the overlapping sums contains the whole step.
        let until = intervals[first].from_ns + 2 * STEP_NS;
        let end = first + intervals[first..].iter().take_while(|it| it.from_ns <= until).count();
        let largest = (first..end).max_by(|a, b| sums[*a].abs().total_cmp(&sums[*b].abs())).unwrap_or(first);
        let stop_ns = intervals[largest].from_ns + STEP_NS;
        let inside = largest..largest + intervals[largest..].iter().take_while(|it| it.to_ns <= stop_ns).count();
        let steepest = inside.clone().max_by(|a, b| changes[*a].abs().total_cmp(&changes[*b].abs())).unwrap_or(largest);
        steps.push(HeadingStep { at_ns: intervals[steepest].to_ns, change_rad: sums[largest] });
        first = inside.end.max(end);
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::AngularRates;

    /// Attitudes at 50 Hz of a vehicle with a heading error in radians at a time in seconds, and the gyroscope's facts.
    fn flight(heading_error: impl Fn(f64) -> f64) -> (Vec<(i64, UnitQuaternion<f64>)>, ImuFacts) {
        let rate_at = |time_s: f64| Vector3::new(0.3 * (1.3 * time_s).sin(), 0.3 * (1.9 * time_s).cos(), 0.4);
        let mut enu_from_flu = UnitQuaternion::identity();
        let (mut attitudes, mut rates) = (Vec::new(), Vec::new());
        // The IMU's axes are rotated against the vehicle's.
        let imu_from_flu = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.2);
        for number in 0..2000_i32 {
            let time_s = f64::from(number) * 0.005;
            rates.push((time_s, imu_from_flu * rate_at(time_s)));
            if number % 4 == 0 {
                let error = UnitQuaternion::from_euler_angles(0.0, 0.0, heading_error(time_s));
                attitudes.push((i64::from(number) * 5_000_000, error * enu_from_flu));
            }
            enu_from_flu *= so3::exp(&(rate_at(time_s + 0.0025) * 0.005));
        }
        (attitudes, ImuFacts { gyroscope: AngularRates::new(rates), ..ImuFacts::default() })
    }

    fn steps(heading_error: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let (attitudes, imu_facts) = flight(heading_error);
        let found = heading_steps(&intervals(&attitudes, &imu_facts));
        found.iter().map(|step| (seconds_from_ns(step.at_ns), step.change_rad.to_degrees())).collect()
    }

    #[test]
    fn steps_of_the_heading_are_found_with_time_and_size() {
        assert_eq!(steps(|_| 0.7), []);
        // A constant rate is a bias of the gyroscope.
        assert_eq!(steps(|time_s| 0.01 * time_s), []);
        let found = steps(|time_s| if time_s < 4.0 { 0.0 } else { 0.3 });
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].0 - 4.0).abs() < 0.03 && (found[0].1 - 17.2).abs() < 0.5, "{found:?}");
        let found = steps(|time_s| if (3.0..7.0).contains(&time_s) { -0.2 } else { 0.0 });
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].1 + 11.5).abs() < 0.5 && (found[1].1 - 11.5).abs() < 0.5, "{found:?}");
    }
}
