//! Camera values that a rig file may omit because the log has them.

use super::camera_info::PublishedCamera;

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
pub(super) struct NoFacts;

impl CameraFacts for NoFacts {
    fn published(&self, _image_topic: &str) -> Result<PublishedCamera, String> {
        Err("there is no log to take them from".into())
    }

    fn rate_hz(&self, _image_topic: &str) -> Option<f64> {
        None
    }
}
