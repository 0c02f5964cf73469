//! Offset and drift between the clock of a camera and the clock of an IMU or of a gimbal's attitude, from the rotations
//! that both measure.
//!
//! The angular speeds, which do not depend on the extrinsics, are correlated over all offsets of the search. Each of
//! the best offsets is then refined by least squares on the rotation vectors: offset, drift, the constant rotation from
//! the reference to the camera, the bias of a gyroscope, and a scale, because a wrong focal length scales the rotations
//! measured from images.

mod coarse;
mod references;
mod refinement;
mod series;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

pub use self::references::{AlignmentReference, align_camera};
pub(super) use self::refinement::BIAS_SIGMA_RAD_PER_S;
pub use self::refinement::ClockAlignment;
use self::refinement::Refined;
pub(super) use self::refinement::SCALE_SIGMA;
pub use self::series::RotationReference;
use self::series::{DISTINCT_S, MIN_ROTATIONS, PairRotation};
use super::report::ImageRotation;
use super::statistics::median;
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};

/// Minimum median rotation between two images; below it the noise of the images dominates.
const MIN_ROTATION_RAD: f64 = 0.001;
/// Minimum ratio of the squared rotations that the reference explains.
const MIN_EXPLAINED: f64 = 0.6;
/// Minimum ratio of the unexplained rotations of the next offset to the unexplained rotations of the best one.
const MIN_DISTINCTION: f64 = 1.5;
/// Lengths over which rotations of consecutive images are composed, in seconds, for a noisy reference: from one image
/// to the next a stabilized camera rotates too little.
const NOISY_LENGTHS_S: [f64; 2] = [0.3, 0.6];
/// An image rotation is an outlier if it differs from its neighbours by this many times the median.
const OUTLIER_RATIO: f64 = 8.0;

/// Smallest reported time offset of a camera: a twelfth of the image interval at 20 Hz; rolling shutter and exposure shift
/// stamps by less.
pub(super) const OFFSET_TOLERANCE_S: f64 = 0.004;
/// Tolerated error of an orientation; smaller ones are estimated.
pub(super) const ORIENTATION_TOLERANCE_RAD: f64 = 0.07;
/// Smallest reported error of the scale: gyroscopes and focal lengths are known to a percent.
pub(super) const SCALE_TOLERANCE: f64 = 0.02;

/// Reason that two clocks cannot be aligned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AlignmentError {
    #[error("only {found} rotations between images could be measured, {MIN_ROTATIONS} are needed")]
    TooFewRotations {
        /// Number of image rotations.
        found: usize,
    },
    /// The camera does not rotate.
    #[error(
        "the camera rotates by {rotation_deg:.3}° from image to image in the median, which is too little to compare"
    )]
    TooLittleRotation { rotation_deg: f64 },
    /// Images and reference do not overlap at any offset of the search.
    #[error("within ±{search_s:.0} s no offset lets at least {MIN_ROTATIONS} image rotations overlap with it")]
    NoOverlap {
        /// Half the range of the search.
        search_s: f64,
    },
    #[error(
        "the best offset, {offset_s:+.2} s, explains {:.0} % of the images' rotation, {:.0} % are needed",
        100.0 * explained,
        100.0 * MIN_EXPLAINED
    )]
    NoAgreement {
        offset_s: f64,
        /// Ratio of the squared rotations that the offset explains.
        explained: f64,
    },
    /// Two offsets explain the rotations almost equally well.
    #[error(
        "it is ambiguous: {offset_s:+.2} s explains {:.1} % of the images' rotation, {next_s:+.2} s explains {:.1} %",
        100.0 * explained,
        100.0 * next_explained
    )]
    Ambiguous {
        offset_s: f64,
        /// Ratio of the squared rotations that the best offset explains.
        explained: f64,
        /// Second best offset in seconds.
        next_s: f64,
        /// Ratio that the second best offset explains.
        next_explained: f64,
    },
}

/// Finds the offset of a camera's clock within ±`search_s` around `guess_s` from the rotations of its images, which are
/// ordered by time.
///
/// # Errors
/// If there are too few rotations, or no single offset explains them.
pub fn align_clocks(
    images: &[ImageRotation],
    reference: &RotationReference,
    guess_s: f64,
    search_s: f64,
) -> Result<ClockAlignment, AlignmentError> {
    if !reference.is_noisy() {
        return align_rotations(&single(images), reference, guess_s, search_s);
    }
    let images = &without_outliers(images);
    let [mut best, longer] =
        NOISY_LENGTHS_S.map(|length_s| align_rotations(&composed(images, length_s), reference, guess_s, search_s));
    let precision = |aligned: &Result<ClockAlignment, AlignmentError>| {
        aligned.as_ref().map_or(f64::INFINITY, |found| found.offset_sigma_s)
    };
    if precision(&longer) < precision(&best) || best.is_err() {
        best = longer;
    }
    best
}

fn single(images: &[ImageRotation]) -> Vec<PairRotation> {
    let measured = |image: &ImageRotation| PairRotation {
        from_ns: image.from_ns,
        to_ns: image.to_ns,
        rotation: so3::log(&image.second_from_first),
        by_shift: Vector3::zeros(),
    };
    images.iter().filter(|image| image.to_ns > image.from_ns).map(measured).collect()
}

/// Image rotations without those that differ from both neighbours much more than usual: one outlier would corrupt every
/// longer rotation that contains it.
fn without_outliers(images: &[ImageRotation]) -> Vec<ImageRotation> {
    let rate = |image: &ImageRotation| {
        so3::log(&image.second_from_first) / seconds_from_ns(image.to_ns - image.from_ns).max(1e-9)
    };
    let rates: Vec<Vector3<f64>> = images.iter().map(rate).collect();
    let distance = |place: usize| {
        let to = |other: Option<&Vector3<f64>>| other.map_or(f64::INFINITY, |other| (other - rates[place]).norm());
        to(place.checked_sub(1).and_then(|before| rates.get(before))).min(to(rates.get(place + 1)))
    };
    let distances: Vec<f64> = (0..rates.len()).map(distance).collect();
    let limit = OUTLIER_RATIO * median(&distances);
    images.iter().zip(&distances).filter(|(_, distance)| **distance <= limit).map(|(image, _)| image.clone()).collect()
}

/// Rotations over at least `length_s`, composed of rotations of consecutive images; each one starts in the middle of
/// the previous one.
fn composed(images: &[ImageRotation], length_s: f64) -> Vec<PairRotation> {
    let half_ns = ns_from_seconds(0.25 * length_s);
    let mut found = Vec::new();
    let mut start = 0;
    while let Some(first) = images.get(start) {
        let mut rotation = first.second_from_first;
        let mut end = start;
        while seconds_from_ns(images[end].to_ns - first.from_ns) < length_s {
            let Some(next) = images.get(end + 1).filter(|next| next.from_ns == images[end].to_ns) else { break };
            rotation = next.second_from_first * rotation;
            end += 1;
        }
        let (from_ns, to_ns) = (first.from_ns, images[end].to_ns);
        if seconds_from_ns(to_ns - from_ns) >= length_s
            && let (Some(before), Some(after)) =
                (mean_rate(images, from_ns, half_ns), mean_rate(images, to_ns, half_ns))
        {
            found.push(PairRotation { from_ns, to_ns, rotation: so3::log(&rotation), by_shift: after - before });
        }
        start += (end - start).div_ceil(2).max(1);
    }
    found
}

/// Mean angular rate of the images around a time; `None` without images there.
fn mean_rate(images: &[ImageRotation], around_ns: i64, half_ns: i64) -> Option<Vector3<f64>> {
    let first = images.partition_point(|image| image.to_ns <= around_ns - half_ns);
    let near = images[first..].iter().take_while(|image| image.from_ns < around_ns + half_ns);
    let (sum, length_s) = near.fold((Vector3::zeros(), 0.0), |(sum, length_s), image| {
        (sum + so3::log(&image.second_from_first), length_s + seconds_from_ns(image.to_ns - image.from_ns))
    });
    (length_s > 0.0).then(|| sum / length_s)
}

fn align_rotations(
    measured: &[PairRotation],
    reference: &RotationReference,
    guess_s: f64,
    search_s: f64,
) -> Result<ClockAlignment, AlignmentError> {
    if measured.len() < MIN_ROTATIONS {
        return Err(AlignmentError::TooFewRotations { found: measured.len() });
    }
    let rotation_rad = median(&measured.iter().map(|pair| pair.rotation.norm()).collect::<Vec<_>>());
    if rotation_rad < MIN_ROTATION_RAD {
        return Err(AlignmentError::TooLittleRotation { rotation_deg: rotation_rad.to_degrees() });
    }
    let correlation = coarse::correlation(measured, reference, guess_s, search_s);
    let mut candidates: Vec<Refined> = coarse::peaks(&correlation)
        .into_iter()
        .filter_map(|offset_s| refinement::refine(measured, reference, offset_s))
        .filter(|refined| (refined.offset_s - guess_s).abs() <= search_s + DISTINCT_S)
        .collect();
    candidates.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    let Some(best) = candidates.first() else { return Err(AlignmentError::NoOverlap { search_s }) };
    let (offset_s, explained) = (best.offset_s, best.explained);
    if explained < MIN_EXPLAINED {
        return Err(AlignmentError::NoAgreement { offset_s, explained });
    }
    let next = candidates.iter().find(|other| (other.offset_s - offset_s).abs() > DISTINCT_S);
    if let Some(next) = next.filter(|next| 1.0 - next.explained < MIN_DISTINCTION * (1.0 - explained)) {
        let (next_s, next_explained) = (next.offset_s, next.explained);
        return Err(AlignmentError::Ambiguous { offset_s, explained, next_s, next_explained });
    }
    let next = next.map(|next| (next.offset_s, next.explained));
    let curve = correlation.iter().map(|at| (at.offset_s, at.correlation)).collect();
    Ok(best.alignment(measured, reference, next, curve))
}
