use nalgebra::{DMatrix, DVector};

use super::{CalibratedFlight, CalibratedFlights, FlightHistory, Verdict};
use crate::calibration::tests::random::Random;
use crate::gimbal::{Chain, ClassicalChain, ParameterId, Parameterization};

const COLUMNS: usize = 6;
const PRIOR_SIGMA: f64 = 0.05;
/// Standard deviation of one measured direction.
const NOISE: f64 = 0.001;

fn columns() -> Vec<ParameterId> {
    let mount = Chain::from_classical(&ClassicalChain::default(), Parameterization::Minimal);
    mount.parameters()
}

/// Calibration from `directions` random directions about the truth, with this prior.
fn flight(
    random: &mut Random,
    truth: &DVector<f64>,
    directions: usize,
    before: (&DVector<f64>, f64),
) -> CalibratedFlight {
    let jacobian = DMatrix::from_fn(directions, COLUMNS, |_, _| random.normal(1.0) / NOISE);
    let measured = &jacobian * truth + DVector::from_fn(directions, |_, _| random.normal(1.0));
    let (values_before, sigma) = before;
    let covariance_before = DMatrix::identity(COLUMNS, COLUMNS) * sigma.powi(2);
    let information = DMatrix::identity(COLUMNS, COLUMNS) * sigma.powi(-2) + jacobian.tr_mul(&jacobian);
    let covariance = information.cholesky().unwrap().inverse();
    let values = &covariance * (values_before * sigma.powi(-2) + jacobian.tr_mul(&measured));
    CalibratedFlight { values, covariance, values_before: values_before.clone(), covariance_before }
}

fn history(flights: Vec<CalibratedFlight>) -> FlightHistory {
    CalibratedFlights { columns: columns(), flights }.history().unwrap()
}

fn verdicts(history: &FlightHistory) -> String {
    let letter = |verdict| match verdict {
        Verdict::First => 'F',
        Verdict::Agrees => '=',
        Verdict::Alone => '!',
        Verdict::Changed => '|',
    };
    history.agreements.iter().map(|agreement| letter(agreement.verdict)).collect()
}

#[test]
fn flights_of_one_mechanism_agree_and_add_up() {
    let mut random = Random::new(1);
    let truth = DVector::from_fn(COLUMNS, |_, _| PRIOR_SIGMA * random.normal(1.0));
    let rig = DVector::zeros(COLUMNS);
    let mut misfits = Vec::new();
    for _ in 0..100 {
        // Each flight alone leaves two or three directions at the prior, as their runs may start from different rigs.
        let flights: Vec<_> = (0..8)
            .map(|number| {
                let start = &rig + DVector::from_element(COLUMNS, 0.01 * f64::from(number % 2));
                flight(&mut random, &truth, 3 + usize::from(number % 2 == 0), (&start, PRIOR_SIGMA))
            })
            .collect();
        let history = history(flights);
        let [interval] = history.intervals.as_slice() else { panic!("{}", verdicts(&history)) };
        assert_eq!(interval.flights.len(), 8);
        let error = (&interval.values - &truth).norm();
        assert!(error < 4.0 * interval.covariance.trace().sqrt(), "{error}");
        misfits.extend(history.agreements.iter().skip(1).map(|it| it.chi_square / it.directions as f64));
    }
    let mean = misfits.iter().sum::<f64>() / misfits.len() as f64;
    assert!((0.85..1.1).contains(&mean), "χ² per direction {mean}");
}

#[test]
fn a_change_is_found_with_its_parameter() {
    let mut random = Random::new(2);
    let rig = DVector::zeros(COLUMNS);
    let truth = DVector::from_fn(COLUMNS, |_, _| PRIOR_SIGMA * random.normal(1.0));
    let mut moved = truth.clone();
    moved[4] += 0.02;
    let truths = [&truth, &truth, &truth, &moved, &moved];
    let flights = truths.map(|truth| flight(&mut random, truth, 12, (&rig, PRIOR_SIGMA))).to_vec();
    let history = history(flights);
    assert_eq!(verdicts(&history), "F==|=");
    assert_eq!(history.intervals.iter().map(|it| it.flights.clone()).collect::<Vec<_>>(), [vec![0, 1, 2], vec![3, 4]]);
    let [change] = history.agreements[3].changes.as_slice() else { panic!("{:?}", history.agreements[3]) };
    assert_eq!(change.column, 4);
    assert!((change.by - 0.02).abs() < 4.0 * change.sigma && change.sigma < 0.001, "{change:?}");
}

#[test]
fn one_wrong_flight_is_left_out() {
    let mut random = Random::new(3);
    let rig = DVector::zeros(COLUMNS);
    let truth = DVector::zeros(COLUMNS);
    let wrong = DVector::from_element(COLUMNS, 0.01);
    let truths = [&truth, &truth, &wrong, &truth, &truth];
    let flights = truths.map(|truth| flight(&mut random, truth, 12, (&rig, PRIOR_SIGMA))).to_vec();
    let history = history(flights);
    assert_eq!(verdicts(&history), "F=!==");
    assert_eq!(history.intervals[0].flights, [0, 1, 3, 4]);
}

#[test]
fn what_another_flight_knew_is_not_counted_again() {
    let mut random = Random::new(4);
    let rig = DVector::zeros(COLUMNS);
    let truth = DVector::from_element(COLUMNS, 0.01);
    let first = flight(&mut random, &truth, 12, (&rig, PRIOR_SIGMA));
    // The second run started from the first one and measured one direction.
    let row = DVector::from_fn(COLUMNS, |_, _| random.normal(1.0) / NOISE);
    let before = first.covariance.clone().cholesky().unwrap().inverse();
    let covariance = (&before + &row * row.transpose()).cholesky().unwrap().inverse();
    let values = &covariance * (&before * &first.values + &row * (row.dot(&truth) + random.normal(1.0)));
    let second = CalibratedFlight {
        values: values.clone(),
        covariance: covariance.clone(),
        values_before: first.values.clone(),
        covariance_before: first.covariance.clone(),
    };
    let history = history(vec![first, second]);
    assert_eq!(verdicts(&history), "F=");
    assert_eq!(history.agreements[1].directions, 1);
    let sum = &history.intervals[0];
    // The prior has a least variance of 1e-12, a millionth of the variances of the columns.
    assert!((&sum.values - &values).norm() < 1e-5 * covariance.trace().sqrt(), "{}", &sum.values - &values);
    assert!((&sum.covariance - &covariance).norm() < 1e-5 * covariance.norm());
}
