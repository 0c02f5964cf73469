//! Systematic errors of the encoders: scale, first harmonic and drift of each joint, tested one at a time.
//!
//! Each is added to the readings as a function with unknown coefficients, everything else is estimated again. It is
//! significant if the F test of its coefficients is below 1 % divided by the number of tests.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::fit::StillsFit;
use super::loops::EncoderTerm;
use crate::geometry::f_survival;

/// Probability that any of the tests is significant without a systematic error.
const LEVEL: f64 = 0.01;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum EncoderErrorKind {
    /// The error grows in proportion to the reading: coefficient without unit.
    Scale,
    /// `a sin q + b cos q`, an eccentric encoder disc: coefficients in rad.
    Harmonic,
    /// The error grows from set to set in the order of the file: coefficient in rad from first to last set.
    Drift,
}

impl EncoderErrorKind {
    const ALL: [Self; 3] = [Self::Scale, Self::Harmonic, Self::Drift];

    /// Functions of a reading and of the position of its set in the file, 0 to 1.
    fn functions(self) -> &'static [fn(f64, f64) -> f64] {
        match self {
            Self::Scale => &[|reading, _| reading],
            Self::Harmonic => &[|reading, _| reading.sin(), |reading, _| reading.cos()],
            Self::Drift => &[|_, position| position - 0.5],
        }
    }
}

/// Test of one systematic error of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EncoderTest {
    pub joint: String,
    pub kind: EncoderErrorKind,
    /// Coefficients with their standard deviations.
    pub coefficients: Vec<[f64; 2]>,
    pub f: f64,
    /// Degrees of freedom of numerator and denominator.
    pub degrees_of_freedom: [usize; 2],
    pub probability: f64,
    pub significant: bool,
    /// σ of the encoder with and without this error, in degrees.
    pub encoder_sigma_deg: [f64; 2],
}

/// Tests of all joints, in the order of the joints; tests whose equations are singular are missing.
pub(super) fn encoder_tests(fit: &StillsFit<'_>, joints: &[String]) -> Vec<EncoderTest> {
    let tests: Vec<(usize, EncoderErrorKind)> =
        (0..joints.len()).flat_map(|joint| EncoderErrorKind::ALL.map(|kind| (joint, kind))).collect();
    let level = LEVEL / tests.len().max(1) as f64;
    tests.par_iter().filter_map(|(joint, kind)| test(fit, *joint, *kind, &joints[*joint], level)).collect()
}

fn test(fit: &StillsFit<'_>, joint: usize, kind: EncoderErrorKind, name: &str, level: f64) -> Option<EncoderTest> {
    let last = fit.loops.sets.last()?.index.max(1) as f64;
    let terms: Vec<EncoderTerm> = kind
        .functions()
        .iter()
        .map(|function| EncoderTerm {
            joint,
            values: fit
                .loops
                .sets
                .iter()
                .map(|set| function(set.readings_rad[joint], set.index as f64 / last))
                .collect(),
        })
        .collect();
    let count = terms.len();
    let used = fit.wrong.iter().filter(|wrong| !**wrong).count();
    let residual_freedom = used.checked_sub(count + 1).filter(|freedom| *freedom > 0)?;
    let extended = fit.with_terms(terms)?;
    let first = extended.posterior.common.nrows() - count;
    let covariance: DMatrix<f64> = extended.posterior.common.view((first, first), (count, count)).into_owned();
    let values = DVector::from_column_slice(&extended.state.effects);
    let sigmas = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    let f = values.dot(&covariance.cholesky()?.solve(&values)) / count as f64;
    let probability = f_survival(f, count, residual_freedom);
    Some(EncoderTest {
        joint: name.to_owned(),
        kind,
        coefficients: values.iter().zip(&sigmas).map(|(value, sigma)| [*value, *sigma]).collect(),
        f,
        degrees_of_freedom: [count, residual_freedom],
        probability,
        significant: probability < level,
        encoder_sigma_deg: [&extended, fit].map(|fit| fit.loops.noise.encoder_rad[joint].to_degrees()),
    })
}
