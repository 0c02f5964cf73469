//! Spurious information: an old window and a new one, linearized at different values of the calibration, together
//! constrain directions that neither observes (docs/mathematics.md, section 9).
//!
//! That is what a marginalization prior does beside the window when the calibration has moved meanwhile. With first
//! estimates both are linearized at the old value.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::LaboratoryForm;
use super::table::setup;
use super::truth::{Joints, Poses};
use crate::estimator::HypotheticalWindow;
use crate::geometry::{Dimension, SplitMix64, dense};
use crate::gimbal::{Chain, ClassicalChain, Parameterization};
use crate::observability::analysis::measured_block;

/// Frames of each of the two windows.
const FRAMES: usize = 10;
/// Changes of the calibration that are drawn for each row.
const DRAWS: u64 = 8;
/// A direction that is claimed this much counts as known: as much as its scale of 10° or 3 cm.
const KNOWN: f64 = 1.0;
/// With first estimates nothing above this is claimed.
const ROUNDING: f64 = 1e-9;

/// Heading of the rows.
pub(super) fn title() -> String {
    format!(
        "Two windows, the calibration changed between them: the most that they claim together of what neither sees\n  \
         (1: as much as 10° or 3 cm), and how many such directions are claimed over 1; {DRAWS} draws"
    )
}

/// What is claimed of a form's null directions by two windows together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpuriousRow {
    /// Name of the form.
    pub form: String,
    /// Whether the joint angles are known.
    pub encoder: bool,
    /// How far the calibration moved between the windows, each angle and each length up to this either way: in degrees and
    /// in millimetres.
    pub change: (f64, f64),
    /// Number of directions that neither window sees.
    pub null: usize,
    /// The largest singular value of these, both windows linearized at the first value.
    pub with_first_estimates: f64,
    /// The same with each window linearized at its own value: least and most over the draws.
    pub without: (f64, f64),
    /// How many of them are then over 1: least and most over the draws.
    pub known: (usize, usize),
    /// The largest singular value in docs/mathematics.md, section 9.
    pub without_expected: f64,
    /// The numbers above 1 in docs/mathematics.md, section 9: least and most.
    pub known_expected: (usize, usize),
    /// Whether the measured range overlaps the expected one, and first estimates add no information.
    pub agrees: bool,
}

struct Case {
    parameterization: Parameterization,
    joints: Joints,
    change: (f64, f64),
    without: f64,
    known: (usize, usize),
}

const CASES: [Case; 6] = [
    case(Parameterization::Classical, Joints::Known, (0.1, 1.0), 0.7, (0, 0)),
    case(Parameterization::Classical, Joints::Known, (1.0, 10.0), 5.7, (1, 2)),
    case(Parameterization::Classical, Joints::Known, (10.0, 30.0), 7.3, (2, 3)),
    case(Parameterization::Minimal, Joints::Known, (10.0, 30.0), 0.0, (0, 0)),
    case(Parameterization::Minimal, Joints::Free, (10.0, 30.0), 0.0, (0, 0)),
    case(Parameterization::Poe, Joints::Free, (10.0, 30.0), 0.48, (0, 0)),
];

const fn case(
    parameterization: Parameterization,
    joints: Joints,
    change: (f64, f64),
    without: f64,
    known: (usize, usize),
) -> Case {
    Case { parameterization, joints, change, without, known }
}

/// Every case of docs/mathematics.md, section 9.
pub(super) fn measure() -> Vec<SpuriousRow> {
    CASES.par_iter().filter_map(Case::measure).collect()
}

impl Case {
    fn measure(&self) -> Option<SpuriousRow> {
        let setup = setup("generic", self.joints, Poses::Known, FRAMES)?;
        let (old, new) = (setup.window_from(0), setup.window_from(FRAMES));
        let form = LaboratoryForm::whole(self.parameterization);
        let chain = &setup.mechanism.chain;
        let seen = |window: &HypotheticalWindow, chain: &ClassicalChain| {
            measured_block(&window.linearize(chain, form.parameterization, form.joint_offsets))
        };
        let (before, after) = (seen(&old, chain)?, seen(&new, chain)?);
        let consistent = stacked_singular_values(&before.block, &after.block)?;
        let threshold = before.structural_threshold.max(after.structural_threshold);
        let rank = consistent.iter().filter(|value| **value > threshold).count();
        let mut without = (f64::INFINITY, 0.0_f64);
        let mut known = (usize::MAX, 0);
        for draw in 1..=DRAWS {
            let moved = seen(&new, &changed(chain, self.change, draw))?;
            let values = stacked_singular_values(&before.block, &moved.block)?;
            let spurious = &values[rank..];
            let most = spurious.first().copied().unwrap_or(0.0);
            let count = spurious.iter().filter(|value| **value > KNOWN).count();
            without = (without.0.min(most), without.1.max(most));
            known = (known.0.min(count), known.1.max(count));
        }
        let with_first_estimates = consistent.get(rank).copied().unwrap_or(0.0);
        let overlaps = known.0 <= self.known.1 && self.known.0 <= known.1;
        let none = self.without > 0.0 || without.1 <= ROUNDING;
        Some(SpuriousRow {
            form: form.name(),
            encoder: self.joints == Joints::Known,
            change: self.change,
            null: consistent.len() - rank,
            with_first_estimates,
            without,
            known,
            without_expected: self.without,
            known_expected: self.known,
            agrees: overlaps && none && with_first_estimates <= ROUNDING,
        })
    }
}

/// Singular values of two windows together.
fn stacked_singular_values(old: &DMatrix<f64>, new: &DMatrix<f64>) -> Option<Vec<f64>> {
    let mut both = old.clone().resize_vertically(old.nrows() + new.nrows(), 0.0);
    both.rows_mut(old.nrows(), new.nrows()).copy_from(new);
    dense::singular_values(&both)
}

/// The chain with each angle moved by up to so many degrees and each length by up to so many millimetres.
fn changed(chain: &ClassicalChain, (degrees, millimetres): (f64, f64), seed: u64) -> ClassicalChain {
    let chain = Chain::from_classical(chain, Parameterization::Classical);
    let mut random = SplitMix64::new(seed);
    let parameters = chain.parameters();
    let change = DVector::from_fn(parameters.len(), |column, _| {
        let most = match parameters[column].dimension() {
            Dimension::Angle => degrees.to_radians(),
            _ => millimetres * 1e-3,
        };
        most * (2.0 * random.next_unit() - 1.0)
    });
    chain.plus(&change).to_classical()
}

impl fmt::Display for SpuriousRow {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.agrees { ' ' } else { '!' };
        let (degrees, millimetres) = self.change;
        let encoder = if self.encoder { "" } else { ", no encoder" };
        let scenario = format!("{}{encoder}, change {degrees}° {millimetres} mm", self.form);
        write!(out, "{mark} {scenario:<42}")?;
        if self.null == 0 {
            return write!(out, "nothing is lost, so that nothing can be claimed");
        }
        let (least, most) = self.without;
        let range = |(least, most): (usize, usize)| {
            if least == most { least.to_string() } else { format!("{least} to {most}") }
        };
        write!(
            out,
            "first estimates {:.0e}, without {least:.2} to {most:.2} (expected {}); over 1: {}/{} of {}",
            self.with_first_estimates,
            self.without_expected,
            range(self.known),
            range(self.known_expected),
            self.null
        )
    }
}
