use super::inertial::InertialFacts;
use super::statistics::{median, percentile};
use super::survey::{ImageLook, Survey};
use super::{Area, Findings, Severity};
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, CameraRig, GrayImage, Rig};

/// A pixel with a steeper grey slope (per pixel) counts as texture.
const TEXTURE_SLOPE: usize = 12;
/// An image with edges less steep than this share of the usual is blurred.
const BLURRED: f64 = 0.5;
/// Images with less texture than this share of their pixels give few features.
const LEAST_TEXTURE: f64 = 0.01;
/// Pixels at least this bright are taken for overexposed.
const BRIGHT: u8 = 250;
/// Pixels at most this bright are taken for underexposed.
const DARK: u8 = 5;

/// What one image looks like, in numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImageMeasure {
    pub(super) resolution_px: [usize; 2],
    pub(super) mean_grey: f64,
    /// Share of the pixels that are black, and that are white.
    pub(super) dark: f64,
    pub(super) bright: f64,
    /// Share of the pixels with texture.
    pub(super) texture: f64,
    /// Slope of the steepest hundredth of the pixels, in grey values per pixel.
    pub(super) edge: f64,
}

/// Looks at every second pixel of every second row.
pub(super) fn measure(image: &GrayImage) -> ImageMeasure {
    let (width, height) = (image.width, image.height);
    let mut slopes = [0_usize; 256];
    let (mut count, mut sum, mut dark, mut bright) = (0_usize, 0_usize, 0_usize, 0_usize);
    for row in (1..height.saturating_sub(1)).step_by(2) {
        let line = |row: usize| &image.pixels[row * width..(row + 1) * width];
        let (above, here, below) = (line(row - 1), line(row), line(row + 1));
        for column in (1..width.saturating_sub(1)).step_by(2) {
            let value = here[column];
            let along = f64::from(here[column + 1]) - f64::from(here[column - 1]);
            let across = f64::from(below[column]) - f64::from(above[column]);
            slopes[((along.hypot(across) / 2.0) as usize).min(255)] += 1;
            count += 1;
            sum += usize::from(value);
            dark += usize::from(value <= DARK);
            bright += usize::from(value >= BRIGHT);
        }
    }
    let share = |part: usize| part as f64 / count.max(1) as f64;
    let mut steeper = 0;
    let edge = (0..256).rev().find(|slope| {
        steeper += slopes[*slope];
        steeper * 100 >= count.max(1)
    });
    ImageMeasure {
        resolution_px: [width, height],
        mean_grey: share(sum),
        dark: share(dark),
        bright: share(bright),
        texture: share(slopes[TEXTURE_SLOPE..].iter().sum()),
        edge: edge.unwrap_or(0) as f64,
    }
}

/// Size, blur, exposure and texture of each camera's images, and how fast they move.
pub(super) fn check_images(survey: &Survey, rig: &Rig, inertial: &InertialFacts, findings: &mut Findings) {
    for camera in &rig.cameras {
        let Some(looks) = survey.images.get(&camera.key).filter(|looks| !looks.is_empty()) else { continue };
        check_size(camera, looks, findings);
        if let Some(bits) = survey.depths.get(&camera.key).map(|depth| depth.bits()).filter(|bits| *bits < 16) {
            let title = format!("{} has grey values of {bits} bits in 16", camera.key);
            let evidence = format!("by the brightest pixel of its first image; bits {} to {bits} are used", bits - 7);
            findings.add(Severity::Note, Area::Images, title, evidence, "");
        }
        check_blur(camera, looks, findings);
        check_exposure(camera, looks, findings);
        check_texture(camera, looks, findings);
        check_motion(camera, inertial, findings);
    }
}

fn check_size(camera: &CameraRig, looks: &[ImageLook], findings: &mut Findings) {
    let [width, height] = camera.model.resolution_px;
    let Some(other) = looks.iter().find(|look| look.measure.resolution_px != camera.model.resolution_px) else {
        let evidence = format!("{width}×{height} in {} images", looks.len());
        return findings.good(Area::Images, format!("{} has the size that the rig says", camera.key), evidence);
    };
    let [seen_width, seen_height] = other.measure.resolution_px;
    let wrong = looks.iter().filter(|look| look.measure.resolution_px != camera.model.resolution_px).count();
    let evidence =
        format!("{seen_width}×{seen_height} in {wrong} of {} images, {width}×{height} in the rig", looks.len());
    let scale = seen_width as f64 / width as f64;
    let remedy = if (seen_height as f64 / height as f64 - scale).abs() < 0.01 {
        format!("the images are scaled by {scale:.3}: scale fx fy cx cy with them, or record the calibrated size")
    } else {
        "set resolution and the intrinsics that belong to it; images of another size are left out".to_owned()
    };
    findings.add(Severity::Error, Area::Images, format!("{} has another size", camera.key), evidence, remedy);
}

fn check_blur(camera: &CameraRig, looks: &[ImageLook], findings: &mut Findings) {
    let edges: Vec<f64> = looks.iter().map(|look| look.measure.edge).collect();
    let usual = median(&edges);
    let blurred: Vec<&ImageLook> = looks.iter().filter(|look| look.measure.edge < BLURRED * usual).collect();
    let evidence = format!(
        "steepest edges {usual:.0} grey values per pixel in the middle, {:.0} in the softest of {} images",
        percentile(&edges, 0.0),
        looks.len()
    );
    if usual < 8.0 {
        let title = format!("the images of {} are soft throughout", camera.key);
        let remedy = "check focus, compression and lens; features need edges";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
    } else if blurred.len() * 20 >= looks.len() {
        let times: Vec<String> =
            blurred.iter().take(5).map(|look| format!("{:.1} s", seconds_from_ns(look.stamp_ns))).collect();
        let title = format!("some images of {} are blurred", camera.key);
        let evidence = format!("{} of {} looked at, at {}; {evidence}", blurred.len(), looks.len(), times.join(", "));
        let remedy = "shorten the exposure, add light or turn slower; tracks are lost there";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
    } else {
        findings.good(Area::Images, format!("the images of {} are sharp", camera.key), evidence);
    }
}

fn check_exposure(camera: &CameraRig, looks: &[ImageLook], findings: &mut Findings) {
    let of = |pick: fn(&ImageMeasure) -> f64| looks.iter().map(|look| pick(&look.measure)).collect::<Vec<_>>();
    let (grey, dark, bright) = (of(|m| m.mean_grey), of(|m| m.dark), of(|m| m.bright));
    let evidence = format!(
        "mean grey {:.0} (from {:.0} to {:.0}), {:.0} % black and {:.0} % white pixels in the median image",
        median(&grey),
        percentile(&grey, 0.0),
        percentile(&grey, 1.0),
        median(&dark) * 100.0,
        median(&bright) * 100.0
    );
    let jumps = looks.windows(2).filter(|pair| (pair[0].measure.mean_grey - pair[1].measure.mean_grey).abs() > 40.0);
    let jumps = jumps.count();
    if median(&grey) < 25.0 || median(&dark) > 0.5 {
        let title = format!("{} is underexposed", camera.key);
        findings.add(Severity::Warning, Area::Images, title, evidence, "expose longer or raise the gain");
    } else if median(&grey) > 230.0 || median(&bright) > 0.3 {
        let title = format!("{} is overexposed", camera.key);
        findings.add(Severity::Warning, Area::Images, title, evidence, "expose shorter");
    } else if jumps * 10 > looks.len() {
        let title = format!("the exposure of {} jumps", camera.key);
        let evidence = format!("{jumps} changes by more than 40 grey values; {evidence}");
        let remedy = "fix the exposure, or limit its speed: trackers take brightness as constant";
        findings.add(Severity::Note, Area::Images, title, evidence, remedy);
    } else {
        findings.good(Area::Images, format!("{} is well exposed", camera.key), evidence);
    }
}

fn check_texture(camera: &CameraRig, looks: &[ImageLook], findings: &mut Findings) {
    let shares: Vec<f64> = looks.iter().map(|look| look.measure.texture).collect();
    let poor = shares.iter().filter(|share| **share < LEAST_TEXTURE).count();
    let evidence = format!(
        "{:.1} % of the pixels have texture in the median image, {:.1} % in the poorest",
        median(&shares) * 100.0,
        percentile(&shares, 0.0) * 100.0
    );
    if poor * 20 >= looks.len() {
        let title = format!("{} sees little texture at times", camera.key);
        let evidence = format!("{poor} of {} images looked at; {evidence}", looks.len());
        let remedy = "white walls, sky and fog give few features: expect the estimate to drift there";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
    } else {
        findings.good(Area::Images, format!("{} sees enough texture", camera.key), evidence);
    }
}

/// How far the image moves from frame to frame by the rotation alone; a gimbal takes that out.
fn check_motion(camera: &CameraRig, inertial: &InertialFacts, findings: &mut Findings) {
    if camera.mount == CameraMount::Gimbal || camera.rate_hz <= 0.0 || inertial.samples.is_empty() {
        return;
    }
    let rest = inertial.rest_rate_rad_per_s.unwrap_or_default();
    let rates: Vec<f64> =
        inertial.samples.iter().map(|sample| (sample.angular_velocity_rad_per_s - rest).norm()).collect();
    let pixels = |rate: f64| rate / camera.rate_hz * camera.model.focal_length_px();
    let (usual, fast) = (pixels(median(&rates)), pixels(percentile(&rates, 0.99)));
    let evidence = format!(
        "about {usual:.0} px from image to image by rotation, {fast:.0} px in the fastest hundredth ({:.2} rad/s)",
        percentile(&rates, 0.99)
    );
    if fast > 0.15 * camera.model.resolution_px[0] as f64 {
        let title = format!("{} turns fast", camera.key);
        let remedy = "tracking then rests on the gyroscope's prediction: extrinsics and time offset must be right";
        findings.add(Severity::Note, Area::Motion, title, evidence, remedy);
    } else {
        findings.good(Area::Motion, format!("{} turns slowly enough to track", camera.key), evidence);
    }
}
