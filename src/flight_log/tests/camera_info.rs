//! Intrinsics from `CameraInfo` with a region of interest and binning.

use super::*;
use crate::camera::CameraModel;
use crate::flight_log::MessageKind;
use crate::flight_log::RigOfLog as _;
use crate::flight_log::writer::testing as encode;

const SENSOR: [f64; 4] = [100.0, 102.0, 64.5, 47.5];

/// Rig without intrinsics for a log with images of a size, and a `CameraInfo` of 128×96 pixels with this binning
/// (x, y) and region of interest (column, row, width, height); the error of the rig, if there is one.
fn rig_with(
    image_px: [usize; 2],
    binning: [u32; 2],
    [x, y, width, height]: [u32; 4],
    resolution: &str,
) -> Result<Rig, String> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    let mut info = encode::camera_info(EPOCH_NS, "camera", &CameraModel::pinhole(SENSOR, [128, 96]).unwrap());
    // Binning, region of interest and a flag end the message.
    let at = info.len() - 25;
    for (place, number) in binning.into_iter().chain([x, y, height, width]).enumerate() {
        info[at + 4 * place..at + 4 * place + 4].copy_from_slice(&number.to_le_bytes());
    }
    for number in 0..5 {
        let times = MessageTimes { stamp_ns: EPOCH_NS + number * 40 * MS, log_time_ns: EPOCH_NS + number * 40 * MS };
        let image = image_at(number, image_px);
        writer.write_raw_image("/camera", "camera", times, image_px, "mono8", &image.pixels).unwrap();
        writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::z()).unwrap();
        writer.write("/camera_info", MessageKind::CameraInfo, times, &info).unwrap();
    }
    writer.finish().unwrap();
    let open =
        RIG.replace("  intrinsics: [50.0, 50.0, 31.5, 23.5]\n", "").replace("  resolution: [64, 48]\n", resolution);
    std::fs::write(folder.path().join("flight.rig.yaml"), open).unwrap();
    Rig::for_log(&FlightLog::open(&path).unwrap(), None).map_err(|error| error.to_string())
}

fn model(image_px: [usize; 2], binning: [u32; 2], region: [u32; 4]) -> ([f64; 4], [usize; 2]) {
    let model = rig_with(image_px, binning, region, "").unwrap().cameras[0].model.clone();
    (model.intrinsics_px, model.resolution_px)
}

#[test]
fn binning_and_region_are_applied_to_the_intrinsics() {
    let whole = [0; 4];
    for none in [[0, 0], [1, 1]] {
        assert_eq!(model([128, 96], none, whole), (SENSOR, [128, 96]));
        assert_eq!(model([128, 96], none, [0, 0, 128, 96]), (SENSOR, [128, 96]));
    }
    assert_eq!(model([64, 48], [2, 2], whole), ([50.0, 51.0, 32.0, 23.5], [64, 48]));
    assert_eq!(model([64, 32], [2, 3], whole), ([50.0, 34.0, 32.0, 15.5], [64, 32]));
    assert_eq!(model([80, 60], [0, 0], [20, 10, 80, 60]), ([100.0, 102.0, 44.5, 37.5], [80, 60]));
    assert_eq!(model([40, 30], [2, 2], [20, 10, 80, 60]), ([50.0, 51.0, 22.0, 18.5], [40, 30]));
    // A region without a size ends at the end of the sensor.
    assert_eq!(model([108, 86], [1, 1], [20, 10, 0, 0]), ([100.0, 102.0, 44.5, 37.5], [108, 86]));
}

#[test]
fn a_binned_camera_projects_to_the_pixels_that_contain_the_sensors() {
    let sensor = CameraModel::pinhole(SENSOR, [128, 96]).unwrap();
    let (intrinsics_px, resolution_px) = model([64, 48], [2, 2], [0; 4]);
    let binned = CameraModel::pinhole(intrinsics_px, resolution_px).unwrap();
    // The four pixels of a block are around the centre of their common pixel.
    let point = sensor.unproject(&nalgebra::Vector2::new(20.5, 10.5)).unwrap();
    let uv_px = binned.project(&point).unwrap();
    assert!((uv_px - nalgebra::Vector2::new(10.0, 5.0)).norm() < 1e-12, "{uv_px}");
}

#[test]
fn images_that_are_not_binned_keep_the_intrinsics() {
    assert_eq!(model([128, 96], [2, 2], [0; 4]), (SENSOR, [128, 96]));
    assert_eq!(model([80, 60], [2, 2], [20, 10, 80, 60]), ([100.0, 102.0, 44.5, 37.5], [80, 60]));
}

#[test]
fn a_resolution_of_the_rig_is_that_of_the_sensor_or_of_the_images() {
    for resolution in ["  resolution: [128, 96]\n", "  resolution: [64, 48]\n"] {
        let rig = rig_with([64, 48], [2, 2], [0; 4], resolution).unwrap();
        assert_eq!(rig.cameras[0].model.resolution_px, [64, 48]);
    }
    let problem = rig_with([64, 48], [2, 2], [0; 4], "  resolution: [100, 75]\n").unwrap_err();
    assert!(
        problem.contains("cam0.resolution: 100×75, but CameraInfo has 64×48 (128×96 with binning 2×2); remove"),
        "{problem}"
    );
    let problem = rig_with([64, 48], [1, 1], [100, 0, 64, 48], "").unwrap_err();
    assert!(
        problem.contains("(roi) of 64×48 pixels at (100, 0) with binning 1×1 is no part of its 128×96"),
        "{problem}"
    );
}
