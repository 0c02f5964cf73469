//! Angular rates of a camera from the rotations of its images, and rotations during the readout from rates.

use nalgebra::Vector3;

use crate::sensors::AngularRates;

/// Number of rows for which the rotation during a readout is computed.
const NODES: usize = 9;

/// Rotation of a camera during the readout of an image: rotation vectors by row, relative to the first row.
pub(super) struct ReadoutSweep([Vector3<f64>; NODES]);

impl ReadoutSweep {
    /// Rotation during the readout of an image whose first row is exposed at a time; zero without rates.
    pub(super) fn new(rates: &AngularRates, first_row_s: f64, readout_s: f64) -> Self {
        let start = rates.angle_at(first_row_s);
        Self(std::array::from_fn(|node| {
            let row_s = readout_s * node as f64 / (NODES - 1) as f64;
            match (start, rates.angle_at(first_row_s + row_s)) {
                (Some(start), Some(end)) => end - start,
                _ => Vector3::zeros(),
            }
        }))
    }

    /// Rotation vector (rad) at a row, as a ratio of the height: it maps directions in the camera at that row to the
    /// camera at the first row.
    pub(super) fn at(&self, row: f64) -> Vector3<f64> {
        let place = (row * (NODES - 1) as f64).clamp(0.0, (NODES - 1) as f64);
        let before = (place as usize).min(NODES - 2);
        self.0[before].lerp(&self.0[before + 1], place - before as f64)
    }
}

/// Step of the sampled rates, in seconds.
const STEP_S: f64 = 0.0025;
/// Minimum number of consecutive pairs of a spline.
const MIN_PAIRS: usize = 4;

/// Angular rates from rotation vectors (rad) between consecutive times: the derivative of the natural cubic spline
/// through their sums, for each uninterrupted series of pairs.
pub(super) fn rates_of(pairs: &[([f64; 2], Vector3<f64>)]) -> AngularRates {
    let mut samples = Vec::new();
    let mut first = 0;
    while first < pairs.len() {
        let follows = |index: &usize| pairs[*index].0[0].total_cmp(&pairs[*index - 1].0[1]).is_eq();
        let end = (first + 1..pairs.len()).find(|index| !follows(index)).unwrap_or(pairs.len());
        if end - first >= MIN_PAIRS {
            sample(&pairs[first..end], &mut samples);
        }
        first = end;
    }
    AngularRates::new(samples)
}

fn sample(pairs: &[([f64; 2], Vector3<f64>)], samples: &mut Vec<(f64, Vector3<f64>)>) {
    let lengths_s: Vec<f64> = pairs.iter().map(|([from_s, to_s], _)| to_s - from_s).collect();
    let rates = knot_rates(pairs, &lengths_s);
    for (index, ([from_s, _], angle)) in pairs.iter().enumerate() {
        let (length_s, start, end) = (lengths_s[index], rates[index], rates[index + 1]);
        let mean = angle / length_s;
        let steps = (length_s / STEP_S).ceil().max(1.0);
        for step in 0..steps as usize {
            let u = step as f64 / steps;
            // Derivative of the cubic Hermite polynomial.
            let rate =
                start * (1.0 - 4.0 * u + 3.0 * u * u) + end * (3.0 * u * u - 2.0 * u) + mean * (6.0 * u * (1.0 - u));
            samples.push((from_s + u * length_s, rate));
        }
    }
    if let (Some(([_, to_s], _)), Some(rate)) = (pairs.last(), rates.last()) {
        samples.push((*to_s, *rate));
    }
}

/// Rates `r_k` at the ends of all pairs, for which the second derivative of the spline is continuous, and zero at both
/// ends: with the lengths `h_k` and the mean rates `m_k` of the pairs
/// `r_{k−1}/h_{k−1} + 2 (1/h_{k−1} + 1/h_k) r_k + r_{k+1}/h_k = 3 (m_{k−1}/h_{k−1} + m_k/h_k)`, solved by Thomas'
/// tridiagonal elimination.
fn knot_rates(pairs: &[([f64; 2], Vector3<f64>)], lengths_s: &[f64]) -> Vec<Vector3<f64>> {
    let count = pairs.len() + 1;
    let mean = |index: usize| pairs[index].1 / lengths_s[index];
    // Tridiagonal equations: below, diagonal, above, right.
    let row = |knot: usize| match knot {
        0 => (0.0, 2.0, 1.0, mean(0) * 3.0),
        knot if knot + 1 == count => (1.0, 2.0, 0.0, mean(knot - 1) * 3.0),
        knot => {
            let (before, after) = (lengths_s[knot - 1].recip(), lengths_s[knot].recip());
            (before, 2.0 * (before + after), after, (mean(knot - 1) * before + mean(knot) * after) * 3.0)
        }
    };
    let (mut above, mut right) = (Vec::with_capacity(count), Vec::<Vector3<f64>>::with_capacity(count));
    for knot in 0..count {
        let (below, diagonal, over, value) = row(knot);
        let before = knot.checked_sub(1).map_or_else(|| (0.0, Vector3::zeros()), |index| (above[index], right[index]));
        let pivot = diagonal - below * before.0;
        above.push(over / pivot);
        right.push((value - before.1 * below) / pivot);
    }
    for knot in (0..count - 1).rev() {
        let after = right[knot + 1];
        right[knot] -= after * above[knot];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_motion_gives_its_rates() {
        let angle = |time_s: f64| Vector3::new((3.0 * time_s).sin(), (5.0 * time_s).cos(), 0.4 * time_s);
        let rate = |time_s: f64| Vector3::new(3.0 * (3.0 * time_s).cos(), -5.0 * (5.0 * time_s).sin(), 0.4);
        let pair = |index: u32| {
            let times_s = [f64::from(index) * 0.05, f64::from(index + 1) * 0.05];
            (times_s, angle(times_s[1]) - angle(times_s[0]))
        };
        // A pair is missing after two seconds.
        let pairs: Vec<_> = (0..80).filter(|index| *index != 40).map(pair).collect();
        let rates = rates_of(&pairs);
        for step in 0..150 {
            let time_s = 0.3 + f64::from(step) * 0.0103;
            let error = (rates.at(time_s).unwrap() - rate(time_s)).norm();
            assert!(error < 0.004, "{time_s}: {error}");
        }
        assert!(rates.at(2.2).is_some() && rates.at(4.01).is_none());
        assert_eq!(rates_of(&pairs[..3]), AngularRates::default());
    }
}
