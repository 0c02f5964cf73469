//! Noise terms fitted to an Allan deviation.
//!
//! `σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3` (IEEE Std 952, annex C), by weighted least squares over octaves of τ,
//! whose estimates are nearly independent. The relative variance of a point is `2/edf`, with the degrees of freedom of the
//! noise that dominates there. Terms that are not significant are taken out of the sum.

use nalgebra::{DMatrix, DVector};

use super::allan::{AllanVariance, NoiseKind, Phase, degrees_of_freedom};

/// Standard deviation of `√σ²` by which no sensor follows the sum of terms exactly: filters, temperature.
const MODEL_ERROR: f64 = 0.02;
/// A term is identified when the points are this many standard deviations off the others without it; with few degrees of
/// freedom they have long tails.
const SIGNIFICANT: f64 = 4.0;
/// Quantization must make up this part of the variance at the shortest τ: filters of a sensor bend the curve there.
const QUANTIZATION_RATIO: f64 = 0.3;
/// Factor on the standard deviations of flicker noise and random walk: the estimates of adjacent octaves are correlated there
/// (found by simulation, tested).
const CORRELATED: f64 = 1.4;
/// Refinements of weights and degrees of freedom.
const ROUNDS: usize = 4;
/// `B²` has this factor in the variance, the square of 0.664.
const FLICKER_FACTOR: f64 = 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI;

/// The terms in the order of their slopes.
pub(super) const KINDS: [NoiseKind; 4] =
    [NoiseKind::Quantization, NoiseKind::White, NoiseKind::Flicker, NoiseKind::RandomWalk];

/// A coefficient with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coefficient {
    pub(super) value: f64,
    pub(super) sigma: f64,
}

/// The fitted sum of terms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fit {
    /// `3 Q²`, `N²`, `0.664² B²` and `K²/3` with their standard deviations; `None` for terms that are not significant.
    pub(super) coefficients: [Option<Coefficient>; 4],
    /// Which points were used, by their index.
    pub(super) used: Vec<usize>,
}

fn power(kind: usize, tau_s: f64) -> f64 {
    tau_s.powi(kind as i32 - 2)
}

impl Fit {
    /// The variance of the model at an averaging time.
    pub(super) fn variance(&self, tau_s: f64) -> f64 {
        self.coefficients
            .iter()
            .enumerate()
            .filter_map(|(kind, found)| Some(found.as_ref()?.value * power(kind, tau_s)))
            .sum()
    }

    /// The term that dominates at an averaging time; white noise without any.
    pub(super) fn dominant(&self, tau_s: f64) -> NoiseKind {
        let size = |kind: usize| self.coefficients[kind].map_or(0.0, |found| found.value * power(kind, tau_s));
        let largest = (0..KINDS.len()).fold(1, |best, kind| if size(kind) > size(best) { kind } else { best });
        KINDS[largest]
    }

    /// A term in its own unit: `Q`, `N`, `B` or `K`.
    pub(super) fn term(&self, kind: NoiseKind) -> Option<Coefficient> {
        let index = KINDS.iter().position(|known| *known == kind)?;
        let Coefficient { value, sigma } = self.coefficients[index]?;
        let factor = [3.0, 1.0, FLICKER_FACTOR, 1.0 / 3.0][index];
        let term = (value / factor).sqrt();
        Some(Coefficient { value: term, sigma: 0.5 * sigma / (factor * term) })
    }

    /// Fits the points that are not excluded; `None` with fewer than two of them. The points are means over `axes`
    /// independent axes, sampled in these stretches.
    pub(super) fn of(points: &[AllanVariance], excluded: &[bool], stretches: &[Phase], axes: usize) -> Option<Self> {
        let mut used = Vec::new();
        let mut next = 0;
        for (index, point) in points.iter().enumerate() {
            if !excluded[index] && point.count >= next && point.variance > 0.0 {
                used.push(index);
                next = 2 * point.count;
            }
        }
        if used.len() < 2 {
            return None;
        }
        let mut fit = Self { coefficients: [None; 4], used };
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

    /// Solves with weights that follow the model.
    fn refine(&mut self, points: &[AllanVariance], stretches: (&[Phase], usize), kinds: &[usize]) -> Option<()> {
        for round in 0..ROUNDS {
            self.solve(points, stretches, kinds, round == 0)?;
        }
        Some(())
    }

    /// The fit without its least significant term, if there is one: without it the points are explained as well, by the
    /// weights of that smaller model. (A large term has large standard deviations at its own averaging times.)
    fn without_least_significant(
        &self,
        points: &[AllanVariance],
        stretches: (&[Phase], usize),
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
            // Without curvature of its own at the shortest τ it is a filter's.
            let is_filter = *kind == 0 && part < QUANTIZATION_RATIO * self.variance(shortest);
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
    fn sigma(&self, point: &AllanVariance, (stretches, axes): (&[Phase], usize)) -> f64 {
        let freedom = degrees_of_freedom(stretches, point.count, self.dominant(point.tau_s)).max(1.0) * axes as f64;
        self.variance(point.tau_s).max(0.05 * point.variance) * (2.0 / freedom + (2.0 * MODEL_ERROR).powi(2)).sqrt()
    }

    /// One weighted least-squares solution over some terms, none of them negative.
    fn solve(
        &mut self,
        points: &[AllanVariance],
        (stretches, axes): (&[Phase], usize),
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
                design[(row, column)] = power(*kind, point.tau_s) / sigma;
            }
            target[row] = point.variance / sigma;
        }
        let (solution, covariance) = nonnegative(&design, &target)?;
        self.coefficients = [None; 4];
        for (column, kind) in kinds.iter().enumerate() {
            let correlated = if *kind >= 2 { CORRELATED } else { 1.0 };
            let sigma = correlated * covariance[(column, column)].sqrt();
            self.coefficients[*kind] = Some(Coefficient { value: solution[column], sigma });
        }
        Some(())
    }
}

/// Least squares without negative unknowns: the best of all subsets of the columns whose solution is not negative. The
/// covariance is that of all columns.
fn nonnegative(design: &DMatrix<f64>, target: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let columns = design.ncols();
    // Columns of one scale keep the normal equations well conditioned.
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
