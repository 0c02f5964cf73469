//! Stamps that are wrong in a cycle: images that are not in their order, and two sources that take turns.

use nalgebra::{DMatrix, DVector, Vector3};

use super::fit::{Fitted, Fitter};
use crate::faults::{Fault, FaultKind};
use crate::geometry::seconds_from_ns;
use crate::log_check::permutations::permutations;
use crate::log_check::rotations::data::MeasuredRotation;
use crate::log_check::rotations::fit::{RotationFit, RotationPair, TAIL_DEGREES, tail_cost};

/// Lengths of a cycle in images, and the longest one of which all orders are tried.
const CYCLES: std::ops::RangeInclusive<usize> = 2..=6;
const LONGEST_ORDERED: usize = 4;
/// Starts of a cycle that are followed, and iterations.
const FOLLOWED: usize = 3;
const ITERATIONS: usize = 6;
/// Step of a difference quotient, in seconds.
const STEP_S: f64 = 2e-3;
/// Smallest difference of the stamps of a cycle that is one, in seconds.
const SMALLEST_S: f64 = 2e-3;

/// Rotations of consecutive images and the place of each image in a cycle.
struct Cycle<'a> {
    fitter: &'a Fitter<'a>,
    /// Stamps of all images in nanoseconds since the log began, in order.
    stamps_ns: &'a [i64],
    length: usize,
    period_s: f64,
}

/// Fit with stamps that are wrong in a cycle, of the length that the criterion prefers; `None` if they are not.
pub(super) fn fit(fitter: &Fitter<'_>) -> Option<Fitted> {
    let camera = fitter.data.camera;
    let mut stamps_ns: Vec<i64> =
        fitter.data.survey.topics.get(&camera.topic)?.times.iter().map(|times| times.stamp_ns).collect();
    stamps_ns.sort_unstable();
    stamps_ns.dedup();
    let period_s = seconds_from_ns(stamps_ns.last()? - stamps_ns.first()?) / stamps_ns.len() as f64;
    let fits = CYCLES.filter_map(|length| Cycle { fitter, stamps_ns: &stamps_ns, length, period_s }.fit());
    fits.min_by(|one, other| one.criterion.total_cmp(&other.criterion))
}

impl Cycle<'_> {
    fn fit(&self) -> Option<Fitted> {
        let starts: Vec<Vec<f64>> = if self.length <= LONGEST_ORDERED {
            let shifts = |order: Vec<usize>| {
                order.iter().enumerate().map(|(place, at)| (*at as f64 - place as f64) * self.period_s).collect()
            };
            permutations(self.length).into_iter().map(shifts).collect()
        } else {
            vec![vec![0.0; self.length]]
        };
        let mut tried: Vec<(f64, Vec<f64>)> = starts.into_iter().map(|start| (self.cost(&start), start)).collect();
        tried.sort_by(|one, other| one.0.total_cmp(&other.0));
        let refined = tried.into_iter().take(FOLLOWED).map(|(_, start)| {
            let shifts = self.refined(start);
            (self.cost(&shifts), shifts)
        });
        let (_, shifts_s) = refined.min_by(|one, other| one.0.total_cmp(&other.0))?;
        let largest_s = shifts_s.iter().copied().map(f64::abs).fold(0.0, f64::max);
        if largest_s < SMALLEST_S {
            return None;
        }
        let pairs: Vec<RotationPair> = self.pairs(&shifts_s, [0.0; 2]).into_iter().map(|(_, pair)| pair).collect();
        let fit: RotationFit = self.fitter.fit_pairs(&pairs)?;
        let criterion = self.fitter.criterion(&fit, self.length - 1);
        Some(Fitted { fault: Fault::new(FaultKind::ImageOrder, &shifts_s), fit, criterion })
    }

    /// Place in the cycle of the image with the nearest stamp.
    fn place(&self, stamp_ns: i64) -> usize {
        let after = self.stamps_ns.partition_point(|stamp| *stamp < stamp_ns);
        let distance_ns =
            |number: &usize| self.stamps_ns.get(*number).map_or(i64::MAX, |stamp| (stamp - stamp_ns).abs());
        let number = [after.saturating_sub(1), after].into_iter().min_by_key(distance_ns).unwrap_or(after);
        number % self.length
    }

    /// Pairs of consecutive images with shifted stamps and the places of their images; `further_s` is added to the stamps of
    /// first and second images.
    fn pairs(&self, shifts_s: &[f64], further_s: [f64; 2]) -> Vec<([usize; 2], RotationPair)> {
        let predictor = self.fitter.data.predictor(self.fitter.chain, None);
        let pair = |measured: &MeasuredRotation| {
            let rotation = &measured.rotation;
            let places = [self.place(rotation.from_ns), self.place(rotation.to_ns)];
            let [from_s, to_s] = [0, 1].map(|end| shifts_s[places[end]] + further_s[end]);
            Some((places, predictor.pair_at(measured, [from_s, to_s])?))
        };
        self.fitter.data.measured.iter().filter_map(pair).collect()
    }

    fn cost(&self, shifts_s: &[f64]) -> f64 {
        let square = |(_, pair): &([usize; 2], RotationPair)| tail_cost(square(pair, &self.difference(pair)));
        self.pairs(shifts_s, [0.0; 2]).iter().map(square).sum()
    }

    fn difference(&self, pair: &RotationPair) -> Vector3<f64> {
        pair.measured - pair.predicted(self.fitter.chain)
    }

    /// Shifts with a mean of zero by Gauss-Newton's method with the weights of a t distribution.
    fn refined(&self, mut shifts_s: Vec<f64>) -> Vec<f64> {
        let length = self.length;
        for _ in 0..ITERATIONS {
            let [at, first, second] = [[0.0; 2], [STEP_S, 0.0], [0.0, STEP_S]].map(|step| self.pairs(&shifts_s, step));
            if first.len() != at.len() || second.len() != at.len() {
                return shifts_s;
            }
            // A shift of all stamps is a time offset.
            let mut hessian = DMatrix::from_element(length, length, 1.0 / self.period_s.powi(2));
            hessian += DMatrix::identity(length, length) / self.period_s.powi(2);
            let mut gradient = DVector::zeros(length);
            for ((places, pair), ((_, by_first), (_, by_second))) in at.iter().zip(first.iter().zip(&second)) {
                let difference = self.difference(pair);
                let information =
                    (TAIL_DEGREES + 3.0) / (TAIL_DEGREES + square(pair, &difference)) / variance_rad2(pair);
                let slopes = [by_first, by_second].map(|other| (self.difference(other) - difference) / STEP_S);
                for (end, slope) in slopes.iter().enumerate() {
                    gradient[places[end]] -= slope.dot(&difference) * information;
                    for (other, other_slope) in slopes.iter().enumerate() {
                        hessian[(places[end], places[other])] += slope.dot(other_slope) * information;
                    }
                }
            }
            let Some(factor) = hessian.cholesky() else { return shifts_s };
            let step = factor.solve(&gradient);
            for (shift_s, step_s) in shifts_s.iter_mut().zip(step.iter()) {
                *shift_s += step_s.clamp(-0.5 * self.period_s, 0.5 * self.period_s);
            }
            let mean_s = shifts_s.iter().sum::<f64>() / length as f64;
            for shift_s in &mut shifts_s {
                *shift_s -= mean_s;
            }
        }
        shifts_s
    }
}

/// Squared difference in units of the mean variance of its axes.
fn square(pair: &RotationPair, difference: &Vector3<f64>) -> f64 {
    difference.norm_squared() / variance_rad2(pair)
}

/// Mean variance of a rotation per axis.
fn variance_rad2(pair: &RotationPair) -> f64 {
    (pair.covariance_rad2.trace() / 3.0).max(f64::MIN_POSITIVE)
}
