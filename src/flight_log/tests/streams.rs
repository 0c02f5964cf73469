use super::*;
use crate::files::RigFile as _;
use crate::flight_log::ImageReader;
use crate::geometry::seconds_from_ns;

/// Every compression, with and without an index and chunks.
fn all_options() -> Vec<LogWriterOptions> {
    let compressions = [LogCompression::None, LogCompression::Lz4, LogCompression::Zstd];
    let mut all = Vec::new();
    for compression in compressions {
        for indexed in [true, false] {
            for chunk_bytes in [Some(40_000), None] {
                all.push(LogWriterOptions { compression, chunk_bytes, indexed });
            }
        }
    }
    all
}

#[test]
fn frames_are_the_same_whatever_the_container() {
    let (expected, _) = play(&Flight::default(), RIG, 0.0);
    assert_eq!(expected.len(), 60);
    for options in all_options() {
        let (frames, warnings) = play(&Flight { options: options.clone(), ..Flight::default() }, RIG, 0.0);
        assert_eq!(warnings, [], "{options:?}");
        assert_eq!(frames.len(), expected.len(), "{options:?}");
        for (frame, expected) in frames.iter().zip(&expected) {
            assert_eq!(frame.image, expected.image);
            assert_eq!(
                (frame.index, frame.stamp_ns, frame.log_time_ns),
                (expected.index, expected.stamp_ns, expected.log_time_ns)
            );
            assert_eq!(
                (&frame.imu, &frame.joint_angles, frame.ground_truth),
                (&expected.imu, &expected.joint_angles, expected.ground_truth)
            );
        }
    }
}

#[test]
fn an_accelerometer_on_its_own_topic_is_merged_at_the_stamps_of_the_gyroscope() {
    let flight = Flight { accelerometer_ms: Some(16), ..Flight::default() };
    let rig = RIG.replace("rostopic: /imu,", "rostopic: /imu, accelerometer_rostopic: /accelerometer,");
    let (frames, warnings) = play(&flight, &rig, 0.0);
    assert_eq!(warnings, []);
    let (together, _) = play(&Flight::default(), RIG, 0.0);
    assert_eq!(frames.len(), together.len());
    for (number, (frame, expected)) in frames.iter().zip(&together).enumerate() {
        // Only the very first sample has no force before it.
        let expected = &expected.imu[usize::from(number == 0)..];
        assert_eq!(frame.imu.len(), expected.len());
        for (sample, expected) in frame.imu.iter().zip(expected) {
            assert_eq!(sample.stamp_ns, expected.stamp_ns);
            assert!((sample.angular_velocity_rad_per_s - expected.angular_velocity_rad_per_s).norm() < 1e-12);
            assert!((sample.specific_force_m_per_s2 - expected.specific_force_m_per_s2).norm() < 1e-12);
        }
    }
    let later = play(&flight, &rig, 1.5).0;
    assert_eq!(later[5].imu, frames[later[5].index].imu, "wherever reading starts");
    let missing = Rig::from_yaml(&rig.replace("/accelerometer,", "/accel,"), Path::new("test.rig.yaml")).unwrap();
    let folder = TempDir::new().unwrap();
    let log = Arc::new(FlightLog::open(&flight.write(folder.path())).unwrap());
    let error = FrameStream::new(log, &missing, "cam0", 0.0, None).unwrap_err().to_string();
    assert!(error.contains("imu0.accelerometer_rostopic") && error.contains("/accelerometer"), "{error}");
}

#[test]
fn a_frame_has_its_measurements() {
    let (frames, warnings) = play(&Flight::default(), RIG, 0.0);
    assert_eq!(warnings, []);
    for (number, frame) in frames.iter().enumerate() {
        let stamp_ns = (27 + 50 * number as i64) * MS;
        assert_eq!((frame.index, frame.stamp_ns, frame.log_time_ns), (number, stamp_ns, stamp_ns + 18 * MS));
        assert_eq!(*frame.image, image_at(stamp_ns, [WIDTH, HEIGHT]));

        // The IMU's signals are linear in time, so interpolation is exact.
        let start_ns = if number == 0 { 0 } else { stamp_ns - 50 * MS };
        assert_eq!((frame.imu[0].stamp_ns, frame.imu[frame.imu.len() - 1].stamp_ns), (start_ns, stamp_ns));
        assert!(frame.imu.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns));
        for sample in &frame.imu {
            let time_s = seconds_from_ns(sample.stamp_ns);
            assert!((sample.angular_velocity_rad_per_s - Vector3::new(time_s, 0.0, 0.4)).norm() < 1e-12);
            assert!((sample.specific_force_m_per_s2 - Vector3::new(0.0, 0.1 * time_s, 9.81)).norm() < 1e-12);
        }
        if number > 0 {
            assert_eq!(frame.imu[0], *frames[number - 1].imu.last().unwrap());
            assert_eq!(frame.imu.len(), 12, "10 samples inside and two ends");
        }

        let angle = frame.joint_angles.as_ref().unwrap().angles_rad[0];
        let defect = (angle - yaw_rad(stamp_ns)).rem_euclid(std::f64::consts::TAU);
        assert!(defect.min(std::f64::consts::TAU - defect) < 1e-9, "{angle} at {stamp_ns}");
        let defect = frame.ground_truth.unwrap().minus(&true_pose(stamp_ns));
        assert!(defect.norm() < 1e-9, "{defect}");
    }
}

#[test]
fn a_replay_from_the_middle_continues_the_numbers() {
    let flight = Flight::default();
    let (all, _) = play(&flight, RIG, 0.0);
    let (late, _) = play(&flight, RIG, 2.2);
    let first = &late[0];
    assert_eq!((first.index, first.stamp_ns), (44, 2_227 * MS));
    assert_eq!(first.imu[0].stamp_ns, 230 * MS, "two seconds of IMU before the first frame");
    assert_eq!(first.imu.len(), 401);
    for (late, all) in late[1..].iter().zip(&all[45..]) {
        assert_eq!(
            (late.index, &late.image, &late.imu, &late.joint_angles),
            (all.index, &all.image, &all.imu, &all.joint_angles)
        );
    }
}

#[test]
fn the_time_offset_shifts_everything_but_the_image() {
    let rig = RIG.replace("timeshift_cam_imu: 0.0", "timeshift_cam_imu: 0.012");
    let (frames, _) = play(&Flight::default(), &rig, 0.0);
    let frame = &frames[10];
    assert_eq!(frame.stamp_ns, 527 * MS);
    assert_eq!(frame.imu.last().unwrap().stamp_ns, 539 * MS);
    assert!(frame.ground_truth.unwrap().minus(&true_pose(539 * MS)).norm() < 1e-9);
}

#[test]
fn samples_are_corrected_by_the_rigs_scale() {
    const SCALE: &str = ", gyroscopes: {M: [[1.25, 0, 0], [0, 0.8, 0], [0, 0, 1]]}, accelerometers: {M: [[1, 0, 0], [0, 1, 0], \
                         [0.25, 0, 1.25]]}}";
    let (measured, _) = play(&Flight::default(), RIG, 0.0);
    let (corrected, _) = play(&Flight::default(), &RIG.replace("3.9e-5}", &format!("3.9e-5{SCALE}")), 0.0);
    let pairs = measured.iter().zip(&corrected).flat_map(|(a, b)| a.imu.iter().zip(&b.imu));
    let mut count = 0;
    for (a, b) in pairs {
        let rate = a.angular_velocity_rad_per_s;
        assert!((b.angular_velocity_rad_per_s - Vector3::new(rate.x * 0.8, rate.y * 1.25, rate.z)).norm() < 1e-12);
        let force = a.specific_force_m_per_s2;
        let expected = Vector3::new(force.x, force.y, (force.z - 0.25 * force.x) / 1.25);
        assert!((b.specific_force_m_per_s2 - expected).norm() < 1e-12 && force.norm() > 1.0);
        count += 1;
    }
    assert!(count > 500, "{count}");
}

#[test]
fn a_rig_without_encoders_gives_frames_without_angles() {
    for rig in [
        RIG.replace("encoder_sigma: 0.0087", "encoder_sigma: null"),
        RIG.replace("rostopic: /joints", "rostopic: null"),
    ] {
        let (frames, warnings) = play(&Flight { joints: false, ..Flight::default() }, &rig, 0.0);
        assert_eq!((frames.len(), warnings.len()), (60, 0));
        assert!(frames.iter().all(|frame| frame.joint_angles.is_none()));
    }
}

#[test]
fn images_are_found_by_number_in_any_order() {
    let folder = TempDir::new().unwrap();
    for options in all_options() {
        let path = Flight { options, ..Flight::default() }.write(folder.path());
        let log = Arc::new(FlightLog::open(&path).unwrap());
        let reader = ImageReader::new(Arc::clone(&log), &rig_from(RIG));
        assert_eq!(reader.count("cam0"), 60);
        for number in [59, 0, 31, 30, 31, 58] {
            let stamp_ns = (27 + 50 * number as i64) * MS;
            assert_eq!(*reader.image("cam0", number).unwrap(), image_at(stamp_ns, [WIDTH, HEIGHT]));
        }
        assert!(reader.image("cam0", 60).unwrap_err().to_string().contains("60 images, none with number 60"));
        assert!(reader.image("cam1", 0).unwrap_err().to_string().contains("no camera 'cam1'; it has 'cam0'"));
    }
}

#[test]
fn a_log_lists_its_topics_and_times() {
    let folder = TempDir::new().unwrap();
    let log = FlightLog::open(&Flight::default().write(folder.path())).unwrap();
    let names: Vec<&str> = log.topics().iter().map(|info| info.topic.as_str()).collect();
    assert_eq!(names, ["/camera", "/imu", "/joints", "/truth"]);
    assert_eq!((log.epoch_ns(), log.duration_ns()), (EPOCH_NS, 2_995 * MS));
    let imu = log.topic("/imu").unwrap();
    assert_eq!((imu.count, imu.first_ns, imu.last_ns), (600, MS, 2_996 * MS));
    assert!((imu.rate_hz - 200.0).abs() < 1e-9);
}

#[test]
fn a_stream_can_be_dropped_early_and_ends_after_its_duration() {
    let folder = TempDir::new().unwrap();
    let log = Arc::new(FlightLog::open(&Flight::default().write(folder.path())).unwrap());
    let rig = rig_from(RIG);
    let mut stream = FrameStream::new(Arc::clone(&log), &rig, "cam0", 0.0, None).unwrap();
    assert!(stream.next_frame().is_some());
    drop(stream);
    let frames: Vec<SensorFrame> = FrameStream::new(log, &rig, "cam0", 1.0, Some(0.5)).unwrap().collect();
    assert_eq!(frames.iter().map(|frame| frame.index).collect::<Vec<_>>(), (20..30).collect::<Vec<_>>());
}
