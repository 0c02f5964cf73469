use nalgebra::Vector3;

use super::attitude;
use super::camera_facts::{CameraFacts, PublishedCamera};
use super::fields::Field;
use super::mask;
use super::sensor;
use crate::camera::{CameraError, CameraModel};
use crate::files::FileError;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, InverseChain, ParameterNames};
use crate::sensors::{
    AssumedField, CameraMount, CameraRig, ChainPrior, GimbalImuRig, GimbalRig, ImuNoise, ImuRig, Joint, LeverArm,
    MAX_LEVER_ARM_M, RequiredAccuracy, Rig,
};
use crate::text::shortened;

const RIG_VERSION: u64 = 1;
/// Largest number of joints of a gimbal: the covariance of the chain grows with the square of its links.
const MAX_LINKS: usize = 16;
const MAX_CAMERAS: usize = 16;
/// Largest number of assumed fields of a rig.
const MAX_ASSUMED: usize = 256;
/// Gravity where no rig states it, as in Kalibr's files, in m/s².
pub(crate) const USUAL_GRAVITY_M_PER_S2: f64 = 9.81;

/// A joint limit beyond two revolutions is an angle in degrees.
pub(crate) const MAX_LIMIT_RAD: f64 = 2.0 * std::f64::consts::TAU;
/// An encoder with a larger standard deviation measures nothing; values of 0.5 to 1 are usually degrees.
const MAX_SIGMA_RAD: f64 = 0.5;

/// A larger time offset means that a clock was never set; the largest of a clock that is set is 37 s, of TAI to UTC.
pub(crate) const MAX_TIMESHIFT_S: f64 = 60.0;

/// Reads a rig in the schema of this program.
pub(crate) fn read_rig(root: &Field<'_>, default_name: &str, facts: &dyn CameraFacts) -> Result<Rig, FileError> {
    let version = root.field("rig_version").number("the number 1")?;
    if version.total_cmp(&(RIG_VERSION as f64)).is_ne() {
        return Err(root.field("rig_version").unexpected("the number 1, the only version so far"));
    }
    let name = root.field("name").optional().map_or(Ok(default_name), |name| name.text("a name"))?.to_owned();
    let gravity_m_per_s2 = root.field("gravity").positive("gravity's magnitude in m/s²")?;
    let imu = read_imu(&root.field("imu0"), None)?;
    let gimbal = root.field("gimbal").optional().map(|gimbal| read_gimbal(&gimbal)).transpose()?;
    let gimbal_imu = read_gimbal_imu(root, &imu, gimbal.is_some())?;
    let keys = camera_keys(root)?;
    if keys.is_empty() {
        return Err(root.field("cam0").unexpected("at least one camera, cam0"));
    }
    let mut cameras: Vec<CameraRig> = Vec::new();
    for key in &keys {
        let camera = read_camera(&root.field(key), key, &cameras, facts)?;
        cameras.push(camera);
    }
    if gimbal.is_none()
        && let Some(camera) = cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal)
    {
        let expected = format!("a gimbal, since {}.mount is gimbal", camera.key);
        return Err(root.field("gimbal").unexpected(&expected));
    }
    let ground_truth = root.field("ground_truth").optional();
    let ground_truth_topic = ground_truth.and_then(|ground_truth| ground_truth.field("rostopic").optional());
    let ground_truth_topic = ground_truth_topic.map(|topic| topic.text("a topic").map(str::to_owned)).transpose()?;
    let ground_truth_use_log_time = root.field("ground_truth").field("use_log_time").flag()?;
    let ground_truth_lever_arm = read_lever_arm(root.field("ground_truth").field("lever_arm"))?;
    let assumed = read_assumed(root)?;
    let mut rig = Rig {
        name,
        gravity_m_per_s2,
        imu,
        gimbal_imu,
        cameras,
        gimbal,
        ground_truth_topic,
        ground_truth_use_log_time,
        ground_truth_lever_arm,
        required_accuracy: RequiredAccuracy::default(),
        assumed,
    };
    rig.required_accuracy = read_required_accuracy(root.field("required_accuracy"), &rig.parameter_names())?;
    Ok(rig)
}

/// Reads the position of the ground-truth antenna.
fn read_lever_arm(field: Field<'_>) -> Result<Option<LeverArm>, FileError> {
    const EXPECTED: &str = "3 numbers (x y z of the antenna in the IMU frame, in m), or estimate";
    let Some(field) = field.optional() else { return Ok(None) };
    if let Ok(text) = field.text(EXPECTED) {
        return if text == "estimate" { Ok(Some(LeverArm::Estimated)) } else { Err(field.unexpected(EXPECTED)) };
    }
    let lever_arm_m = Vector3::from(field.exactly::<3>(EXPECTED)?);
    if lever_arm_m.amax() > MAX_LEVER_ARM_M {
        return Err(field.unexpected("metres, at most 100 in each direction"));
    }
    Ok(Some(LeverArm::Known(lever_arm_m)))
}

/// Reads the accuracy that the calibration must reach; the defaults stand for values that are not given.
fn read_required_accuracy(field: Field<'_>, names: &ParameterNames) -> Result<RequiredAccuracy, FileError> {
    let mut required = RequiredAccuracy::default();
    let Some(given) = field.optional() else { return Ok(required) };
    for key in given.keys("a mapping of translation, rotation or parameters to standard deviations")? {
        let of_key = given.field(key);
        let unit = RequiredAccuracy::dimension_of(key, names).map_err(|problem| of_key.error(problem))?.unit();
        let unit = if unit.is_empty() { String::new() } else { format!(" in {unit}") };
        let sigma = of_key.positive(&format!("a standard deviation{unit}"))?;
        required.set(key, sigma, names).map_err(|problem| of_key.error(problem))?;
    }
    Ok(required)
}

/// Reads the assumed fields; an error if the rig lacks one of them.
fn read_assumed(root: &Field<'_>) -> Result<Vec<AssumedField>, FileError> {
    const EXPECTED: &str = "a mapping of fields of the rig, such as cam0.intrinsics, to the assumption";
    let Some(assumed) = root.field("assumed").optional() else { return Ok(Vec::new()) };
    let paths = assumed.keys(EXPECTED)?;
    if paths.len() > MAX_ASSUMED {
        return Err(assumed.error(format!("{} entries, expected at most {MAX_ASSUMED}", paths.len())));
    }
    let entry = |path: &str| {
        let reason = assumed.field(path).text("a sentence that states the assumption")?.to_owned();
        if !root.has_path(path) {
            let problem = format!(
                "the rig has no field '{}'; remove the entry, or name a field as in cam0.intrinsics",
                shortened(path, 60)
            );
            return Err(assumed.error(problem));
        }
        Ok(AssumedField { field: path.to_owned(), reason })
    };
    paths.into_iter().map(entry).collect()
}

/// Keys `cam0`, `cam1`, … in the order of their numbers.
pub(crate) fn camera_keys(root: &Field<'_>) -> Result<Vec<String>, FileError> {
    let number = |key: &str| key.strip_prefix("cam").and_then(|number| number.parse::<u32>().ok());
    let mut keys: Vec<&str> = root.keys("a mapping with imu0, cam0, …")?;
    keys.retain(|key| number(key).is_some());
    keys.sort_by_key(|key| number(key));
    if keys.len() > MAX_CAMERAS {
        return Err(root.error(format!("{} cameras, expected at most {MAX_CAMERAS}", keys.len())));
    }
    Ok(keys.into_iter().map(str::to_owned).collect())
}

/// Reads the IMU; Kalibr's `imu.yaml` has the same fields without a frame name.
pub(crate) fn read_imu(imu: &Field<'_>, default_topic: Option<&str>) -> Result<ImuRig, FileError> {
    if !imu.is_present() {
        return Err(imu.unexpected("the IMU with its topic and noise densities"));
    }
    let topic = match (imu.field("rostopic").optional(), default_topic) {
        (None, Some(topic)) => topic,
        _ => imu.field("rostopic").text("the topic of its sensor_msgs/msg/Imu")?,
    };
    let accelerometer = imu.field("accelerometer_rostopic").optional();
    let accelerometer = accelerometer.map(|field| field.text("the topic of a sensor_msgs/msg/Imu")).transpose()?;
    let density = |key: &str, unit: &str| imu.field(key).positive(&format!("a number greater than 0 in {unit}"));
    Ok(ImuRig {
        topic: topic.to_owned(),
        accelerometer_topic: accelerometer.map(str::to_owned),
        use_log_time: imu.field("use_log_time").flag()?,
        frame_id: imu.field("frame_id").optional().map_or(Ok("imu"), |frame| frame.text("a frame's name"))?.to_owned(),
        rate_hz: imu.field("update_rate").positive("the rate in Hz")?,
        noise: ImuNoise {
            accelerometer_noise_density: density("accelerometer_noise_density", "m/s²/√Hz")?,
            accelerometer_random_walk: density("accelerometer_random_walk", "m/s³/√Hz")?,
            gyroscope_noise_density: density("gyroscope_noise_density", "rad/s/√Hz")?,
            gyroscope_random_walk: density("gyroscope_random_walk", "rad/s²/√Hz")?,
        },
        intrinsics: sensor::read_imu_intrinsics(imu)?,
    })
}

/// Reads the IMU on the gimbal; `None` without `imu1`, or if it has no `mount` as in Kalibr's files.
fn read_gimbal_imu(root: &Field<'_>, vehicle: &ImuRig, has_gimbal: bool) -> Result<Option<GimbalImuRig>, FileError> {
    const MOUNT: &str = "gimbal (the IMU moves with the gimbal's camera)";
    let Some(imu) = root.field("imu1").optional().filter(|imu| imu.field("mount").is_present()) else {
        return Ok(None);
    };
    if imu.field("mount").text(MOUNT)? != "gimbal" {
        return Err(imu.field("mount").unexpected(MOUNT));
    }
    if !has_gimbal {
        return Err(root.field("gimbal").unexpected("a gimbal, since imu1.mount is gimbal"));
    }
    let sensor = read_imu(&imu, None)?;
    if sensor.topic == vehicle.topic {
        return Err(imu.field("rostopic").error("is the topic of imu0, expected the topic of the gimbal's IMU"));
    }
    let shift = imu.field("timeshift_imu1_imu");
    let timeshift_s = if shift.is_present() { shift.number("seconds, t_imu = t_imu1 + shift")? } else { 0.0 };
    if timeshift_s.abs() > MAX_TIMESHIFT_S {
        return Err(shift.unexpected("seconds, at most 60 either way"));
    }
    Ok(Some(GimbalImuRig { sensor, camera_from_imu: imu.field("T_cam_imu").transform()?, timeshift_s }))
}

fn read_camera(
    camera: &Field<'_>,
    key: &str,
    earlier: &[CameraRig],
    facts: &dyn CameraFacts,
) -> Result<CameraRig, FileError> {
    const MOUNTS: &str = "gimbal or static";
    let on_gimbal = match camera.field("mount").text(MOUNTS)? {
        "gimbal" => true,
        "static" => false,
        _ => return Err(camera.field("mount").unexpected(MOUNTS)),
    };
    let relative = camera.field("T_cn_cnm1");
    let before = earlier.iter().rfind(|other| other.is_on_gimbal() == on_gimbal);
    // The first camera of a mount has none before it.
    let before = before.filter(|_| on_gimbal || relative.is_present());
    let before_from_camera = before.map(|_| relative.transform()).transpose()?.map(|pose| pose.inverse());
    let (mount, first_from_camera) = match before.zip(before_from_camera) {
        Some((before, pose)) => match &before.mount {
            CameraMount::Gimbal => (CameraMount::Gimbal, before.first_from_camera * pose),
            CameraMount::Static { imu_from_camera: imu_from_before } => {
                let imu_from_camera = *imu_from_before * pose;
                agree(camera, &imu_from_camera)?;
                (CameraMount::Static { imu_from_camera }, RigidTransform::identity())
            }
        },
        None if on_gimbal => (CameraMount::Gimbal, RigidTransform::identity()),
        None => {
            let imu_from_camera = camera.field("T_cam_imu").transform()?.inverse();
            (CameraMount::Static { imu_from_camera }, RigidTransform::identity())
        }
    };
    let relative_prior = before.map(|_| read_relative_prior(camera)).transpose()?;
    Ok(CameraRig { first_from_camera, relative_prior, ..read_camera_as(camera, key, mount, facts)? })
}

/// Requires that `T_cam_imu`, if it is given beside `T_cn_cnm1`, is the same pose.
fn agree(camera: &Field<'_>, imu_from_camera: &RigidTransform) -> Result<(), FileError> {
    /// Largest difference in metres and radians: digits that were cut off, and no other calibration.
    const ROUNDING: f64 = 0.005;
    let given = camera.field("T_cam_imu");
    if !given.is_present() {
        return Ok(());
    }
    let difference = given.transform()? * *imu_from_camera;
    let (shift_m, rotation_rad) = (difference.translation_m.norm(), difference.rotation.angle());
    if shift_m.max(rotation_rad) <= ROUNDING {
        return Ok(());
    }
    let problem = format!(
        "differs by {:.1} mm and {:.2}° from the pose by T_cn_cnm1 and the camera before; remove one of them",
        shift_m * 1e3,
        rotation_rad.to_degrees()
    );
    Err(given.error(problem))
}

/// Bounds of the errors of `T_cn_cnm1`.
fn read_relative_prior(camera: &Field<'_>) -> Result<ChainPrior, FileError> {
    match camera.field("T_cn_cnm1_prior").optional() {
        Some(prior) => read_bounds(&prior),
        None => Ok(ChainPrior::RELATIVE),
    }
}

/// Bounds of the errors of a translation and of a rotation.
fn read_bounds(prior: &Field<'_>) -> Result<ChainPrior, FileError> {
    let rotation_bound_rad = prior.field("rotation_bound").not_negative("a bound in rad")?;
    prior.field("rotation_bound").in_radians(rotation_bound_rad, std::f64::consts::PI)?;
    Ok(ChainPrior {
        translation_bound_m: prior.field("translation_bound").not_negative("a bound in m")?,
        rotation_bound_rad,
    })
}

/// Reads the fields common to rigs of this program and Kalibr's files.
pub(super) fn read_camera_as(
    camera: &Field<'_>,
    key: &str,
    mount: CameraMount,
    facts: &dyn CameraFacts,
) -> Result<CameraRig, FileError> {
    let topic = camera.field("rostopic").text("the topic of its images")?.to_owned();
    let rate_hz = match (camera.field("update_rate").optional(), facts.rate_hz(&topic)) {
        (None, Some(rate_hz)) if rate_hz > 0.0 => rate_hz,
        _ => camera.field("update_rate").positive("the rate in Hz")?,
    };
    let shift = camera.field("timeshift_cam_imu").optional();
    let model = if camera.field("intrinsics").is_present() {
        read_camera_model(camera)?
    } else {
        read_published_camera(camera, &topic, facts)?
    };
    let mask = mask::read(camera, model.resolution_px, facts)?;
    let shutter = sensor::read_shutter(camera, model.resolution_px[1])?;
    let intrinsics_sigma = sensor::read_intrinsics_sigma(camera)?;
    Ok(CameraRig {
        key: key.to_owned(),
        mount,
        first_from_camera: RigidTransform::identity(),
        relative_prior: None,
        rate_hz,
        model,
        mask,
        readout_s: shutter.readout_s,
        readout_sigma_s: shutter.sigma_s,
        intrinsics_sigma,
        frame_id: camera.field("frame_id").optional().map_or(Ok(key), |frame| frame.text("a frame's name"))?.to_owned(),
        timeshift_cam_imu_s: shift.map_or(Ok(0.0), |shift| shift.number("seconds, t_imu = t_cam + shift"))?,
        use_log_time: camera.field("use_log_time").flag()?,
        topic,
    })
}

/// Model of a camera without intrinsics: by `CameraInfo`, with whose sensor or images a given `resolution` must agree.
fn read_published_camera(camera: &Field<'_>, topic: &str, facts: &dyn CameraFacts) -> Result<CameraModel, FileError> {
    let PublishedCamera { sensor, window, image } = facts.published(topic).map_err(|reason| {
        let expected = format!("4 numbers (fx fy cx cy), or a CameraInfo in the log ({reason})");
        camera.field("intrinsics").unexpected(&expected)
    })?;
    let resolution = camera.field("resolution");
    if resolution.is_present() {
        let given_px = read_resolution(&resolution)?;
        if ![sensor.resolution_px, image.resolution_px].contains(&given_px) {
            let text = |[width, height]: [usize; 2]| format!("{width}×{height}");
            let window =
                window.map_or_else(String::new, |window| format!(" ({} with {window})", text(sensor.resolution_px)));
            let problem = format!(
                "{}, but CameraInfo has {}{window}; remove resolution, or give intrinsics that belong to it",
                text(given_px),
                text(image.resolution_px)
            );
            return Err(resolution.error(problem));
        }
    }
    Ok(image)
}

/// Reads width and height in pixels.
fn read_resolution(field: &Field<'_>) -> Result<[usize; 2], FileError> {
    let [width, height] = field.exactly::<2>("2 (width height)")?;
    if [width, height].iter().any(|side| *side < 1.0 || side.fract() != 0.0 || *side > 65_535.0) {
        return Err(field.error(format!("{width}×{height}, expected whole pixels from 1 to 65535")));
    }
    Ok([width as usize, height as usize])
}

/// Reads projection, distortion, intrinsics and resolution in Kalibr's spelling and order.
fn read_camera_model(camera: &Field<'_>) -> Result<CameraModel, FileError> {
    let model = camera.field("camera_model").text(CAMERA_MODELS)?;
    let intrinsics = camera.field("intrinsics").numbers("4 numbers (fx fy cx cy)")?;
    let distortion_model = camera.field("distortion_model").optional();
    let distortion_model = distortion_model.map_or(Ok("none"), |model| model.text(DISTORTION_MODELS))?;
    let coefficients = match camera.field("distortion_coeffs").optional() {
        Some(coefficients) => coefficients.numbers("the coefficients of the lens")?,
        None if distortion_model == "none" => Vec::new(),
        None => return Err(camera.field("distortion_coeffs").unexpected("the coefficients of the lens")),
    };
    let resolution_px = read_resolution(&camera.field("resolution"))?;
    CameraModel::from_kalibr(model, &intrinsics, distortion_model, &coefficients, resolution_px)
        .map_err(|error| name_the_field(camera, &error))
}

const CAMERA_MODELS: &str = "pinhole, omni, eucm or ds";
const DISTORTION_MODELS: &str = "none, radtan, plumb_bob, rational_polynomial, equidistant or fov";

/// Error of a camera model with the rig field that it concerns.
fn name_the_field(camera: &Field<'_>, error: &CameraError) -> FileError {
    match error {
        CameraError::UnknownModel { .. } => camera.field("camera_model").unexpected(CAMERA_MODELS),
        CameraError::UnknownDistortion { .. } => camera.field("distortion_model").unexpected(DISTORTION_MODELS),
        CameraError::Combination { model, distortion, expected } => {
            let problem = format!("'{distortion}' is not supported with camera_model '{model}', expected {expected}");
            camera.field("distortion_model").error(problem)
        }
        CameraError::Count { field, found, expected, meaning, .. } => {
            camera.field(field).error(format!("{found} numbers, expected {expected} ({})", meaning.replace(',', "")))
        }
        CameraError::Value { field, value, expected } => {
            let place = if field.contains("distortion") { "distortion_coeffs" } else { "intrinsics" };
            camera.field(place).error(format!("{field} is {value}, expected {expected}"))
        }
    }
}

fn read_gimbal(gimbal: &Field<'_>) -> Result<GimbalRig, FileError> {
    let joint_topic = gimbal.field("rostopic").optional();
    let joint_topic = joint_topic
        .map(|topic| topic.text("the topic of its sensor_msgs/msg/JointState, or null").map(str::to_owned))
        .transpose()?;
    let source = gimbal.field("source").optional().map(|source| attitude::read(&source)).transpose()?;
    if joint_topic.is_some() && source.is_some() {
        let problem = "is given together with gimbal.source; expected one of them: joint angles, or an attitude";
        return Err(gimbal.field("rostopic").error(problem));
    }
    let (topic, attitude) = source.map_or((joint_topic, None), |(topic, source)| (Some(topic), Some(source)));
    let shift = gimbal.field("timeshift_gimbal_imu").optional();
    let timeshift_gimbal_imu_s =
        shift.map_or(Ok(0.0), |shift| shift.number("seconds, t_imu = t_gimbal + shift")).and_then(|shift_s| {
            let limit = MAX_TIMESHIFT_S;
            let field = gimbal.field("timeshift_gimbal_imu");
            if shift_s.abs() <= limit { Ok(shift_s) } else { Err(field.unexpected("seconds, at most 60 either way")) }
        })?;
    let rate = gimbal.field("update_rate").optional();
    let rate_hz = match (&topic, rate) {
        (None, None) => 0.0,
        _ => gimbal.field("update_rate").positive("the rate in Hz")?,
    };
    let sigma = gimbal.field("encoder_sigma").optional();
    let encoder_sigma_rad =
        sigma.map(|sigma| sigma.positive("a standard deviation greater than 0 in rad, or null")).transpose()?;
    if let Some(sigma_rad) = encoder_sigma_rad {
        gimbal.field("encoder_sigma").in_radians(sigma_rad, MAX_SIGMA_RAD)?;
    }
    let prior = read_bounds(&gimbal.field("prior"))?;
    let parameterization = gimbal.field("parameterization");
    let switches_parameterization =
        match parameterization.is_present().then(|| parameterization.text("auto")).transpose()? {
            None => false,
            Some("auto") => true,
            Some(other) => return Err(parameterization.error(format!("holds '{other}', expected auto, or nothing"))),
        };
    let mut links = Vec::new();
    let mut joints: Vec<Joint> = Vec::new();
    let fields = gimbal.field("links").list("a list of links with joint, theta_offset, d, a, alpha and limits")?;
    if fields.len() > MAX_LINKS {
        return Err(gimbal.field("links").error(format!("{} links, expected at most {MAX_LINKS}", fields.len())));
    }
    for link in fields {
        let name = link.field("joint").text("the joint's name in the JointState")?.to_owned();
        if joints.iter().any(|joint| joint.name == name) {
            return Err(link.field("joint").error(format!("'{name}' again, expected each joint once")));
        }
        links.push(link.link()?);
        let limits = link.field("limits").optional();
        let limits = match limits {
            Some(limits) => limits.exactly::<2>("2 (lower upper, in rad)")?,
            None => [-std::f64::consts::PI, std::f64::consts::PI],
        };
        if limits[0] >= limits[1] {
            let problem = format!("lower limit {} not below upper limit {}", limits[0], limits[1]);
            return Err(link.field("limits").error(problem));
        }
        for limit_rad in limits {
            link.field("limits").in_radians(limit_rad, MAX_LIMIT_RAD)?;
        }
        joints.push(Joint { name, limits_rad: (limits[0], limits[1]) });
    }
    let chain = ClassicalChain {
        imu_from_base: gimbal.field("T_I_B").transform()?,
        links,
        effector_from_camera: gimbal.field("T_E_C").transform()?,
    };
    if attitude.is_some() && !(1..=InverseChain::MAX_JOINTS).contains(&joints.len()) {
        let problem = format!("{} links, expected one to three: an attitude does not determine more", joints.len());
        return Err(gimbal.field("links").error(problem));
    }
    let of_source = attitude.as_ref().and_then(|source| source.chain.as_ref());
    if let Some(found) = of_source.map(|chain| chain.links.len()).filter(|found| *found != joints.len()) {
        let problem = format!("{found} links, expected {} as in gimbal.links", joints.len());
        return Err(gimbal.field("source").field("chain").field("links").error(problem));
    }
    Ok(GimbalRig {
        topic,
        attitude,
        use_log_time: gimbal.field("use_log_time").flag()?,
        timeshift_gimbal_imu_s,
        rate_hz,
        encoder_sigma_rad,
        prior,
        switches_parameterization,
        chain,
        joints,
    })
}
