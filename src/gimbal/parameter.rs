//! Identity of a calibration parameter and its name.

use std::f64::consts::TAU;

use crate::geometry::{Dimension, principal_angle};
use crate::table::Shown;
use crate::text::Named;

/// A scalar parameter of the static calibration: one column of its Jacobian.
///
/// Cameras are numbered as in the estimator: 0 is the main camera, whose chain may have joints; further rigid cameras
/// follow from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ParameterId {
    pub part: ParameterPart,
    pub quantity: Quantity,
}

/// Calibration parameters of one kind, which are enabled together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ParameterGroup {
    /// Gimbal chain and extrinsics of cameras.
    Chain,
    Camera,
    Imu,
    /// Time offsets, and readout times of rolling shutters.
    Clocks,
}

/// In the order of display.
impl Named for ParameterGroup {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Chain, "chain"), (Self::Camera, "camera"), (Self::Imu, "IMU"), (Self::Clocks, "clocks")];
}

/// Transform, link or sensor that has calibration parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ParameterPart {
    /// `imu_from_base` of the classical parameterization.
    ImuFromBase,
    /// Base block of the minimal parameterizations: rotations about and translations along x and y of the IMU.
    Base,
    /// Denavit–Hartenberg link, counted from 0; the last one includes the end block of the minimal parameterizations.
    Link(u8),
    /// `effector_from_camera` of the classical parameterization.
    EffectorFromCamera,
    /// Transform between joint axes in the product of exponentials, counted from 0.
    Exponential(u8),
    /// `imu_from_camera` of a rigid camera.
    ImuFromCamera(u8),
    /// Clock, shutter and intrinsics of a camera.
    Camera(u8),
    /// Clock of the joint encoders.
    Encoder,
    /// Intrinsics of the gyroscope, and its rotation relative to the accelerometer.
    Gyroscope,
    /// Intrinsics of the accelerometer; its axes are the axes of the IMU frame.
    Accelerometer,
    /// Orientation of the IMU on the gimbal in the camera's frame relative to the rig's, and its clock.
    GimbalImu,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// Rotation about x: of a rotation vector, or an angle of the minimal base block.
    Rx,
    Ry,
    Rz,
    Tx,
    Ty,
    Tz,
    /// Joint offset θ of a link.
    Theta,
    /// Offset d of a link along its joint axis.
    D,
    /// Length a of a link.
    A,
    /// Twist α of a link.
    Alpha,
    /// Rotation β about y in the end block of the minimal parameterizations.
    Beta,
    /// Translation along y in the end block of the minimal parameterizations.
    Y,
    /// Local rotation about x of a block of the product of exponentials.
    Wx,
    /// Local rotation about y.
    Wy,
    /// Local translation along x.
    Vx,
    /// Local translation along y.
    Vy,
    /// Time offset to the IMU: `t_imu = t_sensor + timeshift`.
    Timeshift,
    /// Readout time of a rolling shutter: row `v` is exposed `v / height · readout` after the first row.
    Readout,
    /// Focal length in x.
    Fx,
    /// Focal length in y.
    Fy,
    /// Principal point in x.
    Cx,
    /// Principal point in y.
    Cy,
    /// First coefficient of the distortion.
    K1,
    /// Second coefficient of the distortion.
    K2,
    /// Scale error of the x axis of a gyroscope or accelerometer: the corrected value is `1 + Sx` times the measured
    /// one.
    Sx,
    /// Scale error of the y axis.
    Sy,
    /// Scale error of the z axis.
    Sz,
    /// Misalignment: part of the measured y in the corrected x.
    Mxy,
    /// Misalignment: part of the measured z in the corrected x.
    Mxz,
    /// Misalignment: part of the measured z in the corrected y.
    Myz,
}

impl ParameterId {
    pub const fn timeshift(camera: u8) -> Self {
        Self { part: ParameterPart::Camera(camera), quantity: Quantity::Timeshift }
    }

    pub const ENCODER_TIMESHIFT: Self = Self { part: ParameterPart::Encoder, quantity: Quantity::Timeshift };

    pub const GIMBAL_IMU_TIMESHIFT: Self = Self { part: ParameterPart::GimbalImu, quantity: Quantity::Timeshift };

    /// Readout time of a camera's rolling shutter.
    pub const fn readout(camera: u8) -> Self {
        Self { part: ParameterPart::Camera(camera), quantity: Quantity::Readout }
    }

    pub const fn dimension(self) -> Dimension {
        self.quantity.dimension()
    }

    /// Scale of the observability analysis, in the unit of its dimension: [`Dimension::scale`], and one percent or a
    /// hundredth of a radian for the intrinsics of the IMU.
    ///
    /// Columns of a Jacobian are multiplied by it, so that columns of different dimensions are comparable.
    pub const fn scale(self) -> f64 {
        const IMU_INTRINSICS: f64 = 0.01;
        match self.group() {
            ParameterGroup::Imu => IMU_INTRINSICS,
            _ => self.dimension().scale(),
        }
    }

    /// Shown unit: the unit of the dimension, or percent for scale and misalignment of the IMU.
    pub const fn shown(self) -> Shown {
        match (self.group(), self.dimension()) {
            (ParameterGroup::Imu, Dimension::Ratio) => Shown { factor: 100.0, unit: " %" },
            (_, dimension) => Shown::of(dimension),
        }
    }

    pub const fn group(self) -> ParameterGroup {
        match (self.part, self.quantity) {
            (_, Quantity::Timeshift | Quantity::Readout) => ParameterGroup::Clocks,
            (ParameterPart::Camera(_), _) => ParameterGroup::Camera,
            (ParameterPart::Gyroscope | ParameterPart::Accelerometer | ParameterPart::GimbalImu, _) => {
                ParameterGroup::Imu
            }
            _ => ParameterGroup::Chain,
        }
    }

    /// Value for display and files: angles of the base block and of links in (−π, π], in radians; all others
    /// unchanged, because components of rotation vectors have no period.
    pub fn principal_value(self, value: f64) -> f64 {
        let is_angle =
            self.dimension() == Dimension::Angle && matches!(self.part, ParameterPart::Base | ParameterPart::Link(_));
        if is_angle { principal_angle(value) } else { value }
    }

    /// The value plus the multiple of 2π that brings it nearest to a reference, for angles that have a principal value;
    /// all others unchanged. Values of one run are shown near its first one, so that they do not jump at ±π.
    pub fn value_near(self, reference: f64, value: f64) -> f64 {
        let turns = (self.principal_value(value - reference) - (value - reference)) / TAU;
        if turns.is_finite() { value + turns.round() * TAU } else { value }
    }

    pub const fn is_joint_offset(self) -> bool {
        matches!(self.quantity, Quantity::Theta)
    }

    /// Index of its link, counted from 0; `None` if the parameter belongs to no link.
    pub const fn link(self) -> Option<usize> {
        match self.part {
            ParameterPart::Link(link) => Some(link as usize),
            _ => None,
        }
    }

    /// Corresponding parameter of another camera.
    #[must_use]
    pub const fn of_camera(self, camera: u8) -> Self {
        let part = match self.part {
            ParameterPart::ImuFromCamera(_) => ParameterPart::ImuFromCamera(camera),
            ParameterPart::Camera(_) => ParameterPart::Camera(camera),
            part => part,
        };
        Self { part, quantity: self.quantity }
    }
}

impl ParameterPart {
    /// Number of the camera that the parameter belongs to.
    pub const fn camera(self) -> usize {
        match self {
            Self::ImuFromCamera(camera) | Self::Camera(camera) => camera as usize,
            _ => 0,
        }
    }

    /// True if some parameterization has the quantity in this transform, link or sensor.
    fn has(self, quantity: Quantity) -> bool {
        use Quantity::{
            A, Alpha, Beta, Cx, Cy, D, Fx, Fy, K1, K2, Mxy, Mxz, Myz, Readout, Rx, Ry, Rz, Sx, Sy, Sz, Theta,
            Timeshift, Tx, Ty, Tz, Vx, Vy, Wx, Wy, Y,
        };
        match self {
            Self::ImuFromBase | Self::EffectorFromCamera | Self::ImuFromCamera(_) => {
                matches!(quantity, Rx | Ry | Rz | Tx | Ty | Tz)
            }
            Self::Base => matches!(quantity, Rx | Ry | Tx | Ty),
            Self::Link(_) => matches!(quantity, Theta | D | A | Alpha | Beta | Y),
            Self::Exponential(_) => matches!(quantity, Wx | Wy | Vx | Vy | Rx | Ry | Rz | Tx | Ty | Tz),
            Self::Camera(_) => matches!(quantity, Timeshift | Readout | Fx | Fy | Cx | Cy | K1 | K2),
            Self::Encoder => matches!(quantity, Timeshift),
            Self::Gyroscope => matches!(quantity, Sx | Sy | Sz | Mxy | Mxz | Myz | Rx | Ry | Rz),
            Self::Accelerometer => matches!(quantity, Sx | Sy | Sz | Mxy | Mxz | Myz),
            Self::GimbalImu => matches!(quantity, Rx | Ry | Rz | Tx | Ty | Tz | Timeshift),
        }
    }
}

/// Second half of a parameter's name, after the dot.
impl Named for Quantity {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Rx, "rx"),
        (Self::Ry, "ry"),
        (Self::Rz, "rz"),
        (Self::Tx, "tx"),
        (Self::Ty, "ty"),
        (Self::Tz, "tz"),
        (Self::Theta, "theta"),
        (Self::D, "d"),
        (Self::A, "a"),
        (Self::Alpha, "alpha"),
        (Self::Beta, "beta"),
        (Self::Y, "y"),
        (Self::Wx, "wx"),
        (Self::Wy, "wy"),
        (Self::Vx, "vx"),
        (Self::Vy, "vy"),
        (Self::Timeshift, "timeshift"),
        (Self::Readout, "readout"),
        (Self::Fx, "fx"),
        (Self::Fy, "fy"),
        (Self::Cx, "cx"),
        (Self::Cy, "cy"),
        (Self::K1, "k1"),
        (Self::K2, "k2"),
        (Self::Sx, "sx"),
        (Self::Sy, "sy"),
        (Self::Sz, "sz"),
        (Self::Mxy, "mxy"),
        (Self::Mxz, "mxz"),
        (Self::Myz, "myz"),
    ];
}

impl Quantity {
    /// Columns of a rotation vector.
    pub const ROTATION: [Self; 3] = [Self::Rx, Self::Ry, Self::Rz];
    pub const TRANSLATION: [Self; 3] = [Self::Tx, Self::Ty, Self::Tz];
    /// Columns of a rigid transform: rotation vector, then translation.
    pub const TRANSFORM: [Self; 6] = [Self::Rx, Self::Ry, Self::Rz, Self::Tx, Self::Ty, Self::Tz];
    /// Columns of a Denavit–Hartenberg link.
    pub const LINK: [Self; 4] = [Self::Theta, Self::D, Self::A, Self::Alpha];
    /// Columns of an inner transform of the product of exponentials.
    pub const EXPONENTIAL: [Self; 4] = [Self::Wx, Self::Wy, Self::Vx, Self::Vy];

    /// Columns of the intrinsics of a camera; a lens without coefficients has the first four.
    pub const INTRINSICS: [Self; 6] = [Self::Fx, Self::Fy, Self::Cx, Self::Cy, Self::K1, Self::K2];
    /// Columns of scale and misalignment of a gyroscope or accelerometer.
    pub const SCALE_MISALIGNMENT: [Self; 6] = [Self::Sx, Self::Sy, Self::Sz, Self::Mxy, Self::Mxz, Self::Myz];

    pub const fn dimension(self) -> Dimension {
        match self {
            Self::Rx | Self::Ry | Self::Rz | Self::Theta | Self::Alpha | Self::Beta | Self::Wx | Self::Wy => {
                Dimension::Angle
            }
            Self::Tx | Self::Ty | Self::Tz | Self::D | Self::A | Self::Y | Self::Vx | Self::Vy => Dimension::Length,
            Self::Timeshift | Self::Readout => Dimension::Time,
            Self::Fx | Self::Fy | Self::Cx | Self::Cy => Dimension::Pixel,
            Self::K1 | Self::K2 | Self::Sx | Self::Sy | Self::Sz | Self::Mxy | Self::Mxz | Self::Myz => {
                Dimension::Ratio
            }
        }
    }
}

/// Names of calibration parameters, from the names of joints and cameras.
///
/// Without names, links are `L1`, `L2`, … and further rigid cameras `cam1`, `cam2`, ….
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ParameterNames {
    /// Names of the joints by link.
    pub joints: Vec<String>,
    /// Keys of the further rigid cameras, camera 1 first.
    pub cameras: Vec<String>,
}

impl ParameterNames {
    /// Name of a parameter: `IB.rx`, `yaw.alpha`, `cam1.tx`, `timeshift`.
    pub fn name(&self, id: ParameterId) -> String {
        match id.part {
            ParameterPart::Camera(0) => id.quantity.name().to_owned(),
            part => format!("{}.{}", self.part(part), id.quantity.name()),
        }
    }

    /// First half of a parameter's name, before the dot.
    pub fn part(&self, part: ParameterPart) -> String {
        let numbered = |names: &[String], index: usize, prefix: &str| {
            names.get(index).cloned().unwrap_or_else(|| format!("{prefix}{}", index + 1))
        };
        match part {
            ParameterPart::ImuFromBase => "IB".to_owned(),
            ParameterPart::Base => "I".to_owned(),
            ParameterPart::Link(link) => numbered(&self.joints, usize::from(link), "L"),
            ParameterPart::EffectorFromCamera => "EC".to_owned(),
            ParameterPart::Exponential(index) => format!("X{index}"),
            ParameterPart::ImuFromCamera(0) => "IC".to_owned(),
            ParameterPart::Camera(0) => "camera".to_owned(),
            ParameterPart::ImuFromCamera(camera) | ParameterPart::Camera(camera) => {
                numbered(&self.cameras, usize::from(camera) - 1, "cam")
            }
            ParameterPart::Encoder => "encoder".to_owned(),
            ParameterPart::Gyroscope => "gyroscope".to_owned(),
            ParameterPart::Accelerometer => "accelerometer".to_owned(),
            ParameterPart::GimbalImu => "imu1".to_owned(),
        }
    }

    /// Name of a singularity: `base`, `end`, or the twist of a middle link, `pitch.alpha`.
    pub fn singularity(&self, singularity: Singularity) -> String {
        match singularity {
            Singularity::Base => "base".to_owned(),
            Singularity::End => "end".to_owned(),
            Singularity::ParallelAxes(link) => {
                self.name(ParameterId { part: ParameterPart::Link(link), quantity: Quantity::Alpha })
            }
        }
    }

    pub fn parse_singularity(&self, name: &str) -> Option<Singularity> {
        match name {
            "base" => Some(Singularity::Base),
            "end" => Some(Singularity::End),
            _ => match self.parse(name)? {
                ParameterId { part: ParameterPart::Link(link), quantity: Quantity::Alpha } => {
                    Some(Singularity::ParallelAxes(link))
                }
                _ => None,
            },
        }
    }

    /// Parses the name of a parameter; a link by its joint name or as `L1`.
    pub fn parse(&self, name: &str) -> Option<ParameterId> {
        let (part, quantity) = name.rsplit_once('.').unwrap_or(("", name));
        let quantity = Quantity::from_name(quantity)?;
        let index_of = |names: &[String]| names.iter().position(|known| known == part);
        let number = |prefix: &str| part.strip_prefix(prefix)?.parse::<u8>().ok();
        let camera = index_of(&self.cameras).and_then(|index| u8::try_from(index + 1).ok());
        let part = if let Some(link) = index_of(&self.joints) {
            ParameterPart::Link(u8::try_from(link).ok()?)
        } else if let Some(camera) = camera.or_else(|| number("cam").filter(|camera| *camera > 0)) {
            let part = ParameterPart::Camera(camera);
            if part.has(quantity) { part } else { ParameterPart::ImuFromCamera(camera) }
        } else {
            match part {
                "" => ParameterPart::Camera(0),
                "IB" => ParameterPart::ImuFromBase,
                "I" => ParameterPart::Base,
                "EC" => ParameterPart::EffectorFromCamera,
                "IC" => ParameterPart::ImuFromCamera(0),
                "encoder" => ParameterPart::Encoder,
                "gyroscope" => ParameterPart::Gyroscope,
                "accelerometer" => ParameterPart::Accelerometer,
                "imu1" => ParameterPart::GimbalImu,
                _ => match number("L") {
                    Some(link) => ParameterPart::Link(link.checked_sub(1)?),
                    None => ParameterPart::Exponential(number("X")?),
                },
            }
        };
        part.has(quantity).then_some(ParameterId { part, quantity })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Singularity {
    /// Base block of a minimal parameterization.
    Base,
    /// End block of a minimal parameterization.
    End,
    /// Link, counted from 0, with parallel joint axes at both ends.
    ParallelAxes(u8),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::tests::random::Random;
    use crate::gimbal::{Chain, Parameterization};

    #[test]
    fn parameter_names_convert_both_ways() {
        let named = ParameterNames {
            joints: ["yaw", "roll", "pitch"].map(str::to_owned).into(),
            cameras: vec!["cam4".to_owned()],
        };
        let mut random = Random::new(31);
        for joints in [0, 1, 3] {
            let classical = random.chain(joints);
            for parameterization in Parameterization::all() {
                let mut parameters = Chain::from_classical(&classical, parameterization).parameters();
                parameters.extend([
                    ParameterId::timeshift(0),
                    ParameterId::timeshift(1),
                    ParameterId::ENCODER_TIMESHIFT,
                    ParameterId::readout(0),
                    ParameterId::readout(1),
                ]);
                let of = |part| move |quantity| ParameterId { part, quantity };
                for camera in [0, 1] {
                    parameters.extend(Quantity::INTRINSICS.map(of(ParameterPart::Camera(camera))));
                }
                for sensor in [ParameterPart::Gyroscope, ParameterPart::Accelerometer] {
                    parameters.extend(Quantity::SCALE_MISALIGNMENT.map(of(sensor)));
                }
                parameters.push(ParameterId { part: ParameterPart::Gyroscope, quantity: Quantity::Rx });
                parameters.extend(Quantity::TRANSFORM.map(of(ParameterPart::GimbalImu)));
                parameters.push(ParameterId::GIMBAL_IMU_TIMESHIFT);
                parameters.extend(
                    Quantity::TRANSFORM.map(|quantity| ParameterId { part: ParameterPart::ImuFromCamera(1), quantity }),
                );
                for names in [&named, &ParameterNames::default()] {
                    for id in &parameters {
                        assert_eq!(names.parse(&names.name(*id)), Some(*id));
                    }
                }
            }
        }
        let id = named.parse("roll.alpha").unwrap();
        assert_eq!(
            (named.name(id), ParameterNames::default().name(id)),
            ("roll.alpha".to_owned(), "L2.alpha".to_owned())
        );
        assert_eq!(named.parse("L2.alpha"), Some(id));
        assert_eq!(named.name(ParameterId::timeshift(1)), "cam4.timeshift");
    }

    #[test]
    fn an_angle_is_shown_near_its_first_value_and_a_length_as_it_is() {
        let names = ParameterNames::default();
        let [angle, length, vector] = ["I.rx", "I.tx", "EC.rx"].map(|name| names.parse(name).unwrap());
        let near = |reference: f64, value: f64| angle.value_near(reference, value);
        assert!((near(3.13, -3.13) - (TAU - 3.13)).abs() < 1e-12);
        assert!((near(-3.13, 9.0) - (9.0 - 2.0 * TAU)).abs() < 1e-12);
        assert_eq!((near(3.13, 3.0), near(f64::NAN, 3.0)), (3.0, 3.0));
        assert_eq!((length.value_near(0.1, 9.0), vector.value_near(3.13, -3.13)), (9.0, -3.13));
    }

    #[test]
    fn quantities_outside_a_block_are_no_parameters() {
        let names = ParameterNames { joints: vec!["yaw".to_owned()], cameras: Vec::new() };
        for name in [
            "",
            "yaw",
            "yaw.rx",
            "L0.d",
            "IB.theta",
            "encoder.rx",
            "rx",
            "X.wx",
            "pan.alpha",
            "cam0.rx",
            "sx",
            "accelerometer.rx",
        ] {
            assert_eq!(names.parse(name), None, "{name}");
        }
    }
}
