use crate::geometry::so3;
use crate::sensors::{CameraMount, Rig};
use crate::simulation::{SyntheticOptions, synthetic_tracks};
use crate::study::{Distribution, PerturbationStart, RigChange, RigPerturbation, RigQuantity};
use crate::text::Named as _;

fn rig() -> Rig {
    let options = SyntheticOptions { duration_s: 1.0, ..SyntheticOptions::default() };
    synthetic_tracks(&options).given_rig
}

fn perturbation(quantity: RigQuantity, distribution: Distribution, magnitude: f64) -> RigPerturbation {
    RigPerturbation {
        name: "level".to_owned(),
        changes: vec![RigChange { quantity, distribution, magnitude }],
        ..RigPerturbation::default()
    }
}

/// Differences of the chain's parameters: lengths and angles of base, links and end.
fn chain_differences(rig: &Rig, other: &Rig) -> (Vec<f64>, Vec<f64>) {
    let [a, b] = [rig, other].map(|rig| rig.gimbal.as_ref().unwrap().chain.clone());
    let mut lengths: Vec<f64> =
        (a.imu_from_base.translation_m - b.imu_from_base.translation_m).iter().copied().collect();
    lengths.extend((a.effector_from_camera.translation_m - b.effector_from_camera.translation_m).iter());
    let turn = so3::log(&(a.imu_from_base.rotation.inverse() * b.imu_from_base.rotation));
    let mut angles: Vec<f64> = turn.iter().copied().collect();
    for (a, b) in a.links.iter().zip(&b.links) {
        lengths.extend([a.d_m - b.d_m, a.a_m - b.a_m]);
        angles.extend([a.theta_offset_rad - b.theta_offset_rad, a.alpha_rad - b.alpha_rad]);
    }
    (lengths, angles)
}

#[test]
fn errors_stay_within_their_bounds_and_follow_the_seed() {
    let rig = rig();
    let level = perturbation(RigQuantity::GimbalTranslation, Distribution::Uniform, 0.005);
    let wrong = level.apply(&rig, None, 7).unwrap();
    assert_eq!(wrong, level.apply(&rig, None, 7).unwrap());
    assert_ne!(wrong, level.apply(&rig, None, 8).unwrap());
    let (lengths, angles) = chain_differences(&wrong, &rig);
    assert!(lengths.iter().all(|error| error.abs() <= 0.005) && angles.iter().all(|error| error.abs() < 1e-12));
    assert!(lengths.iter().any(|error| error.abs() > 0.001), "{lengths:?}");
    // Twice the magnitude of one seed is twice the error.
    let twice = perturbation(RigQuantity::GimbalTranslation, Distribution::Uniform, 0.01).apply(&rig, None, 7).unwrap();
    let (doubled, _) = chain_differences(&twice, &rig);
    assert!(doubled.iter().zip(&lengths).all(|(twice, once)| (twice - 2.0 * once).abs() < 1e-12));
}

#[test]
fn normal_errors_have_their_standard_deviation() {
    let rig = rig();
    let level = perturbation(RigQuantity::GimbalThetaOffset, Distribution::Normal, 0.01);
    let angles: Vec<f64> = (0..2000)
        .flat_map(|seed| {
            let wrong = level.apply(&rig, None, seed).unwrap();
            let pairs = |rig: &Rig| {
                rig.gimbal.as_ref().unwrap().chain.links.iter().map(|link| link.theta_offset_rad).collect::<Vec<_>>()
            };
            pairs(&wrong).into_iter().zip(pairs(&rig)).map(|(a, b)| a - b).collect::<Vec<_>>()
        })
        .collect();
    let mean = angles.iter().sum::<f64>() / angles.len() as f64;
    let sigma = (angles.iter().map(|angle| angle * angle).sum::<f64>() / angles.len() as f64).sqrt();
    assert!(mean.abs() < 5e-4 && (sigma / 0.01 - 1.0).abs() < 0.04, "{mean} {sigma}");
}

#[test]
fn every_quantity_changes_the_rig_or_says_what_is_missing() {
    let rig = rig();
    let has_rigid = rig.cameras.iter().any(|camera| camera.mount != CameraMount::Gimbal);
    for quantity in RigQuantity::all() {
        let level = perturbation(quantity, Distribution::Constant, 0.01);
        assert!(!level.is_random());
        let needs_rigid = matches!(quantity, RigQuantity::StaticTranslation | RigQuantity::StaticRotation);
        match level.apply(&rig, None, 0) {
            Ok(wrong) if quantity == RigQuantity::Distortion => drop(wrong),
            Ok(wrong) => assert_ne!(wrong, rig, "{}", quantity.name()),
            Err(error) => {
                assert!(needs_rigid && !has_rigid, "{error}");
                assert!(error.to_string().contains("the rig has no rigid camera"), "{error}");
            }
        }
    }
    let level = RigPerturbation {
        start: PerturbationStart::Truth,
        ..perturbation(RigQuantity::Focal, Distribution::Constant, 0.1)
    };
    assert!(level.apply(&rig, None, 0).unwrap_err().to_string().contains("the log has no ground-truth rig"));
    let focal = level.apply(&rig, Some(&rig), 0).unwrap().cameras[0].model.intrinsics()[0];
    assert!((focal / rig.cameras[0].model.intrinsics()[0] - 1.1).abs() < 1e-12);
}

#[test]
fn the_prior_follows_the_changes_when_asked() {
    let rig = rig();
    let mut level = perturbation(RigQuantity::GimbalTranslation, Distribution::Uniform, 0.02);
    let prior = |level: &RigPerturbation| level.apply(&rig, None, 1).unwrap().gimbal.unwrap().prior;
    assert_eq!(prior(&level), rig.gimbal.as_ref().unwrap().prior);
    level.match_prior = true;
    assert_eq!(prior(&level).translation_bound_m, 0.02);
    assert_eq!(prior(&level).rotation_bound_rad, rig.gimbal.as_ref().unwrap().prior.rotation_bound_rad);
}
