//! Images of each camera: size, content, blur, exposure, texture, and the parts of a video that cannot be decoded.

pub(super) mod content;
pub(super) mod still_pixels;

use std::collections::BTreeMap;

use self::content::ContentFault;
use super::imu::ImuFacts;
use super::report::{Area, Findings, Severity};
use super::statistics::{median, percentile};
use super::survey::gradient_sums::ImageMeasure;
use super::survey::{SampledImage, Survey};
use crate::flight_log::FlightLog;
use crate::flight_log::grey_levels::{GreyLevels, OUTSIDE_RATIO};
use crate::flight_log::video::{MissingFrames, missing_frames};
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, CameraRig, Rig};

/// An image is blurred if the ratio of its edge gradient to the median is below this.
const BLURRED: f64 = 0.5;
/// Ratio of pixels with texture below which an image gives few features.
const MIN_TEXTURE: f64 = 0.01;
/// Edge gradient of the median image, in grey levels per pixel, below which all images are blurred.
const MIN_EDGE: f64 = 8.0;
/// Blurred images, or images with little texture, are reported from one in this many.
const POOR_ONE_IN: usize = 20;
/// Changes of the exposure are reported above one in this many images.
const JUMP_ONE_IN: usize = 10;
/// Change of the mean grey value between two sampled images that is a jump of the exposure.
const JUMP_GREY: f64 = 40.0;
/// Mean grey values of the median image of an exposed camera.
const EXPOSED_GREY: [f64; 2] = [25.0, 230.0];
/// Ratio of black pixels in the median image above which a camera is underexposed.
const MOST_DARK: f64 = 0.5;
/// Ratio of white pixels in the median image above which a camera is overexposed.
const MOST_BRIGHT: f64 = 0.3;
/// Difference of the ratios of both sides to the rig's up to which an image is a scaled one.
const SAME_SCALE: f64 = 0.01;
/// Quantile of the angular rates that counts as fast.
const FAST_QUANTILE: f64 = 0.99;
/// Image motion by rotation, as a ratio of the width, that is fast for a tracker.
const FAST_MOTION: f64 = 0.15;
/// Maximum number of listed times of blurred images.
const LISTED_TIMES: usize = 5;

/// Number of messages of a video that are decoded: about a minute at 30 Hz.
const DECODED_MESSAGES: usize = 2000;
/// Maximum number of listed intervals.
const LISTED_INTERVALS: usize = 3;

/// Checks the size of each camera's images, their motion by rotation, and blur, exposure and texture if their content is not
/// broken.
pub(super) fn check_images(
    log: &FlightLog,
    survey: &Survey,
    rig: &Rig,
    imu_facts: &ImuFacts,
    faults: &BTreeMap<String, ContentFault>,
    findings: &mut Findings,
) {
    for camera in &rig.cameras {
        let Some(images) = survey.images.get(&camera.key).filter(|images| !images.is_empty()) else { continue };
        check_size(log, camera, images, findings);
        check_motion(camera, imu_facts, findings);
        let fault = faults.get(&camera.key);
        if fault == Some(&ContentFault::Broken) {
            continue;
        }
        if let Some(levels) = survey.grey_levels.get(&camera.key) {
            note_grey_levels(camera, levels, findings);
        }
        // Gradients follow the brightness.
        if fault.is_none() {
            check_blur(camera, images, findings);
            check_exposure(camera, images, findings);
        }
        check_texture(camera, images, findings);
    }
}

/// Adds a note on the conversion of images of 16 bits, unless the upper eight bits are taken.
fn note_grey_levels(camera: &CameraRig, levels: &GreyLevels, findings: &mut Findings) {
    let (key, bits, images) = (&camera.key, levels.bits(), levels.images());
    let (title, evidence) = if let Some([low, high, smallest, largest]) = levels.stretched() {
        let size = if largest - smallest < 1.0 {
            format!("{largest:.0} values")
        } else {
            format!("{smallest:.0} to {largest:.0} values at a time")
        };
        let title = format!("{key} uses grey values from {low:.0} to {high:.0} of 16 bits");
        let evidence = format!(
            "all but {:.1} % of the pixels on either side, in {images} images of the recording; contrast is stretched over \
             this range, {size}, which follows the recording",
            OUTSIDE_RATIO * 100.0
        );
        (title, evidence)
    } else if bits < 16 {
        let title = format!("{key} has grey values of {bits} bits in 16");
        let evidence = format!("by the brightest pixel of {images} images; bits {} to {bits} are used", bits - 7);
        (title, evidence)
    } else {
        return;
    };
    findings.add(Severity::Note, Area::Images, title, evidence, "");
}

fn check_size(log: &FlightLog, camera: &CameraRig, images: &[SampledImage], findings: &mut Findings) {
    let [width, height] = camera.model.resolution_px;
    let Some(other) = images.iter().find(|image| image.measure.resolution_px != camera.model.resolution_px) else {
        let evidence = format!("{width}×{height} in {} images", images.len());
        return findings.good(Area::Images, format!("{} has the size given in the rig", camera.key), evidence);
    };
    let [image_width, image_height] = other.measure.resolution_px;
    let wrong = images.iter().filter(|image| image.measure.resolution_px != camera.model.resolution_px).count();
    let evidence =
        format!("{image_width}×{image_height} in {wrong} of {} images, {width}×{height} in the rig", images.len());
    let scale = image_width as f64 / width as f64;
    let remedy = if let Some(remedy) = window_remedy(log, camera, other.measure.resolution_px) {
        remedy
    } else if (image_height as f64 / height as f64 - scale).abs() < SAME_SCALE {
        format!("the images are scaled by {scale:.3}: scale fx fy cx cy with them, or record the calibrated size")
    } else {
        "set resolution with its intrinsics; images of another size are skipped".to_owned()
    };
    findings.add(
        Severity::Error,
        Area::Images,
        format!("{} differs in size from the rig", camera.key),
        evidence,
        remedy,
    );
}

/// Values for a rig with the intrinsics of the whole sensor, if `CameraInfo` states the part of it in the images.
fn window_remedy(log: &FlightLog, camera: &CameraRig, image_px: [usize; 2]) -> Option<String> {
    let published = log.published_camera(&camera.topic, &camera.topic).ok()?;
    let window = published.window?;
    let is_of_sensor = camera.model.resolution_px == published.sensor.resolution_px;
    if !is_of_sensor || published.image.resolution_px != image_px {
        return None;
    }
    let [fx, fy, cx, cy] = window.applied_to(&camera.model).intrinsics_px;
    let ([width, height], key) = (image_px, &camera.key);
    Some(format!(
        "CameraInfo states {window}: set {key}.intrinsics: [{fx:.3}, {fy:.3}, {cx:.3}, {cy:.3}] and \
         {key}.resolution: [{width}, {height}], or remove both from the rig to take those of CameraInfo"
    ))
}

fn check_blur(camera: &CameraRig, images: &[SampledImage], findings: &mut Findings) {
    let edges: Vec<f64> = images.iter().map(|image| image.measure.edge).collect();
    let usual = median(&edges);
    let blurred: Vec<&SampledImage> = images.iter().filter(|image| image.measure.edge < BLURRED * usual).collect();
    let evidence = format!(
        "edge gradient {usual:.0} grey levels per pixel in the median image, {:.0} in the most blurred of {} images",
        percentile(&edges, 0.0),
        images.len()
    );
    if usual < MIN_EDGE {
        let title = format!("all images of {} are blurred", camera.key);
        let remedy = "check focus, compression and lens; features need edges";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
    } else if blurred.len() * POOR_ONE_IN >= images.len() {
        let times: Vec<String> = blurred
            .iter()
            .take(LISTED_TIMES)
            .map(|image| format!("{:.1} s", seconds_from_ns(image.stamp_ns)))
            .collect();
        let title = format!("some images of {} are blurred", camera.key);
        let evidence = format!("{} of {} images, at {}; {evidence}", blurred.len(), images.len(), times.join(", "));
        let remedy = "shorten the exposure, add light or rotate more slowly; tracks are lost there";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
        findings.state_interval(blurred.iter().map(|image| image.stamp_ns));
    } else {
        findings.good(Area::Images, format!("the images of {} are sharp", camera.key), evidence);
    }
}

fn check_exposure(camera: &CameraRig, images: &[SampledImage], findings: &mut Findings) {
    let of = |pick: fn(&ImageMeasure) -> f64| images.iter().map(|image| pick(&image.measure)).collect::<Vec<_>>();
    let (grey, dark, bright) = (of(|m| m.mean_grey), of(|m| m.dark), of(|m| m.bright));
    let evidence = format!(
        "mean grey {:.0} (from {:.0} to {:.0}), {:.0} % black and {:.0} % white pixels in the median image",
        median(&grey),
        percentile(&grey, 0.0),
        percentile(&grey, 1.0),
        median(&dark) * 100.0,
        median(&bright) * 100.0
    );
    let jumps = grey.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > JUMP_GREY).count();
    if median(&grey) < EXPOSED_GREY[0] || median(&dark) > MOST_DARK {
        let title = format!("{} is underexposed", camera.key);
        findings.add(Severity::Warning, Area::Images, title, evidence, "expose longer or raise the gain");
    } else if median(&grey) > EXPOSED_GREY[1] || median(&bright) > MOST_BRIGHT {
        let title = format!("{} is overexposed", camera.key);
        findings.add(Severity::Warning, Area::Images, title, evidence, "expose shorter");
    } else if jumps * JUMP_ONE_IN > images.len() {
        let title = format!("the exposure of {} jumps", camera.key);
        let evidence = format!("{jumps} changes by more than {JUMP_GREY} grey values; {evidence}");
        let remedy = "fix the exposure, or limit its rate of change: the tracker assumes constant brightness";
        findings.add(Severity::Note, Area::Images, title, evidence, remedy);
    } else {
        findings.good(Area::Images, format!("{} is well exposed", camera.key), evidence);
    }
}

fn check_texture(camera: &CameraRig, images: &[SampledImage], findings: &mut Findings) {
    let ratios: Vec<f64> = images.iter().map(|image| image.measure.texture).collect();
    let poor_images = images.iter().filter(|image| image.measure.texture < MIN_TEXTURE);
    let poor = poor_images.clone().count();
    let evidence = format!(
        "{:.1} % of the pixels have texture in the median image, {:.1} % in the poorest",
        median(&ratios) * 100.0,
        percentile(&ratios, 0.0) * 100.0
    );
    if poor * POOR_ONE_IN >= images.len() {
        let title = format!("some images of {} have little texture", camera.key);
        let evidence = format!("{poor} of {} images; {evidence}", images.len());
        let remedy = "white walls, sky and fog give few features: expect the estimate to drift there";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
        findings.state_interval(poor_images.map(|image| image.stamp_ns));
    } else {
        findings.good(Area::Images, format!("the images of {} have enough texture", camera.key), evidence);
    }
}

/// Checks the image motion between images due to the vehicle's rotation alone, in pixels; a gimbal compensates it.
fn check_motion(camera: &CameraRig, imu_facts: &ImuFacts, findings: &mut Findings) {
    if camera.mount == CameraMount::Gimbal || camera.rate_hz <= 0.0 || imu_facts.samples.is_empty() {
        return;
    }
    let bias = imu_facts.gyroscope_bias_rad_per_s.unwrap_or_default();
    let rates: Vec<f64> =
        imu_facts.samples.iter().map(|sample| (sample.angular_velocity_rad_per_s - bias).norm()).collect();
    let pixels = |rate: f64| rate / camera.rate_hz * camera.model.focal_length_px();
    let (usual, fast) = (pixels(median(&rates)), pixels(percentile(&rates, FAST_QUANTILE)));
    let evidence = format!(
        "image motion by rotation: {usual:.0} px per image in the median, {fast:.0} px in the fastest 1 % ({:.2} rad/s)",
        percentile(&rates, FAST_QUANTILE)
    );
    if fast > FAST_MOTION * camera.model.resolution_px[0] as f64 {
        let title = format!("high angular rate of {}", camera.key);
        let remedy = "tracking depends on the gyroscope's prediction: extrinsics and time offset must be correct";
        findings.add(Severity::Note, Area::Motion, title, evidence, remedy);
    } else {
        findings.good(Area::Motion, format!("the angular rate of {} is low enough for tracking", camera.key), evidence);
    }
}

/// Decodes the videos of a rig's cameras and reports the intervals that a run has to skip.
pub(crate) fn check_video_decoding(log: &FlightLog, survey: &Survey, rig: &Rig, findings: &mut Findings) {
    for camera in &rig.cameras {
        let Some(info) = log.topic(&camera.topic) else { continue };
        let Some(kind) = info.kind.filter(|kind| kind.is_video()) else { continue };
        let (read, missing) = missing_frames(log, &camera.topic, kind, DECODED_MESSAGES);
        let of = if read < info.count as usize { format!("the first {read}") } else { read.to_string() };
        let count: usize = missing.iter().map(|stretch| stretch.count).sum();
        if count == 0 {
            findings.good(Area::Images, format!("the video of {} can be decoded", camera.key), format!("{of} images"));
            continue;
        }
        let times = survey.topics.get(&camera.topic).map_or(&[][..], |topic| topic.times.as_slice());
        let second = |number: usize| times.get(number).map_or(0.0, |times| seconds_from_ns(times.stamp_ns));
        let listed = |stretch: &MissingFrames| {
            let (from_s, to_s) = (second(stretch.first), second(stretch.first + stretch.count - 1));
            format!("{} from {from_s:.3} to {to_s:.3} s ({})", stretch.count, stretch.problem)
        };
        let mut stretches: Vec<String> = missing.iter().take(LISTED_INTERVALS).map(listed).collect();
        if missing.len() > LISTED_INTERVALS {
            stretches.push(format!("{} more intervals", missing.len() - LISTED_INTERVALS));
        }
        let title = format!("images of {} cannot be decoded", camera.key);
        let evidence = format!("{count} of {of} images: {}", stretches.join("; "));
        let remedy = "a run skips them up to the next keyframe: record without losses, or with more frequent keyframes";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
        let ends = |stretch: &MissingFrames| second(stretch.first + stretch.count - 1);
        findings.state_times(missing.first().map(|it| second(it.first)), missing.last().map(ends));
    }
}
