use nalgebra::{Vector2, Vector3};

/// Identity of a feature over its entire track.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FeatureId(pub u64);

/// Offset between the ids of two cameras, larger than the number of features of one.
const IDS_PER_CAMERA: u64 = 1_000_000_000;

impl FeatureId {
    /// Id that is unique among cameras: `id + 10⁹·camera`.
    pub fn of_camera(self, camera: usize) -> Self {
        Self(self.0 + camera as u64 * IDS_PER_CAMERA)
    }

    /// Number of the camera given to [`Self::of_camera`].
    pub fn camera(self) -> usize {
        (self.0 / IDS_PER_CAMERA) as usize
    }
}

/// Observation of one feature in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedFeature {
    pub id: FeatureId,
    /// Number of consecutive images before this one with an observation; 0 for a new feature.
    pub age: u32,
    /// Position in the distorted image, in pixels.
    pub uv_px: Vector2<f64>,
    /// Position in the previous image, in pixels; `None` for a new feature.
    pub previous_uv_px: Option<Vector2<f64>>,
    /// Direction in the camera frame, unit length.
    pub bearing: Vector3<f64>,
}

impl TrackedFeature {
    /// Observation in a view; `None` unless pixel and bearing are finite.
    pub(crate) fn seen_in<View>(&self, view: View) -> Option<ObservedPixel<View>> {
        let Self { uv_px, bearing, .. } = *self;
        let is_finite = bearing.iter().chain(&uv_px).all(|value| value.is_finite());
        is_finite.then_some(ObservedPixel { view, uv_px, bearing })
    }
}

/// Observation of a landmark in a view: the slot of a frame, or the frame set and camera of an offline calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ObservedPixel<View> {
    pub(crate) view: View,
    pub(crate) uv_px: Vector2<f64>,
    /// Measured unit bearing in the camera.
    pub(crate) bearing: Vector3<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrontEndStatistics {
    /// Features tracked from the previous image and kept.
    pub tracked: usize,
    pub detected: usize,
    /// Number lost by the Lucas–Kanade tracker or its forward–backward check.
    pub lost: usize,
    /// Number rejected as geometric outliers.
    pub rejected: usize,
    /// Mean parallax of the tracked features to the previous image, camera rotation removed, in pixels.
    pub mean_parallax_px: f64,
    /// Median length of the tracked features' motion in the image, in pixels.
    pub median_flow_px: f64,
}

/// All features of one image, ordered by id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackedFrame {
    /// Header stamp of the image since the start of the log.
    pub stamp_ns: i64,
    pub features: Vec<TrackedFeature>,
    /// Observations of some of the features in the image of the other camera of a stereo pair at the same moment, ordered by
    /// id; empty without one.
    pub matched: Vec<TrackedFeature>,
    pub statistics: FrontEndStatistics,
}
