//! Suggested excitation: candidate motions from the present state, linearized, with the σ of the least observable
//! direction after each.

use std::fmt;

use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use super::super::classification::excitable_directions;
use super::Situation;
use super::mechanism::LaboratoryJoint;
use super::predicted_window::predicted_information;
use crate::estimator::{HypotheticalFrame, NavigationState};
use crate::geometry::{Dimension, RigidTransform, ns_from_seconds, so3};
use crate::gimbal::ParameterId;
use crate::sensors::ImuSample;
use crate::simulation::{Exercise, JOINT_PERIOD_S, JointSwing, ROCK_PERIOD_S, VehicleSwing};

/// Duration of a candidate, in seconds.
pub const ADVICE_DURATION_S: f64 = 4.0;
/// Number of frames of a candidate's window: about as many keyframes as the estimator makes.
const FRAMES: usize = 16;
/// Landmarks drawn in each frame's view.
const LANDMARKS_PER_FRAME: usize = 12;
/// Rate of the simulated IMU samples: their covariance hardly depends on it.
const IMU_RATE_HZ: f64 = 50.0;
/// Largest amplitude of a joint.
const JOINT_SWING_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Largest rate of a joint, in rad/s: slow for any gimbal.
const JOINT_RATE_RAD_PER_S: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// Joints with less range than this do not move, in radians.
pub(super) const MIN_SWING_RAD: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// The vehicle's velocity at the start decays with this time constant, in seconds.
const BRAKING_S: f64 = 0.8;

/// Candidate motions, sorted by the σ of the least observable direction after each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advice {
    /// The least observable direction among those that some motion constrains.
    #[serde(rename = "weakest")]
    pub least_observable: WeakDirection,
    /// Candidates, the best one first.
    pub candidates: Vec<CandidateReport>,
    /// Duration of each candidate, in seconds.
    pub duration_s: f64,
    /// Columns of the chain.
    #[serde(skip)]
    pub parameters: Vec<ParameterId>,
    /// Present standard deviation of each of them within the observable directions, in units of 10° and 3 cm.
    #[serde(skip)]
    pub sigmas: Vec<f64>,
}

/// A direction of the calibration with its posterior standard deviation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WeakDirection {
    pub names: Vec<String>,
    /// Weights of the unit direction (one per column), in units of 10° and 3 cm.
    pub weights: Vec<f64>,
    /// Standard deviation along the direction, in the same units.
    pub sigma: f64,
    /// The parameter with the largest weight.
    pub leading: String,
    /// Standard deviation of the leading parameter that corresponds to one σ along the direction, in radians or
    /// metres.
    pub leading_sigma: f64,
    #[serde(rename = "unit")]
    pub dimension: Dimension,
}

/// A candidate motion with the predicted σ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateReport {
    /// Motion as an instruction.
    pub words: String,
    /// Predicted standard deviation along the least observable direction after the motion.
    pub sigma_after: f64,
    /// Ratio of the predicted to the present standard deviation.
    pub remaining: f64,
    #[serde(skip)]
    pub exercise: Exercise,
    /// Predicted standard deviation of each column of the chain, as [`Advice::sigmas`].
    #[serde(skip)]
    pub sigmas: Vec<f64>,
}

/// Linearizes every candidate from the present state and sorts them by the predicted σ of the least observable
/// direction; `None` when no parameter is estimated or a number is not finite.
///
/// A candidate's window is independent of the past: positions, yaw, velocities and biases at its start are
/// unknown. Its information is added to the posterior of the calibration.
pub fn advise(situation: &Situation) -> Option<Advice> {
    let excitable = excitable_directions(&situation.chain, situation.joints_free());
    if excitable.ncols() == 0 {
        return None;
    }
    let known = excitable.tr_mul(&(&situation.information * &excitable));
    let eigen = known.clone().symmetric_eigen();
    let least_observable = eigen.eigenvalues.imin();
    let along: DVector<f64> = eigen.eigenvectors.column(least_observable).into_owned();
    let sigma_along = |information: &DMatrix<f64>| {
        let solved = information.clone().cholesky()?.solve(&along);
        Some(along.dot(&solved).sqrt()).filter(|sigma| sigma.is_finite())
    };
    let sigma = sigma_along(&known)?;
    let sigmas = |information: &DMatrix<f64>| -> Option<Vec<f64>> {
        let covariance = information.clone().cholesky()?.inverse();
        let variances = (&excitable * covariance).component_mul(&excitable).column_sum();
        Some(variances.iter().map(|variance| variance.max(0.0).sqrt()).collect())
    };
    let candidates: Vec<Exercise> = candidates(situation);
    let mut reports: Vec<CandidateReport> = candidates
        .par_iter()
        .filter_map(|exercise| {
            let gained = information_of(situation, exercise)?;
            let gained = excitable.tr_mul(&(gained * &excitable));
            let after = &known + gained;
            let sigma_after = sigma_along(&after)?;
            Some(CandidateReport {
                sigmas: sigmas(&after)?,
                words: words(exercise, &situation.joints),
                sigma_after,
                remaining: sigma_after / sigma,
                exercise: *exercise,
            })
        })
        .collect();
    // A stable sort: equal candidates keep their order.
    reports.sort_by(|a, b| a.sigma_after.total_cmp(&b.sigma_after));
    let direction = &excitable * along;
    Some(Advice {
        least_observable: WeakDirection::new(situation, &direction, sigma),
        candidates: reports,
        duration_s: ADVICE_DURATION_S,
        parameters: situation.chain.parameters(),
        sigmas: sigmas(&known)?,
    })
}

impl WeakDirection {
    fn new(situation: &Situation, direction: &DVector<f64>, sigma: f64) -> Self {
        let leading = direction.iamax();
        let flip = direction[leading].signum();
        let parameters = situation.chain.parameters();
        let names: Vec<String> = parameters.iter().map(|parameter| situation.names.name(*parameter)).collect();
        Self {
            leading: names[leading].clone(),
            leading_sigma: sigma * direction[leading].abs() * situation.scale()[leading],
            dimension: parameters[leading].dimension(),
            weights: direction.iter().map(|weight| weight * flip).collect(),
            names,
            sigma,
        }
    }
}

/// All combinations of a vehicle motion with a joint motion that the joint's range admits.
pub(super) fn candidates(situation: &Situation) -> Vec<Exercise> {
    let mut swings = vec![None];
    for (joint, angle_rad) in situation.joints_rad.iter().enumerate() {
        let (low, high) = situation.joints.get(joint).map_or((-JOINT_SWING_RAD, JOINT_SWING_RAD), |it| it.limits_rad);
        let room = (high - angle_rad).min(angle_rad - low);
        let by_rate = JOINT_RATE_RAD_PER_S * JOINT_PERIOD_S / std::f64::consts::TAU;
        let amplitude_rad = JOINT_SWING_RAD.min(room).min(by_rate);
        if amplitude_rad >= MIN_SWING_RAD {
            swings.push(Some(JointSwing { joint, amplitude_rad, period_s: JOINT_PERIOD_S }));
        }
    }
    let with = |vehicle: VehicleSwing| swings.iter().map(move |joint| Exercise::full(vehicle, *joint));
    VehicleSwing::ALL.into_iter().flat_map(with).collect()
}

/// Information matrix of a candidate about the calibration columns (n × n), in units of 10° and 3 cm; `None`
/// when it is not finite.
fn information_of(situation: &Situation, exercise: &Exercise) -> Option<DMatrix<f64>> {
    let times_s: Vec<f64> = (0..FRAMES).map(|slot| ADVICE_DURATION_S * slot as f64 / (FRAMES - 1) as f64).collect();
    let states: Vec<(f64, NavigationState, Vec<f64>)> = times_s
        .iter()
        .map(|time_s| (*time_s, navigation_at(situation, exercise, *time_s), joints_at(situation, exercise, *time_s)))
        .collect();
    let gravity = situation.gravity_in_world;
    let frames: Vec<HypotheticalFrame> = states
        .iter()
        .enumerate()
        .map(|(slot, (time_s, navigation, joints_rad))| HypotheticalFrame {
            time_s: *time_s,
            navigation: *navigation,
            joints_rad: joints_rad.clone(),
            imu: slot.checked_sub(1).map_or_else(Vec::new, |before| {
                let motion = |time_s: f64| navigation_at(situation, exercise, time_s);
                samples(&motion, states[before].0, *time_s, &gravity)
            }),
            camera_imu: None,
        })
        .collect();
    predicted_information(situation, frames, LANDMARKS_PER_FRAME)
}

fn joints_at(situation: &Situation, exercise: &Exercise, time_s: f64) -> Vec<f64> {
    let angles = situation.joints_rad.iter().enumerate();
    angles.map(|(joint, angle)| angle + exercise.joint_rad(joint, time_s)).collect()
}

/// Position of the vehicle in the world: the present velocity decays, and the exercise is added.
fn position_at(situation: &Situation, exercise: &Exercise, time_s: f64) -> Vector3<f64> {
    let start = &situation.navigation;
    let shift = exercise.shift_m(time_s.max(0.0));
    let forward = forward_of(&start.world_from_imu);
    let left = Vector3::z().cross(&forward);
    let glide = start.velocity_m_per_s * (BRAKING_S * (1.0 - (-time_s / BRAKING_S).exp()));
    start.world_from_imu.translation_m + glide + forward * shift.x + left * shift.y + Vector3::z() * shift.z
}

/// Horizontal heading of the body: its x axis, or its z axis when the x axis is vertical.
fn forward_of(world_from_imu: &RigidTransform) -> Vector3<f64> {
    let flat = |axis: Vector3<f64>| {
        let axis = world_from_imu.rotation * axis;
        Vector3::new(axis.x, axis.y, 0.0)
    };
    let ahead = flat(Vector3::x());
    let ahead = if ahead.norm() < 0.5 { flat(Vector3::z()) } else { ahead };
    ahead.try_normalize(1e-6).unwrap_or_else(Vector3::x)
}

/// Pose and velocity during a candidate: the vehicle tilts like a multirotor to accelerate (no drag).
fn navigation_at(situation: &Situation, exercise: &Exercise, time_s: f64) -> NavigationState {
    const STEP_S: f64 = 1e-3;
    let at = |steps: f64| position_at(situation, exercise, time_s + steps * STEP_S);
    let (before, here, after) = (at(-1.0), at(0.0), at(1.0));
    let acceleration = (after - here * 2.0 + before) / (STEP_S * STEP_S);
    let thrust = acceleration - situation.gravity_in_world;
    let tilt = UnitQuaternion::rotation_between(&Vector3::z(), &thrust).unwrap_or_else(UnitQuaternion::identity);
    let yaw = so3::exp(&(Vector3::z() * exercise.heading_change_rad(time_s.max(0.0))));
    let rotation = tilt * yaw * situation.navigation.world_from_imu.rotation;
    NavigationState {
        world_from_imu: RigidTransform::new(rotation, here),
        velocity_m_per_s: (after - before) / (2.0 * STEP_S),
        bias: situation.navigation.bias,
    }
}

/// Samples of an ideal IMU over an interval of a motion, both ends included.
fn samples(
    motion: &dyn Fn(f64) -> NavigationState,
    from_s: f64,
    to_s: f64,
    gravity_in_world: &Vector3<f64>,
) -> Vec<ImuSample> {
    const STEP_S: f64 = 2e-3;
    let count = ((to_s - from_s) * IMU_RATE_HZ).round().max(1.0) as usize;
    (0..=count)
        .map(|index| {
            let time_s = from_s + (to_s - from_s) * index as f64 / count as f64;
            let (before, here, after) = (motion(time_s - STEP_S), motion(time_s), motion(time_s + STEP_S));
            let rotation_change = before.world_from_imu.rotation.inverse() * after.world_from_imu.rotation;
            let acceleration = (after.velocity_m_per_s - before.velocity_m_per_s) / (2.0 * STEP_S);
            let felt = here.world_from_imu.rotation.inverse() * (acceleration - gravity_in_world);
            ImuSample {
                stamp_ns: ns_from_seconds(time_s),
                angular_velocity_rad_per_s: so3::log(&rotation_change) / (2.0 * STEP_S) + here.bias.gyroscope_rad_per_s,
                specific_force_m_per_s2: felt + here.bias.accelerometer_m_per_s2,
                unmeasured_s: 0.0,
            }
        })
        .collect()
}

/// Describes a candidate as an instruction.
pub(super) fn words(exercise: &Exercise, joints: &[LaboratoryJoint]) -> String {
    let vehicle = vehicle_words(exercise);
    match exercise.joint {
        Some(swing) => format!("{}, {vehicle}", swing_words(&swing, joints)),
        None if joints.is_empty() => vehicle,
        None => format!("{vehicle}, gimbal fixed"),
    }
}

/// Describes the motion of a joint to both sides.
pub(super) fn swing_words(swing: &JointSwing, joints: &[LaboratoryJoint]) -> String {
    format!("{} ±{:.0}°", joint_words(swing, joints), swing.amplitude_rad.abs().to_degrees())
}

/// Says which joint moves.
pub(super) fn joint_words(swing: &JointSwing, joints: &[LaboratoryJoint]) -> String {
    let name = joints.get(swing.joint).map_or("a joint", |joint| joint.name.as_str());
    if ["yaw", "pitch", "roll", "pan", "tilt"].contains(&name) {
        format!("{name} gimbal")
    } else {
        format!("rotate {name}")
    }
}

/// Describes the motion of the vehicle.
pub(super) fn vehicle_words(exercise: &Exercise) -> String {
    let (size, period_s) = (exercise.vehicle_amplitude(), ROCK_PERIOD_S);
    match exercise.vehicle {
        VehicleSwing::Hover => "hover".to_owned(),
        VehicleSwing::Forward => format!("translate forward and back ±{size:.2} m"),
        VehicleSwing::Sideways => format!("translate sideways ±{size:.2} m"),
        VehicleSwing::UpDown => format!("climb and descend ±{size:.2} m"),
        VehicleSwing::Roll => format!("translate sideways ±{size:.2} m every {period_s} s (roll)"),
        VehicleSwing::Pitch => format!("translate forward and back ±{size:.2} m every {period_s} s (pitch)"),
        VehicleSwing::Yaw => format!("yaw vehicle ±{:.0}°", size.to_degrees()),
    }
}

impl Advice {
    /// Candidate with the smallest predicted σ of a parameter of the chain, and the ratio of that σ to the present one;
    /// `None` for another parameter or without a candidate.
    pub fn for_parameter(&self, parameter: ParameterId) -> Option<(&CandidateReport, f64)> {
        let column = self.parameters.iter().position(|known| *known == parameter)?;
        let sigma = |candidate: &CandidateReport| candidate.sigmas.get(column).copied().unwrap_or(f64::INFINITY);
        let best = self.candidates.iter().min_by(|a, b| sigma(a).total_cmp(&sigma(b)))?;
        Some((best, sigma(best) / self.sigmas.get(column)?)).filter(|(_, ratio)| ratio.is_finite())
    }

    /// Best candidate and its effect in one line:
    /// `roll gimbal ±15°, hover for 4 s → σ(L3.d, with L3.a) 1.68 → 1.26 mm`.
    pub fn sentence(&self) -> Option<String> {
        self.candidates.first().map(|best| self.line(best))
    }

    pub fn line(&self, candidate: &CandidateReport) -> String {
        let least = &self.least_observable;
        let (factor, unit) = least.unit();
        let before = least.leading_sigma * factor;
        let after = before * candidate.remaining;
        let label = least.label();
        format!("{} for {:.0} s → {label} {before:.2} → {after:.2}{unit}", candidate.words, self.duration_s)
    }
}

impl WeakDirection {
    /// The leading parameter's σ as a symbol, `σ(L3.d, with L3.a)`.
    fn label(&self) -> String {
        let others =
            self.names.iter().zip(&self.weights).filter(|(name, weight)| **name != self.leading && weight.abs() >= 0.3);
        let others: Vec<&str> = others.map(|(name, _)| name.as_str()).collect();
        if others.is_empty() {
            format!("σ({})", self.leading)
        } else {
            format!("σ({}, with {})", self.leading, others.join(", "))
        }
    }

    /// Shown units per stored unit of the leading parameter, and the shown unit.
    fn unit(&self) -> (f64, &'static str) {
        match self.dimension {
            Dimension::Angle => (1_f64.to_degrees(), "°"),
            _ => (1e3, " mm"),
        }
    }
}

impl fmt::Display for WeakDirection {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (factor, unit) = self.unit();
        write!(out, "{} = {:.2}{unit}", self.label(), self.leading_sigma * factor)
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (factor, unit) = self.least_observable.unit();
        writeln!(out, "least observable direction   {}", self.least_observable)?;
        writeln!(
            out,
            "candidate excitations        predicted σ after {:.0} s, and its ratio to σ now",
            self.duration_s
        )?;
        for candidate in &self.candidates {
            let after = self.least_observable.leading_sigma * factor * candidate.remaining;
            writeln!(out, "  {after:7.2}{unit}  {:5.1} %  {}", 100.0 * candidate.remaining, candidate.words)?;
        }
        Ok(())
    }
}
