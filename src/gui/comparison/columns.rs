//! Label and style of the columns of the panel: runs, then trajectories.

use crate::gui::theme::{RunStyle, Theme};
use crate::session::Recording;

/// Label of a column of the panel: of a run, then of a trajectory.
pub(super) fn label_of(recording: &Recording, index: usize) -> &str {
    let lane = |index: usize| recording.trajectories.get(index).map_or("", |lane| lane.label.as_str());
    match recording.runs.get(index) {
        Some(run) => &run.spec.label,
        None => lane(index - recording.runs.len()),
    }
}

/// Style of a column of the panel: of a run, then of a trajectory.
pub(super) fn style_of(recording: &Recording, theme: &Theme, index: usize) -> RunStyle {
    let runs = recording.runs.len();
    if index < runs { theme.run(index) } else { theme.trajectory(index - runs) }
}
