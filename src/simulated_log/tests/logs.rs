use std::path::Path;
use std::sync::Arc;

use super::super::{Disturbances, SimulationError, SimulationOptions, SimulationSummary, simulate};
use crate::files::RigFile as _;
use crate::flight_log::RigOfLog as _;
use crate::flight_log::{FlightLog, FrameStream};
use crate::sensors::Rig;
use crate::simulation::Experiment;

pub(super) fn small(experiment: Experiment) -> SimulationOptions {
    SimulationOptions { duration_s: Some(1.0), resolution_px: [96, 72], ..SimulationOptions::new(experiment) }
}

pub(super) fn write(options: &SimulationOptions, folder: &Path) -> SimulationSummary {
    let mut last = 0;
    let summary = simulate(options, &folder.join("flight.mcap"), &mut |progress| {
        assert_eq!(progress.images_done, last + 1);
        last = progress.images_done;
    });
    let summary = summary.unwrap();
    assert_eq!(summary.images, last);
    summary
}

#[test]
fn a_simulated_log_reads_back_with_its_rig_and_ground_truth() {
    let folder = tempfile::tempdir().unwrap();
    let summary = write(&small(Experiment::T3), folder.path());
    assert_eq!(summary.images, 40);
    let log = Arc::new(FlightLog::open(&summary.log).unwrap());
    assert!(log.warnings().is_empty(), "{:?}", log.warnings());
    let rig = Rig::for_log(&log, None).unwrap();
    let ground_truth = Rig::ground_truth_for_log(&log, None).unwrap().unwrap();
    assert_ne!(rig.gimbal, ground_truth.gimbal);
    assert_eq!(rig.imu, ground_truth.imu);
    assert!(summary.given_chain_error.0 > 1e-3 && summary.given_chain_error.0 < 0.02, "{summary:?}");
    for camera in ["cam0", "cam1"] {
        let frames: Vec<_> = FrameStream::new(Arc::clone(&log), &rig, camera, 0.0, None).unwrap().collect();
        assert_eq!(frames.len(), 20);
        for frame in &frames {
            assert!(frame.log_time_ns > frame.stamp_ns + 15_000_000);
            assert_eq!([frame.image.width, frame.image.height], [96, 72]);
            assert!(frame.ground_truth.is_some());
            assert_eq!(frame.joint_angles.as_ref().map(|angles| angles.angles_rad.len()), Some(3));
            let spread = frame.image.pixels.iter().max().unwrap() - frame.image.pixels.iter().min().unwrap();
            assert!(spread > 60);
        }
        assert!(frames[1..].iter().all(|frame| frame.imu.len() >= 11));
    }
}

#[test]
fn an_imu_on_the_gimbal_is_added_without_changing_the_other_sensors() {
    let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let plain = write(&small(Experiment::T3), other.path());
    let mut options = SimulationOptions { gimbal_imu_noise_scale: Some(1.0), ..small(Experiment::T3) };
    options.disturbances.set("gimbal-imu-error=0.01,0.02").unwrap();
    let summary = write(&options, folder.path());
    let frames = |summary: &SimulationSummary| {
        let log = Arc::new(FlightLog::open(&summary.log).unwrap());
        let rig = Rig::for_log(&log, None).unwrap();
        let frames: Vec<_> = FrameStream::new(Arc::clone(&log), &rig, "cam0", 0.0, None).unwrap().collect();
        (frames, rig, Rig::ground_truth_for_log(&log, None).unwrap().unwrap())
    };
    let (without, rig, _) = frames(&plain);
    assert!(rig.gimbal_imu.is_none() && without.iter().all(|frame| frame.gimbal_imu.is_empty()));
    let (with, rig, truth) = frames(&summary);
    assert_eq!(with.len(), without.len());
    for (with, without) in with.iter().zip(&without) {
        assert_eq!((&with.imu, &with.joint_angles, &with.image), (&without.imu, &without.joint_angles, &without.image));
    }
    for frame in &with[1..] {
        let (own, imu) = (&frame.gimbal_imu, &frame.imu);
        assert!(own.len() >= 11, "{} samples", own.len());
        assert_eq!(own.first().map(|it| it.stamp_ns), imu.first().map(|it| it.stamp_ns));
        assert_eq!(own.last().map(|it| it.stamp_ns), imu.last().map(|it| it.stamp_ns));
    }
    let (given, truth) = (rig.gimbal_imu.unwrap(), truth.gimbal_imu.unwrap());
    assert_eq!((given.timeshift_s, truth.timeshift_s), (0.0, 0.01));
    let angle = given.camera_from_imu.rotation.angle_to(&truth.camera_from_imu.rotation);
    assert!((0.002..0.1).contains(&angle), "{angle} rad");
}

#[test]
fn the_same_options_give_the_same_bytes_whatever_the_thread_count() {
    let options = small(Experiment::T1);
    let read = |threads: usize, seed: u64| {
        let folder = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let summary = pool.install(|| write(&SimulationOptions { seed, ..options.clone() }, folder.path()));
        [summary.log, summary.rig, summary.ground_truth].map(|path| std::fs::read(path).unwrap())
    };
    let first = read(1, 7);
    assert_eq!(first, read(3, 7));
    assert_ne!(first, read(3, 8));
}

#[test]
fn a_shorter_flight_is_the_beginning_of_a_longer_one() {
    let ground_truth = |duration_s: f64| {
        let folder = tempfile::tempdir().unwrap();
        let options = SimulationOptions {
            duration_s: Some(duration_s),
            static_camera: false,
            resolution_px: [32, 24],
            camera_rate_hz: 2.0,
            ..SimulationOptions::new(Experiment::T4)
        };
        let summary = write(&options, folder.path());
        let log = Arc::new(FlightLog::open(&summary.log).unwrap());
        let rig = Rig::for_log(&log, None).unwrap();
        let frames = FrameStream::new(log, &rig, "cam0", 0.0, None).unwrap();
        frames.map(|frame| frame.ground_truth).collect::<Vec<_>>()
    };
    let (short, long) = (ground_truth(4.0), ground_truth(8.0));
    assert_eq!(short[..7], long[..7]);
}

#[test]
fn encoderless_logs_have_no_joint_angles() {
    let folder = tempfile::tempdir().unwrap();
    let summary = write(&SimulationOptions { encoder_sigma_rad: None, ..small(Experiment::T2) }, folder.path());
    let log = FlightLog::open(&summary.log).unwrap();
    assert!(log.topic("/gimbal/joint_states").is_none());
    let rig = Rig::from_file(&summary.rig).unwrap();
    assert_eq!(rig.gimbal.unwrap().topic, None);
}

#[test]
fn impossible_options_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let options = SimulationOptions { duration_s: Some(f64::NAN), ..small(Experiment::T1) };
    let error = simulate(&options, &folder.path().join("x.mcap"), &mut |_| ()).unwrap_err();
    assert!(matches!(error, SimulationError::BadOption { option: "duration in seconds", .. }), "{error}");
    let lost = folder.path().join("no such folder").join("x.mcap");
    let error = simulate(&small(Experiment::T1), &lost, &mut |_| ()).unwrap_err();
    assert!(matches!(error, SimulationError::Log(_)), "{error}");
}

#[test]
fn disturbances_are_read_as_they_are_written_on_the_command_line() {
    let mut disturbances = Disturbances::default();
    for text in [
        "camera-offset=0.01",
        "readout=-0.02",
        "focal=0.03",
        "imu-intrinsics=0.01,0.005",
        "accelerometer-drift=0.02,30",
        "image-gap=3,0.5",
        "image-noise=7",
        "jpeg=40",
        "vignetting=0.5",
        "exposure-drift=0.3",
        "light=4,0.5",
        "blank=5,1.5",
        "blind-gimbal=3,2,0",
        "blind-static=4,1,150",
        "slew=6,2",
        "spin=7,1,3.5",
        "hold-joint=2,8,1",
        "hover=9,2",
        "stabilize=12,2",
    ] {
        disturbances.set(text).unwrap();
    }
    let expected = Disturbances {
        camera_time_offset_s: 0.01,
        readout_s: -0.02,
        focal_ratio: 0.03,
        imu_intrinsics: [0.01, 0.005],
        accelerometer_drift: Some([0.02, 30.0]),
        image_gap_s: Some([3.0, 0.5]),
        image_noise: Some(7.0),
        jpeg_quality: Some(40.0),
        vignetting: Some(0.5),
        exposure_drift: Some(0.3),
        light_change: Some([4.0, 0.5]),
        blank_s: Some([5.0, 1.5]),
        blind_gimbal: Some([3.0, 2.0, 0.0]),
        blind_static: Some([4.0, 1.0, 150.0]),
        gimbal_slew_s: Some([6.0, 2.0]),
        spin: Some([7.0, 1.0, 3.5]),
        fixed_joint: Some([2.0, 8.0, 1.0]),
        hover_s: Some([9.0, 2.0]),
        stabilized_s: Some([12.0, 2.0]),
        ..Disturbances::default()
    };
    assert_eq!(disturbances, expected);
    for (text, words) in [
        ("blanc=1,2", "expected one of camera-offset"),
        ("blank=1", "2 numbers"),
        ("blank=1,x", "numbers after 'blank='"),
        ("blank", "expected one of"),
    ] {
        let message = disturbances.set(text).unwrap_err().to_string();
        assert!(message.contains(words) && message.contains(text), "{message}");
    }
}

#[test]
fn a_row_shows_what_is_there_at_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let images = |disturbances: &[&str]| {
        let mut options = SimulationOptions { image_noise: 0.0, jpeg_quality: 100, ..small(Experiment::T3) };
        for text in ["spin=0,1,2"].iter().chain(disturbances) {
            options.disturbances.set(text).unwrap();
        }
        let summary = write(&options, folder.path());
        let log = Arc::new(FlightLog::open(&summary.log).unwrap());
        let rigs = [Rig::for_log(&log, None).unwrap(), Rig::ground_truth_for_log(&log, None).unwrap().unwrap()];
        let readouts_s = rigs.map(|rig| rig.cameras.iter().map(|camera| camera.readout_s).collect::<Vec<_>>());
        let rig = Rig::for_log(&log, None).unwrap();
        let images = ["cam0", "cam1"].map(|camera| {
            let frames = FrameStream::new(Arc::clone(&log), &rig, camera, 0.0, None).unwrap();
            frames.map(|frame| frame.image).collect::<Vec<_>>()
        });
        (images, readouts_s)
    };
    // Row 48 of 72 is exposed 100 ms after the stamp.
    let (rolling, readouts_s) = images(&["readout=0.15"]);
    assert_eq!(readouts_s, [vec![0.0; 2], vec![0.15; 2]]);
    let (at_first, _) = images(&[]);
    let (at_row, _) = images(&["camera-offset=0.1"]);
    let difference = |a: &crate::sensors::GrayImage, b: &crate::sensors::GrayImage, row: usize| {
        let greys = |image: &crate::sensors::GrayImage| image.pixels[row * 96..(row + 1) * 96].to_vec();
        let sum: u32 = greys(a).iter().zip(greys(b)).map(|(a, b)| u32::from(a.abs_diff(b))).sum();
        f64::from(sum) / 96.0
    };
    for camera in 0..2 {
        for index in [4, 9] {
            let [rolling, at_first, at_row] = [&rolling, &at_first, &at_row].map(|images| &images[camera][index]);
            let near = [difference(rolling, at_first, 0), difference(rolling, at_row, 48)];
            let far = [difference(rolling, at_row, 0), difference(rolling, at_first, 48)];
            let case = format!("camera {camera}, image {index}: {near:?} {far:?}");
            assert!(near.iter().zip(far).all(|(near, far)| *near < 4.0 && far > 2.0 && far > 4.0 * near), "{case}");
        }
    }
}

#[test]
fn noise_compression_vignetting_and_exposure_drift_change_images() {
    let folder = tempfile::tempdir().unwrap();
    let images = |disturbance: &str| {
        let mut options = small(Experiment::T1);
        options.disturbances.set(disturbance).unwrap();
        let log = Arc::new(FlightLog::open(&write(&options, folder.path()).log).unwrap());
        let rig = Rig::for_log(&log, None).unwrap();
        let frames = FrameStream::new(log, &rig, "cam0", 0.0, None).unwrap();
        frames.map(|frame| frame.image).collect::<Vec<_>>()
    };
    // A disturbance without effect: images without disturbances.
    let plain = images("exposure-drift=0");
    let difference = |images: &[Arc<crate::sensors::GrayImage>]| {
        let pixels = |images: &[Arc<crate::sensors::GrayImage>]| -> Vec<f64> {
            images.iter().flat_map(|image| image.pixels.iter().map(|pixel| f64::from(*pixel))).collect()
        };
        let (one, other) = (pixels(images), pixels(&plain));
        let squares = one.iter().zip(&other).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        (squares / one.len() as f64).sqrt()
    };
    let corner_over_middle = |images: &[Arc<crate::sensors::GrayImage>]| {
        let near = |image: &crate::sensors::GrayImage, column: usize, row: usize| -> f64 {
            let rows = (row..row + 8).flat_map(|y| (column..column + 8).map(move |x| y * image.width + x));
            rows.map(|index| f64::from(image.pixels[index])).sum()
        };
        let sums = images.iter().fold((0.0, 0.0), |(corners, middles), image| {
            let (middle_x, middle_y) = (image.width / 2 - 4, image.height / 2 - 4);
            (corners + near(image, 0, 0) + near(image, image.width - 8, 0), middles + near(image, middle_x, middle_y))
        });
        sums.0 / sums.1
    };
    let noisy = difference(&images("image-noise=12"));
    assert!((8.0..16.0).contains(&noisy), "{noisy} grey values");
    assert!((1.0..20.0).contains(&difference(&images("jpeg=10"))));
    assert!((5.0..80.0).contains(&difference(&images("exposure-drift=0.8"))));
    let darker = corner_over_middle(&images("vignetting=0.6")) / corner_over_middle(&plain);
    // The centre of a patch in the corner is at 0.82 of the squared distance of the corner.
    let expected = (1.0 - 0.82 * 0.6) / (1.0 - 0.82 * 0.12);
    assert!((darker - expected).abs() < 0.02, "{darker} instead of {expected}");
    let mut options = small(Experiment::T1);
    options.disturbances.set("jpeg=0").unwrap();
    let refused = simulate(&options, &folder.path().join("refused.mcap"), &mut |_| {});
    assert!(format!("{refused:?}").contains("\"jpeg\""), "{refused:?}");
}

#[test]
fn light_and_fog_change_images_only_while_active() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = small(Experiment::T1);
    let means_and_spreads = |options: &SimulationOptions| -> Vec<(f64, f64)> {
        let log = Arc::new(FlightLog::open(&write(options, folder.path()).log).unwrap());
        let rig = Rig::for_log(&log, None).unwrap();
        let frames = FrameStream::new(log, &rig, "cam0", 0.0, None).unwrap();
        let statistics = frames.map(|frame| {
            let greys: Vec<f64> = frame.image.pixels.iter().map(|pixel| f64::from(*pixel)).collect();
            let mean = greys.iter().sum::<f64>() / greys.len() as f64;
            (mean, (greys.iter().map(|grey| (grey - mean).powi(2)).sum::<f64>() / greys.len() as f64).sqrt())
        });
        statistics.collect()
    };
    let plain = means_and_spreads(&options);
    options.disturbances.light_change = Some([0.4, 0.5]);
    options.disturbances.blank_s = Some([0.75, 0.1]);
    let disturbed = means_and_spreads(&options);
    assert_eq!(plain[..7], disturbed[..7]);
    // Frame 8 is taken at 0.403 s, just after the light has halved; frames 15 and 16 show fog.
    let fraction = disturbed[8].0 / plain[8].0;
    assert!((fraction - 0.5).abs() < 0.02, "{fraction}");
    assert!(disturbed[12].0 / plain[12].0 > fraction + 0.05);
    assert!(disturbed[15].1 < 10.0 && plain[15].1 > 20.0, "{:?} {:?}", disturbed[15], plain[15]);
    assert!(disturbed[17].1 > 12.0);
}
