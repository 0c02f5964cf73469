//! Camera values that a rig file may omit because the log has them.

use std::fmt;

use crate::camera::CameraModel;

/// Values of a log that replace missing values of a rig, by image topic.
pub(crate) trait CameraFacts {
    /// Camera by `CameraInfo`, or the reason why there is none.
    fn published(&self, image_topic: &str) -> Result<PublishedCamera, String>;
    /// Mean rate of the images.
    fn rate_hz(&self, image_topic: &str) -> Option<f64>;
    /// Content of a file of the rig, next to it or attached with it, or the reason why there is none.
    fn file_beside_rig(&self, _name: &str) -> Result<Vec<u8>, String> {
        Err("there is no folder to take it from".into())
    }
}

/// Facts without a log.
pub(crate) struct NoFacts;

impl CameraFacts for NoFacts {
    fn published(&self, _image_topic: &str) -> Result<PublishedCamera, String> {
        Err("there is no log to take them from".into())
    }

    fn rate_hz(&self, _image_topic: &str) -> Option<f64> {
        None
    }
}

/// Part of a sensor in an image: a region, of whose pixels blocks are joined to one pixel of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SensorWindow {
    /// Column and row of the region's first pixel.
    pub(crate) offset_px: [usize; 2],
    /// Width and height of the region.
    pub(crate) size_px: [usize; 2],
    /// Width and height of a block.
    pub(crate) binning_px: [usize; 2],
    /// True if the region is not the whole sensor.
    pub(crate) is_cropped: bool,
}

impl SensorWindow {
    /// Width and height of the images in pixels.
    pub(crate) fn image_px(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.size_px[axis] / self.binning_px[axis])
    }

    pub(crate) fn without_binning(self) -> Self {
        Self { binning_px: [1, 1], ..self }
    }

    /// True if the images have all pixels of the sensor.
    pub(crate) fn is_whole(&self) -> bool {
        !self.is_cropped && self.binning_px == [1, 1]
    }

    /// Model of the images by the model of the sensor. Pixel centres are at whole numbers, so that the first of two
    /// joined pixels is half a pixel before their centre.
    pub(crate) fn applied_to(&self, sensor: &CameraModel) -> CameraModel {
        let [fx, fy, cx, cy] = sensor.intrinsics_px;
        let binning = self.binning_px.map(|side| side as f64);
        let center = |axis: usize, px: f64| (px - self.offset_px[axis] as f64 + 0.5) / binning[axis] - 0.5;
        CameraModel {
            intrinsics_px: [fx / binning[0], fy / binning[1], center(0, cx), center(1, cy)],
            resolution_px: self.image_px(),
            ..sensor.clone()
        }
    }
}

/// `region 320×240 at (100, 50), binning 2×2`.
impl fmt::Display for SensorWindow {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([x, y], [width, height], [across, down]) = (self.offset_px, self.size_px, self.binning_px);
        let comma = if self.is_cropped && self.binning_px != [1, 1] { ", " } else { "" };
        if self.is_cropped {
            write!(out, "region {width}×{height} at ({x}, {y}){comma}")?;
        }
        if self.binning_px != [1, 1] {
            write!(out, "binning {across}×{down}")?;
        }
        Ok(())
    }
}

/// Camera by the `CameraInfo` of a log.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PublishedCamera {
    /// Model of the whole sensor.
    pub(crate) sensor: CameraModel,
    /// Part of the sensor in the images; `None` if it is the whole sensor.
    pub(crate) window: Option<SensorWindow>,
    /// Model of the images.
    pub(crate) image: CameraModel,
}
