//! One link of a chain in a rig file.

use super::super::LogError;
use super::fields::Field;
use crate::gimbal::DhLink;

/// A joint offset or twist beyond a full revolution is an angle in degrees.
const MAX_OFFSET_RAD: f64 = std::f64::consts::TAU;

pub(super) fn read_link(link: &Field<'_>) -> Result<DhLink, LogError> {
    let angle = |key: &str| {
        let angle_rad = link.field(key).number("an angle in rad")?;
        link.field(key).in_radians(angle_rad, MAX_OFFSET_RAD)
    };
    let length = |key: &str| link.field(key).number("a length in m");
    Ok(DhLink {
        theta_offset_rad: angle("theta_offset")?,
        d_m: length("d")?,
        a_m: length("a")?,
        alpha_rad: angle("alpha")?,
    })
}
