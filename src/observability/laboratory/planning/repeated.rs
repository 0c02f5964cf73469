//! The listed motions, continued over a whole flight.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::admitted::listed;
use super::moves::HandMove;
use super::search::SearchProblem;
use super::starts;
use crate::simulation::MotionSplines;

/// A listed motion that continues over a whole flight.
#[derive(Clone, Debug)]
pub(super) struct RepeatedMove {
    pub(super) choice: HandMove,
    pub(super) motion: MotionSplines,
    /// Information about the calibration at the end.
    pub(super) information: DMatrix<f64>,
}

impl RepeatedMove {
    /// All listed motions over a flight of this duration.
    pub(super) fn all(problem: &SearchProblem<'_>, duration_s: f64) -> Vec<Self> {
        let of = |choice: HandMove| {
            let flown = problem.evaluate(starts::as_described(problem, duration_s, &[choice]))?;
            Some(Self { choice, information: problem.total(&flown.windows), motion: flown.motion })
        };
        listed(problem, duration_s).into_par_iter().filter_map(of).collect()
    }
}
