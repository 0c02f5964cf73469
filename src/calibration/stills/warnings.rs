//! Warnings of a calibration that leans on free angles, and of data that do not determine it.

use super::fit::AngleModel;
use super::outcome::{ScoredChain, StillsOutcome};
use super::ranks::AngleKnowledge;
use crate::text::counted;

/// Difference of an angle between axes to the initial chain that is implausible, in degrees.
const MAX_AXIS_CHANGE_DEG: f64 = 15.0;
/// Standard deviation of an angle between axes that leaves it open, in degrees.
const MAX_AXIS_SIGMA_DEG: f64 = 5.0;
/// Standard deviation of an encoder that is implausible, in degrees.
const MAX_ENCODER_DEG: f64 = 3.0;
/// Ratio of corrections to the σ of the encoder that is implausible.
const MAX_CORRECTION_RATIO: f64 = 3.0;
/// Ratio of hold-out to training error with angles as read that shows too few data.
const MAX_HOLD_OUT_RATIO: f64 = 2.0;
/// Ratio of the error with angles as read to that with estimated angles at which the angles carry the answer.
const MAX_READING_RATIO: f64 = 10.0;

/// Warnings in the order of their weight.
pub(super) fn warnings(outcome: &StillsOutcome) -> Vec<String> {
    let mut warnings = Vec::new();
    axes(outcome, &mut warnings);
    corrections(outcome, &mut warnings);
    pixels(outcome, &mut warnings);
    let wrong = outcome.sets.iter().filter(|set| set.wrong).count();
    if 4 * wrong > outcome.sets.len() {
        warnings.push(format!(
            "the readings of {wrong} of {} are wrong: check the encoders and the order and signs of the joints",
            counted(outcome.sets.len(), "set")
        ));
    }
    ranks(outcome, &mut warnings);
    warnings
}

fn axes(outcome: &StillsOutcome, warnings: &mut Vec<String>) {
    for axis in &outcome.axes {
        let change = axis.value_deg - axis.initial_deg;
        if axis.sigma_deg > MAX_AXIS_SIGMA_DEG {
            warnings.push(format!(
                "the angle between the axes of {} and {} is not determined: {:.0}° ± {:.0}°",
                axis.joints[0], axis.joints[1], axis.value_deg, axis.sigma_deg
            ));
        }
        if change.abs() > MAX_AXIS_CHANGE_DEG {
            warnings.push(format!(
                "implausible axes: {:.1}° between the axes of {} and {}, {:.1}° in the initial chain; a mechanism is not \
                 off by {:.0}°: the joint angles have absorbed an error of the axes",
                axis.value_deg,
                axis.joints[0],
                axis.joints[1],
                axis.initial_deg,
                change.abs()
            ));
        }
    }
}

fn corrections(outcome: &StillsOutcome, warnings: &mut Vec<String>) {
    for (joint, name) in outcome.joints.iter().enumerate() {
        let rms_deg = outcome.rms_correction_deg(joint);
        let sigma_deg = outcome.noise.encoder_rad[joint].to_degrees();
        if outcome.angles == Some(AngleModel::Free) && rms_deg > MAX_CORRECTION_RATIO * sigma_deg {
            warnings.push(format!(
                "the readings of {name} are corrected by {rms_deg:.1}° rms, {:.0} times the σ of {sigma_deg:.2}° that an \
                 encoder model estimates from the same sets: the answer leans on free angles",
                rms_deg / sigma_deg
            ));
        } else if rms_deg > MAX_ENCODER_DEG {
            warnings.push(format!(
                "the readings of {name} are corrected by {rms_deg:.1}° rms: either its encoder is that bad, or the chain is \
                 not the mechanism"
            ));
        }
    }
}

fn pixels(outcome: &StillsOutcome, warnings: &mut Vec<String>) {
    let cameras = outcome.floors.iter().map(|floor| floor.camera.as_str());
    for camera in cameras {
        let chain = if outcome.angles.is_some() { ScoredChain::Training } else { ScoredChain::Given };
        let (training, held) = (outcome.score(chain, camera), outcome.score(ScoredChain::HoldOut, camera));
        let Some(training) = training else { continue };
        let Some(as_read) = training.as_read.map(|it| it.mean_px) else { continue };
        if let Some(held) = held.and_then(|it| it.as_read).filter(|it| it.mean_px > MAX_HOLD_OUT_RATIO * as_read) {
            warnings.push(format!(
                "'{camera}': {:.1} px on sets that were left out, {as_read:.1} px on those of the calibration: too few sets \
                 for this chain; record more stations",
                held.mean_px
            ));
        }
        let read = held.and_then(|it| it.as_read).map_or(as_read, |it| it.mean_px);
        if let Some(estimated) = training.estimated.filter(|it| read > MAX_READING_RATIO * it.mean_px) {
            warnings.push(format!(
                "'{camera}': {read:.1} px with the angles as read, {:.2} px with angles estimated from the images: the \
                 angles, not the chain, explain the images",
                estimated.mean_px
            ));
        }
    }
}

fn ranks(outcome: &StillsOutcome, warnings: &mut Vec<String>) {
    let knowledge = match outcome.angles {
        Some(AngleModel::Encoder) => AngleKnowledge::Encoder,
        Some(AngleModel::Free) => AngleKnowledge::Free,
        None => return,
    };
    let found =
        outcome.ranks.iter().find(|rank| rank.parameterization == outcome.parameterization && rank.angles == knowledge);
    if let Some(rank) = found.filter(|rank| rank.rank_structural < rank.columns) {
        warnings.push(format!(
            "only {} of {} parameters of the chain are observable with {} angles; unobservable: {}",
            rank.rank_structural,
            rank.columns,
            if knowledge == AngleKnowledge::Free { "free" } else { "measured" },
            rank.null_directions.join("; ")
        ));
    }
    if let Some(rank) = found.filter(|rank| rank.rank_informed < rank.rank_structural) {
        warnings.push(format!(
            "{} of the chain have a σ above 10° or 3 cm: {}",
            counted(rank.rank_structural - rank.rank_informed, "more direction"),
            rank.uninformed_directions.join("; ")
        ));
    }
}
