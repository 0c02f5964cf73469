//! `mask` of a camera: a PNG next to the rig file, or attached to the log like the rig itself.

use std::fs::File;
use std::io::Read as _;
use std::path::{Component, Path};

use image::ImageFormat;

use super::camera_facts::{CameraFacts, PublishedCamera};
use super::fields::Field;
use crate::files::image_file::decode_within;
use crate::files::{FileError, LogLimits};
use crate::sensors::{CameraMask, GrayImage, ImageMask};

/// Largest file of a mask in bytes.
const MAX_MASK_BYTES: u64 = 64 << 20;

/// Facts of a log, and the files in the folder of a rig.
pub(crate) struct InFolder<'a> {
    pub(crate) facts: &'a dyn CameraFacts,
    pub(crate) folder: &'a Path,
}

impl CameraFacts for InFolder<'_> {
    fn published(&self, image_topic: &str) -> Result<PublishedCamera, String> {
        self.facts.published(image_topic)
    }

    fn rate_hz(&self, image_topic: &str) -> Option<f64> {
        self.facts.rate_hz(image_topic)
    }

    fn file_beside_rig(&self, name: &str) -> Result<Vec<u8>, String> {
        // Only names within the rig's folder are accepted, since a rig may come from elsewhere.
        if !Path::new(name).components().all(|part| matches!(part, Component::Normal(_))) {
            return Err("expected a file in the folder of the rig".into());
        }
        let path = self.folder.join(name);
        if !path.is_file() {
            return Err(format!("no such file: {}", path.display()));
        }
        let cannot = |error: std::io::Error| format!("{error}: {}", path.display());
        let file = File::open(&path).map_err(cannot)?;
        let mut bytes = Vec::new();
        file.take(MAX_MASK_BYTES + 1).read_to_end(&mut bytes).map_err(cannot)?;
        if bytes.len() as u64 > MAX_MASK_BYTES {
            return Err(format!("more than {MAX_MASK_BYTES} bytes: {}", path.display()));
        }
        Ok(bytes)
    }
}

/// Reads the mask of a camera, `None` if the rig has no mask.
pub(crate) fn read(
    camera: &Field<'_>,
    resolution_px: [usize; 2],
    facts: &dyn CameraFacts,
) -> Result<Option<CameraMask>, FileError> {
    let Some(field) = camera.field("mask").optional() else { return Ok(None) };
    let file = field.text("the name of a PNG image next to the rig")?;
    let bytes = facts.file_beside_rig(file).map_err(|problem| field.error(format!("names '{file}': {problem}")))?;
    let decoded = decode_within(&bytes, ImageFormat::Png, &LogLimits::default(), None);
    let gray =
        decoded.map_err(|problem| field.error(format!("names '{file}', which is not a readable PNG: {problem}")))?;
    let gray = gray.into_luma8();
    let [width, height] = [gray.width() as usize, gray.height() as usize];
    if [width, height] != resolution_px {
        let [expected_width, expected_height] = resolution_px;
        return Err(field.error(format!(
            "names '{file}' of {width}×{height} pixels, expected the resolution of the camera, {expected_width}×{expected_height}"
        )));
    }
    let image = ImageMask::from_image(&GrayImage { width, height, pixels: gray.into_raw() });
    Ok(Some(CameraMask { file: file.to_owned(), image }))
}
