//! Tests: what forms one log, and the folder of converted logs.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::{ConversionStage, ConvertedLogs, LogSources, PreparedLog, SourceError, prepare_log};
use crate::files::LogLimits;
use crate::flight_log::convert::SourceKind;

fn gather(folder: &Path, names: &[&str]) -> Result<LogSources, SourceError> {
    let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    LogSources::gather(&paths, &LogLimits::default())
}

/// Writes a EuRoC folder with an IMU alone.
fn euroc(folder: &Path) -> PathBuf {
    let imu = folder.join("hall/mav0/imu0");
    fs::create_dir_all(&imu).unwrap();
    let rows = (0..400_u64).map(|row| format!("{},0.01,0.02,0.03,0.1,0.2,9.8\n", 1_000_000_000 + row * 5_000_000));
    let head = "#timestamp [ns],w_RS_S_x,w_RS_S_y,w_RS_S_z,a_RS_S_x,a_RS_S_y,a_RS_S_z\n".to_owned();
    fs::write(imu.join("data.csv"), std::iter::once(head).chain(rows).collect::<String>()).unwrap();
    folder.join("hall")
}

fn prepare(source: &Path, cache: &ConvertedLogs) -> Result<(PreparedLog, usize), SourceError> {
    let limits = LogLimits::default();
    let sources = LogSources::gather(&[source.to_owned()], &limits)?;
    let mut calls = 0;
    let prepared = prepare_log(&sources, Ok(cache), &limits, &mut |stage, ratio| {
        assert!(stage == ConversionStage::Converting && (0.0..=1.0).contains(&ratio));
        calls += 1;
        ControlFlow::Continue(())
    })?;
    Ok((prepared, calls))
}

#[test]
fn files_that_form_one_log_are_sorted_and_others_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("a.mp4"), b"\0\0\0\x20ftypisom").unwrap();
    fs::write(folder.join("a.ulg"), b"ULog\x01\x12\x35\x01").unwrap();
    fs::write(folder.join("b.bin"), b"\xA3\x95\x80\x80").unwrap();
    for number in [10, 2, 1] {
        fs::write(folder.join(format!("c_{number}.bag")), b"#ROSBAG V2.0\n").unwrap();
    }
    fs::write(folder.join("notes.txt"), "hello").unwrap();
    fs::write(folder.join("flight.srt"), "1\n00:00:00,000 --> 00:00:00,033\nSrtCnt : 1\n").unwrap();
    for name in ["a.rig.yaml", "camchain-imucam.yaml", "imu.yaml", "a.truth.yaml"] {
        fs::write(folder.join(name), "").unwrap();
    }

    let both = gather(folder, &["a.ulg", "a.rig.yaml", "a.mp4", "a.truth.yaml"]).unwrap();
    assert_eq!((both.main, both.kind), (folder.join("a.mp4"), Some(SourceKind::Video)));
    assert_eq!(both.autopilot.map(|log| log.path), Some(folder.join("a.ulg")));
    assert_eq!((both.rig, both.ground_truth), (Some(folder.join("a.rig.yaml")), Some(folder.join("a.truth.yaml"))));

    let kalibr = gather(folder, &["imu.yaml", "a.mp4", "camchain-imucam.yaml"]).unwrap();
    assert_eq!(kalibr.rig, Some(folder.join("camchain-imucam.yaml")));

    let bags = gather(folder, &["c_10.bag", "c_1.bag", "c_2.bag"]).unwrap();
    assert_eq!(bags.main, folder.join("c_1.bag"));
    assert_eq!(bags.splits, ["c_2.bag", "c_10.bag"].map(|name| folder.join(name)));

    // A log of MCAP is opened as it is, one with messages of ROS 1 converted.
    let log = |profile: &str| {
        let mut bytes = mcap::MAGIC.to_vec();
        bytes.push(1);
        bytes.extend_from_slice(&40_u64.to_le_bytes());
        bytes.extend_from_slice(&(profile.len() as u32).to_le_bytes());
        bytes.extend_from_slice(profile.as_bytes());
        fs::write(folder.join("d.mcap"), bytes).unwrap();
        gather(folder, &["d.mcap", "a.rig.yaml"]).unwrap().kind
    };
    assert_eq!((log("ros2"), log("ros1"), log("")), (None, Some(SourceKind::Mcap), None));

    let problem = |names: &[&str]| gather(folder, names).unwrap_err().to_string();
    assert!(problem(&["a.rig.yaml"]).starts_with("a.rig.yaml: a rig alone"));
    assert!(problem(&["a.mp4", "a.rig.yaml", "camchain-imucam.yaml"]).starts_with("several rigs"));
    let two = problem(&["a.mp4", "a.ulg", "b.bin"]);
    assert!(two.contains("b.bin (ArduPilot DataFlash log)") && two.contains("are not one log"), "{two}");
    assert!(problem(&["notes.txt"]).starts_with("a file that begins with the bytes 68 65"));
    assert!(problem(&["flight.srt"]).contains("subtitles of a DJI video"));
    assert!(problem(&["gone.bag"]).contains("cannot open the source"));
}

#[test]
fn a_recording_is_converted_once_and_again_when_it_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let (source, cache) = (euroc(folder.path()), ConvertedLogs::in_folder(&folder.path().join("cache")));
    fs::write(folder.path().join("hall.rig.yaml"), "").unwrap();
    let (first, calls) = prepare(&source, &cache).unwrap();
    assert!(calls > 0 && first.log.ends_with("hall.mcap") && first.log.is_file());
    assert_eq!(first.kind, Some("EuRoC folder"));
    assert_eq!(first.rig, Some(folder.path().join("hall.rig.yaml")));
    assert_eq!(cache.sources_of(&first.log), std::slice::from_ref(&source));
    assert!(fs::read_to_string(first.log.with_file_name("report.txt")).unwrap().contains("/imu0"));
    let (again, calls) = prepare(&source, &cache).unwrap();
    assert_eq!((again.log, calls), (first.log.clone(), 0), "the log of the cache is used");
    let table = source.join("mav0/imu0/data.csv");
    let mut text = fs::read_to_string(&table).unwrap();
    text.push_str("4000000000,0,0,0,0,0,9.8\n");
    fs::write(&table, text).unwrap();
    let (changed, calls) = prepare(&source, &cache).unwrap();
    assert!(calls > 0 && changed.log != first.log);
}

#[test]
fn an_interrupted_or_failed_conversion_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (source, cache) = (euroc(folder.path()), ConvertedLogs::in_folder(&folder.path().join("cache")));
    let limits = LogLimits::default();
    let sources = LogSources::gather(std::slice::from_ref(&source), &limits).unwrap();
    let stopped = prepare_log(&sources, Ok(&cache), &limits, &mut |_, _| ControlFlow::Break(()));
    assert!(stopped.unwrap_err().is_interrupted());
    let entries = || fs::read_dir(folder.path().join("cache/converted")).unwrap().count();
    assert_eq!(entries(), 0);
    fs::write(source.join("mav0/imu0/data.csv"), "#timestamp\n").unwrap();
    prepare(&source, &cache).unwrap_err();
    assert_eq!(entries(), 0);
    let refused =
        prepare_log(&sources, Err("DCVINS_CACHE_DIR is empty"), &limits, &mut |_, _| ControlFlow::Continue(()));
    let problem = refused.unwrap_err().to_string();
    assert!(problem.contains("DCVINS_CACHE_DIR is empty") && problem.contains("dcvins convert"), "{problem}");
}

#[test]
fn the_least_recently_opened_logs_are_removed_first() {
    let folder = tempfile::tempdir().unwrap();
    let cache = ConvertedLogs::in_folder(&folder.path().join("cache"));
    let places = ["1", "2", "3"].map(|name| folder.path().join(name));
    let sources = places.clone().map(|place| euroc(&place));
    let (first, _) = prepare(&sources[0], &cache).unwrap();
    let (second, _) = prepare(&sources[1], &cache).unwrap();
    let age = |log: &Path, hours: u64| {
        let file = fs::File::options().append(true).open(log.with_file_name("sources.txt")).unwrap();
        let written = fs::metadata(log).unwrap().modified().unwrap();
        file.set_modified(written - Duration::from_hours(hours)).unwrap();
    };
    age(&first.log, 5);
    age(&second.log, 7);
    let bytes = fs::metadata(&first.log).unwrap().len();
    let small = cache.clone().with_max_bytes(bytes * 5 / 2);
    let (third, _) = prepare(&sources[2], &small).unwrap();
    assert_eq!([&first, &second, &third].map(|it| it.log.is_file()), [true, false, true]);
    let (only, _) = prepare(&sources[1], &cache.with_max_bytes(1)).unwrap();
    assert_eq!([&first, &third, &only].map(|it| it.log.is_file()), [false, false, true], "the newest always stays");
}
