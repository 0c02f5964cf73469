use nalgebra::DMatrix;

use crate::estimator::{ColumnBlock, ColumnGroup, ColumnId, FrameId, Linearization};
use crate::gimbal::tests::random::Random;
use crate::gimbal::{Chain, ParameterId, ParameterNames, Parameterization};
use crate::observability::analyse;

const FRAMES: usize = 11;
const JOINTS: usize = 3;
const CALIBRATION: usize = 18;
const JOINTS_START: usize = CALIBRATION;
const POSES_START: usize = JOINTS_START + JOINTS * FRAMES;
const VELOCITIES_START: usize = POSES_START + 6 * FRAMES;
const PRIORS: usize = 120;
const COLUMNS: usize = VELOCITIES_START + 9 * FRAMES;

/// A random linearization with the sparsity of a real one, in which the poses' columns depend on each other as
/// in a visual-inertial window: four directions of all poses and velocities have no effect.
fn window(random: &mut Random, parameters: &[ParameterId]) -> Linearization {
    let mut jacobian = DMatrix::zeros(66 + 15 * (FRAMES - 1) + JOINTS * FRAMES, COLUMNS);
    let mut fill =
        |jacobian: &mut DMatrix<f64>, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>, size: f64| {
            for row in rows {
                for column in columns.clone() {
                    jacobian[(row, column)] = random.within(size);
                }
            }
        };
    fill(&mut jacobian, 0..66, 0..VELOCITIES_START, 100.0);
    for slot in 1..FRAMES {
        let rows = 66 + 15 * (slot - 1)..66 + 15 * slot;
        fill(&mut jacobian, rows.clone(), POSES_START + 6 * (slot - 1)..POSES_START + 6 * (slot + 1), 1000.0);
        fill(&mut jacobian, rows, VELOCITIES_START + 9 * (slot - 1)..VELOCITIES_START + 9 * (slot + 1), 30.0);
    }
    for index in 0..JOINTS * FRAMES {
        let row = 66 + 15 * (FRAMES - 1) + index;
        jacobian[(row, JOINTS_START + index)] = 115.0;
    }
    // Four gauge directions: each pose's last four columns repeat the last four columns of the other poses with the
    // opposite sign.
    for gauge in 0..4 {
        let last = POSES_START + 6 * (FRAMES - 1) + 2 + gauge;
        let mut sum = nalgebra::DVector::zeros(jacobian.nrows());
        for slot in 0..FRAMES - 1 {
            sum += jacobian.column(POSES_START + 6 * slot + 2 + gauge);
        }
        jacobian.set_column(last, &-sum);
    }
    // The marginalization prior couples the calibration with all frames but the newest and with the oldest
    // velocity and biases.
    let mut prior_jacobian = DMatrix::zeros(PRIORS, COLUMNS);
    for row in 0..PRIORS {
        let after = POSES_START + 6 * (FRAMES - 1);
        fill(&mut prior_jacobian, row..row + 1, row.min(after)..after, 10.0);
        fill(&mut prior_jacobian, row..row + 1, VELOCITIES_START..VELOCITIES_START + 9, 10.0);
    }
    let mut columns: Vec<_> = parameters
        .iter()
        .enumerate()
        .map(|(start, parameter)| ColumnBlock { id: ColumnId::Calibration(*parameter), start, len: 1 })
        .collect();
    let blocks = |id: fn(FrameId) -> ColumnId, start: usize, len: usize| {
        (0..FRAMES).map(move |slot| ColumnBlock { id: id(FrameId(slot)), start: start + len * slot, len })
    };
    columns.extend(blocks(ColumnId::Joints, JOINTS_START, JOINTS));
    columns.extend(blocks(ColumnId::Pose, POSES_START, 6));
    columns.extend(blocks(ColumnId::VelocityBias, VELOCITIES_START, 9));
    let calibration_column_norms = nalgebra::DVector::from_fn(CALIBRATION, |column, _| jacobian.column(column).norm());
    Linearization {
        columns,
        fixed_parameters: Vec::new(),
        jacobian,
        prior_jacobian,
        rig_prior_rows: 0,
        calibration_column_norms,
        chain: chain(),
    }
}

/// Singular values by definition: calibration columns minus their projection onto the column space of the nuisance
/// columns.
fn by_definition(jacobian: &DMatrix<f64>, scale: &[f64]) -> Vec<f64> {
    let nuisance = jacobian.columns(CALIBRATION, COLUMNS - CALIBRATION).into_owned();
    let svd = crate::geometry::dense::thin_svd(&nuisance).unwrap();
    let mut rest = jacobian.columns(0, CALIBRATION).into_owned();
    for (direction, value) in svd.u.column_iter().zip(&svd.singular_values) {
        if *value > 1e-9 * svd.singular_values[0] {
            let along = direction.tr_mul(&rest);
            rest -= direction * along;
        }
    }
    for (mut column, scale) in rest.column_iter_mut().zip(scale) {
        column *= *scale;
    }
    crate::geometry::dense::singular_values(&rest).unwrap()
}

fn chain() -> Chain {
    Chain::from_classical(&Random::new(31).chain(JOINTS), Parameterization::Minimal)
}

#[test]
fn block_elimination_equals_the_projection() {
    let mut random = Random::new(32);
    let chain = chain();
    let scale: Vec<f64> = chain.parameters().iter().map(|parameter| parameter.scale()).collect();
    for _ in 0..3 {
        let linearization = window(&mut random, &chain.parameters());
        let angles: Vec<_> = (0..FRAMES).map(|_| random.angles(JOINTS)).collect();
        let report = analyse(&linearization, &chain, &angles, false).unwrap();
        let jacobian = &linearization.jacobian;
        for (found, expected) in report.singular_values.iter().zip(by_definition(jacobian, &scale)) {
            assert!((found - expected).abs() < 1e-10 * report.reference, "{found} for {expected}");
        }
        let rows = jacobian.nrows() + PRIORS;
        let mut stacked = jacobian.clone().resize_vertically(rows, 0.0);
        stacked.rows_mut(jacobian.nrows(), PRIORS).copy_from(&linearization.prior_jacobian);
        for (found, expected) in report.singular_values_with_priors.iter().zip(by_definition(&stacked, &scale)) {
            assert!((found - expected).abs() < 1e-10 * report.reference, "{found} for {expected}");
        }
        assert_eq!(report, analyse(&linearization, &chain, &angles, false).unwrap(), "twice the same bits");
    }
}

#[test]
fn a_linearization_that_is_not_finite_has_no_ranks() {
    let chain = chain();
    let mut linearization = window(&mut Random::new(33), &chain.parameters());
    linearization.jacobian[(3, 5)] = f64::NAN;
    assert_eq!(analyse::<Vec<f64>>(&linearization, &chain, &[], false), None);
}

#[test]
fn empty_linearizations_are_analysed() {
    let chain = chain();
    let mut linearization = window(&mut Random::new(34), &chain.parameters());
    linearization.jacobian = DMatrix::zeros(0, COLUMNS);
    linearization.prior_jacobian = DMatrix::zeros(0, COLUMNS);
    linearization.calibration_column_norms.fill(0.0);
    let report = analyse(&linearization, &chain, &[vec![0.0; JOINTS]], false).unwrap();
    assert_eq!((report.rank_structural, report.rank_informed), (0, 0));
    assert_eq!(report.singular_values, vec![0.0; CALIBRATION]);
    assert_eq!(report.directions.len(), CALIBRATION);
    // No calibration columns, as in a run with a fixed calibration.
    linearization.columns.retain(|block| block.id.group() != ColumnGroup::Calibration);
    linearization.calibration_column_norms = nalgebra::DVector::zeros(0);
    let report = analyse(&linearization, &chain, &[vec![0.0; JOINTS]], false).unwrap();
    assert!(report.parameters.is_empty() && report.singular_values.is_empty());
    assert_eq!(report.verdict(&ParameterNames::default()), "structural rank 0 of 0; informed rank 0");
}
