//! Rig fields of a sensor beyond its model: shutter, uncertain intrinsics, scale and axes of the IMU.

use nalgebra::Matrix3;

use super::fields::Field;
use crate::files::FileError;
use crate::sensors::{ImuIntrinsics, IntrinsicsSigma, KalibrImuMatrices};

/// Longest readout: no video camera reads an image slower; a larger number is given in milliseconds.
const MAX_READOUT_S: f64 = 0.2;
/// Largest standard deviation of focal lengths (ratio) and distortion coefficients.
const MAX_INTRINSICS_RATIO: f64 = 1.0;
/// Largest deviation of a calibrated scale or misalignment from a perfect sensor.
const MAX_IMU_ERROR: f64 = 0.3;

/// Readout of a camera's rows.
pub(crate) struct Shutter {
    /// Time in seconds from the first row to after the last one.
    pub(crate) readout_s: f64,
    /// Standard deviation of `readout_s` in seconds; `None` if the rig states none.
    pub(crate) sigma_s: Option<f64>,
}

/// Reads `readout` and its `readout_sigma`, or Kalibr's `line_delay` in seconds per row.
pub(super) fn read_shutter(camera: &Field<'_>, height_px: usize) -> Result<Shutter, FileError> {
    let [readout, line_delay] = ["readout", "line_delay"].map(|key| camera.field(key));
    let (field, readout_s) = match (readout.is_present(), line_delay.is_present()) {
        (true, true) => {
            let problem = "is given together with readout; expected one of them: readout = line_delay · height";
            return Err(line_delay.error(problem));
        }
        (false, true) => {
            let delay_s = line_delay.number("seconds from one row to the next")?;
            (line_delay, delay_s * height_px as f64)
        }
        (true, false) => {
            let readout_s = readout.number(READOUT)?;
            (readout, readout_s)
        }
        (false, false) => (readout, 0.0),
    };
    if readout_s.abs() > MAX_READOUT_S {
        let problem = format!("a readout of {readout_s} s, expected seconds, at most {MAX_READOUT_S} either way");
        return Err(field.error(problem));
    }
    let sigma = camera.field("readout_sigma").optional();
    let sigma_s = sigma.map(|sigma| {
        let sigma_s = sigma.positive("a standard deviation greater than 0 in seconds")?;
        if sigma_s <= MAX_READOUT_S { Ok(sigma_s) } else { Err(sigma.unexpected("seconds, at most 0.2")) }
    });
    Ok(Shutter { readout_s, sigma_s: sigma_s.transpose()? })
}

const READOUT: &str = "seconds from the first row to the last, negative when read upwards";

pub(super) fn read_intrinsics_sigma(camera: &Field<'_>) -> Result<Option<IntrinsicsSigma>, FileError> {
    let Some(sigma) = camera.field("intrinsics_sigma").optional() else { return Ok(None) };
    let ratio = |key: &str, expected: &str| {
        let field = sigma.field(key);
        let value = field.positive(expected)?;
        if value <= MAX_INTRINSICS_RATIO { Ok(value) } else { Err(field.unexpected(expected)) }
    };
    Ok(Some(IntrinsicsSigma {
        focal_ratio: ratio("focal", "a ratio of the focal length greater than 0, at most 1")?,
        centre_px: sigma.field("centre").positive("a standard deviation greater than 0 in pixels")?,
        distortion: ratio("distortion", "a standard deviation of each coefficient greater than 0, at most 1")?,
    }))
}

/// Reads `gyroscopes` and `accelerometers` in Kalibr's notation; a missing matrix is the identity.
pub(super) fn read_imu_intrinsics<'a>(imu: &Field<'a>) -> Result<ImuIntrinsics, FileError> {
    let (gyroscopes, accelerometers) = (imu.field("gyroscopes"), imu.field("accelerometers"));
    // The same matrices have other names in OpenVINS's files.
    let either = |kalibr: Field<'a>, openvins: &str| kalibr.optional().unwrap_or_else(|| imu.field(openvins));
    let from_imu = either(gyroscopes.field("C_gyro_i"), "R_IMUtoGYRO").optional();
    let kalibr = KalibrImuMatrices {
        gyroscope_m: read_scale(&either(gyroscopes.field("M"), "Tw"))?,
        gyroscope_from_imu: from_imu.map(|field| field.rotation()).transpose()?.unwrap_or_else(Matrix3::identity),
        accelerometer_m: read_scale(&either(accelerometers.field("M"), "Ta"))?,
    };
    ImuIntrinsics::from_kalibr(&kalibr)
        .ok_or_else(|| gyroscopes.field("M").error("the matrix cannot be inverted, expected one near the identity"))
}

/// Reads `M`, with scales on the diagonal and misalignments off it.
fn read_scale(field: &Field<'_>) -> Result<Matrix3<f64>, FileError> {
    if !field.is_present() {
        return Ok(Matrix3::identity());
    }
    let matrix = field.matrix3()?;
    let error = (matrix - Matrix3::identity()).amax();
    if error > MAX_IMU_ERROR {
        let problem = format!(
            "an entry is {error:.3} from the identity, expected scales of 1 and misalignments of 0, each within \
             {MAX_IMU_ERROR}"
        );
        return Err(field.error(problem));
    }
    Ok(matrix)
}
