//! Calibration of a chain from stills, and the judgement of a given one.

use std::ops::ControlFlow;

use rayon::prelude::*;
use thiserror::Error;

use super::encoders::encoder_tests;
use super::fit::{AngleModel, Start, StillsFit};
use super::hold_out::hold_out;
use super::noise::StillsNoise;
use super::observed::{ObservedSet, observe};
use super::outcome::{ScoredChain, StillsCorrelations, StillsOutcome};
use super::parameters::{Jackknife, axes, correlations, reported, rigid_parameters, tables};
use super::pixels::{SetErrors, set_errors};
use super::ranks::ranks;
use super::scores::{SetEvaluation, floors, scores, set_report};
use super::warnings::warnings;
use super::wrong_readings::{next_wrong, robust_sigma_rad, wrong_at_first};
use crate::calibration::CalibrationProgress;
use crate::gimbal::{Chain, Parameterization};
use crate::sensors::{Stills, StillsChain};
use crate::text::Named as _;

/// Reason for the failure of a calibration from stills.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum StillsError {
    #[error(
        "{found} sets with poses of gimbal camera and a rigid camera, at least {needed} are needed for {joints} joints: \
         take more stills with different joint angles{left_out}"
    )]
    TooFewSets {
        found: usize,
        needed: usize,
        joints: usize,
        /// Views that were left out, with reasons; empty without one.
        left_out: String,
    },
    #[error(
        "the pose loops did not converge: their equations are singular; check that every joint moves and that signs and \
         order of the joints are those of the initial chain"
    )]
    Singular,
    /// The caller ended the calibration.
    #[error("interrupted, stage '{stage}': nothing is written")]
    Interrupted { stage: &'static str },
}

/// Settings of a calibration from stills.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StillsOptions {
    pub angles: AngleModel,
    /// Number of groups of stations of the hold-out.
    pub folds: usize,
}

impl Default for StillsOptions {
    fn default() -> Self {
        Self { angles: AngleModel::Encoder, folds: 5 }
    }
}

/// Progress callback; a break ends the calibration.
type OnStillsProgress<'a> = &'a mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>;

fn report(on_progress: OnStillsProgress<'_>, stage: &'static str, fraction: f64) -> Result<(), StillsError> {
    match on_progress(CalibrationProgress { stage, fraction }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(StillsError::Interrupted { stage }),
    }
}

/// Sets with poses, and sentences on views that were left out.
fn observed(stills: &Stills, needed: usize) -> Result<(Vec<ObservedSet>, Vec<String>), StillsError> {
    let (sets, left_out) = observe(stills);
    if sets.len() >= needed {
        return Ok((sets, left_out));
    }
    let joints = stills.joints.len();
    let left_out = if left_out.is_empty() { String::new() } else { format!("; {}", left_out.join("; ")) };
    Err(StillsError::TooFewSets { found: sets.len(), needed, joints, left_out })
}

/// Estimates chain, rigid cameras and noise from stills.
///
/// # Errors
/// With too few sets, singular equations, or if `on_progress` breaks.
pub fn calibrate_stills(
    stills: &Stills,
    options: &StillsOptions,
    on_progress: OnStillsProgress<'_>,
) -> Result<StillsOutcome, StillsError> {
    report(on_progress, "refining the camera poses", 0.0)?;
    let (sets, left_out) = observed(stills, stills.joints.len() + 2)?;
    let references: Vec<&ObservedSet> = sets.iter().collect();
    let start = start_of(&stills.initial);
    report(on_progress, "closing the pose loops", 0.3)?;
    let mut fit = StillsFit::new(&references, &start, options.angles).ok_or(StillsError::Singular)?;
    // Free angles are compared with what the readings are worth.
    if options.angles == AngleModel::Free {
        let reference = StillsFit::new(&references, &start, AngleModel::Encoder).ok_or(StillsError::Singular)?;
        fit.loops.noise.encoder_rad = reference.loops.noise.encoder_rad;
    }
    report(on_progress, "calibrating without one station each", 0.5)?;
    let jackknife = Jackknife::new(&fit);
    report(on_progress, "calibrating without some stations", 0.65)?;
    let held = hold_out(stills, &sets, &start, options.angles, options.folds);
    report(on_progress, "testing the encoders", 0.8)?;
    let encoder_tests =
        if options.angles == AngleModel::Encoder { encoder_tests(&fit, &stills.joints) } else { Vec::new() };
    report(on_progress, "evaluating the chain", 0.9)?;
    let chain = StillsChain { chain: fit.state.chain.to_classical(), further_from_first: fit.state.further.clone() };
    let (initial, training) = (evaluated(stills, &sets, &start), evaluated(stills, &sets, &fit.start()));
    let tables = tables(&fit, stills, jackknife.as_ref());
    let joints = stills.joints.len();
    let set_reports = sets.iter().enumerate().map(|(place, set)| {
        let corrections: Vec<f64> =
            (0..joints).map(|joint| fit.loops.correction_rad(&fit.state, place, joint)).collect();
        let sigmas: Vec<f64> = (0..joints).map(|joint| fit.angle_sigma_rad(place, joint)).collect();
        let evaluation =
            SetEvaluation { initial: &initial[place], chain: &training[place], hold_out: held[place].as_ref() };
        set_report(stills, set, fit.wrong[place], [&corrections, &sigmas], &evaluation)
    });
    let mut scored = scores(stills, ScoredChain::Initial, &seen(&initial), &fit.wrong);
    scored.extend(scores(stills, ScoredChain::Training, &seen(&training), &fit.wrong));
    let held: Vec<Option<&SetErrors>> = held.iter().map(Option::as_ref).collect();
    scored.extend(scores(stills, ScoredChain::HoldOut, &held, &fit.wrong));
    let mut outcome = StillsOutcome {
        configuration: stills.name.clone(),
        joints: stills.joints.clone(),
        angles: Some(options.angles),
        stations: fit.loops.stations.len(),
        floors: floors(stills, &sets),
        scores: scored,
        noise: fit.loops.noise.clone(),
        axes: axes(&chain.chain, &stills.initial.chain, stills, tables.first()),
        parameterization: reported(&chain.chain).name(),
        rigid: rigid_parameters(&fit, stills, jackknife.as_ref()),
        ranks: ranks(&fit, &stills.parameter_names()),
        correlations: correlations(&fit, stills),
        encoder_tests,
        sets: set_reports.collect(),
        warnings: Vec::new(),
        tables,
        chain,
    };
    outcome.warnings = warnings(&outcome);
    outcome.warnings.extend(left_out);
    Ok(outcome)
}

/// Evaluates a given chain on stills without changing it: its errors, and the corrections of the readings that it needs.
///
/// # Errors
/// Without a set with poses of gimbal camera and a rigid camera, or if `on_progress` breaks.
pub fn judge_stills(
    stills: &Stills,
    given: &StillsChain,
    on_progress: OnStillsProgress<'_>,
) -> Result<StillsOutcome, StillsError> {
    report(on_progress, "refining the camera poses", 0.0)?;
    let (sets, left_out) = observed(stills, 1)?;
    report(on_progress, "evaluating the chain", 0.5)?;
    let (initial, errors) =
        (evaluated(stills, &sets, &start_of(&stills.initial)), evaluated(stills, &sets, &start_of(given)));
    let joints = stills.joints.len();
    let corrections: Vec<Vec<f64>> = errors.iter().map(|set| set.corrections_rad.clone()).collect();
    let encoder_rad: Vec<f64> =
        (0..joints).map(|joint| robust_sigma_rad(&corrections, joint).unwrap_or(f64::NAN)).collect();
    let mut wrong = wrong_at_first(&corrections, &encoder_rad);
    loop {
        let right = wrong.iter().filter(|wrong| !**wrong).count() as f64;
        let Some(place) = next_wrong(&corrections, &wrong, &vec![right; joints]) else { break };
        wrong[place] = true;
    }
    let noise = StillsNoise {
        encoder_rad,
        station_rotation_rad: f64::NAN,
        station_position_m: f64::NAN,
        set_position_m: f64::NAN,
    };
    let unknown = vec![f64::NAN; joints];
    let set_reports = sets.iter().enumerate().map(|(place, set)| {
        let evaluation = SetEvaluation { initial: &initial[place], chain: &errors[place], hold_out: None };
        set_report(stills, set, wrong[place], [&corrections[place], &unknown], &evaluation)
    });
    let mut scored = scores(stills, ScoredChain::Initial, &seen(&initial), &wrong);
    scored.extend(scores(stills, ScoredChain::Given, &seen(&errors), &wrong));
    let mut stations: Vec<u64> = sets.iter().map(|set| set.station).collect();
    stations.sort_unstable();
    stations.dedup();
    let mut outcome = StillsOutcome {
        configuration: stills.name.clone(),
        joints: stills.joints.clone(),
        angles: None,
        stations: stations.len(),
        floors: floors(stills, &sets),
        scores: scored,
        noise,
        axes: axes(&given.chain, &stills.initial.chain, stills, None),
        parameterization: reported(&given.chain).name(),
        tables: Vec::new(),
        rigid: Vec::new(),
        ranks: Vec::new(),
        correlations: StillsCorrelations::default(),
        encoder_tests: Vec::new(),
        sets: set_reports.collect(),
        warnings: Vec::new(),
        chain: given.clone(),
    };
    outcome.warnings = warnings(&outcome);
    outcome.warnings.extend(left_out);
    Ok(outcome)
}

fn start_of(chain: &StillsChain) -> Start {
    let further = chain.further_from_first.clone();
    Start { chain: Chain::from_classical(&chain.chain, Parameterization::Poe), further }
}

fn evaluated(stills: &Stills, sets: &[ObservedSet], chain: &Start) -> Vec<SetErrors> {
    sets.par_iter().map(|set| set_errors(set, &stills.rigid_cameras, &chain.chain, &chain.further)).collect()
}

fn seen(errors: &[SetErrors]) -> Vec<Option<&SetErrors>> {
    errors.iter().map(Some).collect()
}
