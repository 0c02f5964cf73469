//! Calibration columns in addition to the chain: time offsets, shutter and intrinsics of a camera.

use crate::camera::CameraModel;
use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::sensors::IntrinsicsSigma;

/// Scalar parameter, estimated relative to the rig's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SensorColumn {
    pub(crate) parameter: ParameterId,
    /// Rig's value, in the unit of the parameter's dimension.
    pub(crate) given: f64,
    /// Prior standard deviation, in the same unit.
    pub(crate) sigma: f64,
}

/// Prior standard deviation of a time offset relative to the rig, in seconds: transport and exposure delay an
/// image by a frame period at most.
const CLOCK_SIGMA_S: f64 = 0.02;
/// Prior standard deviation of a readout time for which the rig has none, in seconds: shutters read an image in 5 to 35
/// ms.
const READOUT_SIGMA_S: f64 = 0.02;
/// Prior standard deviation of each component of the rotation of an IMU on the gimbal relative to the rig, in radians:
/// boards are soldered and screwed to within a degree.
const GIMBAL_IMU_ROTATION_SIGMA_RAD: f64 = 0.02;
/// Prior standard deviation of each component of the position of an IMU on the gimbal relative to the rig, in metres: a
/// board within a camera's housing is known to its half.
const GIMBAL_IMU_TRANSLATION_SIGMA_M: f64 = 0.02;
/// Prior of intrinsics for which the rig has none: the uncertainty of a target calibration that is used at another
/// focus.
const INTRINSICS_SIGMA: IntrinsicsSigma = IntrinsicsSigma { focal_ratio: 0.02, centre_px: 10.0, distortion: 0.03 };

impl SensorColumn {
    pub(crate) fn camera_clock(given_timeshift_s: f64) -> Self {
        Self { parameter: ParameterId::timeshift(0), given: given_timeshift_s, sigma: CLOCK_SIGMA_S }
    }

    pub(crate) const ENCODER_CLOCK: Self =
        Self { parameter: ParameterId::ENCODER_TIMESHIFT, given: 0.0, sigma: CLOCK_SIGMA_S };

    pub(crate) fn readout(given_s: f64, sigma_s: Option<f64>) -> Self {
        Self { parameter: ParameterId::readout(0), given: given_s, sigma: sigma_s.unwrap_or(READOUT_SIGMA_S) }
    }

    /// Orientation of the IMU on the gimbal, as a rotation vector relative to the rig's, its position relative to the
    /// rig's in the camera's frame, and its time offset.
    pub(crate) fn gimbal_imu(given_timeshift_s: f64) -> Vec<Self> {
        let pose = Quantity::TRANSFORM.map(|quantity| Self {
            parameter: ParameterId { part: ParameterPart::GimbalImu, quantity },
            given: 0.0,
            sigma: if Quantity::ROTATION.contains(&quantity) {
                GIMBAL_IMU_ROTATION_SIGMA_RAD
            } else {
                GIMBAL_IMU_TRANSLATION_SIGMA_M
            },
        });
        let shift =
            Self { parameter: ParameterId::GIMBAL_IMU_TIMESHIFT, given: given_timeshift_s, sigma: CLOCK_SIGMA_S };
        pose.into_iter().chain([shift]).collect()
    }

    /// Intrinsics of a camera: focal lengths, principal point, and the first distortion coefficients if the lens model
    /// has any.
    pub(crate) fn intrinsics(model: &CameraModel, sigma: Option<IntrinsicsSigma>) -> Vec<Self> {
        let sigma = sigma.unwrap_or(INTRINSICS_SIGMA);
        let column = |(place, quantity): (usize, Quantity)| {
            let given = model.intrinsics()[place];
            let sigma = match quantity {
                Quantity::Fx | Quantity::Fy => sigma.focal_ratio * given,
                Quantity::Cx | Quantity::Cy => sigma.centre_px,
                _ => sigma.distortion,
            };
            Self { parameter: ParameterId { part: ParameterPart::Camera(0), quantity }, given, sigma }
        };
        let quantities = Quantity::INTRINSICS.into_iter().enumerate();
        quantities.take(model.intrinsic_count()).map(column).collect()
    }
}
