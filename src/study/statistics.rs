//! Intervals of paired differences.

/// Mean of paired differences with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanInterval {
    pub pairs: usize,
    pub mean: f64,
    /// Lower end of the two-sided 95 % interval of the mean.
    pub low: f64,
    /// Upper end of that interval.
    pub high: f64,
}

/// Probability beyond each end of a two-sided interval.
const TAIL: f64 = 0.025;

impl MeanInterval {
    /// Student's t interval of the mean, for independent differences with a normally distributed mean. `None` for fewer
    /// than two.
    pub fn of(differences: &[f64]) -> Option<Self> {
        let pairs = differences.len();
        if pairs < 2 {
            return None;
        }
        let count = pairs as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let square = differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>();
        let half = t_quantile(1.0 - TAIL, count - 1.0) * (square / (count - 1.0) / count).sqrt();
        Some(Self { pairs, mean, low: mean - half, high: mean + half })
    }
}

/// Quantile of Student's t distribution, for a probability above one half; by bisection of the distribution function.
fn t_quantile(probability: f64, degrees: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while t_distribution(high, degrees) < probability && high < 1e9 {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if t_distribution(middle, degrees) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Distribution function of Student's t for values from 0.
fn t_distribution(t: f64, degrees: f64) -> f64 {
    1.0 - 0.5 * incomplete_beta(degrees / (degrees + t * t), 0.5 * degrees, 0.5)
}

/// Regularized incomplete beta function, by its continued fraction (DLMF 8.17.22).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    // The fraction converges fast below this bound, and the function is symmetric.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (1.0 - x).ln()).exp() / a;
    let term = |m: usize| {
        let k = (m / 2) as f64;
        if m.is_multiple_of(2) {
            k * (b - k) * x / ((a + 2.0 * k - 1.0) * (a + 2.0 * k))
        } else {
            -(a + k) * (a + b + k) * x / ((a + 2.0 * k) * (a + 2.0 * k + 1.0))
        }
    };
    // Evaluated from the innermost term, with more terms than the parameters here need.
    let fraction = (1..=200).rev().fold(1.0, |inner, m| 1.0 + term(m) / inner);
    front / fraction
}

/// Natural logarithm of the gamma function of a positive number: Stirling's series after shifting the argument up.
fn ln_gamma(x: f64) -> f64 {
    /// Argument from which the series below is exact to rounding.
    const LARGE: f64 = 16.0;
    let (mut large, mut shift) = (x, 0.0);
    while large < LARGE {
        shift += large.ln();
        large += 1.0;
    }
    let inverse = 1.0 / (large * large);
    let series = (1.0 / 12.0 - inverse * (1.0 / 360.0 - inverse * (1.0 / 1260.0 - inverse / 1680.0))) / large;
    (large - 0.5) * large.ln() - large + 0.5 * std::f64::consts::TAU.ln() + series - shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // Student 1908, as in every table of two-sided 95 % quantiles.
        for (degrees, expected) in
            [(1.0, 12.706), (2.0, 4.303), (4.0, 2.776), (9.0, 2.262), (30.0, 2.042), (1e4, 1.960)]
        {
            let found = t_quantile(0.975, degrees);
            assert!((found - expected).abs() < 6e-4, "{degrees}: {found}");
        }
        assert!((ln_gamma(0.5) - 0.5 * std::f64::consts::PI.ln()).abs() < 1e-13);
        assert!((ln_gamma(10.0) - 362_880_f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn intervals_hold_the_mean_in_95_of_100_cases() {
        let mut random = crate::geometry::SplitMix64::new(3);
        let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
        let holds = |_: &usize| {
            let differences: Vec<f64> = (0..8).map(|_| 0.3 + 0.1 * normal()).collect();
            let interval = MeanInterval::of(&differences).unwrap();
            interval.low <= 0.3 && 0.3 <= interval.high
        };
        let held = (0..1000).filter(holds).count();
        assert!((925..=970).contains(&held), "{held} of 1000");
        assert_eq!(MeanInterval::of(&[0.1]), None);
        let equal = MeanInterval::of(&[0.5; 3]).unwrap();
        assert_eq!((equal.low, equal.mean, equal.high), (0.5, 0.5, 0.5));
    }
}
