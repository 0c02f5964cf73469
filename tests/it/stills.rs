//! `dcvins calibrate --stills`: a synthetic mechanism and an excerpt of a real gimbal through the whole command.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dcvins::files::RigFile as _;
use dcvins::sensors::{Rig, StillCamera, StillView, Stills};
use dcvins::simulation::{SyntheticStills, SyntheticStillsOptions, synthetic_stills};
use serde_json::{Value, json};

fn dcvins(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.current_dir(folder).args(arguments).output().expect("the program starts")
}

/// Runs a command that must succeed and returns its output.
fn printed(folder: &Path, arguments: &[&str]) -> String {
    let output = dcvins(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("the output is UTF-8")
}

/// Runs a command that must fail with this exit code, and whose message contains all words.
fn refused(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let output = dcvins(folder, arguments);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
    for word in words {
        assert!(complaint.contains(word), "{arguments:?} should say '{word}': {complaint}");
    }
}

fn matrix(transform: &dcvins::geometry::RigidTransform) -> Value {
    let matrix = transform.to_matrix();
    json!((0..4).map(|row| (0..4).map(|column| matrix[(row, column)]).collect::<Vec<_>>()).collect::<Vec<_>>())
}

/// The file format of stills.
fn document(stills: &Stills) -> Value {
    let camera = |camera: &StillCamera| json!({"resolution": camera.model.resolution_px, "intrinsics": camera.model.intrinsics_px, "distortion_model": "none"});
    let view = |view: &StillView| {
        let points: Vec<[f64; 5]> = view
            .points
            .iter()
            .map(|it| {
                let point = it.point_in_world_m;
                [point.x, point.y, point.z, it.uv_px.x, it.uv_px.y]
            })
            .collect();
        json!({"T_camera_world": view.camera_from_world.as_ref().map(matrix), "points": points})
    };
    let names: Vec<&str> = stills.rigid_cameras.iter().map(|camera| camera.name.as_str()).collect();
    let mut cameras = json!({"gimbal": camera(&stills.gimbal_camera)});
    for rigid in &stills.rigid_cameras {
        cameras[&rigid.name] = camera(rigid);
    }
    let links = stills.initial.chain.links.iter().zip(&stills.joints).map(|(link, joint)| {
        json!({
            "joint": joint, "theta_offset": link.theta_offset_rad, "d": link.d_m, "a": link.a_m, "alpha": link.alpha_rad
        })
    });
    let sets = stills.sets.iter().map(|set| {
        let mut views = json!({"gimbal": view(&set.gimbal)});
        for (name, rigid) in names.iter().zip(&set.rigid) {
            views[*name] = view(rigid.as_ref().expect("every rigid camera sees every set"));
        }
        json!({"id": set.id, "station": set.station, "joint_angles_rad": set.joint_readings_rad, "views": views})
    });
    json!({
        "format": "acdcc-stills 1",
        "configuration": stills.name,
        "joints": stills.joints,
        "static_cameras": names,
        "cameras": cameras,
        "initial_chain": {
            "T_I_B": matrix(&stills.initial.chain.imu_from_base),
            "links": links.collect::<Vec<_>>(),
            "T_E_C": matrix(&stills.initial.chain.effector_from_camera),
            "T_side_front": matrix(&stills.initial.further_from_first[0]),
        },
        "sets": sets.collect::<Vec<_>>(),
    })
}

/// Stills with two wrong readings, written into a folder.
fn folder() -> (tempfile::TempDir, SyntheticStills) {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let options = SyntheticStillsOptions {
        seed: 5,
        points_per_view: 40,
        wrong_readings: vec![(3, 1, 0.25), (20, 0, -0.3)],
        ..SyntheticStillsOptions::default()
    };
    let made = synthetic_stills(&options);
    fs::write(folder.path().join("stills.json"), document(&made.stills).to_string())
        .expect("the stills can be written");
    (folder, made)
}

#[test]
fn a_synthetic_mechanism_goes_through_the_whole_command() {
    let (folder, made) = folder();
    let path = folder.path();
    let text = printed(path, &["calibrate", "--stills", "stills.json", "--out", "out"]);
    let first: Vec<&str> = text.lines().take(8).collect();
    assert!(first[0].contains("stills.json: chain calibrated, 40 sets at 10 stations"), "{text}");
    assert!(
        first.iter().any(|line| line.contains("wrong readings set 4 (roll off by 14") && line.contains("set 21 (yaw"))
    );
    for name in ["calibration.json", "gimbal.rig.yaml", "report.txt", "parameters.csv", "sets.csv", "ranks.csv"] {
        assert!(path.join("out").join(name).is_file(), "{name} is missing");
    }
    let report: Value =
        serde_json::from_str(&fs::read_to_string(path.join("out/calibration.json")).expect("the report"))
            .expect("JSON");
    assert_eq!(report["stills"], "stills.json");
    assert_eq!(report["sets"].as_array().map(Vec::len), Some(40));

    // The rig has the true forward kinematics, and commands for rigs accept it.
    let rig = Rig::from_file(&path.join("out/gimbal.rig.yaml")).expect("the rig can be read");
    let chain = &rig.gimbal.as_ref().expect("a gimbal").chain;
    for angles in [[0.0; 3], [1.5, -0.3, 0.6], [-2.0, 0.2, -0.7]] {
        let error = chain.imu_from_camera(&angles).minus(&made.truth.chain.imu_from_camera(&angles));
        assert!(error.fixed_rows::<3>(0).norm() < 0.012 && error.fixed_rows::<3>(3).norm() < 0.012, "{error}");
    }
    let degeneracy = printed(path, &["degeneracy", "--rig", "out/gimbal.rig.yaml", "--json"]);
    assert!(degeneracy.contains("rank_structural"));
    printed(path, &["export", "out/gimbal.rig.yaml", "--to", "kalibr", "-o", "exported"]);

    // The same chain is judged as well as it was calibrated; files of the calibration that a judgement lacks go.
    let arguments =
        ["calibrate", "--stills", "stills.json", "--chain", "out/gimbal.rig.yaml", "--out", "judged", "--json"];
    let judged: Value = serde_json::from_str(&printed(path, &arguments)).expect("JSON");
    let as_read = |report: &Value, chain: &str| {
        let scores = report["scores"].as_array().expect("scores").iter();
        let score = scores.clone().find(|it| it["chain"] == chain && it["camera"] == "front").expect("a score");
        score["as_read_all"]["mean_px"].as_f64().expect("a number")
    };
    assert!((as_read(&judged, "given") - as_read(&report, "training")).abs() < 1e-6);
    printed(
        path,
        &["calibrate", "--stills", "stills.json", "--chain", "stills.json", "--out", "out", "--without", "1,2"],
    );
    assert!(!path.join("out/parameters.csv").exists());
}

#[test]
fn wrong_use_and_bad_files_are_refused() {
    let (folder, made) = folder();
    let path = folder.path();
    refused(path, &["calibrate", "--out", "out"], 2, &["<LOG>"]);
    refused(path, &["calibrate", "a.mcap", "--stills", "stills.json", "--out", "out"], 2, &["cannot be used with"]);
    refused(path, &["calibrate", "a.mcap", "--chain", "a.yaml", "--out", "out"], 2, &["cannot be used with"]);
    let bad = |change: &dyn Fn(&mut Value), words: &[&str]| {
        let mut document = document(&made.stills);
        change(&mut document);
        fs::write(path.join("bad.json"), document.to_string()).expect("the file can be written");
        refused(path, &["calibrate", "--stills", "bad.json", "--out", "bad"], 1, words);
        assert!(!path.join("bad").exists(), "nothing is written");
    };
    bad(&|it| it["format"] = json!("other"), &["format is 'other'", "expected 'acdcc-stills 1'"]);
    bad(&|it| it["joints"] = json!(["yaw", "roll"]), &["initial_chain.links has 3 links, expected 2"]);
    bad(&|it| it["joints"] = json!(["yaw", "roll", "yaw"]), &["joints names 'yaw' twice"]);
    bad(&|it| it["static_cameras"] = json!(["front", "rear"]), &["'rear', which is not in cameras"]);
    bad(&|it| it["static_cameras"] = json!(["front"]), &["expected one, the gimbal camera"]);
    bad(&|it| it["initial_chain"]["T_side_front"] = Value::Null, &["T_side_front is missing"]);
    bad(&|it| it["initial_chain"]["T_I_B"][0][0] = json!(3.0), &["initial_chain.T_I_B is no rigid transform"]);
    bad(&|it| it["cameras"]["front"]["intrinsics"][0] = json!(-1.0), &["cameras.front", "fx"]);
    bad(&|it| it["sets"][2]["joint_angles_rad"] = json!([0.0]), &["sets[2] (id 3): joint_angles_rad has 1 numbers"]);
    bad(&|it| it["sets"][1]["id"] = json!(1), &["sets[1] (id 1): the id occurs twice"]);
    bad(
        &|it| it["sets"][0]["views"]["gimbal"]["points"] = json!([[0, 0, 1, 2, 3]]),
        &["sets[0] (id 1): views.gimbal.points"],
    );
    bad(&|it| it["sets"][0]["views"]["front"]["points"][7] = json!([1, 2, 3]), &["invalid length 3", "line 1 column"]);
    bad(
        &|it| drop(it["sets"][0]["views"].as_object_mut().expect("views").remove("gimbal")),
        &["views.gimbal is missing"],
    );
    bad(&|it| it["sets"] = json!([]), &["sets is empty"]);
    bad(&|it| it["sets"].as_array_mut().expect("sets").truncate(3), &["3 sets", "at least 5 are needed"]);
    fs::write(path.join("bad.json"), "{\"format\": \"acdcc-stills 1\", \"joints\"").expect("the file can be written");
    refused(path, &["calibrate", "--stills", "bad.json", "--out", "bad"], 1, &["line 1 column", "bad.json"]);
    refused(path, &["calibrate", "--stills", "none.json", "--out", "bad"], 1, &["cannot open the stills", "none.json"]);
    let arguments = ["calibrate", "--stills", "stills.json", "--without", "77", "--out", "bad"];
    refused(path, &arguments, 1, &["--without names the set 77"]);

    // A folder with the results of something else is left alone.
    fs::create_dir(path.join("other")).expect("a folder can be made");
    fs::write(path.join("other/calibration.json"), "{\"log\": \"flight.mcap\"}").expect("a file can be written");
    let arguments = ["calibrate", "--stills", "stills.json", "--out", "other"];
    refused(path, &arguments, 1, &["results of the log 'flight.mcap'", "--force"]);
}

/// Every twentieth point of the training sets of AC-DCC's first configuration (tests/data/README.md).
#[test]
fn wrong_readings_of_a_real_gimbal_are_found() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let excerpt = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/acdcc_excerpt.json");
    let excerpt = excerpt.to_str().expect("the path is UTF-8");
    let text = printed(folder.path(), &["calibrate", "--stills", excerpt, "--out", "out", "--json"]);
    let report: Value = serde_json::from_str(&text).expect("JSON");
    let sets = report["sets"].as_array().expect("sets").iter();
    let wrong: Vec<u64> = sets.filter(|set| set["wrong"] == true).filter_map(|set| set["id"].as_u64()).collect();
    assert_eq!(wrong, [39, 40]);
    for axis in report["axes"].as_array().expect("axes") {
        let angle_deg = axis["value_deg"].as_f64().expect("a number");
        assert!((angle_deg - 90.0).abs() < 0.7, "{axis}");
    }
    for sigma in report["noise"]["encoder_rad"].as_array().expect("encoders") {
        let sigma_deg = sigma.as_f64().expect("a number").to_degrees();
        assert!((0.2..1.0).contains(&sigma_deg), "{sigma_deg}");
    }
}
