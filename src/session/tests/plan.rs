use nalgebra::{UnitQuaternion, Vector3};

use crate::estimator::VisualLoss;
use crate::optimization::RobustLoss;
use crate::sensors::{CameraRig, Rig};
use crate::session::accuracy::{AlignmentSums, TrajectoryAlignment};
use crate::session::engine::estimator_config;
use crate::session::plan::{ParameterizationChoice, RunSpec, RunSpecError, cameras_of_run, distinct_labels};
use crate::simulation::{SyntheticMount, SyntheticOptions, synthetic_tracks};

/// The parsed specification, or the message of its rejection.
fn parse(text: &str) -> Result<RunSpec, String> {
    text.parse().map_err(|error: RunSpecError| error.to_string())
}

#[test]
fn run_specifications_are_read_and_written() {
    let run = parse("classical:encoder=off,window=8,name=left").unwrap();
    assert_eq!(run.parameterization, ParameterizationChoice::Classical);
    assert_eq!((run.encoder, run.calibrate, run.window, run.label.as_str()), (false, true, 8, "left"));
    for text in [
        "auto",
        "static",
        "cluster:window=8",
        "minimal:calibrate=off",
        "classical:encoder=off,window=8,name=left",
        "poe:camera=cam1",
        "auto:timeshift=on,first-estimates=off",
        "auto:pixel-noise=2,imu-noise=0.5,encoder-noise=3,loss=huber-1.5,iterations=12",
        "static:loss=none,name=quadratic",
        "cluster:window=8,passes=2,iterations=12",
    ] {
        let run = parse(text).unwrap();
        assert_eq!(parse(&run.to_string()).unwrap(), run, "{text} is written as {run}");
    }
}

#[test]
fn specifications_of_one_meaning_have_one_text_of_settings() {
    let check = |text: &str, settings: &str, written: &str| {
        let run = parse(text).unwrap();
        assert_eq!((run.settings().as_str(), run.to_string().as_str()), (settings, written), "{text}");
    };
    check("auto", "auto", "auto");
    check("auto:window=10", "auto", "auto:name=auto-window-10");
    check("auto:encoder=on,pixel-noise=1.0,name=auto", "auto", "auto");
    check(
        "auto:imu-noise=2.0,window=8",
        "auto:window=8,imu-noise=2",
        "auto:window=8,imu-noise=2,name=auto-imu-noise-2.0-window-8",
    );
    check("auto:passes=1", "auto", "auto:name=auto-passes-1");
    check("poe:loss=cauchy-2,name=robust", "poe:loss=cauchy-2", "poe:loss=cauchy-2,name=robust");
}

#[test]
fn tuning_changes_the_configuration() {
    let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.1, ..SyntheticOptions::default() }).given_rig;
    let config = |text: &str| estimator_config(&rig, &parse(text).unwrap()).unwrap();
    let (standard, tuned) =
        (config("auto"), config("auto:pixel-noise=2,imu-noise=3,encoder-noise=4,loss=huber-1.5,iterations=12"));
    assert_eq!(tuned.options.pixel_sigma_px, 2.0 * standard.options.pixel_sigma_px);
    assert_eq!(tuned.options.imu_noise_factor, 3.0 * standard.options.imu_noise_factor);
    assert_eq!(tuned.encoder_sigma_rad, standard.encoder_sigma_rad.map(|sigma_rad| 4.0 * sigma_rad));
    assert!(standard.encoder_sigma_rad.is_some());
    assert_eq!((tuned.options.loss, tuned.options.iterations), (VisualLoss::Fixed(RobustLoss::Huber(1.5)), 12));
}

#[test]
fn rejected_specifications_report_what_was_expected() {
    let check = |text: &str, words: &[&str]| {
        let message = parse(text).unwrap_err();
        assert!(words.iter().all(|word| message.contains(word)), "{text}: {message}");
    };
    check("minimol", &["minimol", "minimal-swapped"]);
    check("auto:encoder=maybe", &["encoder", "maybe", "on or off"]);
    check("auto:window=2", &["window", "'2'", "4 to 30"]);
    check("auto:speed=3", &["unknown key 'speed'", "calibrate"]);
    check("auto:passes=0", &["passes", "'0'", "1 to 3"]);
    check("auto:encoder", &["no value"]);
    check("auto:pixel-noise=0", &["pixel-noise", "'0'", "0.001 to 1000"]);
    check("auto:loss=tukey-2", &["loss", "'tukey-2'", "huber-K"]);
    check("auto:iterations=0", &["iterations", "1 to 100"]);
    check("auto:name=../x", &["name", "letters"]);
}

#[test]
fn labels_are_folders_and_differ() {
    let mut runs =
        vec![parse("auto").unwrap(), parse("auto").unwrap(), parse("static").unwrap(), parse("auto").unwrap()];
    distinct_labels(&mut runs);
    let labels: Vec<&str> = runs.iter().map(|run| run.label.as_str()).collect();
    assert_eq!(labels, ["auto", "auto-2", "static", "auto-3"]);
    assert_eq!(parse("minimal:calibrate=off").unwrap().label, "minimal-calibrate-off");
}

#[test]
fn alignment_recovers_yaw_translation_and_scale() {
    let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.1);
    let shift = Vector3::new(3.0, -2.0, 0.7);
    let check = |alignment: TrajectoryAlignment, rotation: UnitQuaternion<f64>, scale: f64| {
        let mut sums = AlignmentSums::default();
        for step in 0..50 {
            let time = f64::from(step) * 0.3;
            let estimate = Vector3::new(time.sin(), (1.7 * time).cos() * 2.0, 0.4 * (0.9 * time).sin());
            sums.add(&estimate, &(rotation * estimate * scale + shift));
        }
        let found = sums.solve(alignment).unwrap();
        assert!(found.rigid.rotation.angle_to(&rotation) < 1e-9, "{alignment:?}");
        assert!((found.rigid.translation_m - shift).norm() < 1e-9, "{alignment:?}");
        assert!((found.scale - scale).abs() < 1e-9, "{alignment:?}");
    };
    check(TrajectoryAlignment::YawPosition, yaw, 1.0);
    check(TrajectoryAlignment::Rigid, UnitQuaternion::from_euler_angles(0.3, -0.5, 2.0), 1.0);
    check(TrajectoryAlignment::Similarity, UnitQuaternion::from_euler_angles(0.3, -0.5, 2.0), 1.3);
    assert!(AlignmentSums::default().solve(TrajectoryAlignment::YawPosition).is_none());
}

#[test]
fn a_cluster_uses_the_gimballed_and_the_rigid_camera() {
    let rig_of =
        |mount| synthetic_tracks(&SyntheticOptions { mount, duration_s: 0.1, ..SyntheticOptions::default() }).given_rig;
    let (mut rig, rigid) = (rig_of(SyntheticMount::Gimbal), rig_of(SyntheticMount::Static));
    let refused = |rig: &Rig, text: &str| cameras_of_run(rig, &parse(text).unwrap()).unwrap_err().to_string();
    let message = refused(&rig, "cluster");
    assert!(message.contains("a second camera") && message.contains("cam0 (mount: gimbal)"), "{message}");
    let message = refused(&rigid, "cluster");
    assert!(message.contains("a second camera") && message.contains("cam0 (mount: static)"), "{message}");

    rig.cameras.push(CameraRig { key: "cam1".to_owned(), ..rigid.cameras[0].clone() });
    let keys = |text: &str| -> Vec<String> {
        cameras_of_run(&rig, &parse(text).unwrap()).unwrap().iter().map(|camera| camera.key.clone()).collect()
    };
    assert_eq!((keys("auto"), keys("static")), (vec!["cam0".to_owned()], vec!["cam1".to_owned()]));
    assert_eq!(keys("cluster"), ["cam0", "cam1"]);
    let message = refused(&rig, "cluster:camera=cam1");
    assert!(message.contains("camera 'cam1' with mount: gimbal"), "{message}");

    // All cameras, or those that are named; parameters of a camera keep their number.
    rig.cameras.push(CameraRig { key: "cam2".to_owned(), ..rigid.cameras[0].clone() });
    let keys = |text: &str| -> Vec<String> {
        cameras_of_run(&rig, &parse(text).unwrap()).unwrap().iter().map(|camera| camera.key.clone()).collect()
    };
    assert_eq!(keys("cluster"), ["cam0", "cam1", "cam2"]);
    assert_eq!(keys("cluster:cameras=cam2+cam0"), ["cam0", "cam2"]);
    assert_eq!(keys("cluster:cameras=cam2+cam1"), ["cam1", "cam2"]);
    assert_eq!(keys("cluster:camera=cam0"), ["cam0", "cam1", "cam2"]);
    let config = estimator_config(&rig, &parse("cluster:cameras=cam0+cam2").unwrap()).unwrap();
    let further: Vec<_> = config.further_cameras.iter().map(|camera| (camera.key.as_str(), camera.number)).collect();
    assert_eq!(further, [("cam2", 2)]);
    let message = refused(&rig, "cluster:cameras=cam0+cam7");
    assert!(message.contains("camera 'cam7'"), "{message}");
    for (text, problem) in [
        ("auto:cameras=cam0+cam1", "cameras=… requires a cluster"),
        ("cluster:cameras=cam0", "two or more different keys"),
        ("cluster:camera=cam0,cameras=cam0+cam1", "exclude each other"),
        ("cluster:cameras=cam0+cam0", "two or more different keys"),
    ] {
        let message = text.parse::<RunSpec>().unwrap_err().to_string();
        assert!(message.contains(problem), "{message}");
    }
    assert_eq!(parse("cluster:cameras=cam0+cam2").unwrap().settings(), "cluster:cameras=cam0+cam2");
    rig.cameras.pop();

    // Both cameras are configured as in the runs that use one of them.
    let config = |text: &str| estimator_config(&rig, &parse(text).unwrap()).unwrap();
    let (cluster, alone) = (config("cluster:window=8,calibrate=off,encoder=off"), config("static"));
    assert_eq!((cluster.options.window, cluster.calibrate, cluster.use_encoder), (8, false, false));
    assert_eq!(cluster.chain, config("auto").chain);
    let [beside] = cluster.further_cameras.as_slice() else { panic!("one rigid camera") };
    assert_eq!((beside.key.as_str(), beside.base_from_camera), ("cam1", alone.chain.imu_from_base));
    assert_eq!(Some(beside.prior), alone.chain_prior);
}
