//! Tail of the F distribution.

/// Largest number of terms of the continued fraction.
const TERMS: usize = 500;
const TINY: f64 = 1e-300;

/// Probability that an F variable with these degrees of freedom exceeds `f`; 1 for a value that is not positive.
///
/// The regularized incomplete beta function `I_x(d₂/2, d₁/2)` at `x = d₂/(d₂ + d₁ f)`.
pub(super) fn f_survival(f: f64, numerator: usize, denominator: usize) -> f64 {
    let (first, second) = (numerator as f64, denominator as f64);
    if f > 0.0 { beta_ratio(second / 2.0, first / 2.0, second / (second + first * f)) } else { 1.0 }
}

/// Regularized incomplete beta function by Lentz's evaluation of its continued fraction (Press et al., Numerical Recipes,
/// section 6.4).
fn beta_ratio(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * continued_fraction(a, b, x) / a
    } else {
        1.0 - front * continued_fraction(b, a, 1.0 - x) / b
    }
}

fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    let away = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / away(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for term in 1..TERMS {
        let m = term as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut factor = 1.0;
        for coefficient in [even, odd] {
            d = 1.0 / away(1.0 + coefficient * d);
            c = away(1.0 + coefficient / c);
            factor = c * d;
            fraction *= factor;
        }
        if (factor - 1.0).abs() < 1e-14 {
            break;
        }
    }
    fraction
}

/// Logarithm of the gamma function of multiples of one half, by the recurrence `Γ(x + 1) = x Γ(x)`.
fn ln_gamma(x: f64) -> f64 {
    let mut sum = 0.0;
    let mut at = x;
    while at > 1.0 {
        at -= 1.0;
        sum += at.ln();
    }
    // Γ(1) = 1 and Γ(1/2) = √π.
    sum + if at < 0.75 { 0.5 * std::f64::consts::PI.ln() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_tables() {
        for (f, degrees, probability) in [
            (4.241_7, (1, 25), 0.05),
            (7.769_8, (1, 25), 0.01),
            (3.315_8, (2, 30), 0.05),
            (5.390_3, (2, 30), 0.01),
            (161.447_6, (1, 1), 0.05),
        ] {
            let found = f_survival(f, degrees.0, degrees.1);
            assert!((found / probability - 1.0).abs() < 2e-4, "F {f} {degrees:?}: {found}");
        }
        assert_eq!(f_survival(0.0, 1, 10), 1.0);
        assert!(f_survival(1e9, 1, 10) < 1e-9);
    }
}
