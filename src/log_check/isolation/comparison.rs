//! Comparison of two sources over time: constant differences that sound sources have are fitted, and a change of one of them
//! at some time or a misfit beyond the noise is a disagreement.

use nalgebra::{DMatrix, DVector, Matrix3xX, Vector3};

use crate::faults::Fault;
use crate::geometry::{SIGMA_PER_MEDIAN, mean_square_quantile};
use crate::log_check::report::FindingInterval;
use crate::log_check::statistics::{median, percentile};

/// Misfit in units of noise and tolerance from which two sources disagree, and the largest one of sound sources: the part
/// before a change must agree.
pub const LARGEST_MISFIT: f64 = 1.8;
pub const AGREEING_MISFIT: f64 = 1.0;
/// Quantile of the misfits that is compared with the same quantile of a standard normal number, as for image rotations.
const COMPARED_QUANTILE: f64 = 0.7;
const COMPARED_SIGMAS: f64 = 0.5244;
/// Minimum number of rows of a comparison, and of each side of a change.
const MIN_ROWS: usize = 12;
const MIN_SIDE: usize = 10;
/// Largest number of times at which a change is tried.
const TIMES: usize = 200;
/// Rounds of weighting.
const ROUNDS: usize = 5;
/// Misfit of a row beyond which it counts no more.
const LARGEST_COUNTED: f64 = 3.0;
/// Decrease of χ² by which a change is decisive.
const DECISIVE: f64 = 100.0;
/// Part of the decrease of χ² that a change of one parameter alone must reach to be named.
const NAMED_PART: f64 = 0.8;
/// Part of χ² that a parameter of sources that are wrong throughout may leave.
const REMAINING_PART: f64 = 0.1;
/// Length of the bins of a misfit over time, in seconds, and their largest number.
const BIN_S: f64 = 1.0;
const MOST_BINS: f64 = 120.0;
/// Median misfit of consecutive bins from which they are wrong although the log as a whole agrees.
const WRONG_STRETCH: f64 = 10.0;
/// Bins beside an interval that agree and their smallest signal, as a ratio of the signal inside: they show that the interval
/// ends there.
const MIN_SOUND: usize = 2;
const SHOWING_RATIO: f64 = 0.5;

/// Parameter of a difference between two sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parameter {
    /// Difference of the angular rates in rad/s.
    Rate,
    /// Rotation vector in radians.
    Orientation,
    /// Seconds by which the first source is stamped earlier.
    Delay,
    /// Ratio of the first source to the second one, less one.
    Scale,
    /// The same for each axis of the second source.
    AxisScales,
    /// Change of the angular rates over the log, linear in time, in rad/s.
    RateDrift,
    /// Specific force of a body at rest in the world, in m/s².
    Gravity,
    /// Bias of the specific forces in m/s².
    ForceBias,
    /// Position of the accelerometer in the body of the positions, in metres.
    Lever,
    /// Ratio of the accelerations of the accelerometer to the accelerations of the positions, less one.
    PositionScale,
    /// Factor on the cross product of angular rate and velocity that is missing.
    Transport,
    /// Positions have other axes than the orientations with them. Values: matrix (3 × 3) from their axes, by column.
    PositionAxes,
    /// Specific forces have the axes of the world; no value.
    WorldAxes,
    /// Specific forces have the axes of the heading: level, with the yaw of the vehicle; no value.
    LevelAxes,
}

impl Parameter {
    pub(super) fn width(self) -> usize {
        match self {
            Self::Delay | Self::Scale | Self::PositionScale | Self::Transport => 1,
            Self::Rate
            | Self::RateDrift
            | Self::Orientation
            | Self::AxisScales
            | Self::Gravity
            | Self::ForceBias
            | Self::Lever => 3,
            Self::PositionAxes | Self::WorldAxes | Self::LevelAxes => 0,
        }
    }

    /// Prior standard deviation: wide, so that only directions without measurements are given by it.
    fn sigma(self) -> f64 {
        match self {
            Self::Rate | Self::RateDrift | Self::Delay => 0.1,
            Self::Orientation
            | Self::Scale
            | Self::AxisScales
            | Self::Lever
            | Self::PositionScale
            | Self::Transport
            | Self::PositionAxes
            | Self::WorldAxes
            | Self::LevelAxes => 1.0,
            Self::ForceBias => 3.0,
            Self::Gravity => 100.0,
        }
    }
}

/// Difference of two sources over one interval.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) time_s: f64,
    /// First source minus second one.
    pub(super) residual: Vector3<f64>,
    /// Its derivatives by all parameters.
    pub(super) jacobian: Matrix3xX<f64>,
    /// Variance of noise and tolerance per axis.
    pub(super) variance: f64,
    /// Size of what is measured, in the unit of the residual: small ones show no fault.
    pub(super) signal: f64,
}

/// Change of a parameter, constant or from a time on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Change {
    pub(super) parameter: Parameter,
    pub(super) values: Vec<f64>,
}

/// Result of a comparison.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit {
    /// Values of the constant parameters and their standard deviations.
    pub(super) constants: Vec<f64>,
    pub(super) sigmas: Vec<f64>,
    /// Misfit in units of the predicted noise.
    pub(super) misfit: f64,
    /// Median magnitude of the misfit by axis, as a standard deviation.
    pub(super) by_axis: Vec<f64>,
    /// Median predicted standard deviation per axis.
    pub(super) noise: f64,
    /// Middle of each bin in seconds and its misfit.
    pub(super) bins: Vec<[f64; 2]>,
    /// Interval in which the sources disagree.
    pub(super) disagrees: Option<FindingInterval>,
    /// Parameter that describes the disagreement.
    pub(super) change: Option<Change>,
    /// Fault of one of the sources that explains it.
    pub(super) fault: Option<Fault>,
}

/// Change of parameters at a time.
struct Step {
    /// Number of the first row after it.
    at: usize,
    /// The parameter that changes, if it is one.
    change: Option<Change>,
    /// Parameters before it.
    before: DVector<f64>,
}

/// Solution with its covariance and χ².
type Solution = (DVector<f64>, DMatrix<f64>, f64);

/// Sums of the normal equations of some rows.
#[derive(Clone)]
struct Sums {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    square: f64,
}

impl Sums {
    fn zeros(columns: usize) -> Self {
        Self { hessian: DMatrix::zeros(columns, columns), gradient: DVector::zeros(columns), square: 0.0 }
    }

    fn add(&mut self, row: &Row, weight: f64) {
        let information = weight / row.variance;
        self.hessian += row.jacobian.transpose() * &row.jacobian * information;
        self.gradient += row.jacobian.transpose() * row.residual * information;
        self.square += row.residual.norm_squared() * information;
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            hessian: &self.hessian - &other.hessian,
            gradient: &self.gradient - &other.gradient,
            square: self.square - other.square,
        }
    }

    fn of_columns(&self, columns: &[usize]) -> Self {
        Self {
            hessian: self.hessian.select_rows(columns).select_columns(columns),
            gradient: self.gradient.select_rows(columns),
            square: self.square,
        }
    }

    /// The sums with further columns, which are some of the columns of `after` again.
    fn with_change(&self, after: &Self, columns: &[usize]) -> Self {
        let (own, all) = (self.gradient.len(), self.gradient.len() + columns.len());
        let mut sums = Self::zeros(all);
        sums.square = self.square;
        sums.hessian.view_mut((0, 0), (own, own)).copy_from(&self.hessian);
        sums.gradient.rows_mut(0, own).copy_from(&self.gradient);
        let cross = after.hessian.select_columns(columns);
        sums.hessian.view_mut((0, own), (own, columns.len())).copy_from(&cross);
        sums.hessian.view_mut((own, 0), (columns.len(), own)).copy_from(&cross.transpose());
        sums.hessian.view_mut((own, own), (columns.len(), columns.len())).copy_from(&cross.select_rows(columns));
        sums.gradient.rows_mut(own, columns.len()).copy_from(&after.gradient.select_rows(columns));
        sums
    }

    /// Solution with prior standard deviations.
    fn solve(&self, sigmas: &[f64]) -> Option<Solution> {
        let prior = DVector::from_iterator(sigmas.len(), sigmas.iter().map(|sigma| sigma.powi(-2)));
        let factor = (&self.hessian + DMatrix::from_diagonal(&prior)).cholesky()?;
        let solution = factor.solve(&self.gradient);
        let square = self.square - self.gradient.dot(&solution);
        Some((solution, factor.inverse(), square))
    }
}

/// Rows with the parameters of their columns.
pub(super) struct Comparison<'a> {
    pub(super) rows: &'a [Row],
    /// In the order of the columns; the first ones are parameters of sound sources.
    pub(super) parameters: &'a [Parameter],
    /// Number of parameters that sound sources have.
    pub(super) sound: usize,
    /// Parameters that may change at a time.
    pub(super) changing: &'a [Parameter],
}

impl Comparison<'_> {
    /// `None` with too few rows.
    pub(super) fn fit(&self) -> Option<Fit> {
        let rows = self.rows;
        if rows.len() < MIN_ROWS {
            return None;
        }
        let sound = self.columns(&self.parameters[..self.sound]);
        let (weights, solved) = self.robust(&sound)?;
        let (mut constants, covariance, square) = solved;
        let mut misfits = self.misfits(&sound, &constants);
        let (mut disagrees, mut change) = (None, None);
        if let Some(Step { at, change: found, before }) = self.step(&sound, &weights, square) {
            constants = before;
            misfits = self.misfits(&sound, &constants);
            // Between the middles of two rows.
            let since_s = 0.5 * (rows[at - 1].time_s + rows[at].time_s);
            disagrees = Some(FindingInterval { since_s: Some(since_s), until_s: None });
            change = found;
        }
        let misfit = root_mean_square(&misfits);
        let bins = self.bins(&misfits);
        if disagrees.is_none() && misfit <= LARGEST_MISFIT {
            disagrees = wrong_stretch(&bins);
        }
        let suspect = self.suspect(&sound, &weights, square).filter(|_| misfit > LARGEST_MISFIT);
        if disagrees.is_none() && misfit > LARGEST_MISFIT || suspect.is_some() {
            disagrees = Some(if suspect.is_some() { FindingInterval::default() } else { self.interval(&bins) });
            change = suspect;
        }
        let of_axis = |axis: usize| {
            let of_axis: Vec<f64> = rows.iter().map(|row| rest(row, &sound, &constants)[axis].abs()).collect();
            SIGMA_PER_MEDIAN * median(&of_axis)
        };
        let by_axis = [0, 1, 2].map(of_axis).to_vec();
        let noise = median(&rows.iter().map(|row| row.variance.sqrt()).collect::<Vec<_>>());
        let sigmas = covariance.diagonal().iter().map(|variance| variance.sqrt()).collect();
        let constants = constants.iter().copied().collect();
        Some(Fit { constants, sigmas, misfit, by_axis, noise, bins, disagrees, change, fault: None })
    }

    /// Misfits of all rows, in units of the predicted noise, with the best constant parameters of sound sources; `None` with too
    /// few rows.
    pub(super) fn least_misfits(&self) -> Option<Vec<f64>> {
        if self.rows.len() < MIN_ROWS {
            return None;
        }
        let sound = self.columns(&self.parameters[..self.sound]);
        let (_, (solution, ..)) = self.robust(&sound)?;
        Some(self.misfits(&sound, &solution))
    }

    /// Weights of the rows, and the solution for some columns with them.
    fn robust(&self, columns: &[usize]) -> Option<(Vec<f64>, Solution)> {
        let mut weights = vec![1.0; self.rows.len()];
        let mut solved = self.solved(columns, &weights)?;
        for _ in 0..ROUNDS {
            let misfits = self.misfits(columns, &solved.0);
            weights = misfits.iter().map(|it| (LARGEST_COUNTED / it.max(LARGEST_COUNTED)).powi(2)).collect();
            solved = self.solved(columns, &weights)?;
        }
        Some((weights, solved))
    }

    /// Values of a further parameter beside the parameters of sound sources, with their standard deviations for a misfit in units of
    /// the noise.
    pub(super) fn further(&self, parameter: Parameter, misfit: f64) -> Option<Vec<[f64; 2]>> {
        let columns = [self.columns(&self.parameters[..self.sound]), self.columns(&[parameter])].concat();
        let (solution, covariance, _) = self.solved(&columns, &vec![1.0; self.rows.len()])?;
        let first = columns.len() - parameter.width();
        let value = |place: usize| [solution[place], misfit * covariance[(place, place)].sqrt()];
        Some((first..columns.len()).map(value).collect())
    }

    /// Columns of some parameters.
    fn columns(&self, of: &[Parameter]) -> Vec<usize> {
        let mut first = 0;
        let mut columns = Vec::new();
        for parameter in self.parameters {
            if of.contains(parameter) {
                columns.extend(first..first + parameter.width());
            }
            first += parameter.width();
        }
        columns
    }

    /// Prior standard deviations of some columns.
    fn sigmas(&self, columns: &[usize]) -> Vec<f64> {
        let all: Vec<f64> = self.parameters.iter().flat_map(|it| std::iter::repeat_n(it.sigma(), it.width())).collect();
        columns.iter().map(|column| all[*column]).collect()
    }

    fn sums(&self, weights: &[f64]) -> Sums {
        let mut sums = Sums::zeros(self.parameters.iter().map(|it| it.width()).sum());
        for (row, weight) in self.rows.iter().zip(weights) {
            sums.add(row, *weight);
        }
        sums
    }

    fn solved(&self, columns: &[usize], weights: &[f64]) -> Option<Solution> {
        self.sums(weights).of_columns(columns).solve(&self.sigmas(columns))
    }

    /// Time from which on the parameters differ decisively from those before; `None` if those before do not fit either.
    fn step(&self, sound: &[usize], weights: &[f64], square: f64) -> Option<Step> {
        let (rows, sigmas) = (self.rows, self.sigmas(sound));
        let mut before = Sums::zeros(self.parameters.iter().map(|it| it.width()).sum());
        let all = self.sums(weights);
        let stride = rows.len().div_ceil(TIMES);
        let mut best: Option<(f64, usize, Sums)> = None;
        for (place, (row, weight)) in rows.iter().zip(weights).enumerate() {
            if place >= MIN_SIDE && place + MIN_SIDE <= rows.len() && place.is_multiple_of(stride) {
                let sides = [before.clone(), all.minus(&before)].map(|side| side.of_columns(sound).solve(&sigmas));
                let gain = match sides {
                    [Some((.., first)), Some((.., second))] => square - first - second,
                    _ => 0.0,
                };
                if best.as_ref().is_none_or(|(largest, ..)| gain > *largest) {
                    best = Some((gain, place, before.clone()));
                }
            }
            before.add(row, *weight);
        }
        let (gain, at, before) = best?;
        if gain < DECISIVE {
            return None;
        }
        let after = all.minus(&before);
        // The weights belong to a fit to both sides, in which rows without a signal count most.
        let (_, (first, ..)) = Comparison { rows: &rows[..at], ..*self }.robust(sound)?;
        // A change lasts, other than some wrong measurements.
        let misfits = self.misfits(sound, &first);
        let half = at + (rows.len() - at) / 2;
        let [misfit_before, earlier, later] =
            [0..at, at..half, half..rows.len()].map(|it| root_mean_square(&misfits[it]));
        if misfit_before > AGREEING_MISFIT || earlier.min(later) < LARGEST_MISFIT {
            return None;
        }
        let changes = self.changing.iter().filter_map(|parameter| {
            let columns = self.columns(&[*parameter]);
            let places: Vec<usize> = columns.iter().filter_map(|it| sound.iter().position(|own| own == it)).collect();
            let sums = all.of_columns(sound).with_change(&after.of_columns(sound), &places);
            let (solution, _, left) = sums.solve(&[sigmas.clone(), self.sigmas(&columns)].concat())?;
            let values: Vec<f64> = solution.rows(sound.len(), columns.len()).iter().copied().collect();
            let mut changed = solution.rows(0, sound.len()).into_owned();
            for (place, value) in places.iter().zip(&values) {
                changed[*place] += value;
            }
            let misfit_after = root_mean_square(&self.misfits(sound, &changed)[at..]);
            let is_named = square - left > NAMED_PART * gain && misfit_after < AGREEING_MISFIT;
            let criterion = left + columns.len() as f64 * (3.0 * rows.len() as f64).ln();
            Some((criterion, is_named.then_some(Change { parameter: *parameter, values })))
        });
        let (_, change) = changes.min_by(|one, other| one.0.total_cmp(&other.0))?;
        Some(Step { at, change, before: first })
    }

    /// Parameter, not one of sound sources, that explains a misfit of the whole log: it leaves no more than sound sources have.
    fn suspect(&self, sound: &[usize], weights: &[f64], square: f64) -> Option<Change> {
        let suspects = self.parameters[self.sound..].iter().filter_map(|parameter| {
            let columns = self.columns(&[*parameter]);
            let (solution, _, left) = self.solved(&[sound, &columns].concat(), weights)?;
            let values = solution.rows(sound.len(), columns.len()).iter().copied().collect();
            let misfit = root_mean_square(&self.misfits(&[sound, &columns].concat(), &solution));
            (misfit < LARGEST_MISFIT).then_some((left, Change { parameter: *parameter, values }))
        });
        let (left, change) = suspects.min_by(|one, other| one.0.total_cmp(&other.0))?;
        (left < REMAINING_PART * square).then_some(change)
    }

    /// Misfit of each row, in units of its predicted noise, that parameters leave.
    fn misfits(&self, columns: &[usize], values: &DVector<f64>) -> Vec<f64> {
        let misfit = |row: &Row| (rest(row, columns, values).norm_squared() / (3.0 * row.variance)).sqrt();
        self.rows.iter().map(misfit).collect()
    }

    /// Time of the bins beyond the largest misfit. It has an end only if at least two bins beyond it agree although as much is
    /// measured in them.
    fn interval(&self, bins: &[[f64; 2]]) -> FindingInterval {
        let half_s = bins.windows(2).map(|pair| 0.5 * (pair[1][0] - pair[0][0])).fold(BIN_S, f64::min);
        let signal = |bin: &[f64; 2]| {
            let inside = self.rows.iter().filter(|row| (row.time_s - bin[0]).abs() <= half_s);
            median(&inside.map(|row| row.signal).collect::<Vec<_>>())
        };
        let beyond = |bin: &&[f64; 2]| bin[1] > LARGEST_MISFIT;
        let usual = median(&bins.iter().filter(beyond).map(signal).collect::<Vec<_>>());
        let shows =
            |bins: &[[f64; 2]]| bins.iter().filter(|bin| signal(bin) > SHOWING_RATIO * usual).count() >= MIN_SOUND;
        let (Some(first), Some(last)) =
            (bins.iter().position(|bin| beyond(&bin)), bins.iter().rposition(|bin| beyond(&bin)))
        else {
            return FindingInterval::default();
        };
        FindingInterval {
            since_s: shows(&bins[..first]).then(|| bins[first][0] - half_s),
            until_s: shows(&bins[last + 1..]).then(|| bins[last][0] + half_s),
        }
    }

    /// Median misfit in bins of equal length.
    fn bins(&self, misfits: &[f64]) -> Vec<[f64; 2]> {
        let (Some(first), Some(last)) = (self.rows.first(), self.rows.last()) else { return Vec::new() };
        let length_s = BIN_S.max((last.time_s - first.time_s) / MOST_BINS);
        let mut bins: Vec<(i64, Vec<f64>)> = Vec::new();
        for (row, misfit) in self.rows.iter().zip(misfits) {
            let bin = (row.time_s / length_s).floor() as i64;
            match bins.last_mut() {
                Some((at, of_bin)) if *at == bin => of_bin.push(*misfit),
                _ => bins.push((bin, vec![*misfit])),
            }
        }
        bins.into_iter().map(|(bin, of_bin)| [(bin as f64 + 0.5) * length_s, median(&of_bin)]).collect()
    }
}

/// Longest stretch of bins that are wrong while the log as a whole agrees; `None` without one of at least two bins.
fn wrong_stretch(bins: &[[f64; 2]]) -> Option<FindingInterval> {
    let stretches = bins.chunk_by(|one, other| (one[1] > WRONG_STRETCH) == (other[1] > WRONG_STRETCH));
    let wrong = stretches.filter(|bins| bins.len() >= MIN_SOUND && bins[0][1] > WRONG_STRETCH);
    let longest = wrong.max_by_key(|bins| bins.len())?;
    let half_s = 0.5 * (bins.get(1)?[0] - bins.first()?[0]);
    let (first, last) = (longest.first()?, longest.last()?);
    Some(FindingInterval { since_s: Some(first[0] - half_s), until_s: Some(last[0] + half_s) })
}

/// Root of the mean square of misfits in three axes, from a quantile of them.
pub(super) fn root_mean_square(misfits: &[f64]) -> f64 {
    percentile(misfits, COMPARED_QUANTILE) / mean_square_quantile(3.0, COMPARED_SIGMAS).sqrt()
}

/// Sum of the squares of misfits, of which large ones count no more.
pub(super) fn counted_square(misfits: &[f64]) -> f64 {
    misfits.iter().map(|misfit| misfit.min(LARGEST_COUNTED).powi(2)).sum()
}

/// Residual that some columns leave.
fn rest(row: &Row, columns: &[usize], values: &DVector<f64>) -> Vector3<f64> {
    row.residual - row.jacobian.select_columns(columns) * values
}
