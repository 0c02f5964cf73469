use nalgebra::{Vector2, Vector3};

/// Identity of a feature over its whole life in one camera's stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FeatureId(pub u64);

/// More than a camera finds: the ids of the next camera begin there.
const IDS_PER_CAMERA: u64 = 1_000_000_000;

impl FeatureId {
    /// The same feature told apart from those of other cameras; ids of camera 0 stay as they are.
    pub fn of_camera(self, camera: usize) -> Self {
        Self(self.0 + camera as u64 * IDS_PER_CAMERA)
    }

    /// Number of the camera that [`Self::of_camera`] has named.
    pub fn camera(self) -> usize {
        (self.0 / IDS_PER_CAMERA) as usize
    }
}

/// One feature in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedFeature {
    /// Who it is.
    pub id: FeatureId,
    /// In how many images before this one it was seen without a gap; 0 for a new one.
    pub age: u32,
    /// Where it is, in pixels of the distorted image.
    pub uv_px: Vector2<f64>,
    /// Where it was in the image before, `None` for a new one.
    pub previous_uv_px: Option<Vector2<f64>>,
    /// Its direction in the camera frame, unit length.
    pub bearing: Vector3<f64>,
}

/// What the front end did with one image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrontEndStatistics {
    /// Features tracked from the image before and kept.
    pub tracked: usize,
    /// Features newly found.
    pub detected: usize,
    /// Lost by the Lucas–Kanade tracker or its forward–backward check.
    pub lost: usize,
    /// Rejected as geometric outliers.
    pub rejected: usize,
    /// Mean parallax of the tracked ones against the image before, their common rotation removed, in pixels.
    pub mean_parallax_px: f64,
    /// Median length of the tracked ones' motion in the image, in pixels.
    pub median_flow_px: f64,
}

/// All features of one image, ordered by id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackedFrame {
    /// Header stamp of the image since the log began.
    pub stamp_ns: i64,
    /// The features, ordered by id.
    pub features: Vec<TrackedFeature>,
    /// Counts.
    pub statistics: FrontEndStatistics,
}
