//! Relative pose of the cameras of a stereo pair, from the features that both observe at one moment.
//!
//! The features are matched without the epipolar geometry of the rig. With R and t of the rig, a change φ of the rotation, a
//! change of the direction of t and a time τ by which the second camera exposes later than its stamp, the residual of a
//! match is Sampson's distance of
//!
//! ```text
//! e = f'ᵀ [t]× Exp(−ω' τ) R Exp(φ) f
//! ```
//!
//! with the angular rate ω' of the second camera. All six values are fitted together by robust least squares. The matches do
//! not determine the length of the baseline: distances by motion and IMU do, whose ratio to those by the pair is given.

use nalgebra::{Const, Matrix6, SVector, UnitQuaternion, Vector3, Vector6};

use super::report::{Area, CheckReport, Findings, Severity};
use crate::geometry::{RigidTransform, median, seconds_from_ns, so3, tangent_basis};
use crate::optimization::{NormalEquations, gauss_newton};
use crate::sensors::{CameraRig, Rig};

/// Features that both cameras of a pair observe at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct PairMatches {
    /// Stamp of the first camera's image since the log began.
    pub stamp_ns: i64,
    /// Angular rate of the second camera in its frame, in rad/s.
    pub rate_rad_per_s: Vector3<f64>,
    /// Unit bearings in the first and in the second camera.
    pub bearings: Vec<[Vector3<f64>; 2]>,
}

/// Measurements of a stereo pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PairMeasurement {
    /// Keys of both cameras; the pose of the second one is known relative to the first one.
    pub keys: [String; 2],
    pub matches: Vec<PairMatches>,
    /// Median time between an image of the first camera and the nearest one of the second, on the IMU's clock; `None` if one
    /// of them has no images.
    pub apart_s: Option<f64>,
    /// Ratios of distances by motion and IMU to those by the pair, each with its standard deviation.
    pub distance_ratios: Vec<(f64, f64)>,
}

/// Largest time between the images of a pair that is triggered together.
const TOGETHER_S: f64 = 0.0005;
/// Smallest number of matches and of images with them for a fit.
const MIN_MATCHES: usize = 100;
const MIN_IMAGES: usize = 4;
/// Noise of a bearing's coordinate on which the matches of two different cameras agree, in radians.
const BEARING_SIGMA_RAD: f64 = 0.001;
/// Standard deviations from which on a value is a fault.
const SIGNIFICANT: f64 = 5.0;
/// Smallest reported rotation: it shifts images by a pixel.
const WRONG_ROTATION_RAD: f64 = 0.004;
/// Smallest reported change of the baseline's direction.
const WRONG_DIRECTION_RAD: f64 = 0.035;
/// Smallest reported time between the exposures.
const WRONG_TIME_S: f64 = 0.002;
/// Smallest reported error of the baseline's length.
const WRONG_BASELINE: f64 = 0.1;
/// Ratio of near matches that are shifted to the wrong side, of a pair that is swapped.
const SWAPPED: f64 = 0.8;
/// Shift along the baseline from which on a match counts as near, in radians.
const NEAR_SHIFT_RAD: f64 = 0.008;

impl CheckReport {
    /// Adds the findings about the stereo pairs of a rig.
    pub fn add_pairs(&mut self, rig: &Rig, pairs: &[PairMeasurement]) {
        let mut findings = Findings::default();
        for pair in pairs {
            check_pair(rig, pair, &mut findings);
        }
        self.findings.extend(findings.list);
        self.findings.sort_by_key(|finding| (std::cmp::Reverse(finding.severity), finding.area));
    }
}

/// A pair with its pose by the rig.
struct Pair<'a> {
    first: &'a CameraRig,
    second: &'a CameraRig,
    second_from_first: RigidTransform,
    measured: &'a PairMeasurement,
}

fn check_pair(rig: &Rig, measured: &PairMeasurement, findings: &mut Findings) {
    let [first, second] = &measured.keys;
    let pose = rig.base_from_camera(Some(first), second);
    let (Ok(first), Ok(second), Some(pose)) = (rig.camera(first), rig.camera(second), pose) else { return };
    let pair = Pair { first, second, second_from_first: pose.inverse(), measured };
    if pair.check_stamps(findings) {
        pair.check_pose(findings);
        pair.check_baseline(findings);
    }
}

impl Pair<'_> {
    fn names(&self) -> String {
        format!("{} and {}", self.first.key, self.second.key)
    }

    fn matches(&self) -> impl Iterator<Item = &[Vector3<f64>; 2]> {
        self.measured.matches.iter().flat_map(|image| &image.bearings)
    }

    /// Checks that the images have common stamps; false if the pair cannot be checked.
    fn check_stamps(&self, findings: &mut Findings) -> bool {
        let names = self.names();
        let Some(apart_s) = self.measured.apart_s else { return false };
        if apart_s > TOGETHER_S {
            let evidence = format!("the nearest images are {:.1} ms apart, median", 1e3 * apart_s);
            let remedy = "trigger both cameras together, or correct timeshift_cam_imu of one of them; features of a stereo \
                          pair are matched between images of one moment only";
            let title = format!("the images of {names} are not of one moment");
            findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
            return false;
        }
        let count = self.matches().count();
        if count >= MIN_MATCHES && self.measured.matches.len() >= MIN_IMAGES {
            return true;
        }
        let evidence = format!("{count} features observed by both, at least {MIN_MATCHES} required");
        let title = format!("the relative pose of {names} is not checked");
        let remedy = "film a scene with texture at 2 to 10 m that both cameras see";
        findings.add(Severity::Note, Area::Extrinsics, title, evidence, remedy);
        false
    }

    /// Ratio of the near matches that are shifted against the baseline of the rig, `None` without near ones.
    fn swapped_ratio(&self) -> Option<f64> {
        let pose = &self.second_from_first;
        let direction = pose.translation_m.normalize();
        let shift = |[first, second]: &[Vector3<f64>; 2]| {
            let rotated = pose.rotation * first;
            let along = direction - rotated * rotated.dot(&direction);
            along.dot(&(second - rotated)) / along.norm().max(1e-6)
        };
        let near: Vec<f64> = self.matches().map(shift).filter(|shift| shift.abs() > NEAR_SHIFT_RAD).collect();
        let wrong = near.iter().filter(|shift| **shift < 0.0).count();
        (near.len() >= MIN_MATCHES / 4).then(|| wrong as f64 / near.len() as f64)
    }

    fn check_pose(&self, findings: &mut Findings) {
        let names = self.names();
        if let Some(ratio) = self.swapped_ratio().filter(|ratio| *ratio > SWAPPED) {
            let evidence = format!("{:.0} % of the near features are shifted to the wrong side", 100.0 * ratio);
            let remedy =
                format!("exchange the topics of {names} in the rig, or invert T_cn_cnm1 of {}", self.second.key);
            let title = format!("{names} are swapped");
            findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
            return;
        }
        let Some(fit) = PairFit::of(&self.second_from_first, &self.measured.matches) else { return };
        let (rotation_rad, rotation_sigma_rad) = fit.length(0, 3);
        let (direction_rad, direction_sigma_rad) = fit.length(3, 2);
        let (time_s, time_sigma_s) = (fit.values[5], fit.sigma(5));
        let is_fault = |value: f64, sigma: f64, least: f64| value.abs() > least.max(SIGNIFICANT * sigma);
        let mut is_right = true;
        if is_fault(time_s, time_sigma_s, WRONG_TIME_S) {
            is_right = false;
            let evidence = format!(
                "{} exposes {:+.1} ± {:.1} ms after its stamp relative to {}, by the rotations of the vehicle",
                self.second.key,
                1e3 * time_s,
                1e3 * time_sigma_s,
                self.first.key
            );
            let remedy = format!(
                "trigger both cameras together, or add {:+.4} s to timeshift_cam_imu of {}",
                time_s, self.second.key
            );
            let title = format!("the images of {names} are not of one moment");
            findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
        }
        if is_fault(rotation_rad, rotation_sigma_rad, WRONG_ROTATION_RAD) {
            is_right = false;
            let degrees = fit.rotation().map(f64::to_degrees);
            let evidence = format!(
                "rotated by {:.2}° ± {:.2}° from T_cn_cnm1, x {:+.2}°, y {:+.2}°, z {:+.2}°, by {} features",
                rotation_rad.to_degrees(),
                rotation_sigma_rad.to_degrees(),
                degrees.x,
                degrees.y,
                degrees.z,
                self.matches().count()
            );
            let remedy = format!("calibrate T_cn_cnm1 of {} again, or correct it by this rotation", self.second.key);
            let title = format!("the orientation of {} relative to {} is wrong", self.second.key, self.first.key);
            findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
        }
        if is_fault(direction_rad, direction_sigma_rad, WRONG_DIRECTION_RAD) {
            is_right = false;
            let evidence = format!(
                "{:.1}° ± {:.1}° from the translation of T_cn_cnm1",
                direction_rad.to_degrees(),
                direction_sigma_rad.to_degrees()
            );
            let remedy = format!("calibrate T_cn_cnm1 of {} again", self.second.key);
            let title = format!("the direction of the baseline of {names} is wrong");
            findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
        }
        if is_right {
            let evidence = format!(
                "orientation {:.2}° ± {:.2}°, direction of the baseline {:.1}° ± {:.1}° from the rig, by {} features",
                rotation_rad.to_degrees(),
                rotation_sigma_rad.to_degrees(),
                direction_rad.to_degrees(),
                direction_sigma_rad.to_degrees(),
                self.matches().count()
            );
            findings.good(Area::Extrinsics, format!("the relative pose of {names} agrees with the images"), evidence);
        }
    }

    /// Compares distances by the pair with those by motion and IMU.
    fn check_baseline(&self, findings: &mut Findings) {
        let usable = || self.measured.distance_ratios.iter().filter(|(ratio, sigma)| *ratio > 0.0 && *sigma > 0.0);
        let weight: f64 = usable().map(|(_, sigma)| sigma.powi(-2)).sum();
        if weight <= 0.0 {
            return;
        }
        let ratio = (usable().map(|(ratio, sigma)| ratio.ln() * sigma.powi(-2)).sum::<f64>() / weight).exp();
        let spread = median(usable().map(|(one, _)| (one / ratio).ln().abs())).unwrap_or(0.0);
        let sigma = weight.sqrt().recip().hypot(spread);
        let error = ratio - 1.0;
        if error.abs() <= WRONG_BASELINE.max(SIGNIFICANT * sigma) {
            return;
        }
        let baseline_m = self.second_from_first.translation_m.norm();
        let evidence = format!(
            "distances by motion and IMU are {:.2} ± {:.2} of those by the pair: a baseline of {:.1} mm, {:.1} mm in the rig",
            ratio,
            sigma,
            1e3 * baseline_m * ratio,
            1e3 * baseline_m
        );
        let remedy = format!("correct the translation of T_cn_cnm1 of {}: it is in metres", self.second.key);
        let title = format!("the baseline of {} is wrong", self.names());
        findings.add(Severity::Error, Area::Extrinsics, title, evidence, remedy);
    }
}

/// Fitted values `[φ; direction of t on its tangent plane; τ]` with their covariance.
struct PairFit {
    values: Vector6<f64>,
    covariance: Matrix6<f64>,
}

/// Estimate of a fit.
#[derive(Clone, Copy)]
struct PairPose {
    rotation: UnitQuaternion<f64>,
    direction: Vector3<f64>,
    delay_s: f64,
}

/// Scales of the robust loss in standard deviations of a bearing, each until convergence.
const SCALES: [f64; 4] = [40.0, 12.0, 4.0, 2.0];
const ROUNDS: usize = 12;
/// Length of a step at which the iterations end.
const CONVERGED: f64 = 1e-8;

impl PairFit {
    /// Robust fit from the pose of the rig; `None` if the values are not determined.
    fn of(second_from_first: &RigidTransform, matches: &[PairMatches]) -> Option<Self> {
        let start = PairPose {
            rotation: second_from_first.rotation,
            direction: second_from_first.translation_m.normalize(),
            delay_s: 0.0,
        };
        // A pose that is nearly right is lost at large scales, at which wrong matches count; a wrong one needs them.
        let fits = (0..SCALES.len()).filter_map(|first| fitted(&start, matches, &SCALES[first..]));
        let last_rad = SCALES[SCALES.len() - 1] * BEARING_SIGMA_RAD;
        let cost =
            |pose: &PairPose| residuals(pose, matches).map(|rad| 1.0 - 1.0 / (1.0 + (rad / last_rad).powi(2))).sum();
        let pose = fits.map(|pose| (cost(&pose), pose)).min_by(|one: &(f64, _), other| one.0.total_cmp(&other.0))?.1;
        let information = equations(&pose, matches, last_rad).hessian * BEARING_SIGMA_RAD.powi(-2);
        let residual_rad = median(residuals(&pose, matches).map(f64::abs))?;
        // The median of the absolute value of a normal variable is 0.6745 of its standard deviation.
        let inflation = (residual_rad / (0.6745 * BEARING_SIGMA_RAD)).max(0.3);
        let covariance = information.cholesky()?.inverse() * inflation.powi(2);
        let rotation = so3::log(&(start.rotation.inverse() * pose.rotation));
        let basis = tangent_basis(&start.direction);
        let direction = basis.transpose() * pose.direction;
        let values = Vector6::new(rotation.x, rotation.y, rotation.z, direction.x, direction.y, pose.delay_s);
        Some(Self { values, covariance })
    }

    fn rotation(&self) -> Vector3<f64> {
        self.values.fixed_rows::<3>(0).into_owned()
    }

    fn sigma(&self, place: usize) -> f64 {
        self.covariance[(place, place)].max(0.0).sqrt()
    }

    /// Length of a part of the values, with its standard deviation in that direction.
    fn length(&self, start: usize, count: usize) -> (f64, f64) {
        let part = self.values.rows(start, count);
        let length = part.norm();
        if length == 0.0 {
            return (0.0, (start..start + count).map(|place| self.sigma(place)).fold(0.0, f64::max));
        }
        let unit = part / length;
        let covariance = self.covariance.view((start, start), (count, count));
        (length, (unit.transpose() * covariance * &unit)[(0, 0)].max(0.0).sqrt())
    }
}

impl PairPose {
    fn plus(&self, step: &SVector<f64, 6>) -> Self {
        let moved = self.direction + tangent_basis(&self.direction) * step.fixed_rows::<2>(3);
        Self {
            rotation: self.rotation * so3::exp(&step.fixed_rows::<3>(0).into_owned()),
            direction: moved.normalize(),
            delay_s: self.delay_s + step[5],
        }
    }

    /// Sampson's distance of a match in radians with its derivatives by a step.
    fn residual(&self, rate_rad_per_s: &Vector3<f64>, [first, second]: &[Vector3<f64>; 2]) -> (f64, Vector6<f64>) {
        let turned = so3::exp(&(rate_rad_per_s * -self.delay_s));
        let rotated = turned * (self.rotation * first);
        let normal = self.direction.cross(&rotated);
        let other = second.cross(&self.direction);
        let e = second.dot(&normal);
        let variance = (normal.norm_squared() + other.norm_squared() - 2.0 * e * e).max(1e-12);
        // e = (f' × t)·(R f): by φ with R f → R f + R (φ × f), by t, and by τ with −ω' × R f.
        let by_rotation = first.cross(&((turned * self.rotation).inverse() * other));
        let by_direction = tangent_basis(&self.direction).transpose() * rotated.cross(second);
        let by_delay = -other.dot(&rate_rad_per_s.cross(&rotated));
        let length = variance.sqrt();
        let jacobian =
            Vector6::new(by_rotation.x, by_rotation.y, by_rotation.z, by_direction.x, by_direction.y, by_delay);
        (e / length, jacobian / length)
    }
}

/// Fit at these scales of the loss one after the other.
fn fitted(start: &PairPose, matches: &[PairMatches], scales: &[f64]) -> Option<PairPose> {
    let mut pose = *start;
    for scale in scales {
        let linearize = |pose: &PairPose| Some(equations(pose, matches, scale * BEARING_SIGMA_RAD));
        gauss_newton(&mut pose, ROUNDS, linearize, |pose, step: &SVector<f64, 6>| {
            *pose = pose.plus(step);
            step.norm() < CONVERGED
        })?;
    }
    Some(pose)
}

fn residuals<'a>(pose: &'a PairPose, matches: &'a [PairMatches]) -> impl Iterator<Item = f64> + 'a {
    let of_image = move |image: &'a PairMatches| {
        image.bearings.iter().map(move |pair| pose.residual(&image.rate_rad_per_s, pair).0)
    };
    matches.iter().flat_map(of_image)
}

/// Normal equations with the weights of the Geman–McClure loss at a scale in radians, and weak priors of 0.1 rad and 50 ms.
fn equations(pose: &PairPose, matches: &[PairMatches], scale_rad: f64) -> NormalEquations<Const<6>> {
    let mut equations = NormalEquations::zeros(Const::<6>);
    for image in matches {
        for pair in &image.bearings {
            let (residual, jacobian) = pose.residual(&image.rate_rad_per_s, pair);
            let weight = (1.0 + (residual / scale_rad).powi(2)).powi(-2);
            equations.hessian += jacobian * jacobian.transpose() * weight;
            equations.gradient += jacobian * (residual * weight);
        }
    }
    let prior = Vector6::new(0.1, 0.1, 0.1, 0.1, 0.1, 0.05);
    for (place, sigma) in prior.iter().enumerate() {
        equations.hessian[(place, place)] += (BEARING_SIGMA_RAD / sigma).powi(2);
    }
    equations
}

/// Stamps of two cameras with the time between an image of the first one and the nearest one of the second, in seconds.
pub fn median_apart_s(first_ns: &[i64], second_ns: &[i64]) -> Option<f64> {
    let nearest = |at_ns: &i64| {
        let place = second_ns.partition_point(|stamp_ns| stamp_ns < at_ns);
        let before = place.checked_sub(1).and_then(|place| second_ns.get(place));
        before.into_iter().chain(second_ns.get(place)).map(|stamp_ns| (stamp_ns - at_ns).abs()).min()
    };
    median(first_ns.iter().filter_map(nearest).map(seconds_from_ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;
    use crate::simulation::{SyntheticMount, SyntheticOptions, synthetic_tracks};

    fn rig() -> Rig {
        let options = SyntheticOptions {
            mount: SyntheticMount::Static,
            beside: true,
            duration_s: 0.1,
            ..SyntheticOptions::default()
        };
        synthetic_tracks(&options).true_rig
    }

    /// Matches of points at 2 to 12 m at different rates, with noise of 0.3 px and some wrong ones.
    fn measured(rig: &Rig, delay_s: f64) -> PairMeasurement {
        let second_from_first = rig.base_from_camera(Some("cam0"), "cam1").unwrap().inverse();
        let mut random = SplitMix64::new(3);
        let mut unit = move || random.next_unit();
        let matches = (0..12).map(|image| {
            let rate_rad_per_s = Vector3::new(0.8 * unit() - 0.4, 1.2 * unit() - 0.6, 0.6 * unit() - 0.3);
            let mut bearings = Vec::new();
            for number in 0..40 {
                let distance_m = 2.0 + 10.0 * unit();
                let point_m = Vector3::new(1.2 * unit() - 0.6, 0.9 * unit() - 0.45, 1.0).normalize() * distance_m;
                let mut there = so3::exp(&(rate_rad_per_s * -delay_s)) * second_from_first.transform(&point_m);
                if number % 9 == 0 {
                    there += Vector3::new(unit(), unit(), 0.0);
                }
                let noise = Vector3::new(unit() - 0.5, unit() - 0.5, 0.0) * 0.002;
                bearings.push([point_m.normalize(), (there.normalize() + noise).normalize()]);
            }
            PairMatches { stamp_ns: image * 1_000_000_000, rate_rad_per_s, bearings }
        });
        PairMeasurement {
            keys: ["cam0", "cam1"].map(str::to_owned),
            matches: matches.collect(),
            apart_s: Some(0.0),
            distance_ratios: vec![(1.01, 0.02), (0.99, 0.03)],
        }
    }

    fn findings(rig: &Rig, pair: &PairMeasurement) -> Vec<(Severity, String, String)> {
        let mut findings = Findings::default();
        check_pair(rig, pair, &mut findings);
        findings.list.into_iter().map(|finding| (finding.severity, finding.title, finding.evidence)).collect()
    }

    #[test]
    fn a_right_pair_agrees_and_each_fault_of_a_pair_is_named() {
        let truth = rig();
        let pair = measured(&truth, 0.0);
        let found = findings(&truth, &pair);
        assert!(found.len() == 1 && found[0].1.contains("agrees with the images"), "{found:?}");

        let pose = truth.base_from_camera(Some("cam0"), "cam1").unwrap();
        let with_pose = |pose| {
            let mut rig = truth.clone();
            rig.set_base_from_camera(Some("cam0"), "cam1", pose);
            rig
        };
        let named = |rig: &Rig, pair: &PairMeasurement, title: &str, evidence: &str| {
            let found = findings(rig, pair);
            let errors: Vec<_> = found.iter().filter(|(severity, ..)| *severity >= Severity::Warning).collect();
            let is_named = errors.len() == 1 && errors[0].1.contains(title) && errors[0].2.contains(evidence);
            assert!(is_named, "expected '{title}' with '{evidence}': {found:?}");
        };
        named(&with_pose(pose.inverse()), &pair, "are swapped", "wrong side");
        let turn = so3::exp(&Vector3::new(0.0, 0.0, 0.02));
        let turned = with_pose(RigidTransform::new(pose.rotation * turn, pose.translation_m));
        named(&turned, &pair, "the orientation of cam1 relative to cam0 is wrong", "rotated by 1.1");
        named(&truth, &measured(&truth, 0.012), "not of one moment", "exposes +1");
        let apart = PairMeasurement { apart_s: Some(0.02), ..pair.clone() };
        named(&truth, &apart, "not of one moment", "20.0 ms apart");
        let long = PairMeasurement { distance_ratios: vec![(0.8, 0.02), (0.79, 0.03)], ..pair.clone() };
        named(&truth, &long, "the baseline of cam0 and cam1 is wrong", "120.");
        let few = PairMeasurement { matches: pair.matches[..2].to_vec(), ..pair };
        let found = findings(&truth, &few);
        assert!(found.len() == 1 && found[0].1.contains("is not checked"), "{found:?}");
    }

    #[test]
    fn stamps_are_compared_with_the_nearest_ones() {
        let first: Vec<i64> = (0..10).map(|number| number * 100_000_000).collect();
        let later: Vec<i64> = first.iter().map(|stamp_ns| stamp_ns + 11_000_000).collect();
        assert!(median_apart_s(&first, &later).is_some_and(|apart_s| (apart_s - 0.011).abs() < 1e-12));
        assert_eq!(median_apart_s(&first, &[]), None);
    }
}
