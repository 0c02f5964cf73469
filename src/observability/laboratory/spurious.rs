//! Spurious information: an old and a new window, linearized at different values of the calibration, together constrain
//! directions that are unobservable in each of them (docs/mathematics.md, section 9).
//!
//! A marginalization prior and the window do so when the calibration has changed between them. With first-estimate
//! Jacobians both are linearized at the old value.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::LaboratoryForm;
use super::experiments::{GENERIC, GENERIC_WITHOUT_ENCODER};
use crate::estimator::HypotheticalWindow;
use crate::geometry::{Dimension, SplitMix64, dense};
use crate::gimbal::{Chain, ClassicalChain, Parameterization};
use crate::observability::analysis::measured_block;

/// Frames of each of the two windows.
const FRAMES: usize = 10;
/// Random changes of the calibration per row of the table.
const DRAWS: u64 = 8;
/// A direction with a larger scaled singular value counts as constrained: σ below its scale of 10° or 3 cm.
const KNOWN: f64 = 1.0;

/// Heading of the rows.
pub(super) fn title() -> String {
    format!(
        "Spurious information of two windows with different calibrations: largest scaled singular value along the directions\n\
         that are unobservable in both (1: σ of 10° or 3 cm), and the number above 1; {DRAWS} random draws"
    )
}

/// Spurious information along the null directions of one parameterization.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpuriousRow {
    pub form: String,
    /// True if the joint angles are known.
    pub encoder: bool,
    /// Bounds of the uniform random changes: of each angle in degrees, of each length in millimetres.
    pub change: (f64, f64),
    /// Number of directions that are unobservable in both windows.
    pub null: usize,
    /// Largest singular value of these directions with both windows linearized at the first value.
    pub with_first_estimates: f64,
    /// Largest singular value with each window linearized at its own value: minimum and maximum over the draws.
    pub without: (f64, f64),
    /// Number of singular values over 1: minimum and maximum over the draws.
    pub known: (usize, usize),
}

struct Case {
    parameterization: Parameterization,
    encoder: bool,
    change: (f64, f64),
}

const CASES: [Case; 6] = [
    Case { parameterization: Parameterization::Classical, encoder: true, change: (0.1, 1.0) },
    Case { parameterization: Parameterization::Classical, encoder: true, change: (1.0, 10.0) },
    Case { parameterization: Parameterization::Classical, encoder: true, change: (10.0, 30.0) },
    Case { parameterization: Parameterization::Minimal, encoder: true, change: (10.0, 30.0) },
    Case { parameterization: Parameterization::Minimal, encoder: false, change: (10.0, 30.0) },
    Case { parameterization: Parameterization::Poe, encoder: false, change: (10.0, 30.0) },
];

pub(super) fn measure() -> Vec<SpuriousRow> {
    CASES.par_iter().filter_map(Case::measure).collect()
}

impl Case {
    fn measure(&self) -> Option<SpuriousRow> {
        let setup = if self.encoder { GENERIC } else { GENERIC_WITHOUT_ENCODER }.setup_of(FRAMES)?;
        let (old, new) = (setup.window_from(0), setup.window_from(FRAMES));
        let form = LaboratoryForm::whole(self.parameterization);
        let chain = &setup.mechanism.chain;
        let scaled_block = |window: &HypotheticalWindow, chain: &ClassicalChain| {
            measured_block(&window.linearize(chain, form.parameterization, form.joint_offsets))
        };
        let (before, after) = (scaled_block(&old, chain)?, scaled_block(&new, chain)?);
        let consistent = stacked_singular_values(&before.block, &after.block)?;
        let threshold = before.structural_threshold.max(after.structural_threshold);
        let rank = consistent.iter().filter(|value| **value > threshold).count();
        let mut without = (f64::INFINITY, 0.0_f64);
        let mut known = (usize::MAX, 0);
        for draw in 1..=DRAWS {
            let moved = scaled_block(&new, &changed(chain, self.change, draw))?;
            let values = stacked_singular_values(&before.block, &moved.block)?;
            let spurious = &values[rank..];
            let most = spurious.first().copied().unwrap_or(0.0);
            let count = spurious.iter().filter(|value| **value > KNOWN).count();
            without = (without.0.min(most), without.1.max(most));
            known = (known.0.min(count), known.1.max(count));
        }
        let with_first_estimates = consistent.get(rank).copied().unwrap_or(0.0);
        Some(SpuriousRow {
            form: form.name(),
            encoder: self.encoder,
            change: self.change,
            null: consistent.len() - rank,
            with_first_estimates,
            without,
            known,
        })
    }
}

/// Singular values of the two stacked blocks.
fn stacked_singular_values(old: &DMatrix<f64>, new: &DMatrix<f64>) -> Option<Vec<f64>> {
    let mut both = old.clone().resize_vertically(old.nrows() + new.nrows(), 0.0);
    both.rows_mut(old.nrows(), new.nrows()).copy_from(new);
    dense::singular_values(&both)
}

/// Chain with uniform random changes of each angle and each length, up to these bounds.
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
        let (degrees, millimetres) = self.change;
        let encoder = if self.encoder { "" } else { ", no encoder" };
        let scenario = format!("{}{encoder}, change {degrees}° {millimetres} mm", self.form);
        write!(out, "  {scenario:<42}")?;
        if self.null == 0 {
            return write!(out, "full rank");
        }
        let (least, most) = self.without;
        let known = match self.known {
            (least, most) if least == most => least.to_string(),
            (least, most) => format!("{least} to {most}"),
        };
        write!(
            out,
            "with FEJ {:.0e}, without {least:.2} to {most:.2}; above 1: {known} of {}",
            self.with_first_estimates, self.null
        )
    }
}
