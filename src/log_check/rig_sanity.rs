use nalgebra::Vector2;

use super::extrinsics::MAX_LEVER_M;
use super::report::{Area, Basis, CheckReport, Finding, FindingInterval, Findings, Severity};
use crate::camera::{CameraModel, Projection};
use crate::flight_log::FlightLog;
use crate::sensors::{AssumedField, CameraRig, ChainPrior, GimbalRig, Rig};

/// Smallest reported difference between a pixel by the log's `CameraInfo` and by the rig, as a ratio of the focal
/// length.
const INTRINSICS_TOLERANCE: f64 = 0.02;
/// Cells of the grid of directions along a side of the image.
const CELLS: u32 = 8;
/// Distance of the principal point from the image centre, as a ratio of half the side, that is reported.
const FAR_CENTRE: f64 = 0.25;
/// Distance of the principal point from the image centre, as a ratio of half the side, that is an error.
const WRONG_CENTRE: f64 = 0.4;
/// Relative difference of the distances along both sides up to which the intrinsics belong to an image of another size.
const SAME_SCALE: f64 = 0.1;
/// Ratios of the focal lengths of nearly square pixels.
const SQUARE_PIXELS: std::ops::RangeInclusive<f64> = 0.9..=1.1;
/// Usual fields of view, in degrees.
const USUAL_FIELD_DEG: std::ops::RangeInclusive<f64> = 25.0..=200.0;
/// Distance of the checked pixels from the border, as a ratio of the side.
const BORDER: f64 = 0.05;
/// Wide prior of the lengths of a chain.
const WIDE_PRIOR_M: f64 = 0.1;
/// Wide prior of the angles of a chain.
const WIDE_PRIOR_RAD: f64 = 0.35;

impl CheckReport {
    /// Adds a note about keys in the rig's file that are written by other programs and not used here.
    pub fn add_unused_rig_keys(&mut self, keys: &[String]) {
        if keys.is_empty() {
            return;
        }
        let place = self.findings.iter().position(|finding| finding.severity < Severity::Note);
        let note = Finding {
            severity: Severity::Note,
            area: Area::Log,
            title: "keys of the rig that are not used".to_owned(),
            evidence: keys.join(", "),
            remedy: String::new(),
            interval: FindingInterval::default(),
            basis: Basis::Measured,
            faults: Vec::new(),
        };
        self.findings.insert(place.unwrap_or(self.findings.len()), note);
    }
}

/// Checks the plausibility of the rig's intrinsics and chain.
pub(super) fn check_rig(log: &FlightLog, rig: &Rig, findings: &mut Findings) {
    for camera in &rig.cameras {
        check_lens(camera, findings);
        check_camera_info(log, camera, findings);
    }
    if let Some(gimbal) = &rig.gimbal {
        check_chain(gimbal, findings);
    }
    check_assumed(rig, findings);
}

/// Adds one finding for each assumed field, with instructions for measuring it.
fn check_assumed(rig: &Rig, findings: &mut Findings) {
    for AssumedField { field, reason } in &rig.assumed {
        let (area, how) = how_to_measure(field);
        let remedy = format!("{how}; then remove assumed.{field} from the rig");
        findings.assumption(area, format!("{field} is only assumed"), reason.clone(), remedy);
    }
}

/// Subject of a field of the rig, and instructions for measuring its value.
fn how_to_measure(field: &str) -> (Area, &'static str) {
    let (part, name) = field.split_once('.').unwrap_or((field, ""));
    match (part, name) {
        ("imu0" | "imu1", "rostopic" | "accelerometer_rostopic") | ("gimbal", "rostopic") => {
            (Area::Log, "name the topic of the log")
        }
        ("imu1", "T_cam_imu") => {
            (Area::Extrinsics, "correct it by what check measures of its axes, or run with gimbal-imu-axes=on")
        }
        ("imu0" | "imu1", _) => {
            (Area::Imu, "record the stationary IMU for some minutes, or take twice the value that check measures")
        }
        ("gravity", _) => (Area::Imu, "set gravity for the place of the flight"),
        ("gimbal", "source") => {
            (Area::Encoders, "confirm frame, axes, order and unit of the attitude in the gimbal's documentation")
        }
        ("gimbal", "encoder_sigma") => (Area::Encoders, "take the noise of the joint angles that check measures"),
        ("gimbal", name) if name.starts_with("links") => (
            Area::Extrinsics,
            "confirm order and signs of the axes by moving each joint by hand, measure the distances between the axes with a \
             ruler, and refine with dcvins calibrate or a run",
        ),
        ("gimbal", _) => (Area::Extrinsics, "measure it with a ruler, and refine with dcvins calibrate or a run"),
        ("ground_truth", _) => (Area::Log, "confirm that the topic is an external measurement of the IMU's pose"),
        (_, "rostopic") => (Area::Log, "name the topic of the log"),
        (_, "timeshift_cam_imu") => (Area::Time, "take the time offset that check measures, or run with timeshift=on"),
        (_, "T_cam_imu") => (Area::Extrinsics, "calibrate camera and IMU, as with Kalibr"),
        (_, "update_rate") => (Area::Time, "take the rate in the log"),
        _ => (Area::Intrinsics, "calibrate the camera with a target, as with Kalibr or OpenCV"),
    }
}

fn check_lens(camera: &CameraRig, findings: &mut Findings) {
    let model = &camera.model;
    let [fx, fy, cx, cy] = model.intrinsics_px;
    let [width, height] = model.resolution_px.map(|side| side as f64);
    let centre = [cx / (0.5 * width), cy / (0.5 * height)];
    let before = findings.list.len();
    let numbers = format!("fx {fx:.1}, fy {fy:.1}, cx {cx:.1}, cy {cy:.1} at {width:.0}×{height:.0}");
    let off = centre.map(|ratio| (ratio - 1.0).abs());
    if off[0].max(off[1]) > FAR_CENTRE {
        let scale = 0.5 * (centre[0] + centre[1]);
        let remedy = if (centre[0] - centre[1]).abs() < SAME_SCALE * scale {
            format!("the intrinsics fit an image {scale:.2} times as large: scale them, or set resolution")
        } else {
            "check the order fx fy cx cy, and that resolution is [width, height]".to_owned()
        };
        let title = format!("the principal point of {} is far from the image centre", camera.key);
        let severity = if off[0].max(off[1]) > WRONG_CENTRE { Severity::Error } else { Severity::Warning };
        findings.add(severity, Area::Intrinsics, title, numbers.clone(), remedy);
    }
    if !SQUARE_PIXELS.contains(&(fx / fy)) && model.projection == Projection::Pinhole {
        let title = format!("the focal lengths of {} differ", camera.key);
        let remedy = "pixels are nearly always square: calibrate again, or check how the image was resized";
        findings.add(Severity::Warning, Area::Intrinsics, title, numbers.clone(), remedy);
    }
    let Some(fov_deg) = field_of_view_deg(model) else {
        let title = format!("the lens of {} does not cover its image", camera.key);
        let evidence = format!("a pixel at the image border cannot be unprojected; {numbers}");
        let remedy = "the distortion folds inside the image: calibrate with points near the edge, or use another model";
        findings.add(Severity::Warning, Area::Intrinsics, title, evidence, remedy);
        return;
    };
    if !USUAL_FIELD_DEG.contains(&fov_deg) {
        let title = format!("the field of view of {} is unusual", camera.key);
        let evidence = format!("{fov_deg:.0}° across; {numbers}");
        let remedy = "check that fx and fy are in pixels, and the camera model";
        findings.add(Severity::Warning, Area::Intrinsics, title, evidence, remedy);
    }
    if findings.list.len() == before {
        let title = format!("the intrinsics of {} are plausible", camera.key);
        findings.good(Area::Intrinsics, title, format!("{fov_deg:.0}° across; {numbers}"));
    }
}

/// Horizontal field of view in degrees: angle between the bearings of the middle pixels at the left and right border;
/// `None` if the model cannot unproject these or a pixel near a corner.
fn field_of_view_deg(model: &CameraModel) -> Option<f64> {
    let [width, height] = model.resolution_px.map(|side| side as f64);
    let direction = |u: f64, v: f64| model.unproject(&Vector2::new(u, v));
    for corner in [(0.0, 0.0), (width - 1.0, 0.0), (0.0, height - 1.0), (width - 1.0, height - 1.0)] {
        let inner = 1.0 - 2.0 * BORDER;
        let inside = (inner * corner.0 + BORDER * width, inner * corner.1 + BORDER * height);
        direction(inside.0, inside.1)?;
    }
    let [_, _, cx, cy] = model.intrinsics_px;
    let (left, right) = (direction(0.0, cy)?, direction(width - 1.0, cy)?);
    let axis = direction(cx, cy)?;
    Some((left.angle(&axis) + right.angle(&axis)).to_degrees())
}

fn check_camera_info(log: &FlightLog, camera: &CameraRig, findings: &mut Findings) {
    let Ok(published) = log.published_camera(&camera.topic, &camera.topic) else { return };
    let model = &camera.model;
    // Intrinsics of the whole sensor are compared with the rig's; another finding reports their difference from the
    // intrinsics of the images.
    let of_sensor = model.resolution_px == published.sensor.resolution_px;
    let from_log = if of_sensor { &published.sensor } else { &published.image };
    let (rig, log) = (model.intrinsics_px, from_log.intrinsics_px);
    let scale_px = model.focal_length_px();
    let of_intrinsics_px = rig.iter().zip(&log).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (of_lens_px, at_px) = largest_pixel_difference(model, from_log);
    let lens = format!("the same direction lies up to {of_lens_px:.1} px apart (at {:.0}, {:.0})", at_px.x, at_px.y);
    let window = published.window.map_or_else(String::new, |window| {
        let [width, height] = published.sensor.resolution_px;
        let meant = if of_sensor { "of the sensor" } else { "of the images" };
        format!(" {meant} ({width}×{height}, {window})")
    });
    let evidence = format!(
        "the rig has {} {}, the log's CameraInfo {} {}{window}: {lens}",
        in_tenths(rig),
        model.distortion.name(),
        in_tenths(log),
        from_log.distortion.name()
    );
    let differs = of_intrinsics_px.max(of_lens_px) > INTRINSICS_TOLERANCE * scale_px;
    if differs || from_log.resolution_px != model.resolution_px {
        let title = format!("CameraInfo differs from the rig for {}", camera.key);
        let remedy = "check which calibration applies to this flight; the rig's is used";
        findings.add(Severity::Warning, Area::Intrinsics, title, evidence, remedy);
    } else {
        findings.good(Area::Intrinsics, format!("CameraInfo agrees with the rig for {}", camera.key), evidence);
    }
}

/// Focal lengths and principal point in tenths of a pixel.
fn in_tenths(intrinsics_px: [f64; 4]) -> String {
    let [fx, fy, cx, cy] = intrinsics_px;
    format!("[{fx:.1}, {fy:.1}, {cx:.1}, {cy:.1}]")
}

/// Largest distance between the pixels of one direction in two cameras, in pixels, and the pixel in the first one.
/// Directions are taken on a grid over the first camera's image, where both cameras see them.
fn largest_pixel_difference(camera: &CameraModel, other: &CameraModel) -> (f64, Vector2<f64>) {
    let [width, height] = camera.resolution_px.map(|side| side as f64 - 1.0);
    let grid = (0..=CELLS).flat_map(|row| (0..=CELLS).map(move |column| (column, row)));
    let at = |step: u32, side: f64| side * f64::from(step) / f64::from(CELLS);
    let differences = grid.filter_map(|(column, row)| {
        let uv_px = Vector2::new(at(column, width), at(row, height));
        Some(((other.project(&camera.unproject(&uv_px)?)? - uv_px).norm(), uv_px))
    });
    differences.fold((0.0, Vector2::zeros()), |largest, found| if found.0 > largest.0 { found } else { largest })
}

fn check_chain(gimbal: &GimbalRig, findings: &mut Findings) {
    // Position of the camera over joint angles within the limits.
    let middle: Vec<f64> = gimbal.joints.iter().map(|joint| 0.5 * (joint.limits_rad.0 + joint.limits_rad.1)).collect();
    let mut farthest = 0.0_f64;
    for (number, joint) in gimbal.joints.iter().enumerate() {
        for fraction in [0.0, 0.5, 1.0] {
            let mut angles = middle.clone();
            angles[number] = joint.limits_rad.0 + fraction * (joint.limits_rad.1 - joint.limits_rad.0);
            farthest = farthest.max(gimbal.chain.imu_from_camera(&angles).translation_m.norm());
        }
    }
    let evidence = format!("the gimbal camera is up to {farthest:.3} m from the IMU");
    if farthest > MAX_LEVER_M {
        let remedy = "lengths are in metres: check d, a and the translations of T_I_B and T_E_C";
        findings.add(Severity::Warning, Area::Extrinsics, "the gimbal chain is unusually long", evidence, remedy);
    } else {
        findings.good(Area::Extrinsics, "the gimbal chain has a plausible length", evidence);
    }
    let ChainPrior { translation_bound_m, rotation_bound_rad } = gimbal.prior;
    let evidence = format!("±{:.1} mm and ±{:.2}°", translation_bound_m * 1e3, rotation_bound_rad.to_degrees());
    if translation_bound_m == 0.0 || rotation_bound_rad == 0.0 {
        let remedy = "set gimbal.prior to the errors that the chain may have; zero keeps it fixed";
        findings.add(Severity::Note, Area::Extrinsics, "the prior of the chain is zero: it is fixed", evidence, remedy);
    } else if translation_bound_m > WIDE_PRIOR_M || rotation_bound_rad > WIDE_PRIOR_RAD {
        let remedy = "measure the gimbal better: with a wide prior the chain can diverge in the first seconds";
        findings.add(Severity::Note, Area::Extrinsics, "the prior of the chain is wide", evidence, remedy);
    } else {
        findings.good(Area::Extrinsics, "the prior of the chain has a usual width", evidence);
    }
}
