use super::excitation::{estimator, flight, run_flight};
use crate::estimator::Estimator;
use crate::gimbal::tests::parameter;
use crate::gimbal::{Chain, ParameterNames, Parameterization};
use crate::observability::{
    ChainSlide, KnownLoss, RankReport, SlideDirection, SlidePosition, SlideRequest, chain_of_step, known_losses, slide,
};
use crate::simulation::{Exercise, VehicleSwing};

/// Processes a flight up to 4 s. Returns the ranks of its last step, and a function that moves the last chain.
fn moves(parameterization: Parameterization, encoder: bool) -> (RankReport, impl Fn(&SlideDirection) -> ChainSlide) {
    let flight = flight(Exercise::full(VehicleSwing::Hover, None), 7);
    let like = estimator(&flight.given_rig, parameterization, encoder);
    let mut config = like.config().clone();
    // First estimates belong to an earlier chain, whose directions differ slightly from the directions of the present
    // one.
    config.options.calibration_first_estimates = false;
    config.options.first_estimate_reach_rad = 0.0;
    let mut estimator = Estimator::new(config);
    let (report, rank) = run_flight(&mut estimator, &flight, -1.0, 4.0);
    let chain = chain_of_step(&report, &rank).unwrap();
    let reported = rank.clone();
    let moved = move |direction: &SlideDirection| {
        let weights = direction.weights(&reported, &chain).unwrap();
        slide(&report, &flight.given_rig.cameras[0].model, &chain, &weights, 1.0).unwrap()
    };
    (rank, moved)
}

#[test]
fn reprojections_are_unchanged_along_a_redundant_direction() {
    let (rank, moved) = moves(Parameterization::Classical, true);
    assert_eq!((rank.parameters.len(), rank.rank_structural, rank.known.len()), (24, 18, 6));
    // Measured directions: no change to first order.
    let null: Vec<usize> = (0..rank.directions.len()).filter(|index| rank.directions[*index].structural).collect();
    assert_eq!(null.len(), 6);
    for index in null {
        let slid = moved(&SlideDirection::Measured(index));
        assert!(slid.largest_first_order_px < 1e-5, "{index}: {} px", slid.largest_first_order_px);
        assert!(slid.predictions_px.len() > 20 && slid.changes.iter().any(|change| change.abs() > 0.01), "{index}");
    }
    // Directions in closed form: translations along an axis leave all pixels and the camera unchanged at any amount;
    // rotations too unless they are coupled.
    for known in &rank.known {
        let slid = moved(&SlideDirection::Known(known.loss));
        assert!(slid.largest_first_order_px < 1e-5, "{:?}: {} px", known.loss, slid.largest_first_order_px);
        if matches!(known.loss, KnownLoss::BaseD | KnownLoss::EndD | KnownLoss::EndA) {
            assert!(slid.largest_px < 1e-6, "{:?}: {} px", known.loss, slid.largest_px);
            assert!(slid.camera_moves.0 < 1e-12 && slid.camera_moves.1 < 1e-7, "{:?}", slid.camera_moves);
        }
    }
    // An observable parameter changes pixels and camera.
    for name in ["L2.alpha", "EC.rx"] {
        let seen = moved(&SlideDirection::Parameter(parameter(name)));
        assert!(seen.largest_px > 10.0 && seen.largest_first_order_px > 10.0, "{name}: {} px", seen.largest_px);
        assert!(seen.camera_moves.1 > 0.1, "{name}: {:?}", seen.camera_moves);
    }
}

#[test]
fn fixed_parameters_count_as_known() {
    let flight = flight(Exercise::full(VehicleSwing::Hover, None), 7);
    let mut estimator = estimator(&flight.given_rig, Parameterization::Classical, true);
    let (_, before) = run_flight(&mut estimator, &flight, -1.0, 4.0);
    assert_eq!((before.parameters.len(), before.rank_structural, before.deficit_parameterization), (24, 18, 6));
    let mut from_s = 4.0;
    // Each fixes one of the six redundant directions; without the columns that Eqs. 18–20 drop none is left.
    let dropped = ["L1.d", "L1.theta", "L3.theta", "L3.d", "L3.a", "L3.alpha"];
    for (count, name) in dropped.into_iter().enumerate() {
        let fixed = parameter(name);
        estimator.freeze(fixed).unwrap();
        let (report, rank) = run_flight(&mut estimator, &flight, from_s, from_s + 0.2);
        from_s += 0.2;
        let lost = 5 - count;
        assert_eq!((rank.parameters.len(), rank.rank_structural), (18 + lost, 18), "{name}");
        assert_eq!(
            (rank.deficit_parameterization, rank.known.len(), rank.known_agreeing()),
            (lost, lost, lost),
            "{name}"
        );
        assert!(rank.fixed_parameters.contains(&fixed) && !rank.parameters.contains(&fixed), "{name}");
        assert_eq!(report.gain.as_ref().unwrap().columns(), rank.parameters.len(), "{name}");
        // The chain still has all its columns; fixed ones cannot be moved.
        let chain = chain_of_step(&report, &rank).unwrap();
        assert_eq!(chain.dof(), 24, "{name}");
        let place = chain.parameters().iter().position(|known| *known == fixed).unwrap();
        for direction in 0..rank.directions.len() {
            let weights = SlideDirection::Measured(direction).weights(&rank, &chain).unwrap();
            assert!(weights.len() == 24 && weights[place] == 0.0, "{name}");
        }
    }
}

#[test]
fn free_joint_angles_follow_the_chain() {
    let (rank, moved) = moves(Parameterization::Classical, false);
    assert!(rank.parameters.contains(&parameter("IB.rz")), "{:?}", rank.parameters);
    let lost = rank.known.iter().find(|known| known.loss == KnownLoss::BaseTheta).expect("the offset is not a column");
    let slid = moved(&SlideDirection::Known(lost.loss));
    assert!(slid.largest_px < 0.01, "{} px", slid.largest_px);
}

#[test]
fn directions_have_names() {
    let names = ParameterNames { joints: vec!["yaw".to_owned(), "roll".to_owned()], cameras: Vec::new() };
    let read = |text: &str| text.parse::<SlideRequest>().map(|request| request.position(&names));
    let position = |direction, amount| Ok(Some(SlidePosition { direction, amount }));
    assert_eq!(read("1=0.5"), position(SlideDirection::Measured(0), 0.5));
    assert_eq!(read("L2.alpha=-1"), position(SlideDirection::Parameter(parameter("L2.alpha")), -1.0));
    assert_eq!(read("roll.alpha=-1"), read("L2.alpha=-1"));
    assert_eq!(read("parallel-d-2=1"), position(SlideDirection::Known(KnownLoss::ParallelD(1)), 1.0));
    assert_eq!(read("wheel.alpha=1"), Ok(None));
    assert_eq!(read("base-d = 1e-1"), position(SlideDirection::Known(KnownLoss::BaseD), 0.1));
    for wrong in ["", "1", "0=1", "=1", "base-d=much", "2=inf"] {
        let error = read(wrong).unwrap_err().to_string();
        assert!(error.contains("expected DIRECTION=VALUE"), "{error}");
    }
    // Names are unique.
    let chain = super::super::Mechanism::named("coaxial-axes").unwrap().chain;
    let chain = Chain::from_classical(&chain, Parameterization::Classical);
    let mut names: Vec<String> = known_losses(&chain, true).iter().map(|(loss, _)| loss.name()).collect();
    let all = names.len();
    names.sort();
    names.dedup();
    assert!(names.len() == all && all > 8, "{names:?}");
}
