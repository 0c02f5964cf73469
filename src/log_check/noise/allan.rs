//! Overlapping Allan variance of evenly sampled stretches, with its equivalent degrees of freedom.
//!
//! Estimator and degrees of freedom follow NIST Special Publication 1065 (W. J. Riley, 2008, §5.2.4 and §5.4.1; Howe,
//! Allan and Barnes, 1981), applied to inertial sensors as in IEEE Std 952, annex C: the angle or velocity is the
//! phase, the angular rate or specific force the frequency.

use std::collections::BTreeSet;

use crate::geometry::mean_square_quantile;

/// Averaging times per octave.
const PER_OCTAVE: f64 = 4.0;
/// Ratio of the longest stretch to the longest averaging time, at which the estimate has two degrees of freedom.
const LONGEST_RATIO: usize = 4;

/// Dominant noise at an averaging time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoiseKind {
    /// White noise of the integrated signal: quantization, slope −1.
    Quantization,
    /// White noise: slope −1/2.
    White,
    /// Flicker noise: slope 0.
    Flicker,
    /// Random walk: slope +1/2.
    RandomWalk,
}

/// Allan variance at one averaging time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AllanVariance {
    /// Number of averaged samples.
    pub(super) count: usize,
    /// Averaging time, in seconds.
    pub(super) tau_s: f64,
    /// In the squared unit of the samples.
    pub(super) variance: f64,
}

/// Integrated samples of one stretch, without their mean: `x(k) = Σ (y − ȳ)·τ0`, one more than the samples.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AllanPhase(Vec<f64>);

impl AllanPhase {
    pub(super) fn of(samples: &[f64], period_s: f64) -> Self {
        let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
        let mut phase = Vec::with_capacity(samples.len() + 1);
        let mut sum = 0.0;
        phase.push(sum);
        for sample in samples {
            sum += (sample - mean) * period_s;
            phase.push(sum);
        }
        Self(phase)
    }

    /// Number of terms of the estimator.
    fn terms(&self, count: usize) -> usize {
        self.0.len().saturating_sub(2 * count)
    }

    /// Sum of the squared second differences over `count` samples.
    fn sum_of_squares(&self, count: usize) -> f64 {
        let (early, middle, late) =
            (&self.0, self.0.get(count..).unwrap_or_default(), self.0.get(2 * count..).unwrap_or_default());
        late.iter().zip(middle).zip(early).map(|((late, middle), early)| (late - 2.0 * middle + early).powi(2)).sum()
    }
}

/// Numbers of samples of the averaging times, ascending; `longest` is the number of samples of the longest stretch.
pub(super) fn counts(longest: usize) -> Vec<usize> {
    let last = longest / LONGEST_RATIO;
    let steps = (PER_OCTAVE * (last.max(1) as f64).log2()).floor() as usize;
    let counts: BTreeSet<usize> =
        (0..=steps).map(|step| (step as f64 / PER_OCTAVE).exp2().round() as usize).filter(|it| *it <= last).collect();
    counts.into_iter().collect()
}

/// Variance at one averaging time from all stretches that are long enough; `None` without one.
pub(super) fn overlapping(stretches: &[AllanPhase], count: usize, period_s: f64) -> Option<AllanVariance> {
    let terms: usize = stretches.iter().map(|phase| phase.terms(count)).sum();
    if terms == 0 {
        return None;
    }
    let sum: f64 = stretches.iter().map(|phase| phase.sum_of_squares(count)).sum();
    let tau_s = count as f64 * period_s;
    Some(AllanVariance { count, tau_s, variance: sum / (2.0 * tau_s * tau_s * terms as f64) })
}

/// Equivalent degrees of freedom of [`overlapping`]: the degrees of freedom of independent stretches, weighted by their
/// numbers of terms (Satterthwaite).
pub(super) fn degrees_of_freedom(stretches: &[AllanPhase], count: usize, kind: NoiseKind) -> f64 {
    let (mut all, mut spread) = (0.0, 0.0);
    for phase in stretches {
        let terms = phase.terms(count) as f64;
        if terms > 0.0 {
            all += terms;
            spread += terms * terms / of_one_stretch(phase.0.len() as f64, count as f64, kind).max(1.0);
        }
    }
    if spread > 0.0 { all * all / spread } else { 0.0 }
}

/// Degrees of freedom of `n` phases averaged over `m` samples (NIST SP 1065, table 5).
fn of_one_stretch(n: f64, m: f64, kind: NoiseKind) -> f64 {
    match kind {
        NoiseKind::Quantization => (n + 1.0) * (n - 2.0 * m) / (2.0 * (n - m)),
        NoiseKind::White => (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * (4.0 * m * m / (4.0 * m * m + 5.0)),
        NoiseKind::Flicker if m < 1.5 => 2.0 * (n - 2.0).powi(2) / (2.3 * n - 4.9),
        NoiseKind::Flicker => 5.0 * n * n / (4.0 * m * (n + 3.0 * m)),
        NoiseKind::RandomWalk => {
            let square = (n - 1.0).powi(2) - 3.0 * m * (n - 1.0) + 4.0 * m * m;
            (n - 2.0) / m * square / (n - 3.0).powi(2)
        }
    }
}

/// Confidence limits (68.3 %) of the true deviation from a deviation with these degrees of freedom, by the χ²
/// distribution.
pub(super) fn confidence(deviation: f64, degrees_of_freedom: f64) -> (f64, f64) {
    /// Lowest quantile of the mean square: fewer degrees of freedom give no upper limit.
    const SMALLEST: f64 = 1e-4;
    let limit = |normal: f64| deviation / mean_square_quantile(degrees_of_freedom, normal).max(SMALLEST).sqrt();
    (limit(1.0), limit(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;
    use crate::log_check::noise::tests::normal;

    #[test]
    fn the_variance_is_that_of_the_definition() {
        let samples = [1.0, 4.0, 2.0, 8.0, 5.0, 7.0];
        let phase = [AllanPhase::of(&samples, 0.5)];
        let found = overlapping(&phase, 2, 0.5).unwrap();
        // Means of pairs are 2.5 3 5 6.5 6; differences of means two apart: 2.5, 3.5, 1.0.
        let expected = (2.5_f64.powi(2) + 3.5_f64.powi(2) + 1.0) / (2.0 * 3.0);
        assert!((found.variance - expected).abs() < 1e-12 && found.tau_s == 1.0, "{found:?}");
        assert_eq!(overlapping(&phase, 4, 0.5), None);
        assert_eq!(counts(40), [1, 2, 3, 4, 5, 6, 7, 8, 10]);
    }

    #[test]
    fn the_spread_of_the_variance_is_that_of_its_degrees_of_freedom() {
        // Two stretches of different length, over many realizations of white noise and of a random walk.
        let (period_s, count) = (0.1, 8);
        for kind in [NoiseKind::White, NoiseKind::RandomWalk] {
            let mut random = SplitMix64::new(3);
            let mut values = Vec::new();
            let mut expected = 0.0;
            for _ in 0..600 {
                let stretch = |length: usize, random: &mut SplitMix64| {
                    let mut sum = 0.0;
                    let samples: Vec<f64> = (0..length)
                        .map(|_| {
                            let white = normal(random);
                            sum += white;
                            if kind == NoiseKind::White { white } else { sum }
                        })
                        .collect();
                    AllanPhase::of(&samples, period_s)
                };
                let stretches = [stretch(100, &mut random), stretch(60, &mut random)];
                values.push(overlapping(&stretches, count, period_s).unwrap().variance);
                expected = degrees_of_freedom(&stretches, count, kind);
            }
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let spread = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
            let found = 2.0 * mean * mean / spread;
            assert!((found / expected).ln().abs() < 0.25, "{kind:?}: {found} against {expected}");
        }
    }
}
