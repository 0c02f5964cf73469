//! Masks of cameras as PNG files.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use super::error::ExportError;
use crate::files::output::OutputSet;
use crate::log_check::ProposedMask;
use crate::sensors::{ImageMask, Rig};

/// File name of a camera's mask next to a rig file.
fn file_name(camera_key: &str) -> String {
    format!("{camera_key}.mask.png")
}

/// True if a file of this name may be a mask of a run's rig.
pub(super) fn is_mask_name(name: &str) -> bool {
    name.strip_suffix(".mask.png")
        .and_then(|key| key.strip_prefix("cam"))
        .is_some_and(|number| number.parse::<u32>().is_ok())
}

/// Sets the mask names of a rig to files next to it in a new folder, and returns these files with their content.
pub(crate) fn beside(rig: &mut Rig) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let mut files = Vec::new();
    for camera in &mut rig.cameras {
        if let Some(mask) = &mut camera.mask {
            mask.file = file_name(&camera.key);
            files.push((mask.file.clone(), png(&mask.image)?));
        }
    }
    Ok(files)
}

/// A mask as an 8-bit PNG, white where it is masked.
pub(crate) fn png(mask: &ImageMask) -> Result<Vec<u8>, ExportError> {
    let image = mask.to_image();
    let failed = |source: image::ImageError| ExportError::Write {
        source: std::io::Error::other(source.to_string()),
        path: PathBuf::from("mask"),
    };
    let size = [image.width, image.height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    let mut bytes = Cursor::new(Vec::new());
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &image.pixels, size[0], size[1], image::ExtendedColorType::L8)
        .map_err(failed)?;
    Ok(bytes.into_inner())
}

/// Writes proposed masks into a folder, each as `CAMERA.mask.png`, and returns their paths.
///
/// # Errors
/// If a file cannot be written or, without `force`, exists.
pub fn write_masks(masks: &[ProposedMask], folder: &Path, force: bool) -> Result<Vec<PathBuf>, ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let mut outputs = OutputSet::default();
    let mut paths = Vec::new();
    for proposed in masks {
        let path = folder.join(file_name(&proposed.camera_key));
        if path.exists() && !force {
            return Err(ExportError::Existing { problem: "the mask exists".to_owned(), path });
        }
        outputs.write(&path, &png(&proposed.mask)?).map_err(ExportError::write(&path))?;
        paths.push(path);
    }
    outputs.commit().map_err(ExportError::commit)?;
    Ok(paths)
}
