use super::recorded::{GimbalAttitude, GimbalFrame, rotation};

/// Flags of a gimbal device's attitude (`MAVLink`'s `GIMBAL_DEVICE_FLAGS`).
mod flag {
    /// Yaw is locked to the earth.
    pub(super) const YAW_LOCK: u32 = 16;
    /// Yaw of the attitude is relative to the vehicle's heading.
    pub(super) const YAW_IN_VEHICLE_FRAME: u32 = 32;
    /// Yaw of the attitude is relative to north.
    pub(super) const YAW_IN_EARTH_FRAME: u32 = 64;
}

/// Attitude of a gimbal device in the frame of its flags; without a frame flag, a locked yaw is relative to north.
pub(super) fn gimbal_attitude(flags: u32, quaternion: [f64; 4]) -> Option<GimbalAttitude> {
    let has = |bit: u32| flags & bit != 0;
    let is_earth = has(flag::YAW_IN_EARTH_FRAME) || (!has(flag::YAW_IN_VEHICLE_FRAME) && has(flag::YAW_LOCK));
    let frame = if is_earth { GimbalFrame::Earth } else { GimbalFrame::Vehicle };
    Some(GimbalAttitude { frame, frame_from_camera: rotation(quaternion)? })
}
