//! Interpretation of a gimbal's attitude checked by the rotations in the images: frame, axes, order, signs, unit and
//! time offset that predict them, if the rig's do not.

mod meanings;
#[cfg(test)]
mod tests;

use nalgebra::{Unit, UnitQuaternion, Vector3};

use self::meanings::{changes, corrected, difference};
use crate::faults::FaultKind;
use crate::geometry::{ns_from_seconds, principal_angle, seconds_from_ns, so3};
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::{Area, Findings, ImageRotation, Measurement, Severity};
use crate::log_check::statistics::median;
use crate::log_check::survey::Survey;
use crate::log_check::survey::attitude::AttitudeSurvey;
use crate::sensors::{AttitudeSource, CameraMount, GimbalRig, Rig};

/// Consecutive image rotations that are joined to one: over a third of a second the rotation exceeds the errors of
/// attitudes at 10 Hz.
const JOINED: usize = 6;
/// Minimum number of joined rotations.
const MIN_SPANS: usize = 20;
/// Minimum median rotation of camera or vehicle over such an interval that distinguishes interpretations.
const MIN_ROTATION_RAD: f64 = 0.02;
/// An interpretation fits if its misfit is below this ratio of the rotation.
const FITTING_RATIO: f64 = 0.25;
/// Another interpretation is preferred if its misfit is below this ratio of the rig's.
const BETTER_RATIO: f64 = 0.6;
/// Quaternions are wrong if their correction leaves this ratio of the misfit of an interpretation that fits.
const WRONG_QUATERNIONS: f64 = 0.4;
/// Time offsets (`t_imu = t_gimbal + shift`) beyond the rig's with which every interpretation is tried: delays of
/// gimbals reach 0.2 s.
const COARSE_SHIFTS_S: [f64; 5] = [0.0, -0.05, -0.1, -0.15, -0.2];
/// Largest magnitude of a time offset in the search.
const MAX_SHIFT_S: f64 = 0.3;
/// Step of the search for the time offset.
const SHIFT_STEP_S: f64 = 0.01;
/// Smallest reported time offset: stamps of gimbals at 50 Hz are no more accurate.
const SHIFT_TOLERANCE_S: f64 = 0.01;
/// Smallest reported offset of the first joint.
const OFFSET_TOLERANCE_RAD: f64 = 0.026;
/// Minimum relative decrease of the squared misfit by a time offset or a joint offset.
const MIN_GAIN: f64 = 0.2;
/// Steps of the coarse and the fine search for an offset of the first joint, in degrees.
const OFFSET_STEPS_DEG: [f64; 2] = [10.0, 1.0];
/// Number of coarse and of fine steps to either side: half a revolution, and one coarse step.
const OFFSET_STEPS: [i32; 2] = [18, 10];

/// Interpretation that fits the images, in place of the rig's.
pub(crate) struct FittedSource {
    pub(crate) source: AttitudeSource,
    pub(crate) timeshift_s: f64,
}

/// Joined rotation of the camera.
#[derive(Clone)]
struct Span {
    /// Stamps of the first and the last image, in IMU time.
    from_ns: i64,
    to_ns: i64,
    /// Rotation vector measured from the images, second from first, in radians.
    measured: Vector3<f64>,
    /// Rotation of the IMU, second from first.
    of_imu: UnitQuaternion<f64>,
}

/// Rotations of the gimbal camera and the attitudes that predict them.
struct SourceFit<'a> {
    attitude: &'a AttitudeSurvey,
    spans: Vec<Span>,
    /// Rotation of an orientation by the rig's offset of the first joint.
    offset: UnitQuaternion<f64>,
}

/// Interpretation with its misfit in radians, at the best time offset.
#[derive(Clone)]
struct Meaning {
    source: AttitudeSource,
    misfit_rad: f64,
}

/// Compares the rig's source with alternatives; returns the one that fits, or `None`.
pub(crate) fn check_source(
    survey: &Survey,
    rig: &Rig,
    imu_facts: &ImuFacts,
    rotations: &[ImageRotation],
    findings: &mut Findings,
) -> Option<FittedSource> {
    if !findings.can_compare(Measurement::Gyroscope) {
        return None;
    }
    let (attitude, gimbal) = (survey.attitude.as_ref()?, rig.gimbal.as_ref()?);
    let source = gimbal.attitude.as_ref()?;
    let camera = rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal)?;
    let of_camera: Vec<&ImageRotation> =
        rotations.iter().filter(|rotation| rotation.camera_key == camera.key).collect();
    let spans = spans(&of_camera, camera.timeshift_cam_imu_s, imu_facts);
    let fit = SourceFit { attitude, spans, offset: about_first_joint(gimbal, -source.first_joint_offset_rad) };
    let rotation_rad = fit.rotation_rad();
    if fit.spans.len() < MIN_SPANS || rotation_rad < MIN_ROTATION_RAD {
        let title = "too little rotation to compare the gimbal's attitude with the images";
        let evidence = format!("{} rotations, {:.2}° in the median", fit.spans.len(), rotation_rad.to_degrees());
        findings.add(Severity::Note, Area::Encoders, title, evidence, "rotate vehicle and camera about all axes");
        return None;
    }
    let given_s = gimbal.timeshift_gimbal_imu_s;
    let given = fit.best_shift(source, given_s);
    let others = fit.single_changes(source, given_s);
    let best = fit.best_of(&given, &others, given_s);
    let listed = listed(gimbal, source, &given, &others);
    let fits = best.misfit_rad < FITTING_RATIO * rotation_rad;
    if !fits {
        findings.exclude(Measurement::Joints);
        if fit.check_quaternions(source, given_s, FITTING_RATIO * rotation_rad, &listed, findings) {
            return None;
        }
        let title = "no interpretation of gimbal.source predicts the rotations in the images";
        let evidence = format!("rotations of {:.2}° in the median; {listed}", rotation_rad.to_degrees());
        let remedy =
            "check its topic, the stamps, and gimbal_axes and imu_axes; then the findings on time and intrinsics";
        findings.add(Severity::Warning, Area::Encoders, title, evidence, remedy);
        return None;
    }
    let better = best.misfit_rad < BETTER_RATIO * given.misfit_rad;
    if fit.check_quaternions(source, given_s, WRONG_QUATERNIONS * best.misfit_rad, &listed, findings) {
        findings.exclude(Measurement::Joints);
        return None;
    }
    let (chosen, equivalent) =
        if better { fit.within_reach(gimbal, best, &others) } else { (given.clone(), Vec::new()) };
    let evidence = format!(
        "rotations of {:.2}° in the median differ from the images' by {:.3}°; {listed}",
        rotation_rad.to_degrees(),
        chosen.misfit_rad.to_degrees()
    );
    if better {
        let all = std::iter::once(&chosen).chain(&equivalent).map(|it| difference(gimbal, source, &it.source));
        let changes = all.collect::<Vec<_>>().join(", or ");
        let title = format!("gimbal.source is wrong; correct values: {changes}");
        let remedy = format!("set {changes} in gimbal.source");
        findings.add(Severity::Error, Area::Encoders, title, evidence, remedy);
        findings.state_faults([FaultKind::UnusableJoints.into()]);
    } else {
        findings.good(Area::Encoders, "gimbal.source predicts the rotations in the images", evidence);
    }
    let timeshift_s = fit.check_shift(&chosen, given_s, findings);
    fit.check_first_joint(&chosen, timeshift_s, gimbal, findings);
    Some(FittedSource { source: chosen.source, timeshift_s })
}

/// Joins consecutive rotations, starting at every image, if the IMU covers them.
fn spans(rotations: &[&ImageRotation], timeshift_s: f64, imu_facts: &ImuFacts) -> Vec<Span> {
    let shift_ns = ns_from_seconds(timeshift_s);
    let joined = |few: &[&ImageRotation]| {
        let gapless = few.windows(2).all(|pair| pair[0].to_ns == pair[1].from_ns);
        let (first, last) = (few.first()?, few.last().filter(|_| gapless)?);
        let rotation = few.iter().fold(UnitQuaternion::identity(), |before, next| next.second_from_first * before);
        let (from_ns, to_ns) = (first.from_ns + shift_ns, last.to_ns + shift_ns);
        let of_imu = imu_facts.gyroscope.rotation_between(seconds_from_ns(from_ns), seconds_from_ns(to_ns))?;
        Some(Span { from_ns, to_ns, measured: so3::log(&rotation), of_imu })
    };
    rotations.windows(JOINED).filter_map(joined).collect()
}

impl SourceFit<'_> {
    /// The larger of the median rotations of camera and IMU: a stabilized camera hardly rotates, but a wrong
    /// interpretation predicts that it does.
    fn rotation_rad(&self) -> f64 {
        let of_camera: Vec<f64> = self.spans.iter().map(|span| span.measured.norm()).collect();
        let of_imu: Vec<f64> = self.spans.iter().map(|span| span.of_imu.angle()).collect();
        median(&of_camera).max(median(&of_imu))
    }

    /// Median difference of predicted and measured rotations in radians, with the rig's offset of the first joint.
    fn misfit(&self, source: &AttitudeSource, shift_s: f64) -> f64 {
        self.misfit_with(source, shift_s, &self.offset)
    }

    /// [`Self::misfit`] with another rotation about the axis of the first joint.
    fn misfit_with(&self, source: &AttitudeSource, shift_s: f64, first_joint: &UnitQuaternion<f64>) -> f64 {
        let shift_ns = ns_from_seconds(shift_s);
        let difference = |span: &Span| {
            let from = first_joint * self.attitude.orientation_at(source, shift_ns, span.from_ns)?;
            let to = first_joint * self.attitude.orientation_at(source, shift_ns, span.to_ns)?;
            Some((so3::log(&(to.inverse() * span.of_imu * from)) - span.measured).norm())
        };
        let differences: Vec<f64> = self.spans.iter().filter_map(difference).collect();
        // An interpretation without a value at most times (no heading, alternating frames) is rejected.
        if differences.len() * 2 < self.spans.len() { f64::INFINITY } else { median(&differences) }
    }

    fn best_shift(&self, source: &AttitudeSource, given_s: f64) -> Meaning {
        let at = |shift_s: &f64| self.misfit(source, given_s + shift_s);
        let misfit_rad = COARSE_SHIFTS_S.iter().map(at).fold(f64::INFINITY, f64::min);
        Meaning { source: source.clone(), misfit_rad }
    }

    /// Interpretations that differ from `source` in one property, grouped by property.
    fn single_changes(&self, source: &AttitudeSource, given_s: f64) -> Vec<Vec<Meaning>> {
        let of = |sources: Vec<AttitudeSource>| {
            sources.iter().map(|source| self.best_shift(source, given_s)).collect::<Vec<_>>()
        };
        changes(source, self.attitude.has_vehicle()).into_iter().map(of).collect()
    }

    /// Interpretation with the least misfit among the given one, its single changes, and second changes of the best of
    /// these.
    fn best_of(&self, given: &Meaning, others: &[Vec<Meaning>], given_s: f64) -> Meaning {
        /// Number of single changes from which a second one is tried.
        const FOLLOWED: usize = 12;
        /// Equivalent interpretations differ by rounding errors; the one with fewer changes is kept.
        const CLEARLY: f64 = 0.95;
        let clearly_better = |best: Meaning, other: &Meaning| {
            if other.misfit_rad < CLEARLY * best.misfit_rad { other.clone() } else { best }
        };
        let mut singles: Vec<&Meaning> = others.iter().flatten().collect();
        singles.sort_by(|a, b| a.misfit_rad.total_cmp(&b.misfit_rad));
        let mut best = singles.iter().copied().fold(given.clone(), clearly_better);
        for single in singles.iter().take(FOLLOWED) {
            let further = self.single_changes(&single.source, given_s);
            best = further.iter().flatten().fold(best, clearly_better);
        }
        best
    }

    /// Of the best interpretation and single changes that predict the rotations as well, the one whose attitudes the joints
    /// can reach, with those that they reach as well.
    fn within_reach(&self, gimbal: &GimbalRig, best: Meaning, others: &[Vec<Meaning>]) -> (Meaning, Vec<Meaning>) {
        /// Largest ratio of the misfits of equivalent interpretations.
        const EQUIVALENT: f64 = 1.1;
        /// Largest difference of the median distances to the reachable attitudes, in radians.
        const SAME_REACH_RAD: f64 = 0.01;
        let is_equivalent =
            |other: &&Meaning| other.misfit_rad < EQUIVALENT * best.misfit_rad && other.source != best.source;
        let all: Vec<Meaning> = others.iter().flatten().filter(is_equivalent).cloned().collect();
        if all.is_empty() {
            return (best, all);
        }
        let distance_rad = |meaning: &Meaning| {
            let gimbal = GimbalRig { attitude: Some(meaning.source.clone()), ..gimbal.clone() };
            median(&self.attitude.solve(&gimbal).iter().map(|solved| solved.unreachable_rad).collect::<Vec<_>>())
        };
        let of_best = distance_rad(&best);
        let distances: Vec<f64> = all.iter().map(distance_rad).collect();
        let least = distances.iter().copied().fold(of_best, f64::min);
        let is_near = |distance: f64| distance < least + SAME_REACH_RAD;
        let mut near: Vec<Meaning> = all
            .into_iter()
            .zip(distances)
            .filter(|(_, distance)| is_near(*distance))
            .map(|(meaning, _)| meaning)
            .collect();
        if is_near(of_best) {
            return (best, near);
        }
        // One of them has the least distance.
        let chosen = near.remove(0);
        (chosen, near)
    }

    /// Reports quaternions that were filled in wrongly, if their correction predicts the rotations to a misfit in radians;
    /// returns true if it does.
    fn check_quaternions(
        &self,
        source: &AttitudeSource,
        given_s: f64,
        largest_rad: f64,
        listed: &str,
        findings: &mut Findings,
    ) -> bool {
        let rotation_rad = self.rotation_rad();
        let tried = corrected(self.attitude).into_iter().map(|corrected| {
            let fit = SourceFit { attitude: &corrected.attitude, spans: self.spans.clone(), offset: self.offset };
            let misfit_rad = fit.best_shift(source, given_s).misfit_rad;
            (misfit_rad, corrected.fault)
        });
        let Some((misfit_rad, fault)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else { return false };
        if misfit_rad > largest_rad {
            return false;
        }
        let evidence = format!(
            "rotations of {:.2}° in the median then differ from the images' by {:.3}°; {listed}",
            rotation_rad.to_degrees(),
            misfit_rad.to_degrees()
        );
        let remedy =
            "correct the driver: geometry_msgs/Quaternion maps the body to its reference, with the fields x, y, z, w";
        findings.add(Severity::Error, Area::Encoders, fault, evidence, remedy);
        findings.state_faults([FaultKind::UnusableJoints.into()]);
        true
    }

    /// Time offset of the gimbal with the least misfit, in seconds.
    fn check_shift(&self, chosen: &Meaning, given_s: f64, findings: &mut Findings) -> f64 {
        let steps = (MAX_SHIFT_S / SHIFT_STEP_S).round() as i32;
        let cost = |step: i32| {
            let shift_s = given_s + f64::from(step) * SHIFT_STEP_S;
            (shift_s, self.misfit(&chosen.source, shift_s))
        };
        let costs: Vec<(f64, f64)> = (-steps..=steps).map(cost).collect();
        let best = (0..costs.len()).min_by(|a, b| costs[*a].1.total_cmp(&costs[*b].1)).unwrap_or(steps as usize);
        let (unshifted, least) = (costs[steps as usize].1, costs[best].1);
        let shift_s = vertex(&costs, best, SHIFT_STEP_S);
        let evidence = format!(
            "rotations in the images differ by {:.3}° from those predicted, by {:.3}° with timeshift_gimbal_imu {shift_s:+.3} s",
            unshifted.to_degrees(),
            least.to_degrees()
        );
        let topic = self.attitude.topic();
        let gain = 1.0 - (least / unshifted.max(f64::MIN_POSITIVE)).powi(2);
        if (shift_s - given_s).abs() < SHIFT_TOLERANCE_S || gain < MIN_GAIN {
            findings.good(Area::Time, format!("{topic} and the images are synchronized"), evidence);
            return given_s;
        }
        let title = format!("time offset of {topic} to the IMU: {:+.0} ms", (shift_s - given_s) * 1e3);
        let remedy = format!("set gimbal.timeshift_gimbal_imu to {shift_s:+.3}");
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
        shift_s
    }

    /// Reports an offset of the first joint that decreases the misfit: a yaw relative to another direction.
    fn check_first_joint(&self, chosen: &Meaning, shift_s: f64, gimbal: &GimbalRig, findings: &mut Findings) {
        let given_rad = chosen.source.first_joint_offset_rad;
        let cost = |change_rad: f64| {
            let first_joint = about_first_joint(gimbal, -given_rad - change_rad);
            (change_rad, self.misfit_with(&chosen.source, shift_s, &first_joint))
        };
        let scan = |middle_rad: f64, step_rad: f64, steps: i32| {
            let costs: Vec<(f64, f64)> =
                (-steps..=steps).map(|step| cost(middle_rad + f64::from(step) * step_rad)).collect();
            let best = (0..costs.len()).min_by(|a, b| costs[*a].1.total_cmp(&costs[*b].1)).unwrap_or(0);
            (vertex(&costs, best, step_rad), costs[best].1)
        };
        let [coarse_step_rad, fine_step_rad] = OFFSET_STEPS_DEG.map(f64::to_radians);
        let (coarse_rad, _) = scan(0.0, coarse_step_rad, OFFSET_STEPS[0]);
        let (offset_rad, least) = scan(coarse_rad, fine_step_rad, OFFSET_STEPS[1]);
        let unturned = cost(0.0).1;
        let gain = 1.0 - (least / unturned.max(f64::MIN_POSITIVE)).powi(2);
        if offset_rad.abs() < OFFSET_TOLERANCE_RAD || gain < MIN_GAIN {
            return;
        }
        let joint = gimbal.joints.first().map_or("the first joint", |joint| joint.name.as_str());
        let title = format!("the attitude is rotated by {:.1}° about the axis of '{joint}'", offset_rad.to_degrees());
        let evidence = format!(
            "rotations in the images differ by {:.3}° from those predicted, by {:.3}° without it",
            unturned.to_degrees(),
            least.to_degrees()
        );
        let offset_rad = principal_angle(given_rad + offset_rad);
        let remedy = format!("set first_joint_offset: {offset_rad:.4} in gimbal.source");
        findings.add(Severity::Warning, Area::Encoders, title, evidence, remedy);
    }
}

/// Rotation about the axis of the first joint in the IMU frame.
fn about_first_joint(gimbal: &GimbalRig, angle_rad: f64) -> UnitQuaternion<f64> {
    let axis = Unit::new_normalize(gimbal.chain.imu_from_base.rotation * Vector3::z());
    UnitQuaternion::from_axis_angle(&axis, angle_rad)
}

/// Misfits of the rig's interpretation and of the best change of each property.
fn listed(gimbal: &GimbalRig, source: &AttitudeSource, given: &Meaning, others: &[Vec<Meaning>]) -> String {
    let degrees = |misfit_rad: f64| {
        if misfit_rad.is_finite() { format!("{:.2}°", misfit_rad.to_degrees()) } else { "not defined".to_owned() }
    };
    let best = |meanings: &Vec<Meaning>| {
        let best = meanings.iter().min_by(|a, b| a.misfit_rad.total_cmp(&b.misfit_rad))?;
        Some(format!("{} {}", difference(gimbal, source, &best.source), degrees(best.misfit_rad)))
    };
    let all: Vec<String> = others.iter().filter_map(best).collect();
    format!("misfit as in the rig {}, with {}", degrees(given.misfit_rad), all.join("; "))
}

/// Minimum of the parabola through the squared costs around the best offset, in seconds; the offset itself at the end of
/// the range.
fn vertex(costs: &[(f64, f64)], best: usize, step: f64) -> f64 {
    let square = |index: usize| costs[index].1 * costs[index].1;
    let offset_s = costs[best].0;
    if best == 0 || best + 1 >= costs.len() {
        return offset_s;
    }
    let (left, middle, right) = (square(best - 1), square(best), square(best + 1));
    let curvature = left - 2.0 * middle + right;
    if curvature > 0.0 { offset_s + 0.5 * step * (left - right) / curvature } else { offset_s }
}
