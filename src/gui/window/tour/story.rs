//! The stops of the tour, and the run and stamp on which it is based.

use std::sync::Arc;

use crate::geometry::ns_from_seconds;
use crate::gimbal::Parameterization;
use crate::gui::PanelName;
use crate::gui::window::tiles::Preset;
use crate::session::{RunRecord, StepRecord};

/// Run with a redundant parameterization.
pub(super) const CLASSICAL: &str = "classical";

/// Duration of the examined interval after the first rank, in seconds.
const SPAN_S: f64 = 6.0;
/// Time in seconds between the loss of a direction and the stamp of the tour.
const LOST_S: f64 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Log,
    Image,
    Convergence,
    Which,
    Why,
    Remedy,
}

impl Stop {
    pub(super) const ALL: [Self; 6] = [Self::Log, Self::Image, Self::Convergence, Self::Which, Self::Why, Self::Remedy];

    /// The layout, and the panel that the card points at.
    pub(super) const fn place(self) -> (Preset, PanelName) {
        match self {
            Self::Log => (Preset::Overview, PanelName::Timeline),
            Self::Image => (Preset::Overview, PanelName::Image),
            Self::Convergence => (Preset::Calibration, PanelName::Convergence),
            Self::Which | Self::Why | Self::Remedy => (Preset::Calibration, PanelName::Rank),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Story {
    pub(super) run: u64,
    /// Stamp of the step in nanoseconds since the log began; `None` until it is computed.
    pub(super) instant_ns: Option<i64>,
}

impl Story {
    pub(super) fn new(run: &RunRecord) -> Self {
        Self { run: run.id, instant_ns: None }
    }

    pub(super) fn run(self, runs: &[RunRecord]) -> Option<&RunRecord> {
        runs.iter().find(|run| run.id == self.run)
    }

    pub(super) fn step(self, runs: &[RunRecord]) -> Option<&Arc<StepRecord>> {
        self.run(runs)?.step_at(self.instant_ns?)
    }

    /// Finds the stamp as soon as the run has computed enough steps.
    pub(super) fn read(&mut self, runs: &[RunRecord]) {
        if self.instant_ns.is_none() {
            self.instant_ns = self.run(runs).and_then(instant_ns);
        }
    }
}

/// Stamp of the step shortly after the informed rank has fallen from its maximum, within the first seconds of tracking;
/// of the last step of a run without a rank. `None` while too few steps are computed.
fn instant_ns(run: &RunRecord) -> Option<i64> {
    let over = run.has_ended();
    let last_ns = run.steps.last()?.report.stamp_ns;
    let informed = |step: &StepRecord| {
        step.rank.as_ref().filter(|rank| !rank.parameters.is_empty()).map(|rank| rank.rank_informed)
    };
    let ranked: Vec<(i64, usize)> =
        run.steps.iter().filter_map(|step| Some((step.report.stamp_ns, informed(step)?))).collect();
    let Some((first_ns, _)) = ranked.first() else { return over.then_some(last_ns) };
    let end_ns = first_ns + ns_from_seconds(SPAN_S);
    if !over && last_ns < end_ns {
        return None;
    }
    let ranked = &ranked[..ranked.partition_point(|(stamp_ns, _)| *stamp_ns <= end_ns)];
    let largest = ranked.iter().map(|(_, rank)| *rank).max()?;
    let (fell_ns, _) = ranked.iter().rev().find(|(_, rank)| *rank == largest)?;
    let wanted_ns = fell_ns + ns_from_seconds(LOST_S);
    ranked.iter().find(|(stamp_ns, _)| *stamp_ns >= wanted_ns).or_else(|| ranked.last()).map(|(stamp_ns, _)| *stamp_ns)
}

/// Index of a run with the classical parameterization that has a step.
pub(super) fn classical(runs: &[RunRecord]) -> Option<usize> {
    runs.iter().position(|run| {
        run.steps.first().is_some_and(|step| step.report.calibration.parameterization == Parameterization::Classical)
    })
}
