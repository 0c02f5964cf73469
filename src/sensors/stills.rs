//! Still images of known points, taken by a camera on a gimbal and by rigid cameras, with joint readings and without IMU.

use nalgebra::{Vector2, Vector3};

use crate::camera::CameraModel;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, ParameterNames};

/// Images of several camera poses, the joint readings at them, and the chain as it is known before.
///
/// The frame of the first rigid camera stands in for the IMU frame: `imu_from_…` of the chain maps into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stills {
    pub name: String,
    /// Names of the joints from the base outwards.
    pub joints: Vec<String>,
    pub gimbal_camera: StillCamera,
    /// Rigid cameras, at least one.
    pub rigid_cameras: Vec<StillCamera>,
    /// Chain before the calibration.
    pub initial: StillsChain,
    /// Images in the order in which they were taken.
    pub sets: Vec<StillSet>,
}

impl Stills {
    /// Names of calibration parameters: links by their joints, rigid cameras after the first one by their names.
    pub fn parameter_names(&self) -> ParameterNames {
        let further = self.rigid_cameras.iter().skip(1);
        ParameterNames { joints: self.joints.clone(), cameras: further.map(|camera| camera.name.clone()).collect() }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct StillCamera {
    pub name: String,
    /// Model of the measured pixels.
    pub model: CameraModel,
}

/// Chain of the gimbal camera, with the poses of the rigid cameras relative to the first one.
#[derive(Clone, Debug, PartialEq)]
pub struct StillsChain {
    pub chain: ClassicalChain,
    /// `camera_from_first` of each rigid camera after the first one.
    pub further_from_first: Vec<RigidTransform>,
}

impl StillsChain {
    /// `camera_from_first` of a rigid camera, the identity for the first one.
    pub fn rigid_from_first(&self, camera: usize) -> RigidTransform {
        let further = camera.checked_sub(1).and_then(|index| self.further_from_first.get(index));
        further.copied().unwrap_or_else(RigidTransform::identity)
    }
}

/// Images of all cameras at one pose of the vehicle and one reading of the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct StillSet {
    pub id: u64,
    /// Place from which the set was taken: errors of the map are common to its sets.
    pub station: u64,
    /// One reading per joint, in radians.
    pub joint_readings_rad: Vec<f64>,
    pub gimbal: StillView,
    /// Views of the rigid cameras in the order of [`Stills::rigid_cameras`], `None` without an image; at least one.
    pub rigid: Vec<Option<StillView>>,
}

/// Points that one camera sees in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct StillView {
    /// `camera_from_world` as it was given, if it was.
    pub camera_from_world: Option<RigidTransform>,
    pub points: Vec<MapPoint>,
}

/// Known point with its measured pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    pub point_in_world_m: Vector3<f64>,
    pub uv_px: Vector2<f64>,
}
