//! Parts of a run that trials compute again.

use nalgebra::Vector3;

use super::trial::{DiagnosedRun, LATER_S, TrialSpan};
use crate::geometry::ns_from_seconds;
use crate::session::engine::{History, OwnedStepInput};
use crate::session::misfit::StepMisfit;

/// Time before the first window of a run, or before an onset, at which trials start, in seconds.
const BEFORE_S: f64 = 2.0;
/// Time after it on which all changes are tried, in seconds, and on which the best ones are tried again.
const SCREENED_S: f64 = 4.5;
const CONFIRMED_S: f64 = 12.0;
/// The same for a run without a window, whose trials wait for one.
const LOST_SCREENED_S: f64 = 6.0;
/// Ratio of these times for a rolling shutter, whose steps take several times longer, and for a window of more frames.
const SHUTTER_RATIO: f64 = 0.45;
const FRAMES: f64 = 16.0;
/// Standard deviation of the specific force over a second from which on a vehicle moves, in m/s².
const MOVING_M_PER_S2: f64 = 0.4;

/// Span on which all changes are tried: from before the onset of the disagreement, before the first window, or before the
/// first motion of a run without one.
pub(super) fn screened_span(
    run: &DiagnosedRun<'_>,
    history: &History,
    given: &[StepMisfit],
    onset: Option<usize>,
) -> Option<TrialSpan> {
    let first_window = given.iter().position(|step| step.tracking);
    let stamp_ns = |step: usize| run.inputs.get(step).map_or(0, |input| input.stamp_ns);
    let (anchor, length_s) = match onset.or(first_window) {
        Some(step) => (step, SCREENED_S),
        None => (first_motion(&run.inputs), LOST_SCREENED_S),
    };
    let start = run.step_at(stamp_ns(anchor) - ns_from_seconds(BEFORE_S));
    let length_s = length_s * speed_ratio(run, given);
    let end = run.step_at(stamp_ns(anchor) + ns_from_seconds(length_s)).max(start + 1).min(run.inputs.len());
    // Before the first window an engine that starts later waits for the same motion.
    let is_start = onset.is_none() || first_window.is_some_and(|window| start <= window);
    let engine = history.engine_before(if is_start { 0 } else { start })?;
    let window_by = match first_window {
        Some(window) if is_start => Some(run.step_at(stamp_ns(window) + ns_from_seconds(LATER_S))),
        _ => None,
    };
    Some(TrialSpan { engine, steps: start..end, window_by, is_start })
}

/// The same span with more seconds at its end.
pub(super) fn confirmed_span(run: &DiagnosedRun<'_>, given: &[StepMisfit], span: &TrialSpan) -> TrialSpan {
    let length_s = BEFORE_S + CONFIRMED_S * speed_ratio(run, given);
    let from_ns = run.inputs.get(span.steps.start).map_or(0, |input| input.stamp_ns);
    let end = run.step_at(from_ns + ns_from_seconds(length_s));
    TrialSpan { steps: span.steps.start..end.max(span.steps.end), ..span.clone() }
}

/// Ratio by which spans are shorter for runs with slow steps.
fn speed_ratio(run: &DiagnosedRun<'_>, given: &[StepMisfit]) -> f64 {
    let shutter = run.spec.readout || run.rig.camera(run.camera_key).is_ok_and(|camera| camera.readout_s != 0.0);
    let windows = given.iter().filter(|step| step.tracking);
    let (count, frames) = windows.fold((0_usize, 0), |(count, frames), step| (count + 1, frames + step.frames));
    let mean = frames as f64 / count.max(1) as f64;
    let of_frames = if mean > FRAMES { FRAMES / mean } else { 1.0 };
    of_frames * if shutter { SHUTTER_RATIO } else { 1.0 }
}

/// First step after which the specific force changes over a second as in motion; 0 if it never does.
fn first_motion(inputs: &[std::sync::Arc<OwnedStepInput>]) -> usize {
    let mean = |input: &OwnedStepInput| {
        let count = input.imu.len().max(1) as f64;
        input.imu.iter().map(|sample| sample.specific_force_m_per_s2).sum::<Vector3<f64>>() / count
    };
    let forces: Vec<(i64, Vector3<f64>)> = inputs.iter().map(|input| (input.stamp_ns, mean(input))).collect();
    let moves = |from: usize| {
        let until_ns = forces[from].0 + ns_from_seconds(1.0);
        let second: Vec<Vector3<f64>> =
            forces[from..].iter().take_while(|(at_ns, _)| *at_ns < until_ns).map(|(_, force)| *force).collect();
        let average = second.iter().sum::<Vector3<f64>>() / second.len() as f64;
        let square = second.iter().map(|force| (force - average).norm_squared()).sum::<f64>() / second.len() as f64;
        square.sqrt() > MOVING_M_PER_S2
    };
    (0..forces.len()).find(|from| moves(*from)).unwrap_or(0)
}
