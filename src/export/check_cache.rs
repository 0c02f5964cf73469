//! Checks of logs from the cache: a log is checked once with each rig.

use std::sync::Arc;

use image::ImageFormat;
use serde::{Deserialize, Serialize};

use super::masks;
use super::result_cache::{CachedFile, ResultCache, ResultKey, ResultKeyBuilder};
use crate::faults::Fault;
use crate::flight_log::FlightLog;
use crate::log_check::{Basis, CheckReport, ProposedMask};
use crate::sensors::{GrayImage, ImageMask, RequiredAccuracy, Rig};
use crate::session;

/// Name of the report in an entry; its other files are masks by camera.
const REPORT: &str = "check.json";
/// Bytes of the log that are hashed at a time.
const BLOCK_BYTES: usize = 1 << 20;

/// Report with the fields of its findings that its JSON lacks.
#[derive(Serialize, Deserialize)]
struct StoredReport<R> {
    report: R,
    /// By finding: `basis` and `faults`.
    beside: Vec<(Basis, Vec<Fault>)>,
}

/// Result of the check of a log and its rig, from the cache if the program has checked them before.
///
/// An entry that is damaged or was not written by this program is ignored, and so is a cache that cannot be written.
pub fn check_log(cache: Option<&ResultCache>, log: &Arc<FlightLog>, rig: &Rig) -> CheckReport {
    let entry = cache.and_then(|cache| Some((cache, key(log, rig)?)));
    let known = entry.as_ref().and_then(|(cache, key)| report_of(&cache.load(key).ok()??));
    known.unwrap_or_else(|| {
        let report = session::check_log(log, rig);
        if let Some((cache, key)) = &entry
            && log.require_unshortened().is_ok()
            && let Some(files) = files_of(&report)
        {
            // The next check computes it again.
            drop(cache.store(key, &files));
        }
        report
    })
}

/// Key by the content of the log and its path, which the report contains, and by the rig with its masks; `None` if the log
/// or the program cannot be read.
fn key(log: &FlightLog, rig: &Rig) -> Option<ResultKey> {
    let mut key = ResultKeyBuilder::new().ok()?;
    key.watch(log.path());
    // No finding depends on the required accuracy.
    let rig = &Rig { required_accuracy: RequiredAccuracy::default(), ..rig.clone() };
    key.add_text(&format!("check {} {:?} {rig:?}", log.path().display(), log.file().limits()));
    for mask in rig.cameras.iter().filter_map(|camera| camera.mask.as_ref()) {
        key.add_bytes(&mask.image.to_image().pixels);
    }
    let length = log.file().len();
    for start in (0..length).step_by(BLOCK_BYTES) {
        key.add_bytes(&log.file().read(start..length.min(start + BLOCK_BYTES)).ok()?);
    }
    Some(key.finish())
}

/// Files from which [`report_of`] makes an equal report; `None` if there are none, because a number is not finite.
fn files_of(report: &CheckReport) -> Option<Vec<CachedFile>> {
    let beside = report.findings.iter().map(|finding| (finding.basis, finding.faults.clone())).collect();
    let mut files = vec![(REPORT.to_owned(), serde_json::to_vec(&StoredReport { report, beside }).ok()?)];
    for proposed in &report.proposed_masks {
        files.push((proposed.camera_key.clone(), masks::png(&proposed.mask).ok()?));
    }
    (report_of(&files).as_ref() == Some(report)).then_some(files)
}

/// Report of an entry; `None` if the entry contains something else.
fn report_of(files: &[CachedFile]) -> Option<CheckReport> {
    let ((name, json), masks) = files.split_first()?;
    let StoredReport::<CheckReport> { mut report, beside } = serde_json::from_slice(json).ok()?;
    if name != REPORT || beside.len() != report.findings.len() {
        return None;
    }
    for (finding, (basis, faults)) in report.findings.iter_mut().zip(beside) {
        (finding.basis, finding.faults) = (basis, faults);
    }
    for (camera_key, png) in masks {
        let image = image::load_from_memory_with_format(png, ImageFormat::Png).ok()?.into_luma8();
        let [width, height] = [image.width(), image.height()].map(|side| side as usize);
        let mask = ImageMask::from_image(&GrayImage { width, height, pixels: image.into_raw() });
        report.proposed_masks.push(ProposedMask { camera_key: camera_key.clone(), mask });
    }
    Some(report)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::faults::{Choice, FaultKind, ImageFlip};
    use crate::flight_log::RigOfLog as _;
    use crate::geometry::SignedAxes;
    use crate::log_check::{Agreement, Area, Finding, FindingInterval, Severity};
    use crate::simulated_log::{SimulationOptions, simulate};
    use crate::simulation::Experiment;

    fn short_log(folder: &Path) -> (Arc<FlightLog>, Rig) {
        let experiment = SimulationOptions::new(Experiment::T1);
        let options = SimulationOptions { duration_s: Some(0.5), resolution_px: [96, 72], ..experiment };
        let path = folder.join("log.mcap");
        simulate(&options, &path, &mut |_| {}).unwrap();
        let log = Arc::new(FlightLog::open(&path).unwrap());
        let rig = Rig::for_log(&log, None).unwrap();
        (log, rig)
    }

    fn entries(folder: &Path) -> Vec<PathBuf> {
        fs::read_dir(folder).map_or_else(|_| Vec::new(), |all| all.map(|entry| entry.unwrap().path()).collect())
    }

    /// Report without an optional field, with numbers whose decimal text has many digits.
    fn report() -> CheckReport {
        let faults = vec![
            Fault::of_axes(FaultKind::ImuAxes, SignedAxes::all().nth(29).unwrap()),
            Fault { choice: Some(Choice::Flip(ImageFlip::UpsideDown)), ..FaultKind::ImageFlip.into() },
            Fault { since_s: Some(0.1 + 0.2), ..Fault::new(FaultKind::JointOffset, &[1.0 / 3.0, -0.0, 6.02e23]) }
                .of_camera("cam1")
                .of_joints(&["yaw".to_owned()]),
        ];
        let finding = |severity, basis, faults| Finding {
            severity,
            area: Area::Imu,
            title: "a \"title\" of ±3°".to_owned(),
            evidence: "3 of 7".to_owned(),
            remedy: String::new(),
            interval: FindingInterval { since_s: Some(0.1 + 0.2), until_s: None },
            basis,
            faults,
        };
        let image = GrayImage { width: 3, height: 2, pixels: vec![255, 0, 0, 255, 255, 0] };
        CheckReport {
            log: "log.mcap".to_owned(),
            rig: Some("rig".to_owned()),
            epoch_ns: i64::MAX - 7,
            duration_s: 14.3 / 3.0,
            topics: Vec::new(),
            findings: vec![
                finding(Severity::Error, Basis::Measured, faults),
                finding(Severity::Warning, Basis::Assumed, Vec::new()),
            ],
            agreement: Agreement::default(),
            proposed_masks: vec![ProposedMask { camera_key: "cam0".to_owned(), mask: ImageMask::from_image(&image) }],
        }
    }

    #[test]
    fn a_stored_report_is_read_back_exactly() {
        let report = report();
        let again = report_of(&files_of(&report).unwrap()).unwrap();
        assert_eq!(again, report);
        assert_eq!(again.to_string(), report.to_string());
        assert_eq!(serde_json::to_string(&again).unwrap(), serde_json::to_string(&report).unwrap());
        let bits = |report: &CheckReport| report.findings[0].faults[2].values.clone().into_iter().map(f64::to_bits);
        assert!(bits(&again).eq(bits(&report)));
        // JSON has no such number.
        assert_eq!(files_of(&CheckReport { duration_s: f64::NAN, ..report.clone() }), None);
        assert_eq!(files_of(&CheckReport { duration_s: f64::INFINITY, ..report }), None);
    }

    #[test]
    fn a_log_is_checked_once_with_each_rig() {
        let folder = tempfile::tempdir().unwrap();
        let (log, mut rig) = short_log(folder.path());
        let in_cache = folder.path().join("cache");
        let cache = ResultCache::in_folder(in_cache.clone());
        let fresh = check_log(None, &log, &rig);
        assert_eq!(check_log(Some(&cache), &log, &rig), fresh);
        let [entry] = entries(&in_cache).try_into().unwrap();
        let again = check_log(Some(&cache), &log, &rig);
        assert_eq!((&again, again.to_string()), (&fresh, fresh.to_string()));
        // The entry is what is returned.
        let other = report();
        cache.store(&key(&log, &rig).unwrap(), &files_of(&other).unwrap()).unwrap();
        assert_eq!(check_log(Some(&cache), &log, &rig), other);
        // Entries that are damaged, cut off or about something else.
        let foreign = vec![("a.png".to_owned(), vec![1, 2, 3])];
        cache.store(&key(&log, &rig).unwrap(), &foreign).unwrap();
        assert_eq!(check_log(Some(&cache), &log, &rig), fresh);
        let whole = fs::read(&entry).unwrap();
        fs::write(&entry, &whole[..whole.len() / 2]).unwrap();
        assert_eq!(check_log(Some(&cache), &log, &rig), fresh);
        assert_eq!(fs::read(&entry).unwrap(), whole);
        // Another rig is another entry.
        rig.cameras[0].timeshift_cam_imu_s += 0.04;
        let shifted = check_log(Some(&cache), &log, &rig);
        assert_eq!(shifted, check_log(None, &log, &rig));
        assert_eq!(entries(&in_cache).len(), 2);
        // A cache that cannot be written.
        let blocked = folder.path().join("file");
        fs::write(&blocked, "").unwrap();
        assert_eq!(check_log(Some(&ResultCache::in_folder(blocked)), &log, &rig), shifted);
    }
}
