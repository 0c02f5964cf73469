//! Factors and their sinks.

use nalgebra::DVector;

use super::fixture;
use super::window::windows;
use crate::estimator::factors::costs::Costs;
use crate::estimator::factors::dense_equations::DenseEquations;
use crate::estimator::factors::factor::{Factor, JacobianBlock, Point, Sink, WhitenedRows};
use crate::estimator::factors::kind::{FactorKind, FactorLabel};
use crate::estimator::factors::labelled_rows::LabelledRows;
use crate::estimator::state::frame::Stationary;
use crate::text::Named as _;

/// The normal equations of all factors are the products of their rows, and their costs the squared residuals.
#[test]
fn sinks_agree_on_the_factors_of_a_window() {
    for (name, mut estimator) in windows() {
        fixture::marginalize_once(&mut estimator);
        fixture::disturb(&mut estimator, 0.5);
        let newest = estimator.window.frames.newest().stamp_ns;
        for frame in estimator.window.frames.iter_mut().skip(1) {
            frame.stationary = Some(Stationary {
                since_ns: newest - 200_000_000,
                position_sigma_m: 0.01,
                velocity_sigma_m_per_s: 0.1,
            });
        }
        let problem = estimator.problem(&[]);
        let estimate = estimator.estimate(&[]);
        let total = problem.layout.total();
        let rows = fixture::rows(&problem, &estimate, |_| true);
        let equations =
            problem.other_equations(&estimate, &problem.linearization_point(&estimate), problem.layout.frames);
        let (jacobian, residual) = (rows.columns(0, total), rows.column(total));
        let (hessian, gradient) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residual));
        let scale = hessian.amax();
        for column in 0..total {
            for row in column..total {
                let difference = (equations.hessian[(row, column)] - hessian[(row, column)]).abs();
                assert!(difference < 1e-12 * scale, "{name}: entry {row}, {column} differs by {difference}");
            }
        }
        assert!((&equations.gradient - &gradient).amax() < 1e-9 * gradient.amax(), "{name}: gradient");
        let costs = problem.costs(&estimate);
        let squared: f64 = FactorKind::all().map(|kind| costs.of(kind)).sum();
        assert!((squared - residual.norm_squared()).abs() < 1e-9 * squared, "{name}: {squared}");
        let count: usize = FactorKind::all().map(|kind| costs.count(kind)).sum();
        assert_eq!(count, rows.nrows(), "{name}");
        assert!(costs.count(FactorKind::ZeroVelocity) > 0, "{name}");
    }
}

/// A made-up sensor: the height of the newest frame and the vertical component of its velocity, in two rows.
struct HeightFactor {
    height_m: f64,
    climb_m_per_s: f64,
    columns: [usize; 2],
}

impl HeightFactor {
    const SIGMA: f64 = 0.5;

    fn of(point: &Point<'_>) -> Option<Self> {
        let newest = point.layout.frames.checked_sub(1)?;
        let navigation = &point.at.frames[newest].navigation;
        Some(Self {
            height_m: navigation.world_from_imu.translation_m.z,
            climb_m_per_s: navigation.velocity_m_per_s.z,
            columns: [point.layout.pose(newest).start + 5, point.layout.velocity_bias(newest).start + 2],
        })
    }
}

impl Factor for HeightFactor {
    fn label(&self) -> FactorLabel {
        FactorLabel::ZeroVelocity
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let slope = 1.0 / Self::SIGMA;
        let residual = [self.height_m * slope, self.climb_m_per_s * slope];
        let blocks = [
            JacobianBlock { start: self.columns[0], entries: &[slope, 0.0] },
            JacobianBlock { start: self.columns[1], entries: &[0.0, slope] },
        ];
        sink.add(self.label(), &WhitenedRows { residual: &residual, blocks: &blocks, products: None });
    }
}

/// A further sensor is its factor alone: every sink takes it without changes.
#[test]
fn sinks_take_a_factor_that_they_do_not_know() {
    let (_, estimator) = windows().into_iter().next().unwrap();
    let problem = estimator.problem(&[]);
    let estimate = estimator.estimate(&[]);
    let point = problem.point(&estimate, &estimate);
    let total = problem.layout.total();
    let factor = HeightFactor::of(&point).unwrap();
    let [height, climb] = factor.columns;
    let expected = [factor.height_m / HeightFactor::SIGMA, factor.climb_m_per_s / HeightFactor::SIGMA];

    let mut costs = Costs::default();
    costs.take(HeightFactor::of(&point));
    assert_eq!(costs.count(FactorKind::ZeroVelocity), 2);
    assert_eq!(costs.of(FactorKind::ZeroVelocity), DVector::from_row_slice(&expected).norm_squared());

    let mut equations = DenseEquations::zeros(total);
    equations.take(HeightFactor::of(&point));
    assert_eq!(equations.hessian[(height, height)], 4.0);
    assert_eq!(equations.hessian[(climb, height)], 0.0);
    assert_eq!(equations.gradient[climb], 2.0 * expected[1]);

    let mut rows = LabelledRows::new(total);
    rows.take(HeightFactor::of(&point));
    let (label, rows) = rows.by_factor().next().unwrap();
    assert_eq!((label, rows.nrows()), (FactorLabel::ZeroVelocity, 2));
    assert_eq!((rows[(0, height)], rows[(1, climb)], rows[(0, total)]), (2.0, 2.0, expected[0]));

    let mut none = LabelledRows::of(total, |_| false);
    none.take(HeightFactor::of(&point));
    assert!(none.parts.is_empty());
}
