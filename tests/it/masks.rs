//! Mask of a camera: no feature inside it, and it is copied with the rig of a run.

use std::path::Path;
use std::process::Command;

use dcvins::camera::CameraModel;
use dcvins::files::RigFile as _;
use dcvins::flight_log::FlightLog;
use dcvins::flight_log::RigOfLog as _;
use dcvins::sensors::Rig;

fn dcvins(arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_dcvins"))
        .env("DCVINS_CACHE_DIR", "")
        .args(arguments)
        .output()
        .expect("the program runs");
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code().unwrap_or(-1), text)
}

#[test]
fn a_run_with_a_mask_writes_it_beside_its_rig() {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::for_log(&FlightLog::open(&log).unwrap(), None).unwrap();
    let key = rig.cameras[0].key.clone();
    let CameraModel { resolution_px: [width, height], .. } = rig.cameras[0].model;
    let pixel = |column: u32, _: u32| image::Luma([if column < width as u32 / 4 { 255 } else { 0 }]);
    image::GrayImage::from_fn(width as u32, height as u32, pixel).save(folder.path().join("left.png")).unwrap();
    let text = rig.to_yaml().replacen("  mount: ", "  mask: left.png\n  mount: ", 1);
    let path = folder.path().join("masked.rig.yaml");
    std::fs::write(&path, text).unwrap();
    let results = folder.path().join("results");
    let (log, path, out) = (log.to_str().unwrap(), path.to_str().unwrap(), results.to_str().unwrap());
    let arguments = ["run", log, "--rig", path, "--out", out, "--duration", "5", "--no-check"];
    let (code, text) = dcvins(&arguments);
    assert_eq!(code, 0, "{text}");
    let written = Rig::from_file(&results.join("auto/rig.yaml")).unwrap();
    let mask = written.cameras[0].mask.as_ref().unwrap();
    assert_eq!(mask.file, format!("{key}.mask.png"));
    assert!((mask.image.ratio() - 0.25).abs() < 0.01);
    // Results of the same log are replaced, including the mask.
    let (code, text) = dcvins(&arguments);
    assert_eq!(code, 0, "{text}");
}
