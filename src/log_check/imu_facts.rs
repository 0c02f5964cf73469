use nalgebra::Vector3;

use super::statistics::{mean, median, percentile, standard_deviation, white_standard_deviation};
use super::survey::Survey;
use super::{Area, Findings, Severity};
use crate::geometry::seconds_from_ns;
use crate::sensors::{ImuSample, Rig};

/// A norm of the specific force below this is that of messages that leave it unset.
const NO_FORCE_M_PER_S2: f64 = 0.01;
/// Length of the windows that are classified as stationary or not.
const WINDOW_NS: i64 = 500_000_000;
/// Stationary: the standard deviation of the angular rate, white noise removed, is below this.
const STATIONARY_RATE_RAD_PER_S: f64 = 0.012;
/// Stationary: the standard deviation of the specific force, white noise removed, is below this.
const STATIONARY_FORCE_M_PER_S2: f64 = 0.06;
/// Stationary: the mean angular rate, bias included, is below this.
const STATIONARY_MEAN_RAD_PER_S: f64 = 0.08;
/// Measured noise above this many times the rig's is reported.
const NOISE_TOO_SMALL: f64 = 3.0;
/// Measured noise this many times below the rig's is reported.
const NOISE_TOO_LARGE: f64 = 30.0;

/// Half a second of IMU samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) start_ns: i64,
    pub(super) end_ns: i64,
    pub(super) stationary: bool,
    mean_rate: Vector3<f64>,
    mean_force: Vector3<f64>,
    white_rate: Vector3<f64>,
    white_force: Vector3<f64>,
}

/// IMU samples and what they measure of the motion, for later checks.
#[derive(Clone, Debug, Default)]
pub(super) struct ImuFacts {
    /// Finite samples in the order of their stamps.
    pub(super) samples: Vec<ImuSample>,
    /// Mean angular rate while stationary, in the IMU frame; `None` when the vehicle never was.
    pub(super) gyroscope_bias_rad_per_s: Option<Vector3<f64>>,
    /// Time and mean specific force (IMU frame, m/s²) of a stationary window; without one, the middle of the log and the
    /// mean over all of it. Its direction is up.
    pub(super) up: Option<(i64, Vector3<f64>)>,
}

/// Units, gravity, biases, noise and saturation of the IMU, and stationary periods.
pub(super) fn check_imu(survey: &Survey, rig: Option<&Rig>, findings: &mut Findings) -> ImuFacts {
    let finite = |sample: &&ImuSample| {
        let numbers = sample.angular_velocity_rad_per_s.iter().chain(&sample.specific_force_m_per_s2);
        numbers.copied().all(f64::is_finite)
    };
    let mut samples: Vec<ImuSample> = survey.imu.iter().filter(finite).copied().collect();
    let lost = survey.imu.len() - samples.len();
    if lost > 0 {
        let first = survey.imu.iter().find(|sample| !finite(sample)).map_or(0, |sample| sample.stamp_ns);
        let evidence = format!("{lost} of {} samples, the first at {:.3} s", survey.imu.len(), seconds_from_ns(first));
        let remedy = "check the driver; these samples are dropped";
        findings.add(Severity::Warning, Area::Imu, "IMU samples are not finite", evidence, remedy);
    }
    samples.sort_by_key(|sample| sample.stamp_ns);
    samples.dedup_by_key(|sample| sample.stamp_ns);
    if samples.len() < 10 {
        return ImuFacts { samples, ..ImuFacts::default() };
    }
    let windows = windows_of(&samples, &survey.accelerometer);
    let stationary: Vec<Window> = windows.iter().filter(|window| window.stationary).copied().collect();
    let others: Vec<&String> =
        survey.imu_topics.iter().filter(|topic| survey.imu_topic.as_ref() != Some(*topic)).collect();
    check_gravity(&samples, &stationary, rig, &others, findings);
    let gyroscope_bias = check_gyroscope_bias(&stationary, findings);
    let rates_hz = [
        sample_rate_hz(&samples, |sample| sample.stamp_ns),
        sample_rate_hz(&survey.accelerometer, |(stamp_ns, _)| *stamp_ns),
    ];
    check_noise(rates_hz, &windows, &stationary, rig, findings);
    check_clipping(&samples, findings);
    check_stationary(&windows, findings);
    let forces = || samples.iter().map(|sample| sample.specific_force_m_per_s2).collect::<Vec<_>>();
    let stationary_up =
        stationary.get(stationary.len() / 2).map(|window| (window.start_ns.midpoint(window.end_ns), window.mean_force));
    let up = stationary_up.unwrap_or_else(|| (samples[samples.len() / 2].stamp_ns, mean(&forces())));
    ImuFacts { samples, gyroscope_bias_rad_per_s: gyroscope_bias, up: Some(up) }
}

/// Mean rate in Hz of at least two samples in the order of their stamps.
fn sample_rate_hz<T>(samples: &[T], stamp_ns: impl Fn(&T) -> i64) -> Option<f64> {
    let (first, last) = (samples.first()?, samples.last().filter(|_| samples.len() > 1)?);
    Some((samples.len() - 1) as f64 / seconds_from_ns(stamp_ns(last) - stamp_ns(first)).max(1e-9))
}

/// The windows of a log. Specific forces are those of an accelerometer of its own when there is one: interpolation removes
/// noise.
fn windows_of(samples: &[ImuSample], accelerometer: &[(i64, Vector3<f64>)]) -> Vec<Window> {
    let mut windows = Vec::new();
    let mut begin = 0;
    while begin < samples.len() {
        let end_ns = samples[begin].stamp_ns + WINDOW_NS;
        let end = samples.partition_point(|sample| sample.stamp_ns < end_ns);
        let part = &samples[begin..end];
        if part.len() >= 20 && samples.len() > end {
            let rates: Vec<Vector3<f64>> = part.iter().map(|sample| sample.angular_velocity_rad_per_s).collect();
            let forces: Vec<Vector3<f64>> = if accelerometer.is_empty() {
                part.iter().map(|sample| sample.specific_force_m_per_s2).collect()
            } else {
                let from = accelerometer.partition_point(|(stamp_ns, _)| *stamp_ns < samples[begin].stamp_ns);
                let own = accelerometer[from..].iter().take_while(|(stamp_ns, _)| *stamp_ns < end_ns);
                own.map(|(_, force)| *force).collect()
            };
            let (white_rate, white_force) = (white_standard_deviation(&rates), white_standard_deviation(&forces));
            let beyond =
                |all: Vector3<f64>, white: Vector3<f64>| (all.norm_squared() - white.norm_squared()).max(0.0).sqrt();
            let mean_rate = mean(&rates);
            windows.push(Window {
                start_ns: samples[begin].stamp_ns,
                end_ns,
                stationary: beyond(standard_deviation(&rates), white_rate) < STATIONARY_RATE_RAD_PER_S
                    && beyond(standard_deviation(&forces), white_force) < STATIONARY_FORCE_M_PER_S2
                    && mean_rate.norm() < STATIONARY_MEAN_RAD_PER_S,
                mean_rate,
                mean_force: mean(&forces),
                white_rate,
                white_force,
            });
        }
        begin = end;
    }
    windows
}

fn check_gravity(
    samples: &[ImuSample],
    stationary: &[Window],
    rig: Option<&Rig>,
    other_topics: &[&String],
    findings: &mut Findings,
) {
    let gravity = rig.map_or(9.81, |rig| rig.gravity_m_per_s2);
    if !(9.75..=9.85).contains(&gravity) {
        let evidence = format!("{gravity} m/s²; on the ground it lies between 9.78 and 9.83");
        findings.add(
            Severity::Warning,
            Area::Imu,
            "the rig's gravity is unusual",
            evidence,
            "set gravity for the place of the flight",
        );
    }
    let (measured, when) = if stationary.is_empty() {
        // Where start and end velocity are equal, the mean specific force is gravity, measured in a tilting frame.
        let norms: Vec<f64> = samples.iter().map(|sample| sample.specific_force_m_per_s2.norm()).collect();
        (median(&norms), "median over the flight")
    } else {
        let norms: Vec<f64> = stationary.iter().map(|window| window.mean_force.norm()).collect();
        (median(&norms), "while stationary")
    };
    let difference = measured - gravity;
    let evidence = format!("|a| is {measured:.3} m/s² {when}, gravity {gravity:.3}: {difference:+.3} m/s²");
    if measured < NO_FORCE_M_PER_S2 {
        let quoted: Vec<String> = other_topics.iter().map(|topic| format!("'{topic}'")).collect();
        let remedy = if quoted.is_empty() {
            "record the accelerometer, too".to_owned()
        } else {
            format!("name the accelerometer's topic in imu0.accelerometer_rostopic: one of {}", quoted.join(", "))
        };
        return findings.add(
            Severity::Error,
            Area::Imu,
            "the IMU's messages have no specific force",
            evidence,
            &remedy,
        );
    }
    let (severity, title, remedy) = if (measured - 1.0).abs() < 0.2 {
        (
            Severity::Error,
            "accelerations are in g, not m/s²",
            "multiply by 9.80665 in the driver: sensor_msgs/Imu requires m/s²",
        )
    } else if difference.abs() > 2.0 {
        (
            Severity::Error,
            "the accelerometer does not measure gravity",
            "check units, scale and IMU intrinsics in the driver: while stationary the norm must be gravity",
        )
    } else if difference.abs() > 0.2 && !stationary.is_empty() {
        (
            if difference.abs() > 1.0 { Severity::Warning } else { Severity::Note },
            "the accelerometer has a large bias or scale error along gravity",
            "the estimator finds the bias once the vehicle moves; expect a slow start, or calibrate the IMU",
        )
    } else {
        return findings.good(Area::Imu, "the accelerometer measures gravity", evidence);
    };
    findings.add(severity, Area::Imu, title, evidence, remedy);
}

fn check_gyroscope_bias(stationary: &[Window], findings: &mut Findings) -> Option<Vector3<f64>> {
    if stationary.is_empty() {
        return None;
    }
    let rates: Vec<Vector3<f64>> = stationary.iter().map(|window| window.mean_rate).collect();
    // The median of each axis is insensitive to slow rotation in some of the windows.
    let axis = |index: usize| median(&rates.iter().map(|rate| rate[index]).collect::<Vec<_>>());
    let bias = Vector3::new(axis(0), axis(1), axis(2));
    let evidence = format!("({:+.4}, {:+.4}, {:+.4}) rad/s while stationary or hovering", bias.x, bias.y, bias.z);
    if bias.norm() > 0.03 {
        let remedy = "calibrate the gyroscope before the flight, unless the vehicle rotated slowly all the time";
        findings.add(Severity::Note, Area::Imu, "the gyroscope's bias is large", evidence, remedy);
    } else {
        findings.good(Area::Imu, "the gyroscope's bias is small", evidence);
    }
    Some(bias)
}

/// White noise against the rig's densities, and vibration. `rates_hz` are those of the IMU and of an accelerometer of its own.
fn check_noise(
    [imu_rate_hz, accelerometer_rate_hz]: [Option<f64>; 2],
    windows: &[Window],
    stationary: &[Window],
    rig: Option<&Rig>,
    findings: &mut Findings,
) {
    let Some(imu_rate_hz) = imu_rate_hz else { return };
    let rate_hz = |gyroscope: bool| accelerometer_rate_hz.filter(|_| !gyroscope).unwrap_or(imu_rate_hz);
    let average = |window: &Window, gyroscope: bool| {
        let white = if gyroscope { window.white_rate } else { window.white_force };
        (white.norm_squared() / 3.0).sqrt() / rate_hz(gyroscope).sqrt()
    };
    let quiet_when = if stationary.is_empty() { "in the quietest 10 % of the flight" } else { "while stationary" };
    let sensors = [
        ("gyroscope", true, rig.map(|rig| rig.imu.noise.gyroscope_noise_density), "rad/s/√Hz"),
        ("accelerometer", false, rig.map(|rig| rig.imu.noise.accelerometer_noise_density), "m/s²/√Hz"),
    ];
    for (name, gyroscope, given, unit) in sensors {
        let all: Vec<f64> = windows.iter().map(|window| average(window, gyroscope)).collect();
        let stationary_noise: Vec<f64> = stationary.iter().map(|window| average(window, gyroscope)).collect();
        let quiet = if stationary_noise.is_empty() { percentile(&all, 0.1) } else { median(&stationary_noise) };
        let flight = percentile(&all, 0.9);
        if quiet > 0.0 && flight > 10.0 * quiet {
            let evidence = format!("{flight:.2e} {unit} in the noisiest 10 % of the windows, {quiet:.2e} {quiet_when}");
            let remedy = "isolate the IMU from vibration, or raise the noise density to the value in flight";
            findings.add(Severity::Note, Area::Imu, format!("vibration on the {name} in flight"), evidence, remedy);
        }
        let Some(given) = given else { continue };
        compare_density(name, (quiet, quiet_when), given, unit, rate_hz(gyroscope), findings);
    }
}

fn compare_density(
    name: &str,
    (measured, when): (f64, &str),
    given: f64,
    unit: &str,
    rate_hz: f64,
    findings: &mut Findings,
) {
    let ratio = measured / given;
    let evidence = format!("{measured:.2e} {unit} measured {when} at {rate_hz:.0} Hz, {given:.2e} in the rig");
    // A density confused with the noise of one sample differs by √rate.
    let discrete = |ratio: f64| (ratio.ln() - 0.5 * rate_hz.ln()).abs() < 0.3;
    let field = format!("imu0.{name}_noise_density");
    if ratio > NOISE_TOO_SMALL {
        let hint = if discrete(ratio) { " (it appears to have been divided by √rate twice)" } else { "" };
        let remedy =
            format!("raise {field} to {:.1e}{hint}; estimators need 2 to 10 times the measured value", 2.0 * measured);
        let title = format!("{name} noise in the rig is {ratio:.1} times too small");
        findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
    } else if ratio < 1.0 / NOISE_TOO_LARGE || (measured > 0.0 && discrete(1.0 / ratio)) {
        let hint =
            if discrete(1.0 / ratio) { ": it appears to be the noise of one sample; divide it by √rate" } else { "" };
        let remedy = format!("{field} is a continuous-time density in {unit}{hint}");
        let title = format!("{name} noise in the rig is {:.0} times too large", 1.0 / ratio);
        findings.add(Severity::Note, Area::Imu, title, evidence, remedy);
    } else {
        findings.good(Area::Imu, format!("{name} noise agrees with the rig"), evidence);
    }
}

/// Saturation (many samples at exactly the largest value) and samples that repeat.
fn check_clipping(samples: &[ImuSample], findings: &mut Findings) {
    let components = |gyroscope: bool, axis: usize| {
        samples.iter().map(move |sample| {
            if gyroscope { sample.angular_velocity_rad_per_s[axis] } else { sample.specific_force_m_per_s2[axis] }
        })
    };
    let mut largest = [0.0_f64; 2];
    let mut clipped = false;
    for (name, gyroscope) in [("gyroscope", true), ("accelerometer", false)] {
        for axis in 0..3 {
            let limit = components(gyroscope, axis).map(f64::abs).fold(0.0, f64::max);
            let hits = components(gyroscope, axis).filter(|value| value.abs() >= limit).count();
            largest[usize::from(!gyroscope)] = largest[usize::from(!gyroscope)].max(limit);
            if hits >= 3 && hits < samples.len() / 2 && limit > if gyroscope { 1.0 } else { 12.0 } {
                clipped = true;
                let unit = if gyroscope { "rad/s" } else { "m/s²" };
                let title = format!("the {name} saturates on {}", ["x", "y", "z"][axis]);
                let evidence = format!("{hits} samples at exactly ±{limit:.4} {unit}");
                let remedy =
                    "set a wider range in the sensor, or reduce vibration: clipped samples bias the preintegration";
                findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
            }
        }
    }
    let evidence = format!("largest values {:.2} rad/s and {:.1} m/s²", largest[0], largest[1]);
    if largest[0] > 35.0 {
        let remedy = "check the unit: sensor_msgs/Imu requires rad/s, and 35 rad/s is 2000 °/s";
        findings.add(Severity::Error, Area::Imu, "angular velocities appear to be in degrees", evidence, remedy);
    } else if !clipped {
        findings.good(Area::Imu, "the IMU does not saturate", evidence);
    }
    let same = samples.windows(2).filter(|pair| {
        pair[0].angular_velocity_rad_per_s == pair[1].angular_velocity_rad_per_s
            && pair[0].specific_force_m_per_s2 == pair[1].specific_force_m_per_s2
    });
    let repeated = same.count();
    if repeated * 100 > samples.len() {
        let evidence = format!("{repeated} of {} samples equal the previous one in all six values", samples.len());
        let remedy = "the driver sends faster than the sensor measures, or fills gaps: send each measurement once";
        findings.add(Severity::Warning, Area::Imu, "IMU samples repeat", evidence, remedy);
    }
}

/// Periods in which the vehicle is stationary or hovers, where motion neither initializes nor calibrates anything.
fn check_stationary(windows: &[Window], findings: &mut Findings) {
    let total_s: f64 = windows.iter().map(|window| seconds_from_ns(window.end_ns - window.start_ns)).sum();
    let mut periods: Vec<(i64, i64)> = Vec::new();
    for window in windows.iter().filter(|window| window.stationary) {
        match periods.last_mut().filter(|last| window.start_ns - last.1 < WINDOW_NS / 2) {
            Some(last) => last.1 = window.end_ns,
            None => periods.push((window.start_ns, window.end_ns)),
        }
    }
    periods.retain(|(begin, end)| end - begin >= 2 * WINDOW_NS);
    let stationary_s: f64 = periods.iter().map(|(begin, end)| seconds_from_ns(end - begin)).sum();
    if periods.is_empty() {
        let title = "the vehicle is never stationary";
        let remedy = "initialization needs motion; biases cannot be measured directly";
        return findings.add(
            Severity::Note,
            Area::Motion,
            title,
            format!("no stationary interval of 1 s in {total_s:.0} s"),
            remedy,
        );
    }
    let listed: Vec<String> = periods
        .iter()
        .take(6)
        .map(|(begin, end)| format!("{:.1}–{:.1} s", seconds_from_ns(*begin), seconds_from_ns(*end)))
        .collect();
    let evidence = format!("{stationary_s:.1} of {total_s:.1} s: {}", listed.join(", "));
    let remedy = "scale and calibration are unobservable there; initialization needs motion";
    let severity = if stationary_s > 0.5 * total_s { Severity::Warning } else { Severity::Note };
    findings.add(severity, Area::Motion, "the vehicle is stationary or hovers", evidence, remedy);
}
