//! Noise terms fitted to an Allan deviation.
//!
//! `σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3` (IEEE Std 952, annex C), by weighted least squares over octaves of
//! τ, whose estimates are nearly independent. The relative variance of a point is `2/edf`, with the degrees of freedom
//! of the noise that dominates there. Terms that are not significant are removed from the sum.

use nalgebra::{DMatrix, DVector};

use super::allan::{AllanPhase, AllanVariance, NoiseKind, degrees_of_freedom};

/// Relative standard deviation of `√σ²` due to errors of the model: filters, temperature.
const MODEL_ERROR: f64 = 0.02;
/// A term is identified if the fit without it is worse by this many standard deviations; with few degrees of freedom
/// the points have long tails.
const SIGNIFICANT: f64 = 4.0;
/// Minimum ratio of quantization in the variance at the shortest τ: filters of a sensor bend the curve there.
const QUANTIZATION_RATIO: f64 = 0.3;
/// The slope of the sum of terms never decreases with the averaging time. If the slope of the variance decreases by
/// more than this (and by more than chance), the shorter averaging times belong to a low-pass filter.
const FILTER_BEND: f64 = 0.35;
/// Slopes with a larger standard deviation are not tested for a filter.
const CLEAR_SLOPE: f64 = 0.15;
/// Factor on the standard deviations of flicker noise and random walk: the estimates of adjacent octaves are correlated there
/// (found by simulation, tested).
const CORRELATED: f64 = 1.4;
/// Lowest variance of the model by which a point is weighted, as a ratio of the measured variance.
const LOWEST_VARIANCE: f64 = 0.05;
/// Iterations of weights and degrees of freedom.
const ROUNDS: usize = 4;
/// Factor of `B²` in the variance, the square of 0.664.
const FLICKER_FACTOR: f64 = 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI;

/// Terms in the order of their slopes.
pub(super) const KINDS: [NoiseKind; 4] =
    [NoiseKind::Quantization, NoiseKind::White, NoiseKind::Flicker, NoiseKind::RandomWalk];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coefficient {
    pub(super) value: f64,
    pub(super) sigma: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fit {
    /// `3 Q²`, `N²`, `0.664² B²` and `K²/3` with their standard deviations; `None` for terms that are not significant.
    /// Above the averaging times of a filter the first one is negative: white noise through a low-pass filter has the
    /// variance `N²/τ − c/τ²` if τ is long compared with its response, with `c = 1.5 N² T` for a first-order filter
    /// with the time constant `T`.
    pub(super) coefficients: [Option<Coefficient>; 4],
    /// Indices of the used points.
    pub(super) used: Vec<usize>,
    /// Excluded averaging times are below this one: a filter of the sensor bends the curve there.
    pub(super) filtered_below_s: Option<f64>,
}

fn power(kind: usize, tau_s: f64) -> f64 {
    tau_s.powi(kind as i32 - 2)
}

impl Fit {
    /// Variance of the model at an averaging time.
    pub(super) fn variance(&self, tau_s: f64) -> f64 {
        self.coefficients
            .iter()
            .enumerate()
            .filter_map(|(kind, found)| Some(found.as_ref()?.value * power(kind, tau_s)))
            .sum()
    }

    /// True if the model is valid at an averaging time.
    pub(super) fn covers(&self, tau_s: f64) -> bool {
        self.filtered_below_s.is_none_or(|below_s| tau_s >= below_s)
    }

    /// Dominant term at an averaging time; white noise without any.
    pub(super) fn dominant(&self, tau_s: f64) -> NoiseKind {
        let size = |kind: usize| self.coefficients[kind].map_or(0.0, |found| found.value * power(kind, tau_s));
        let largest = (0..KINDS.len()).fold(1, |best, kind| if size(kind) > size(best) { kind } else { best });
        KINDS[largest]
    }

    /// Term in its own unit: `Q`, `N`, `B` or `K`.
    pub(super) fn term(&self, kind: NoiseKind) -> Option<Coefficient> {
        let index = KINDS.iter().position(|known| *known == kind)?;
        let Coefficient { value, sigma } = self.coefficients[index].filter(|found| found.value > 0.0)?;
        let factor = [3.0, 1.0, FLICKER_FACTOR, 1.0 / 3.0][index];
        let term = (value / factor).sqrt();
        Some(Coefficient { value: term, sigma: 0.5 * sigma / (factor * term) })
    }

    /// Fits the points that are not excluded; `None` with fewer than two of them. The points are means over `axes`
    /// independent axes, sampled in these stretches.
    pub(super) fn of(
        points: &[AllanVariance],
        excluded: &[bool],
        stretches: &[AllanPhase],
        axes: usize,
    ) -> Option<Self> {
        let mut used = Vec::new();
        let mut next = 0;
        for (index, point) in points.iter().enumerate() {
            if !excluded[index] && point.count >= next && point.variance > 0.0 {
                used.push(index);
                next = 2 * point.count;
            }
        }
        let filtered = filtered_points(points, &used, stretches, axes);
        let filtered_below_s = used.get(filtered).filter(|_| filtered > 0).map(|index| points[*index].tau_s);
        used.drain(..filtered);
        if used.len() < 2 {
            return None;
        }
        let mut fit = Self { coefficients: [None; 4], used, filtered_below_s };
        // Few points do not separate four terms.
        let mut kinds = match fit.used.len() {
            2 => vec![1],
            3..5 => vec![1, 3],
            _ => (0..KINDS.len()).collect(),
        };
        fit.refine(points, (stretches, axes), &kinds)?;
        while let Some((reduced, left)) = fit.without_least_significant(points, (stretches, axes), &kinds) {
            (fit, kinds) = (reduced, left);
        }
        Some(fit)
    }

    fn sign(&self, kind: usize) -> f64 {
        if kind == 0 && self.filtered_below_s.is_some() { -1.0 } else { 1.0 }
    }

    /// Solves with weights that follow the model.
    fn refine(&mut self, points: &[AllanVariance], stretches: (&[AllanPhase], usize), kinds: &[usize]) -> Option<()> {
        for round in 0..ROUNDS {
            self.solve(points, stretches, kinds, round == 0)?;
        }
        Some(())
    }

    /// The fit without its least significant term; `None` if all terms are significant. Both fits are compared with the
    /// weights of the smaller model. (A large term has large standard deviations at its own averaging times.)
    fn without_least_significant(
        &self,
        points: &[AllanVariance],
        stretches: (&[AllanPhase], usize),
        kinds: &[usize],
    ) -> Option<(Self, Vec<usize>)> {
        if kinds.len() < 2 {
            return None;
        }
        let shortest = points[*self.used.first()?].tau_s;
        let reductions = kinds.iter().filter_map(|kind| {
            let left: Vec<usize> = kinds.iter().copied().filter(|other| other != kind).collect();
            let mut reduced = Self { coefficients: [None; 4], ..self.clone() };
            reduced.refine(points, stretches, &left)?;
            let part = self.coefficients[*kind]?.value * power(*kind, shortest);
            // A term without separate curvature at the shortest τ is due to a filter.
            let is_filter = *kind == 0 && part >= 0.0 && part < QUANTIZATION_RATIO * self.variance(shortest);
            let chi2 = |model: &Self| -> f64 {
                let score = |index: &usize| {
                    let point = &points[*index];
                    (model.variance(point.tau_s) - point.variance) / reduced.sigma(point, stretches)
                };
                self.used.iter().map(score).map(|score| score * score).sum()
            };
            let lost = if is_filter { 0.0 } else { chi2(&reduced) - chi2(self) };
            Some((lost, reduced, left))
        });
        let (lost, reduced, left) = reductions.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (lost < SIGNIFICANT * SIGNIFICANT).then_some((reduced, left))
    }

    /// Standard deviation of a point's variance by the model.
    fn sigma(&self, point: &AllanVariance, (stretches, axes): (&[AllanPhase], usize)) -> f64 {
        let freedom = degrees_of_freedom(stretches, point.count, self.dominant(point.tau_s)).max(1.0) * axes as f64;
        self.variance(point.tau_s).max(LOWEST_VARIANCE * point.variance)
            * (2.0 / freedom + (2.0 * MODEL_ERROR).powi(2)).sqrt()
    }

    /// One weighted least-squares solution over some terms, all with the right sign.
    fn solve(
        &mut self,
        points: &[AllanVariance],
        (stretches, axes): (&[AllanPhase], usize),
        kinds: &[usize],
        first: bool,
    ) -> Option<()> {
        let rows = self.used.len();
        let mut design = DMatrix::zeros(rows, kinds.len());
        let mut target = DVector::zeros(rows);
        for (row, index) in self.used.iter().enumerate() {
            let point = &points[*index];
            let sigma = if first {
                let freedom = degrees_of_freedom(stretches, point.count, NoiseKind::White).max(1.0) * axes as f64;
                point.variance * (2.0 / freedom + (2.0 * MODEL_ERROR).powi(2)).sqrt()
            } else {
                self.sigma(point, (stretches, axes))
            };
            for (column, kind) in kinds.iter().enumerate() {
                design[(row, column)] = self.sign(*kind) * power(*kind, point.tau_s) / sigma;
            }
            target[row] = point.variance / sigma;
        }
        let (solution, covariance) = nonnegative(&design, &target)?;
        self.coefficients = [None; 4];
        for (column, kind) in kinds.iter().enumerate() {
            let correlated = if *kind >= 2 { CORRELATED } else { 1.0 };
            let sigma = correlated * covariance[(column, column)].sqrt();
            self.coefficients[*kind] = Some(Coefficient { value: self.sign(*kind) * solution[column], sigma });
        }
        Some(())
    }
}

/// Number of the shortest averaging times that precede a steeper part of the curve.
fn filtered_points(points: &[AllanVariance], used: &[usize], stretches: &[AllanPhase], axes: usize) -> usize {
    let relative_variance = |point: &AllanVariance| {
        2.0 / (degrees_of_freedom(stretches, point.count, NoiseKind::White).max(1.0) * axes as f64)
    };
    let slope = |pair: &[usize]| {
        let [from, to] = [pair[0], pair[1]].map(|index| &points[index]);
        let octaves = (to.tau_s / from.tau_s).ln();
        let sigma = (relative_variance(from) + relative_variance(to)).sqrt() / octaves;
        ((to.variance / from.variance).ln() / octaves, sigma)
    };
    let slopes: Vec<(f64, f64)> = used.windows(2).map(slope).take_while(|(_, sigma)| *sigma < CLEAR_SLOPE).collect();
    let Some(steepest) = (0..slopes.len()).min_by(|a, b| slopes[*a].0.total_cmp(&slopes[*b].0)) else { return 0 };
    let (least, least_sigma) = slopes[steepest];
    let bends = |(slope, sigma): &(f64, f64)| slope - least > FILTER_BEND + SIGNIFICANT * sigma.hypot(least_sigma);
    slopes[..steepest].iter().rposition(bends).map_or(0, |last| last + 1)
}

/// Nonnegative least squares: the best of all subsets of the columns whose solution is not negative. The covariance is
/// computed with all columns.
fn nonnegative(design: &DMatrix<f64>, target: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let columns = design.ncols();
    // Columns are scaled to keep the normal equations well conditioned.
    let scales: Vec<f64> = (0..columns).map(|column| design.column(column).norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(design.nrows(), columns, |row, column| design[(row, column)] / scales[column]);
    let normal = scaled.tr_mul(&scaled);
    let mut best: Option<(f64, DVector<f64>)> = None;
    for subset in 1_u32..1 << columns {
        let chosen: Vec<usize> = (0..columns).filter(|column| subset >> column & 1 == 1).collect();
        let part = scaled.select_columns(&chosen);
        let Some(solved) = part.tr_mul(&part).cholesky().map(|factor| factor.solve(&part.tr_mul(target))) else {
            continue;
        };
        if solved.iter().any(|value| *value < 0.0) {
            continue;
        }
        let rest = (&part * &solved - target).norm_squared();
        if best.as_ref().is_none_or(|(least, _)| rest < *least) {
            let mut solution = DVector::zeros(columns);
            for (column, value) in chosen.iter().zip(solved.iter()) {
                solution[*column] = value / scales[*column];
            }
            best = Some((rest, solution));
        }
    }
    let inverse = normal.try_inverse()?;
    let covariance =
        DMatrix::from_fn(columns, columns, |row, column| inverse[(row, column)] / (scales[row] * scales[column]));
    Some((best?.1, covariance))
}
