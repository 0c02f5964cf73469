//! A run's summary as text for the terminal.

use std::path::Path;

use dcvins::observability::{Determination, MIN_SPURIOUS_GAIN};
use dcvins::session::{FlightParameter, KnownLossSummary, RunSummary, TrajectoryLane, least_determined};
use dcvins::text::{Named as _, printable};

/// Text of a trajectory of another program for the terminal.
pub(crate) fn describe_trajectory(lane: &TrajectoryLane) -> String {
    let accuracy = match (&lane.evaluation.accuracy, &lane.accuracy_missing) {
        (Some(accuracy), _) => accuracy.to_string(),
        (None, Some(reason)) => format!("not available: {reason}"),
        (None, None) => "not available".to_owned(),
    };
    let poses = lane.track.samples().len();
    format!("trajectory {} ({}, {poses} poses)\n  accuracy     {accuracy}\n", lane.label, lane.source)
}

/// Text of a run's summary for the terminal.
pub(crate) fn describe(folder: &Path, summary: &RunSummary) -> String {
    let frames = &summary.frames;
    let answer = &summary.answer;
    let mut lines = vec![
        format!("{}\n", printable(&answer.sentence)),
        format!("{} on {} ({})\n", summary.run, summary.log, summary.camera),
    ];
    if !answer.remedy.is_empty() {
        lines.insert(1, format!("  → {}\n", printable(&answer.remedy)));
    }
    let start = frames
        .initialized_at_s
        .map_or_else(|| "never initialized".to_owned(), |time_s| format!("initialized at {time_s:.2} s"));
    lines.push(format!(
        "  frames       {} of {} estimated, {} keyframes, {start}, {} restarts\n",
        frames.estimated, frames.total, frames.keyframes, frames.restarts
    ));
    if let Some(accuracy) = &summary.accuracy {
        lines.push(format!("  accuracy     {accuracy}\n"));
    } else if let Some(reason) = &summary.accuracy_missing {
        lines.push(format!("  accuracy     not available: {reason}\n"));
    }
    let calibration = &summary.calibration;
    if let (Some(first), Some(last)) = (&calibration.chain_error_initial, &calibration.chain_error) {
        let in_sigmas = calibration
            .parameter_error_sigma()
            .map_or_else(String::new, |ratio| format!("; errors of the parameters {ratio:.1} σ RMS"));
        lines.push(format!(
            "  chain error  {:.1} mm, {:.2}° (rig) → {:.1} mm, {:.2}° (final, {}{in_sigmas})\n",
            first.translation_mean_m * 1e3,
            first.rotation_mean_rad.to_degrees(),
            last.translation_mean_m * 1e3,
            last.rotation_mean_rad.to_degrees(),
            calibration.parameterization
        ));
    }
    if calibration.sigma_scale > 1.0 {
        lines.push(format!(
            "  σ            × {:.2}: the estimates have changed more than their σ allow\n",
            calibration.sigma_scale
        ));
    }
    lines.extend(verdict_lines(&calibration.estimability));
    if let Some(rank) = &summary.rank {
        lines.push(format!(
            "  rank         structural {} of {}, informed {}; deficit: {} parameterization, {} joints, {} absorbed, {} motion\n",
            rank.rank_structural,
            rank.columns,
            rank.rank_informed,
            rank.deficit.parameterization,
            rank.deficit.joints,
            rank.deficit.absorbed,
            rank.deficit.motion
        ));
        let null_throughout = |known: &KnownLossSummary| known.agreeing == known.steps;
        if !rank.known.is_empty() {
            let agreeing = rank.known.iter().filter(|known| null_throughout(known)).count();
            lines.push(format!(
                "  structure    {agreeing} of {} closed-form null directions confirmed in every step; {}\n",
                rank.known.len(),
                spurious_information(&rank.known)
            ));
        }
        lines.extend(rank.known.iter().filter(|known| !null_throughout(known)).map(|known| {
            format!("               confirmed in {} of {} steps only: {}\n", known.agreeing, known.steps, known.reason)
        }));
    }
    if let (Some(timing), Some(factor)) = (&summary.timing_ms, summary.real_time_factor) {
        let stages = timing.0.iter().map(|(key, stage)| {
            let name = if *key == "frontend" { "front end" } else { key };
            format!("{name} {:.1}/{:.1}", stage.p50, stage.p95)
        });
        let stages = stages.collect::<Vec<_>>().join(", ");
        lines.push(format!("  ms p50/p95   {stages}; {factor:.1} × real time\n"));
    }
    for warning in &summary.warnings {
        lines.push(format!("  warning      {warning}\n"));
    }
    lines.push(format!("  files        {}\n", folder.display()));
    lines.concat()
}

/// The parameters by verdict, and the least determined one with its reason and its remedy.
fn verdict_lines(parameters: &[FlightParameter]) -> Vec<String> {
    let line = |verdict: Determination| {
        let of = parameters.iter().filter(|parameter| parameter.verdict == verdict);
        let names: Vec<&str> = of.map(|parameter| parameter.name.as_str()).collect();
        (!names.is_empty()).then(|| format!("{} ({}): {}", verdict.name(), names.len(), names.join(", ")))
    };
    let mut lines: Vec<String> = Determination::all().filter_map(line).collect();
    if lines.is_empty() {
        lines.push("fixed at the values of the rig".to_owned());
    }
    if let Some(least) = least_determined(parameters) {
        lines.push(format!("least determined: {}, {}", least.name, least.verdict_text()));
        lines.push(format!("  why: {}", least.reason));
        if !least.remedy.is_empty() {
            lines.push(format!("  what helps: {}", least.remedy));
        }
    }
    let indented = lines.iter().enumerate();
    indented.map(|(place, text)| format!("  {:<13}{text}\n", if place == 0 { "calibration" } else { "" })).collect()
}

/// Spurious information of the priors along the unobservable directions.
fn spurious_information(known: &[KnownLossSummary]) -> String {
    let claimed = known.iter().map(|known| known.largest_spurious_gain).filter(|gain| *gain > MIN_SPURIOUS_GAIN);
    match (claimed.clone().count(), claimed.fold(0.0, f64::max)) {
        (0, _) => "no spurious information".to_owned(),
        (count, most) => format!("spurious information on {count} of them, up to {most:.2} (1: σ of 10° or 3 cm)"),
    }
}
