//! Camera models by `CameraInfo`: intrinsics of the sensor, region of interest and binning of its images.

use super::super::FlightLog;
use super::super::messages::{self, CameraInfoMessage, MessageKind};
use crate::camera::CameraModel;
use crate::files::rig::camera_facts::{PublishedCamera, SensorWindow};
use crate::flight_log::images::decoding::image_size;

/// Number of unreadable images after which a topic's size is unknown; a video begins with a keyframe among them.
const MOST_TRIED: usize = 300;

/// Region and binning of a message; a region without a size ends at the end of the sensor.
fn window_of(info: &CameraInfoMessage) -> Result<SensorWindow, String> {
    let sensor_px = [info.width, info.height];
    let axis = |axis: usize| {
        let (offset, size) = (info.region_offset_px[axis], info.region_size_px[axis]);
        let size = if size == 0 { sensor_px[axis].saturating_sub(offset) } else { size };
        let fits = size > 0 && offset.checked_add(size).is_some_and(|end| end <= sensor_px[axis]);
        let binning = info.binning_px[axis].max(1);
        (fits && size >= binning).then_some([offset, size, binning])
    };
    let ([x, width, across], [y, height, down]) = axis(0).zip(axis(1)).ok_or_else(|| {
        let ([x, y], [width, height], [across, down]) = (info.region_offset_px, info.region_size_px, info.binning_px);
        format!(
            "its region of interest (roi) of {width}×{height} pixels at ({x}, {y}) with binning {across}×{down} is no \
             part of its {}×{} pixels",
            info.width, info.height
        )
    })?;
    let is_cropped = [width, height] != sensor_px;
    Ok(SensorWindow { offset_px: [x, y], size_px: [width, height], binning_px: [across, down], is_cropped })
}

/// Camera of a message whose images have a size, if it is known. Region and binning apply if the images agree with
/// them: some drivers state a binning with intrinsics that are binned already.
fn camera_of(info: &CameraInfoMessage, image_px: Option<[usize; 2]>) -> Result<PublishedCamera, String> {
    let sensor = model_of(info)?;
    let stated = window_of(info)?;
    let candidates = [stated, stated.without_binning()];
    let agrees = |window: &&SensorWindow| image_px.is_none_or(|image_px| window.image_px() == image_px);
    let window = match candidates.iter().find(agrees) {
        Some(window) => Some(*window),
        None if image_px == Some(sensor.resolution_px) => None,
        None => Some(stated),
    };
    let window = window.filter(|window| !window.is_whole());
    let image = window.map_or_else(|| sensor.clone(), |window| window.applied_to(&sensor));
    Ok(PublishedCamera { sensor, window, image })
}

impl FlightLog {
    /// Camera of an image topic by the `camera_info` next to `beside`, by convention published in its namespace:
    /// `/ns/image_raw/compressed` → `/ns/camera_info`.
    pub(crate) fn published_camera(&self, image_topic: &str, beside: &str) -> Result<PublishedCamera, String> {
        let mut parent = beside;
        let mut tried = Vec::new();
        while let Some((upper, _)) = parent.rsplit_once('/') {
            parent = upper;
            let topic = format!("{parent}/camera_info");
            if self.topic(&topic).is_some_and(|info| info.kind == Some(MessageKind::CameraInfo)) {
                let info = self.find_message(&topic, |data| messages::read_camera_info(data).ok());
                let info = info.ok_or_else(|| format!("no readable message on {topic}"))?;
                let published = camera_of(&info, self.image_size(image_topic));
                return published.map_err(|problem| format!("{topic}: {problem}"));
            }
            tried.push(topic);
        }
        Err(format!("the log has none of {}", tried.join(", ")))
    }

    /// Width and height of the first readable image of a topic in pixels.
    pub(crate) fn image_size(&self, topic: &str) -> Option<[usize; 2]> {
        let kind = self.topic(topic)?.kind.filter(|kind| kind.is_image())?;
        let mut tried = 0;
        self.find_message(topic, |data| {
            tried += 1;
            let size = image_size(kind, data, self.file().limits());
            (size.is_some() || tried == MOST_TRIED).then_some(size)
        })?
    }
}

/// Camera model of the whole sensor.
fn model_of(info: &CameraInfoMessage) -> Result<CameraModel, String> {
    let k = &info.intrinsic_matrix;
    let intrinsics_px = [k[0], k[4], k[2], k[5]];
    if !(intrinsics_px.iter().all(|value| value.is_finite()) && k[0] > 0.0 && k[4] > 0.0) {
        return Err("matrix K is not set".into());
    }
    if info.width == 0 || info.height == 0 {
        return Err("its width and height are not set".into());
    }
    let resolution_px = [info.width, info.height];
    let coefficients = info.distortion.as_slice();
    let (name, coefficients) = match (info.distortion_model.as_str(), coefficients) {
        (_, coefficients) if coefficients.iter().all(|value| *value == 0.0) => ("none", &[][..]),
        ("plumb_bob" | "radtan", [_, _, _, _] | [_, _, _, _, _]) => ("plumb_bob", coefficients),
        // They are followed by OpenCV's coefficients of the thin prism and the tilted sensor, which are not modelled.
        ("rational_polynomial", coefficients)
            if matches!(coefficients.len(), 8 | 12 | 14) && coefficients[8..].iter().all(|value| *value == 0.0) =>
        {
            ("rational_polynomial", &coefficients[..8])
        }
        ("equidistant" | "fisheye", [_, _, _, _]) => ("equidistant", coefficients),
        (other, coefficients) => {
            return Err(format!(
                "distortion '{other}' with {} coefficients, expected plumb_bob (4 or 5), rational_polynomial (8) or equidistant (4)",
                coefficients.len()
            ));
        }
    };
    CameraModel::from_kalibr("pinhole", &intrinsics_px, name, coefficients, resolution_px)
        .map_err(|error| error.to_string())
}
