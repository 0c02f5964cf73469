use nalgebra::{Const, DMatrix, DVector, Dyn, Matrix2, Vector2, Vector3, Vector6};

use super::damped::{DampedEquations as _, DampedOptions, DampedProblem, StopReason, minimize};
use super::reprojection::{self, BearingProjection, TangentPlane};
use super::{
    BlockTerm, CameraPose, Cholesky, DensePoseEquations, Landmark, LandmarkRows, LossSum, NormalEquations, Ray,
    RelativePose, Reprojection, ReprojectionEquations, RobustLoss, TriangulationOptions, TwoLevelEquations,
    gauss_newton, triangulate,
};
use crate::camera::{self, CameraModel, Distortion};
use crate::geometry::{RigidTransform, SplitMix64, so3};

fn uniform(random: &mut SplitMix64, half_width: f64) -> f64 {
    (2.0 * random.next_unit() - 1.0) * half_width
}

fn vector(random: &mut SplitMix64, half_width: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| uniform(random, half_width))
}

fn pose(random: &mut SplitMix64) -> RigidTransform {
    RigidTransform::new(so3::exp(&vector(random, 0.4)), vector(random, 0.5))
}

fn moved(pose: &RigidTransform, delta: &Vector6<f64>) -> CameraPose {
    pose.plus(delta).into()
}

fn cameras() -> Vec<CameraModel> {
    let radtan = Distortion::Radtan([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]);
    let fisheye = Distortion::Equidistant([0.0034823894, 0.0007150348, -0.0020532361, 0.00020293673]);
    [
        (camera::Projection::Pinhole, Distortion::None),
        (camera::Projection::Pinhole, radtan),
        (camera::Projection::Pinhole, fisheye),
        (camera::Projection::Ds { xi: -0.18, alpha: 0.59 }, Distortion::None),
    ]
    .into_iter()
    .map(|(projection, distortion)| {
        CameraModel::new(projection, distortion, [352.6, 348.1, 322.4, 238.1], [640, 480]).unwrap()
    })
    .collect()
}

/// Compares every column of the Jacobians with central differences; `tolerance` is absolute, in the unit of the
/// projection.
fn check_jacobians(
    random: &mut SplitMix64,
    projection: &impl BearingProjection,
    measured: &Vector2<f64>,
    tolerance: f64,
) {
    const STEP: f64 = 1e-6;
    let (anchor, observer) = (pose(random), pose(random));
    let bearing = (vector(random, 0.6).xy().push(1.0)).normalize();
    let landmark = Landmark { bearing, inverse_distance: 0.05 + 0.4 * random.next_unit() };
    let zero = Vector6::zeros();
    let relative = RelativePose::new(&moved(&anchor, &zero), &moved(&observer, &zero));
    let Some(term) = reprojection::linearize(projection, &relative, &relative, &landmark, measured) else { return };
    let at = |a: &Vector6<f64>, o: &Vector6<f64>, l: &Vector3<f64>| {
        let relative = RelativePose::new(&moved(&anchor, a), &moved(&observer, o));
        reprojection::residual(projection, &relative, &landmark.plus(l), measured).unwrap()
    };
    let still = Vector3::zeros();
    assert!((term.residual - at(&zero, &zero, &still)).amax() < tolerance);
    for column in 0..6 {
        let mut delta = Vector6::zeros();
        delta[column] = STEP;
        let by_anchor = (at(&delta, &zero, &still) - at(&-delta, &zero, &still)) / (2.0 * STEP);
        let by_observer = (at(&zero, &delta, &still) - at(&zero, &-delta, &still)) / (2.0 * STEP);
        assert!((term.by_anchor.column(column) - by_anchor).amax() < tolerance, "anchor, column {column}");
        assert!((term.by_observer.column(column) - by_observer).amax() < tolerance, "observer, column {column}");
    }
    let own = reprojection::linearize_in_anchor(projection, &landmark, measured);
    let in_anchor = |landmark: &Landmark| projection.project(&landmark.bearing).unwrap() - measured;
    for column in 0..3 {
        let mut delta = Vector3::zeros();
        delta[column] = STEP;
        let numeric = (at(&zero, &zero, &delta) - at(&zero, &zero, &-delta)) / (2.0 * STEP);
        assert!((term.by_landmark.column(column) - numeric).amax() < tolerance, "landmark, column {column}");
        let Some(own) = &own else { continue };
        let numeric = (in_anchor(&landmark.plus(&delta)) - in_anchor(&landmark.plus(&-delta))) / (2.0 * STEP);
        assert!((own.by_landmark.column(column) - numeric).amax() < tolerance, "in the anchor, column {column}");
        assert_eq!((own.by_anchor.amax(), own.by_observer.amax()), (0.0, 0.0));
    }
}

#[test]
fn reprojection_jacobians_meet_central_differences() {
    let mut random = SplitMix64::new(3);
    for camera in cameras() {
        for _ in 0..60 {
            check_jacobians(&mut random, &camera, &Vector2::new(300.0, 200.0), 1e-4);
        }
    }
    for _ in 0..200 {
        let measured = (vector(&mut random, 0.8).xy().push(1.0)).normalize();
        check_jacobians(&mut random, &TangentPlane::new(measured), &Vector2::zeros(), 1e-7);
    }
}

#[test]
fn a_landmark_reproduces_its_point() {
    let point = Vector3::new(0.3, -2.0, 5.0);
    let landmark = Landmark::from_point(&point).unwrap();
    assert!((landmark.point_in_anchor() - point).norm() < 1e-14);
    assert!(Landmark::from_point(&Vector3::new(0.0, 0.0, 1e-4)).is_none());
    let infinitely_far = landmark.plus(&Vector3::new(0.0, 0.0, -10.0));
    assert!(
        infinitely_far.is_infinitely_far() && infinitely_far.inverse_distance > 0.0 && !landmark.is_infinitely_far()
    );
}

#[test]
fn loss_weights_are_the_slopes_of_the_cost() {
    for loss in [RobustLoss::None, RobustLoss::Huber(1.5), RobustLoss::Cauchy(0.8)] {
        for squared in [0.01, 1.0, 2.0, 3.0, 50.0] {
            let slope = (loss.cost_and_weight(squared + 1e-6).0 - loss.cost_and_weight(squared - 1e-6).0) / 2e-6;
            assert!((slope - loss.cost_and_weight(squared).1).abs() < 1e-7, "{loss:?} at {squared}");
        }
        assert_eq!(loss.cost_of(None, 0.3), loss.cost_and_weight(1e4).0);
        let residuals = (0..500).map(|index| (index % 7 > 0).then(|| Vector2::new(0.01 * f64::from(index), 0.3)));
        let mut sum = LossSum::new(loss, 0.3);
        residuals.clone().for_each(|residual| sum.add(residual));
        let expected: f64 = residuals.map(|residual| loss.cost_of(residual, 0.3)).sum();
        assert!((sum.get() - expected).abs() < 1e-12 * expected, "{loss:?}: {} for {expected}", sum.get());
    }
}

/// Whitened terms of one landmark observed by `poses` cameras, the first of them its anchor.
fn terms(random: &mut SplitMix64, poses: usize) -> Vec<(usize, Reprojection)> {
    let camera = &cameras()[0];
    let world_from_camera: Vec<CameraPose> = (0..poses).map(|_| pose(random).into()).collect();
    let landmark = Landmark { bearing: Vector3::new(0.1, -0.2, 1.0).normalize(), inverse_distance: 0.3 };
    (0..poses)
        .map(|observer| {
            let relative = RelativePose::new(&world_from_camera[0], &world_from_camera[observer]);
            let measured = Vector2::new(320.0 + uniform(random, 40.0), 240.0 + uniform(random, 40.0));
            let term = if observer == 0 {
                reprojection::linearize_in_anchor(camera, &landmark, &measured)
            } else {
                reprojection::linearize(camera, &relative, &relative, &landmark, &measured)
            };
            (observer, term.unwrap().whitened(0.7, RobustLoss::Huber(1.5)))
        })
        .collect()
}

#[test]
fn elimination_by_qr_equals_the_schur_complement() {
    let mut random = SplitMix64::new(8);
    for poses in 2..6 {
        let terms = terms(&mut random, poses);
        let mut equations = ReprojectionEquations::new(DensePoseEquations::new(poses), 1);
        equations.add_landmark(Some(0), poses, terms.iter().copied());
        let reduced = equations.eliminate(0.0).poses;

        let columns = 6 * poses + 1;
        let mut local = LandmarkRows::default();
        local.begin([0], None, poses - 1);
        for (observer, term) in &terms {
            local.push(&BlockTerm::of_poses(Some(0), *observer, term));
        }
        local.eliminate();
        let mut rows = Vec::new();
        for (number, (added, blocks)) in local.added().enumerate() {
            assert_eq!(blocks.len(), number + 1);
            local.append_to(&mut rows, columns, added, blocks, |block| 6 * block);
        }
        let rows = DMatrix::from_row_slice(2 * poses - 3, columns, &rows);
        let squared = rows.tr_mul(&rows);
        let scale = squared.amax();
        for row in 0..poses {
            let gradient = squared.view((6 * row, columns - 1), (6, 1)).into_owned();
            let expected = DVector::from_column_slice(reduced.gradient[row].as_slice());
            assert!((gradient - expected).amax() < 1e-6 * scale, "{poses} poses, gradient");
            for column in row..poses {
                let block = squared.fixed_view::<6, 6>(6 * row, 6 * column);
                let expected = reduced.hessian.block(row, column);
                assert!((block - expected).amax() < 1e-6 * scale, "{poses} poses, block {row} {column}");
            }
        }
    }
}

/// Rosenbrock's valley, `r = [1 − x, 10 (y − x²)]`.
#[derive(Default)]
struct Valley {
    /// Length of the last step.
    moved: f64,
    /// Largest length of a step at which the solver may stop.
    longest_last: Option<f64>,
}

impl DampedProblem for Valley {
    type Estimate = Vector2<f64>;
    type Equations = NormalEquations<Const<2>>;

    fn cost(&self, at: &Vector2<f64>) -> f64 {
        (1.0 - at.x).powi(2) + 100.0 * (at.y - at.x * at.x).powi(2)
    }

    fn linearize(&self, at: &Vector2<f64>) -> Self::Equations {
        let jacobian = Matrix2::new(-1.0, 0.0, -20.0 * at.x, 10.0);
        let residual = Vector2::new(1.0 - at.x, 10.0 * (at.y - at.x * at.x));
        let mut equations = NormalEquations::zeros(Const);
        equations.add(&residual, &jacobian, 1.0);
        equations
    }

    fn step(&mut self, at: &Vector2<f64>, equations: &Self::Equations, damping: f64) -> Option<Vector2<f64>> {
        let step = equations.solve(damping)?;
        self.moved = step.norm();
        Some(at + step)
    }

    fn is_settled(&self) -> bool {
        self.longest_last.is_none_or(|longest| self.moved <= longest)
    }
}

const VALLEY_OPTIONS: DampedOptions = DampedOptions {
    iterations: 100,
    relative_cost_tolerance: 1e-12,
    first_damping: 1e-3,
    min_damping: 1e-9,
    max_damping: 1e8,
    growth: 10.0,
};

/// Usual start in the valley, far from its minimum at `(1, 1)`.
fn valley_start() -> Vector2<f64> {
    Vector2::new(-1.2, 1.0)
}

#[test]
fn the_damped_solver_goes_on_until_the_problem_is_settled() {
    let options = DampedOptions { relative_cost_tolerance: 0.9, ..VALLEY_OPTIONS };
    let start = valley_start();
    let by_cost = minimize(&mut Valley::default(), start, &options);
    let settled = minimize(&mut Valley { longest_last: Some(1e-6), ..Valley::default() }, start, &options);
    assert_eq!((by_cost.stop, settled.stop), (StopReason::Converged, StopReason::Converged));
    assert!(settled.tried > by_cost.tried, "{} and {} steps", settled.tried, by_cost.tried);
    let target = Vector2::new(1.0, 1.0);
    assert!((by_cost.estimate - target).norm() > 0.1, "{by_cost:?}");
    assert!((settled.estimate - target).norm() < 1e-6, "{settled:?}");
}

#[test]
fn the_damped_solver_descends_and_reports_why_it_stopped() {
    let (options, start) = (VALLEY_OPTIONS, valley_start());
    let solution = minimize(&mut Valley::default(), start, &options);
    assert!((solution.estimate - Vector2::new(1.0, 1.0)).norm() < 1e-6, "{solution:?}");
    assert!(matches!(solution.stop, StopReason::Converged | StopReason::Rounding), "{:?}", solution.stop);
    assert!(solution.iterations.iter().any(|iteration| !iteration.accepted));
    for pair in solution.iterations.windows(2) {
        let [before, after] = pair else { continue };
        let kept = if before.accepted { before.cost_after } else { before.cost_before };
        assert_eq!(after.cost_before, kept);
        assert_eq!(before.accepted, after.damping < before.damping || after.damping == options.min_damping);
    }
    let stopped = minimize(&mut Valley::default(), start, &DampedOptions { iterations: 2, ..options });
    assert_eq!((stopped.stop, stopped.tried), (StopReason::IterationLimit, 2));
    let limit = DampedOptions { max_damping: 1e-2, growth: 100.0, ..options };
    assert_eq!(minimize(&mut Valley::default(), Vector2::new(-1.2, 1.4), &limit).stop, StopReason::DampingLimit);
}

#[test]
fn gauss_newton_solves_the_valley_in_two_steps_and_stops_at_singular_equations() {
    let valley = Valley::default();
    let (mut at, mut steps) = (valley_start(), 0);
    let solved = gauss_newton(
        &mut at,
        10,
        |at| Some(valley.linearize(at)),
        |at, step| {
            (*at, steps) = (*at + step, steps + 1);
            step.norm() < 1e-9
        },
    );
    assert!(solved.is_some() && steps == 3 && (at - Vector2::new(1.0, 1.0)).norm() < 1e-12, "{at} after {steps}");
    let singular = gauss_newton(&mut at, 10, |_| Some(NormalEquations::zeros(Const::<2>)), |_, _| false);
    assert_eq!((singular, at), (None, at));
}

#[test]
fn two_levels_of_unknowns_have_the_solution_and_the_covariance_of_the_dense_equations() {
    let sizes = [3, 2];
    let (common, all) = (2, 7);
    let mut random = SplitMix64::new(5);
    let mut matrix = |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| uniform(&mut random, 1.0));
    let mut equations = TwoLevelEquations::zeros(&sizes, common);
    let mut dense = NormalEquations::zeros(Dyn(all));
    for (group, first) in [(0, 2), (0, 2), (1, 5), (1, 5)] {
        let (of_common, own) = (matrix(4, common), matrix(4, sizes[group]));
        let residual = matrix(4, 1).column(0).into_owned();
        equations.add(group, &residual, &[(0, &own)], &[(0, &of_common)], 0.7);
        let mut jacobian = DMatrix::zeros(4, all);
        jacobian.columns_mut(0, common).copy_from(&of_common);
        jacobian.columns_mut(first, sizes[group]).copy_from(&own);
        dense.add(&residual, &jacobian, 0.7);
    }
    for damping in [0.0, 0.3] {
        let (step, expected) = (equations.solve(damping).unwrap(), dense.solve(damping).unwrap());
        let found = step.common.iter().chain(step.groups.iter().flatten());
        assert!(found.zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-12), "{step:?} {expected}");
    }
    let covariance = dense.hessian.try_inverse().unwrap();
    let posterior = equations.posterior(&DVector::repeat(common, f64::INFINITY)).unwrap();
    let expected = covariance.view((0, 0), (common, common)).into_owned();
    assert!(
        (&posterior.common - &expected).amax() < 1e-12 && posterior.common == equations.common_covariance().unwrap()
    );
    for (unknown, variance) in posterior.groups.iter().flatten().enumerate() {
        let expected = covariance[(common + unknown, common + unknown)];
        assert!((variance - expected).abs() < 1e-12, "{variance}, {expected}");
    }
}

#[test]
fn the_length_of_a_step_is_in_marginal_standard_deviations() {
    let jacobian = DMatrix::from_fn(9, 5, |row, column| ((3 * row + 5 * column) % 7) as f64 - 2.5 + 0.1 * row as f64);
    let hessian = jacobian.tr_mul(&jacobian);
    let step = DVector::from_vec(vec![0.3, -0.2, 0.5, 0.1, -0.4]);
    let order = vec![4, 1, 0, 3, 2];
    let factor = Cholesky::ordered(&hessian, order.clone(), |diagonal| diagonal).unwrap();
    for count in [1, 2, 5] {
        let last = DVector::from_iterator(count, order[5 - count..].iter().map(|index| step[*index]));
        let covariance = factor.trailing_covariance(count);
        let expected = last.dot(&(covariance.try_inverse().unwrap() * &last)).sqrt();
        let length = factor.trailing_length(count, &step);
        assert!((length - expected).abs() < 1e-9 * expected, "{count} unknowns: {length}, {expected}");
    }
}

const TRIANGULATION: TriangulationOptions =
    TriangulationOptions { rounds: 3, min_parallax_rad: 0.01, of_all_pairs: false, max_error_rad: 0.01 };

fn ray(centre: Vector3<f64>, point: Vector3<f64>) -> Ray {
    Ray { centre, direction: (point - centre).normalize() }
}

#[test]
fn triangulation_meets_the_point() {
    let mut random = SplitMix64::new(4);
    let options = TriangulationOptions { of_all_pairs: true, min_parallax_rad: 1e-3, ..TRIANGULATION };
    for _ in 0..100 {
        let point = vector(&mut random, 3.0) + Vector3::new(0.0, 0.0, 7.0);
        let rays: Vec<Ray> = (0..4).map(|_| ray(vector(&mut random, 1.0), point)).collect();
        let found = triangulate(&rays, &TriangulationOptions { max_error_rad: 1e-9, ..options }).unwrap();
        assert!((found - point).norm() < 1e-9);
    }
    assert!(triangulate(&[ray(Vector3::zeros(), Vector3::z())], &options).is_none());
    let parallel = [Vector3::zeros(), Vector3::x()].map(|centre| ray(centre, centre + Vector3::z()));
    assert!(triangulate(&parallel, &options).is_none());
    assert!(triangulate(&[], &options).is_none());
}

#[test]
fn parallax_of_a_triangulation_is_that_of_the_chosen_pairs() {
    let point = Vector3::new(0.0, 0.0, 10.0);
    // The other two rays differ from the first by less than the least parallax, from each other by more.
    let rays = [0.0, 0.08, -0.08].map(|x| ray(Vector3::new(x, 0.0, 0.0), point));
    assert!(triangulate(&rays, &TRIANGULATION).is_none());
    assert!(triangulate(&rays, &TriangulationOptions { of_all_pairs: true, ..TRIANGULATION }).is_some());
}

#[test]
fn points_behind_a_camera_or_far_from_a_ray_are_not_triangulated() {
    let wide = TriangulationOptions::of_anchored(0.01);
    let second = Vector3::x();
    let diverging =
        [ray(Vector3::zeros(), Vector3::new(-1.0, 0.0, 5.0)), ray(second, second + Vector3::new(1.0, 0.0, 5.0))];
    assert!(triangulate(&diverging, &wide).is_none());
    let skew = [ray(Vector3::zeros(), Vector3::new(0.0, 0.0, 5.0)), ray(second, Vector3::new(0.0, 0.4, 5.0))];
    assert!(triangulate(&skew, &TRIANGULATION).is_none());
    assert!(triangulate(&skew, &wide).is_some());
}
