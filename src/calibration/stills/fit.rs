//! Calibration of some sets: chain, noise, and the sets whose readings are wrong.

use super::loops::{EncoderTerm, StillsLoops, StillsState};
use super::noise::{EffectSum, StillsNoise};
use super::observed::ObservedSet;
use super::wrong_readings::{next_wrong, robust_sigma_rad, wrong_at_first};
use crate::geometry::RigidTransform;
use crate::gimbal::Chain;
use crate::optimization::TwoLevelPosterior;
use crate::optimization::damped::{DampedOptions, minimize};

const OPTIONS: DampedOptions = DampedOptions {
    iterations: 60,
    relative_cost_tolerance: 1e-9,
    first_damping: 1e-6,
    min_damping: 1e-12,
    max_damping: 1e12,
    growth: 20.0,
};
/// Number of reweighted adjustments before the noise is estimated.
const ROBUST_ROUNDS: usize = 8;
/// Correction of half weight in them, in standard deviations.
const CAUCHY_SIGMAS: f64 = 3.0;
/// Largest number of estimations of the noise.
const NOISE_ROUNDS: usize = 60;
/// Relative change of a standard deviation at which the noise has converged.
const NOISE_TOLERANCE: f64 = 2e-3;
/// Smallest robust estimate of an encoder's standard deviation, in rad (0.01°).
const MIN_ROBUST_RAD: f64 = 1.7e-4;

/// Use of the joint readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleModel {
    /// Angle = reading + noise, its σ estimated per joint.
    Encoder,
    /// Angles of every set free, readings as start only.
    Free,
}

#[derive(Clone, Debug)]
pub(super) struct StillsFit<'a> {
    pub(super) loops: StillsLoops<'a>,
    pub(super) state: StillsState,
    pub(super) posterior: TwoLevelPosterior,
    /// True for each set whose readings are wrong.
    pub(super) wrong: Vec<bool>,
}

/// Chain and further rigid cameras from which an adjustment starts.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub(super) chain: Chain,
    pub(super) further: Vec<RigidTransform>,
}

impl<'a> StillsFit<'a> {
    /// Calibrates from `start`; `None` if the equations are singular.
    pub(super) fn new(sets: &[&'a ObservedSet], start: &Start, model: AngleModel) -> Option<Self> {
        let noise = StillsNoise::initial(start.chain.joint_count());
        let mut loops = StillsLoops::new(sets.to_vec(), noise);
        let mut state = StillsState::at_readings(start.chain.clone(), start.further.clone(), &loops);
        if model == AngleModel::Free {
            let wrong = vec![false; sets.len()];
            loops.reading_weights.fill(0.0);
            let posterior = settle(&mut loops, &mut state, &wrong)?;
            return Some(Self { loops, state, posterior, wrong });
        }
        for _ in 0..ROBUST_ROUNDS {
            state = minimize(&mut loops, state, &OPTIONS).estimate;
            let corrections = all_corrections(&loops, &state);
            for joint in 0..state.chain.joint_count() {
                loops.noise.encoder_rad[joint] = robust_sigma_rad(&corrections, joint)?.max(MIN_ROBUST_RAD);
            }
            for place in 0..sets.len() {
                let ratio = largest_ratio(&loops, &state, place) / CAUCHY_SIGMAS;
                loops.reading_weights[place] = 1.0 / (1.0 + ratio * ratio);
            }
        }
        let mut wrong = wrong_at_first(&all_corrections(&loops, &state), &loops.noise.encoder_rad);
        let posterior = loop {
            weigh(&mut loops, &wrong);
            let posterior = settle(&mut loops, &mut state, &wrong)?;
            let corrections = all_corrections(&loops, &state);
            let determined: Vec<f64> = loops
                .noise
                .encoder_rad
                .iter()
                .enumerate()
                .map(|(joint, sigma)| {
                    let right = corrections.iter().zip(&wrong).filter(|(_, wrong)| !**wrong);
                    right.map(|(set, _)| (set[joint] / sigma).powi(2)).sum()
                })
                .collect();
            let Some(place) = next_wrong(&corrections, &wrong, &determined) else { break posterior };
            wrong[place] = true;
        };
        Some(Self { loops, state, posterior, wrong })
    }

    /// The same sets and wrong readings with encoder terms, starting at this solution.
    pub(super) fn with_terms(&self, terms: Vec<EncoderTerm>) -> Option<Self> {
        let mut fit = self.clone();
        fit.state.effects = vec![0.0; terms.len()];
        fit.loops.terms = terms;
        fit.posterior = settle(&mut fit.loops, &mut fit.state, &fit.wrong)?;
        Some(fit)
    }

    /// The chain without one station, with this noise and these wrong readings.
    pub(super) fn without_station(&self, station: usize) -> Option<StillsState> {
        let kept: Vec<usize> =
            (0..self.loops.sets.len()).filter(|place| !self.loops.stations[station].contains(place)).collect();
        let sets = kept.iter().map(|place| self.loops.sets[*place]).collect();
        let mut loops = StillsLoops::new(sets, self.loops.noise.clone());
        loops.reading_weights = kept.iter().map(|place| self.loops.reading_weights[*place]).collect();
        let mut state = StillsState::at_readings(self.state.chain.clone(), self.state.further.clone(), &loops);
        state.joints_rad = kept.iter().map(|place| self.state.joints_rad[*place].clone()).collect();
        loops.posterior(&state)?;
        Some(minimize(&mut loops, state, &OPTIONS).estimate)
    }

    pub(super) fn start(&self) -> Start {
        Start { chain: self.state.chain.clone(), further: self.state.further.clone() }
    }

    /// Standard deviation of a set's joint angle after the adjustment, in rad.
    pub(super) fn angle_sigma_rad(&self, place: usize, joint: usize) -> f64 {
        let found = self
            .loops
            .stations
            .iter()
            .enumerate()
            .find_map(|(station, places)| places.iter().position(|it| *it == place).map(|index| (station, index)));
        let row = |index: usize| index * (self.state.chain.joint_count() + 3) + joint;
        found.map_or(f64::NAN, |(station, index)| self.posterior.groups[station][row(index)].max(0.0).sqrt())
    }
}

/// Readings of wrong sets have no weight, all others have weight 1.
fn weigh(loops: &mut StillsLoops<'_>, wrong: &[bool]) {
    for (weight, wrong) in loops.reading_weights.iter_mut().zip(wrong) {
        *weight = f64::from(u8::from(!wrong));
    }
}

/// Corrections of all joints by set, in rad.
fn all_corrections(loops: &StillsLoops<'_>, state: &StillsState) -> Vec<Vec<f64>> {
    let joints = state.chain.joint_count();
    let of_set = |place: usize| (0..joints).map(|joint| loops.correction_rad(state, place, joint)).collect();
    (0..loops.sets.len()).map(of_set).collect()
}

/// Largest correction of a set's joints, in standard deviations of their encoders.
fn largest_ratio(loops: &StillsLoops<'_>, state: &StillsState, place: usize) -> f64 {
    let ratio = |joint: usize| loops.correction_rad(state, place, joint).abs() / loops.noise.encoder_rad[joint];
    (0..state.chain.joint_count()).map(ratio).fold(0.0, f64::max)
}

/// Adjusts and estimates the noise in turn until both have converged; `None` if the equations are singular.
fn settle(loops: &mut StillsLoops<'_>, state: &mut StillsState, wrong: &[bool]) -> Option<TwoLevelPosterior> {
    for _ in 0..NOISE_ROUNDS {
        *state = minimize(loops, state.clone(), &OPTIONS).estimate;
        let posterior = loops.posterior(state)?;
        let noise = estimated_noise(loops, state, &posterior, wrong);
        let change = relative_change(&loops.noise, &noise);
        loops.noise = noise;
        if change < NOISE_TOLERANCE {
            break;
        }
    }
    *state = minimize(loops, state.clone(), &OPTIONS).estimate;
    loops.posterior(state)
}

/// Standard deviations that the effects of a solution have, given their posterior variances.
fn estimated_noise(
    loops: &StillsLoops<'_>,
    state: &StillsState,
    posterior: &TwoLevelPosterior,
    wrong: &[bool],
) -> StillsNoise {
    let joints = state.chain.joint_count();
    let previous = &loops.noise;
    let mut encoders = vec![EffectSum::default(); joints];
    let [mut rotation, mut position, mut gimbal] = [EffectSum::default(); 3];
    for (station, places) in loops.stations.iter().enumerate() {
        let variances = &posterior.groups[station];
        for (index, &place) in places.iter().enumerate() {
            let first = index * (joints + 3);
            if loops.reading_weights[place] > 0.0 && !wrong[place] {
                for (joint, sum) in encoders.iter_mut().enumerate() {
                    let correction = loops.correction_rad(state, place, joint);
                    sum.add(correction, variances[first + joint], previous.encoder_rad[joint]);
                }
            }
            for coordinate in 0..3 {
                let variance = variances[first + joints + coordinate];
                gimbal.add(state.gimbal_map_m[place][coordinate], variance, previous.set_position_m);
            }
        }
        let rigid = variances.len() - 6 * state.rigid_map[station].len();
        for (camera, errors) in state.rigid_map[station].iter().enumerate() {
            let seen = places.iter().any(|place| loops.sets[*place].rigid.iter().any(|(index, _)| *index == camera));
            for (coordinate, error) in errors.iter().enumerate().filter(|_| seen) {
                let sum = if coordinate < 3 { &mut rotation } else { &mut position };
                let variance = variances[rigid + 6 * camera + coordinate];
                sum.add(*error, variance, loops.rigid_map_sigma(coordinate));
            }
        }
    }
    let encoder = |(joint, sum): (usize, &EffectSum)| {
        let terms = loops.terms.iter().filter(|term| term.joint == joint).count();
        sum.less(terms).sigma(previous.encoder_rad[joint], true)
    };
    StillsNoise {
        encoder_rad: encoders.iter().enumerate().map(encoder).collect(),
        station_rotation_rad: rotation.sigma(previous.station_rotation_rad, true),
        station_position_m: position.sigma(previous.station_position_m, false),
        set_position_m: gimbal.sigma(previous.set_position_m, false),
    }
}

fn relative_change(before: &StillsNoise, after: &StillsNoise) -> f64 {
    let values = |noise: &StillsNoise| -> Vec<f64> {
        let map = [noise.station_rotation_rad, noise.station_position_m, noise.set_position_m];
        noise.encoder_rad.iter().copied().chain(map).collect()
    };
    let pairs = values(before).into_iter().zip(values(after));
    pairs.map(|(before, after)| (after / before - 1.0).abs()).fold(0.0, f64::max)
}
