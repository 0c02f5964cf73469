use nalgebra::SVector;

/// Degree of the splines: position, velocity, acceleration and jerk are smooth.
const DEGREE: usize = 5;

/// Uniform B-spline of degree five through `D`-dimensional control points.
///
/// Control point `c` has its largest weight at the time `(c − 2) · knot_s`; equal control points give an exact
/// standstill.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline<const D: usize> {
    pub knot_s: f64,
    pub points: Vec<SVector<f64, D>>,
}

/// Weights of the `degree + 1` control points that affect `u ∈ [0, 1]` of a knot interval.
fn basis(degree: usize, u: f64) -> [f64; DEGREE + 1] {
    let mut weights = [0.0; DEGREE + 1];
    weights[0] = 1.0;
    for k in 1..=degree {
        let order = k as f64;
        for j in (0..=k).rev() {
            let from_left = if j > 0 { (u + order - j as f64) / order * weights[j - 1] } else { 0.0 };
            let from_right = if j < k { (1.0 - u + j as f64) / order * weights[j] } else { 0.0 };
            weights[j] = from_left + from_right;
        }
    }
    weights
}

impl<const D: usize> Spline<D> {
    /// Time in seconds at which a control point has its largest weight.
    pub(crate) fn time_of_point(&self, index: usize) -> f64 {
        (index as f64 - 2.0) * self.knot_s
    }

    /// Number of control points that cover `duration_s` and one more interval.
    pub(crate) fn points_for(duration_s: f64, knot_s: f64) -> usize {
        (duration_s / knot_s).ceil() as usize + DEGREE + 2
    }

    /// Index of the first of the six control points that affect a time.
    pub(crate) fn first_acting(&self, time_s: f64) -> usize {
        let last = self.points.len().saturating_sub(DEGREE + 1);
        ((time_s / self.knot_s).max(0.0) as usize).min(last)
    }

    /// Derivative of order `order` (0 to 4) at a time; the ends are extrapolated as polynomials.
    pub fn derivative(&self, time_s: f64, order: usize) -> SVector<f64, D> {
        let first = self.first_acting(time_s);
        let mut acting = [SVector::<f64, D>::zeros(); DEGREE + 1];
        for (slot, point) in acting.iter_mut().zip(&self.points[first..]) {
            *slot = *point;
        }
        for k in 0..order {
            for j in 0..DEGREE - k {
                acting[j] = (acting[j + 1] - acting[j]) / self.knot_s;
            }
        }
        let weights = basis(DEGREE - order, time_s / self.knot_s - first as f64);
        let mut sum = SVector::zeros();
        for j in 0..=DEGREE - order {
            sum += acting[j] * weights[j];
        }
        sum
    }
}
