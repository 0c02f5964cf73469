//! Real roots of a univariate polynomial, without complex arithmetic.

/// Bisection and Newton steps per bracket; a bracket is halved at least every second step, so this reaches rounding
/// level.
const STEPS_PER_BRACKET: usize = 120;

/// Value `Σ coefficients[i]·xⁱ` by Horner's rule.
pub(super) fn evaluate(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

/// Real roots of `Σ coefficients[i]·xⁱ` in ascending order; a root without a sign change is found only if rounding
/// permits.
///
/// The polynomial is monotonic between two neighbouring stationary points, so each sign change there brackets one root.
/// The stationary points are the roots of the derivative, found in the same way.
pub(super) fn real_roots(coefficients: &[f64]) -> Vec<f64> {
    let largest = coefficients.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
    if !largest.is_finite() || largest == 0.0 {
        return Vec::new();
    }
    let mut trimmed: Vec<f64> = coefficients.iter().map(|c| c / largest).collect();
    while trimmed.last().is_some_and(|leading| leading.abs() < 1e-14) {
        trimmed.pop();
    }
    if trimmed.len() < 2 {
        return Vec::new();
    }
    // All derivatives, the linear one last.
    let mut ladder = vec![trimmed];
    while let Some(last) = ladder.last()
        && last.len() > 2
    {
        ladder.push(last.iter().enumerate().skip(1).map(|(power, c)| c * power as f64).collect());
    }
    let mut stationary: Vec<f64> = Vec::new();
    for polynomial in ladder.iter().rev() {
        stationary = roots_between(polynomial, &stationary);
    }
    stationary
}

/// Roots of a polynomial with known stationary points, one search per monotonic piece.
fn roots_between(polynomial: &[f64], stationary: &[f64]) -> Vec<f64> {
    let Some((&leading, lower)) = polynomial.split_last() else { return Vec::new() };
    // Cauchy's bound contains all real roots.
    let bound = 1.0 + lower.iter().fold(0.0_f64, |most, c| most.max((c / leading).abs()));
    if !bound.is_finite() {
        return Vec::new();
    }
    let mut ends = Vec::with_capacity(stationary.len() + 2);
    ends.push(-bound);
    ends.extend(stationary.iter().copied().filter(|x| x.abs() < bound));
    ends.push(bound);
    let mut roots: Vec<f64> = Vec::new();
    for pair in ends.windows(2) {
        let &[left, right] = pair else { continue };
        let (value_left, value_right) = (evaluate(polynomial, left), evaluate(polynomial, right));
        if value_left == 0.0 {
            if roots.last() != Some(&left) {
                roots.push(left);
            }
        } else if value_right != 0.0 && (value_left < 0.0) != (value_right < 0.0) {
            roots.push(root_in_bracket(polynomial, left, right, value_left < 0.0));
        }
    }
    roots
}

/// Root in a bracket with a sign change, by Newton steps with bisection as fallback.
fn root_in_bracket(polynomial: &[f64], mut left: f64, mut right: f64, rising: bool) -> f64 {
    let mut x = 0.5 * (left + right);
    for _ in 0..STEPS_PER_BRACKET {
        let (mut value, mut slope) = (0.0, 0.0);
        for coefficient in polynomial.iter().rev() {
            slope = slope * x + value;
            value = value * x + coefficient;
        }
        if value == 0.0 {
            return x;
        }
        if (value < 0.0) == rising {
            left = x;
        } else {
            right = x;
        }
        let newton = x - value / slope;
        let next = if newton > left && newton < right { newton } else { 0.5 * (left + right) };
        if (next - x).abs() <= f64::EPSILON * x.abs() {
            return next;
        }
        x = next;
    }
    x
}
