//! Images with broken content: the bytes in another order, the mosaic of a colour sensor, interlaced or torn images, and
//! images whose brightness alternates. Rotations by images that are no views of the scene at one instant are not compared.

use std::collections::{BTreeMap, BTreeSet};

use crate::faults::{Fault, FaultKind};
use crate::geometry::median;
use crate::log_check::report::{Area, Findings, ImageRotation, Severity};
use crate::log_check::survey::Survey;
use crate::log_check::survey::image_content::{ContentSurvey, ImageContent, PhaseContrast, ValueSpread};
use crate::sensors::Rig;
use crate::text::counted;

/// Minimum number of images, or of groups of three images, that show a fault.
const MIN_IMAGES: usize = 3;
/// One in this many images shows a fault between the first and the last that do.
const MOST_ONE_IN: usize = 2;
/// Largest ratio of the roughness of values in the right order to their roughness in the other one.
const ROUGHER_RATIO: f64 = 0.5;
/// Largest ratio of the standard deviation of chroma to the standard deviation of luma.
const CHROMA_RATIO: f64 = 0.5;
/// Contrast between pixels of even and odd columns or rows that is no noise of a sensor.
const MOSAIC_CONTRAST: f64 = 0.02;
/// Ratio of the regions of an image in which such a contrast has one sign.
const MOSAIC_AGREEMENT: f64 = 0.75;
/// Difference in gain by which the two green pixels of a mosaic are known.
const GREEN_DIFFERENCE: f64 = 0.02;
/// Displacement of rows of two instants, in pixels.
const INTERLACED_PX: f64 = 0.25;
/// Ratio of the regions of an image in which the displacement exceeds its noise.
const INTERLACED_REGIONS: f64 = 0.5;
/// Ratio of the differences between rows in the order of their times and in the other order.
const EARLIER_RATIO: f64 = 0.95;
/// Smallest ratio of the rows of a part that repeats the image before.
const REPEATED_ROWS: f64 = 0.1;
/// Smallest mean change of the other rows, in grey levels.
const CHANGED_GREY: f64 = 2.0;
/// Minimum number of torn images.
const MIN_TORN: usize = 2;
/// Largest ratio of the changing images in which a part repeats: more are an overlay or the vehicle in view.
const MOST_REPEATED: f64 = 0.7;
/// Minimum number of groups of images with a seam at the same row.
const SEAM_GROUPS: usize = 4;
/// Minimum number of different displacements at the seam.
const SEAM_SHIFTS: usize = 3;
/// Ratio of the brightness by which every second image differs.
const ALTERNATING: f64 = 0.03;
/// Smallest ratio of that difference to the change of brightness from one image to the next but one.
const ALTERNATING_RATIO: f64 = 3.0;

/// Fault in the content of a camera's images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ContentFault {
    /// They do not show the scene at one instant in grey values.
    Broken,
    /// Their brightness alternates.
    Brightness,
}

/// Reports faulty content of the cameras' images; returns the faults by camera key.
pub(crate) fn check_content(survey: &Survey, rig: &Rig, findings: &mut Findings) -> BTreeMap<String, ContentFault> {
    let mut faults = BTreeMap::new();
    for camera in &rig.cameras {
        let Some(content) = survey.content.get(&camera.key) else { continue };
        let checked = Content { key: &camera.key, content };
        // Each of them changes the measures of those that follow.
        let checks = [Content::check_bytes, Content::check_mosaic, Content::check_fields, Content::check_parts];
        if checks.iter().any(|check| check(&checked, findings)) {
            findings.state_faults([Fault::from(FaultKind::UnusableImages).of_camera(&camera.key)]);
            faults.insert(camera.key.clone(), ContentFault::Broken);
        } else if checked.check_brightness(findings) {
            faults.insert(camera.key.clone(), ContentFault::Brightness);
        }
    }
    faults
}

/// Rotations of the cameras whose images are not broken and whose stamps are times of exposure.
pub(crate) fn of_intact_images(
    rotations: &[ImageRotation],
    faults: &BTreeMap<String, ContentFault>,
    findings: &mut Findings,
) -> Vec<ImageRotation> {
    let measured: BTreeSet<&String> = rotations.iter().map(|rotation| &rotation.camera_key).collect();
    let is_broken =
        |key: &&String| faults.get(*key) == Some(&ContentFault::Broken) || !findings.can_compare_camera(key);
    let broken: BTreeSet<&String> = measured.into_iter().filter(is_broken).collect();
    for key in &broken {
        let title = format!("the rotations of {key} are not compared");
        let evidence = "the fault of its images or stamps is reported above";
        findings.add(Severity::Note, Area::Extrinsics, title, evidence, "check again when it is corrected");
    }
    rotations.iter().filter(|rotation| !broken.contains(&rotation.camera_key)).cloned().collect()
}

/// Measured images of a camera.
struct Content<'a> {
    key: &'a str,
    content: &'a ContentSurvey,
}

impl Content<'_> {
    /// Images that show a fault, if they are enough of those between them.
    fn faulty(&self, is_faulty: impl Fn(&ImageContent) -> bool) -> Option<Vec<&ImageContent>> {
        let images: Vec<&ImageContent> = self.content.images().collect();
        let places: Vec<usize> = (0..images.len()).filter(|place| is_faulty(images[*place])).collect();
        let (first, last) = (places.first()?, places.last()?);
        let is_enough = places.len() >= MIN_IMAGES && places.len() * MOST_ONE_IN > last - first;
        is_enough.then(|| places.iter().map(|place| images[*place]).collect())
    }

    /// Number of images out of all measured ones: `17 of 24 images`.
    fn out_of(&self, count: usize) -> String {
        format!("{count} of {}", counted(self.content.images().count(), "image"))
    }

    fn check_bytes(&self, findings: &mut Findings) -> bool {
        let encoding = self.content.encoding.as_str();
        let is_yuv = encoding.starts_with("yuv") || encoding.starts_with("uyvy");
        let is_exchanged = |image: &ImageContent| {
            image.orders.is_some_and(|[stored, exchanged]| {
                if is_yuv {
                    stored.sigma < CHROMA_RATIO * exchanged.sigma
                } else {
                    exchanged.roughness < ROUGHER_RATIO * stored.roughness
                }
            })
        };
        let Some(images) = self.faulty(is_exchanged) else { return false };
        let value = |order: usize, pick: fn(&ValueSpread) -> f64| {
            median(images.iter().filter_map(|image| Some(pick(&image.orders?[order])))).unwrap_or(0.0)
        };
        let (key, of_images) = (self.key, self.out_of(images.len()));
        let texts = if is_yuv {
            let other = if encoding.contains("yuy") { "yuv422 (U Y V Y)" } else { "yuv422_yuy2 (Y U Y V)" };
            [
                format!("the images of {key} show colour in place of brightness: luma and chroma are exchanged"),
                format!(
                    "values read as brightness have σ {:.0}, those read as colour {:.0} grey levels, in {of_images}",
                    value(0, |it| it.sigma),
                    value(1, |it| it.sigma)
                ),
                format!("set the encoding to {other} instead of {encoding} in the driver"),
            ]
        } else {
            let remedy = if encoding.is_empty() {
                "exchange both bytes of each value before the images are compressed: PNG is big-endian"
            } else {
                "correct is_bigendian of the image messages, or exchange both bytes of each value"
            };
            [
                format!("both bytes of the 16-bit values of {key} are exchanged"),
                format!(
                    "neighbouring pixels differ by {:.2} of what unrelated ones do, by {:.2} with the bytes exchanged, in \
                     {of_images}",
                    value(0, |it| it.roughness.sqrt()),
                    value(1, |it| it.roughness.sqrt())
                ),
                remedy.to_owned(),
            ]
        };
        report(Severity::Error, texts, &images, findings);
        true
    }

    fn check_mosaic(&self, findings: &mut Findings) -> bool {
        let Some(images) = self.faulty(|image| image.phases.is_some_and(|phases| is_mosaic(&phases))) else {
            return false;
        };
        let of = |pick: &dyn Fn(&PhaseContrast) -> f64| {
            median(images.iter().filter_map(|image| Some(pick(image.phases.as_ref()?)))).unwrap_or(0.0)
        };
        let [columns, rows, diagonals] = [0, 1, 2].map(|axis| of(&|phases| phases.contrast[axis]));
        let agreement = of(&|phases| phases.agreement.iter().copied().fold(0.0, f64::max));
        // Pixels from left to right, then the row below.
        let gains = [
            1.0 + columns + rows + diagonals,
            1.0 - columns + rows - diagonals,
            1.0 + columns - rows - diagonals,
            1.0 - columns - rows + diagonals,
        ];
        let brightest = gains.iter().copied().fold(0.0, f64::max);
        let [a, b, c, d] = gains.map(|gain| gain / brightest);
        let (of_first, of_second) = ((a - d).abs(), (b - c).abs());
        let green_first =
            if (of_first - of_second).abs() > GREEN_DIFFERENCE { of_first < of_second } else { a + d > b + c };
        let patterns = if green_first { ["grbg", "gbrg"] } else { ["rggb", "bggr"] };
        let encoding = self.content.encoding.as_str();
        let evidence = format!(
            "the four pixels of 2×2 have relative gains of {a:.2} {b:.2} and, in the row below, {c:.2} {d:.2} in {}, with one \
             sign in {:.0} % of their regions",
            self.out_of(images.len()),
            100.0 * agreement
        );
        let names = |bits: &str| patterns.map(|pattern| format!("bayer_{pattern}{bits}")).join(" or ");
        let texts = if encoding.starts_with("bayer_") {
            let title = format!("the encoding of {} names another mosaic of colours than its images have", self.key);
            [title, evidence, format!("{encoding} is stated: set the encoding to the pattern of the sensor")]
        } else {
            let title = format!("the images of {} are the mosaic of a colour sensor, not grey values", self.key);
            let remedy = if encoding.is_empty() {
                format!("convert the mosaic ({}) to grey before the images are compressed", patterns.join(" or "))
            } else {
                let bits = if encoding.contains("16") { "16" } else { "8" };
                format!("set the encoding to {} instead of {encoding} in the driver, or convert to grey", names(bits))
            };
            [title, evidence, remedy]
        };
        report(Severity::Error, texts, &images, findings);
        true
    }

    fn check_fields(&self, findings: &mut Findings) -> bool {
        // Rows that were doubled have a constant displacement down.
        let Some(constant_px) = median(self.content.images().filter_map(|image| Some(image.fields?.down_px))) else {
            return false;
        };
        let displacement_px = |image: &ImageContent| {
            let fields = image.fields?;
            let along = [fields.across_px, (fields.down_px - constant_px).abs()];
            let is_significant = |axis: &usize| fields.significant[*axis] > INTERLACED_REGIONS;
            let largest = (0..along.len()).filter(is_significant).map(|axis| along[axis]).fold(0.0, f64::max);
            (largest > INTERLACED_PX).then_some(largest)
        };
        // They show only while the camera moves.
        let images: Vec<&ImageContent> =
            self.content.images().filter(|image| displacement_px(image).is_some()).collect();
        if images.len() < MIN_IMAGES {
            return false;
        }
        let largest_px = images.iter().filter_map(|image| displacement_px(image)).fold(0.0, f64::max);
        let changes = || self.content.images().filter_map(|image| image.change.as_ref());
        let [from_odd, from_even]: [f64; 2] =
            [0, 1].map(|order| changes().map(|change| change.between_fields[order]).sum());
        let count = changes().count().max(1) as f64;
        let later = if from_odd < EARLIER_RATIO * from_even {
            "odd rows are the later ones"
        } else if from_even < EARLIER_RATIO * from_odd {
            "even rows are the later ones"
        } else {
            "which rows are later is not known"
        };
        let title = format!("the images of {} are interlaced: odd and even rows show two instants", self.key);
        let evidence = format!(
            "odd rows are displaced by up to {largest_px:.1} px against the rows around them, in {} while the camera moves; \
             {later}: odd rows differ from the even ones of the next image by {:.1} grey levels, even from odd ones by {:.1}",
            self.out_of(images.len()),
            from_odd / count,
            from_even / count
        );
        let remedy = "set camera or grabber to progressive scan; of a recording use every second row, with resolution, fy and \
                      cy for half of the rows";
        report(Severity::Error, [title, evidence, remedy.to_owned()], &images, findings);
        true
    }

    fn check_parts(&self, findings: &mut Findings) -> bool {
        let title = format!("images of {} are torn: a part of them belongs to another image", self.key);
        let remedy =
            "the driver passes a buffer on while it is filled: wait for the end of the image, or use more buffers";
        let changing =
            |image: &&ImageContent| image.change.as_ref().is_some_and(|change| change.elsewhere_grey > CHANGED_GREY);
        let repeats = |image: &&ImageContent| {
            let Some(change) = image.change.as_ref() else { return false };
            let rows = change.repeated.as_ref().map_or(0, |rows| rows.clone().count());
            rows as f64 >= REPEATED_ROWS * change.height as f64
        };
        let all: Vec<&ImageContent> = self.content.images().filter(changing).collect();
        let (mut torn, whole): (Vec<&ImageContent>, Vec<&ImageContent>) =
            all.iter().copied().partition(|image| repeats(image));
        // The vehicle in view and what is drawn over the images hardly change at any time.
        torn.retain(|image| {
            let rows = image.change.as_ref().and_then(|change| change.repeated.as_ref());
            let usual = |rows| median(whole.iter().filter_map(|it| Some(it.change.as_ref()?.around_grey(rows))));
            rows.and_then(usual).is_some_and(|usual| usual > CHANGED_GREY)
        });
        if torn.len() >= MIN_TORN && (torn.len() as f64) < MOST_REPEATED * all.len() as f64 {
            let example = torn.iter().find_map(|image| {
                let change = image.change.as_ref()?;
                let rows = change.repeated.as_ref()?;
                Some(format!("rows {} to {} of {}", rows.start(), rows.end(), change.height))
            });
            let elsewhere = median(torn.iter().filter_map(|image| Some(image.change.as_ref()?.elsewhere_grey)));
            let evidence = format!(
                "a part of {} of {} equals the image before to the bit, such as {}, while the other rows change by {:.1} grey \
                 levels",
                torn.len(),
                counted(all.len(), "image"),
                example.unwrap_or_default(),
                elsewhere.unwrap_or(0.0)
            );
            report(Severity::Error, [title, evidence, remedy.to_owned()], &torn, findings);
            return true;
        }
        // Groups of images with a seam, and its displacements, by row.
        let mut seams: BTreeMap<usize, (BTreeSet<usize>, BTreeSet<i32>)> = BTreeMap::new();
        for (number, group) in self.content.groups.iter().enumerate() {
            let is_changing = group.iter().any(|image| changing(&image));
            for seam in group.iter().filter_map(|image| image.seam).filter(|_| is_changing) {
                let (groups, shifts) = seams.entry(seam.row).or_default();
                groups.insert(number);
                shifts.insert(seam.shift_px);
            }
        }
        let Some((row, (groups, shifts))) = seams.iter().max_by_key(|(_, (groups, _))| groups.len()) else {
            return false;
        };
        // The joints of a wall have one displacement, a torn image follows the motion.
        let (Some(least_px), Some(most_px)) = (shifts.first(), shifts.last()) else { return false };
        if groups.len() < SEAM_GROUPS || shifts.len() < SEAM_SHIFTS {
            return false;
        }
        let at_row = |image: &&ImageContent| image.seam.is_some_and(|seam| seam.row == *row);
        let torn: Vec<&ImageContent> = self.content.images().filter(at_row).collect();
        let evidence = format!(
            "below row {row} they are displaced against the part above by {least_px} to {most_px} px, in {}, in {} of {} \
             groups over the log",
            self.out_of(torn.len()),
            groups.len(),
            self.content.groups.len()
        );
        report(Severity::Error, [title, evidence, remedy.to_owned()], &torn, findings);
        true
    }

    fn check_brightness(&self, findings: &mut Findings) -> bool {
        // Difference of the image in the middle relative to the brighter ones, for groups that alternate.
        let alternation = |group: &Vec<ImageContent>| {
            let [first, middle, last] = group.as_slice() else { return None };
            let around = 0.5 * (first.mean_grey + last.mean_grey);
            let difference = middle.mean_grey - around;
            let change = 0.5 * (last.mean_grey - first.mean_grey).abs();
            let ratio = difference.abs() / around.max(middle.mean_grey).max(1.0);
            (ratio > ALTERNATING && difference.abs() > ALTERNATING_RATIO * change).then_some(ratio)
        };
        let groups = &self.content.groups;
        let found: Vec<(usize, f64)> =
            groups.iter().enumerate().filter_map(|(number, group)| Some((number, alternation(group)?))).collect();
        let (Some((first, _)), Some((last, _))) = (found.first(), found.last()) else { return false };
        if found.len() < MIN_IMAGES || found.len() * MOST_ONE_IN <= last - first {
            return false;
        }
        let ratio = median(found.iter().map(|(_, ratio)| *ratio)).unwrap_or(0.0);
        let title =
            format!("the exposure of {} alternates: every second image is {:.0} % darker", self.key, 100.0 * ratio);
        let example = groups[*first].iter().map(|image| format!("{:.0}", image.mean_grey)).collect::<Vec<_>>();
        let evidence = format!(
            "in {} of {} groups of three images, mean grey values such as {}",
            found.len(),
            groups.len(),
            example.join(", ")
        );
        let remedy = "use one exposure, gain and light for all images, or record each exposure under its own topic: the \
                      tracker assumes constant brightness";
        let images: Vec<&ImageContent> = groups[*first..=*last].iter().flatten().collect();
        report(Severity::Warning, [title, evidence, remedy.to_owned()], &images, findings);
        true
    }
}

/// Adds a finding with title, evidence and remedy that holds from the first to the last of some images.
fn report(severity: Severity, texts: [String; 3], images: &[&ImageContent], findings: &mut Findings) {
    let [title, evidence, remedy] = texts;
    findings.add(severity, Area::Images, title, evidence, remedy);
    findings.state_interval(images.iter().map(|image| image.stamp_ns));
}

/// True for the contrasts of a mosaic: of both diagonals, or of the columns as well as the rows.
fn is_mosaic(phases: &PhaseContrast) -> bool {
    let [columns, rows, diagonals] = [0, 1, 2]
        .map(|axis| phases.contrast[axis].abs() > MOSAIC_CONTRAST && phases.agreement[axis] > MOSAIC_AGREEMENT);
    diagonals || (columns && rows)
}
