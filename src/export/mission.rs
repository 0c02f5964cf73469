//! A planned motion for the autopilot that flies it: missions of ArduPilot and PX4, and a trajectory of the joints for
//! ROS 2. What a mission cannot express is named.

use std::f64::consts::FRAC_PI_2;
use std::fmt::{self, Display, Formatter, Write as _};

use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};

use crate::flight_log::Geodetic;
use crate::gimbal::ClassicalChain;
use crate::simulation::{MotionSample, MotionSplines};

/// Time between two waypoints in seconds; ArduPilot waits whole seconds.
const STEP_S: f64 = 1.0;
/// Distance below which two waypoints are the same place, at which the vehicle waits, in metres.
const SAME_PLACE_M: f64 = 0.05;
/// Radius in which a waypoint is reached, in metres.
const ACCEPTANCE_RADIUS_M: f64 = 0.2;
/// Height above the start to which the vehicle takes off before the motion, where `--home` gives none, in metres.
const DEFAULT_HEIGHT_M: f64 = 10.0;
/// Smallest speed that an autopilot is given, in metres per second.
const LEAST_SPEED_M_PER_S: f64 = 0.1;
/// Commands of MAVLink.
const NAV_WAYPOINT: u16 = 16;
const NAV_LOITER_UNLIM: u16 = 17;
const NAV_TAKEOFF: u16 = 22;
const CONDITION_YAW: u16 = 115;
const DO_CHANGE_SPEED: u16 = 178;
const DO_GIMBAL_MANAGER_PITCHYAW: u16 = 1000;
/// Frames of MAVLink: global with the height above home, and of commands without a place.
const GLOBAL_RELATIVE: u8 = 3;
const MISSION: u8 = 2;
const GLOBAL: u8 = 0;
/// Flag of the gimbal manager: yaw relative to the vehicle.
const YAW_IN_VEHICLE_FRAME: f64 = 32.0;

/// Start of a mission: `LAT,LON[,HEIGHT[,HEADING]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionStart {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    /// Height of the motion's start above home in metres.
    pub height_m: f64,
    /// Heading of the vehicle at the start in degrees, clockwise from north.
    pub heading_deg: f64,
}

impl std::str::FromStr for MissionStart {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || "expected LAT,LON[,HEIGHT[,HEADING]]: degrees, metres above home, degrees from north".to_owned();
        let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        let numbers = numbers.filter(|all| all.iter().all(|number| number.is_finite())).ok_or_else(expected)?;
        let (&[latitude_deg, longitude_deg], rest) = numbers.split_first_chunk::<2>().ok_or_else(expected)?;
        let (height_m, heading_deg) = match rest {
            [] => (DEFAULT_HEIGHT_M, 0.0),
            [height_m] => (*height_m, 0.0),
            [height_m, heading_deg] => (*height_m, *heading_deg),
            _ => return Err(expected()),
        };
        Geodetic::from_deg(latitude_deg, longitude_deg, 0.0).ok_or_else(expected)?;
        if !(1.0..=1000.0).contains(&height_m) || !(-360.0..=360.0).contains(&heading_deg) {
            return Err("expected a height from 1 to 1000 m and a heading within ±360°".to_owned());
        }
        Ok(Self { latitude_deg, longitude_deg, height_m, heading_deg })
    }
}

/// One item of a mission.
#[derive(Clone, Debug, PartialEq)]
struct Item {
    frame: u8,
    command: u16,
    parameters: [f64; 4],
    /// Latitude and longitude in degrees and height in metres, or parameters 5 to 7 of a command without a place.
    place: [f64; 3],
}

/// Files for the autopilot, and what they do not express.
pub(super) struct Mission {
    ardupilot: Vec<Item>,
    px4: Vec<Item>,
    start: MissionStart,
    speed_m_per_s: f64,
    limits: MissionLimits,
}

/// Parts of a motion that a mission does not express.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct MissionLimits {
    waypoints: usize,
    /// Time between waypoints; the autopilot chooses its own.
    step_s: f64,
    /// Largest rotation of the image about the optical axis from the start's, in degrees.
    roll_deg: f64,
    /// Largest distance of the motion from the lines between the waypoints.
    corner_m: f64,
}

/// Direction of the camera relative to the vehicle in degrees: up, to the right, and about the optical axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pointing {
    pitch_deg: f64,
    yaw_deg: f64,
    roll_deg: f64,
}

impl Pointing {
    /// Direction of a camera with its axes x right, y down, z forward; the IMU has x forward, y left, z up.
    fn of(imu_from_camera: &UnitQuaternion<f64>) -> Self {
        let axis = imu_from_camera * Vector3::z();
        let pitch_rad = axis.z.clamp(-1.0, 1.0).asin();
        let yaw_rad = -axis.y.atan2(axis.x);
        let level = axis.cross(&Vector3::z());
        let right = imu_from_camera * Vector3::x();
        // Straight up and down the image has no level direction.
        let roll_rad = if pitch_rad.abs() < FRAC_PI_2 - 1e-3 {
            level.cross(&right).dot(&axis).atan2(level.dot(&right))
        } else {
            0.0
        };
        Self { pitch_deg: pitch_rad.to_degrees(), yaw_deg: yaw_rad.to_degrees(), roll_deg: roll_rad.to_degrees() }
    }
}

impl Mission {
    /// Mission of a motion that begins at a place.
    pub(super) fn new(motion: &MotionSplines, chain: &ClassicalChain, start: MissionStart) -> Self {
        let steps = (motion.duration_s() / STEP_S - 1e-9).ceil().max(1.0) as usize;
        let samples: Vec<MotionSample> =
            (0..=steps).map(|step| motion.sample((STEP_S * step as f64).min(motion.duration_s()))).collect();
        let speeds = samples.windows(2).map(|pair| (pair[1].position_m - pair[0].position_m).norm() / STEP_S);
        let speed_m_per_s = speeds.fold(LEAST_SPEED_M_PER_S, f64::max);
        let pointing = |sample: &MotionSample| Pointing::of(&chain.imu_from_camera(&sample.joints_rad).rotation);
        let first = pointing(&samples[0]);
        let origin = Geodetic::from_deg(start.latitude_deg, start.longitude_deg, 0.0);
        let place = |sample: &MotionSample| {
            let (sine, cosine) = start.heading_deg.to_radians().sin_cos();
            let [forward, left, up] = [sample.position_m.x, sample.position_m.y, sample.position_m.z];
            let (north_m, east_m) = (forward * cosine + left * sine, forward * sine - left * cosine);
            let [latitude_deg, longitude_deg] =
                origin.map_or([0.0; 2], |origin| origin.moved(east_m, north_m).latitude_longitude_deg());
            [latitude_deg, longitude_deg, start.height_m + up]
        };
        let heading_deg =
            |sample: &MotionSample| (start.heading_deg - sample.heading_rad.to_degrees()).rem_euclid(360.0);
        let common = |px4: bool| {
            let mut items = vec![
                Item::at(NAV_TAKEOFF, [0.0, 0.0, 0.0, heading_deg(&samples[0])], place(&samples[0])),
                Item::without_place(DO_CHANGE_SPEED, [1.0, speed_m_per_s, -1.0, 0.0], [0.0; 3]),
            ];
            for (number, sample) in samples.iter().enumerate() {
                let Pointing { pitch_deg, yaw_deg, .. } = pointing(sample);
                items.push(Item::without_place(
                    DO_GIMBAL_MANAGER_PITCHYAW,
                    [pitch_deg, yaw_deg, f64::NAN, f64::NAN],
                    [YAW_IN_VEHICLE_FRAME, 0.0, 0.0],
                ));
                let before = number.checked_sub(1).map(|before| &samples[before]);
                let turned = before.is_none_or(|before| (sample.heading_rad - before.heading_rad).abs() > 1e-3);
                if !px4 && turned {
                    // Parameters: angle, rate, direction (0: the shorter way), 0 for an angle from north.
                    items.push(Item::without_place(CONDITION_YAW, [heading_deg(sample), 0.0, 0.0, 0.0], [0.0; 3]));
                }
                let stays = before.is_some_and(|before| (sample.position_m - before.position_m).norm() < SAME_PLACE_M);
                let hold_s = if stays { STEP_S } else { 0.0 };
                let heading = if px4 { heading_deg(sample) } else { 0.0 };
                items.push(Item::at(NAV_WAYPOINT, [hold_s, ACCEPTANCE_RADIUS_M, 0.0, heading], place(sample)));
            }
            items.push(Item::at(NAV_LOITER_UNLIM, [0.0; 4], place(&samples[samples.len() - 1])));
            items
        };
        let middle = |step: usize| {
            let between = motion.sample((STEP_S * (step as f64 + 0.5)).min(motion.duration_s())).position_m;
            let [one, other] = [&samples[step], &samples[step + 1]].map(|sample| sample.position_m);
            (between - (one + other) * 0.5).norm()
        };
        let rolls = samples.iter().map(|sample| (pointing(sample).roll_deg - first.roll_deg).abs());
        let limits = MissionLimits {
            waypoints: samples.len(),
            step_s: STEP_S,
            roll_deg: rolls.map(|roll| roll.min(360.0 - roll)).fold(0.0, f64::max),
            corner_m: (0..steps).map(middle).fold(0.0, f64::max),
        };
        Self { ardupilot: common(false), px4: common(true), start, speed_m_per_s, limits }
    }

    /// Mission of ArduPilot in the format `QGC WPL 110`; the first line is home.
    pub(super) fn waypoints(&self) -> String {
        let MissionStart { latitude_deg, longitude_deg, .. } = self.start;
        let home = Item { frame: GLOBAL, ..Item::at(NAV_WAYPOINT, [0.0; 4], [latitude_deg, longitude_deg, 0.0]) };
        let mut text = "QGC WPL 110\n".to_owned();
        for (number, item) in std::iter::once(&home).chain(&self.ardupilot).enumerate() {
            let current = u8::from(number == 0);
            write!(text, "{number}\t{current}\t{}\t{}", item.frame, item.command).expect("a string can be written");
            // A mission file has no undefined numbers; 0 leaves the rate to the gimbal.
            for value in item.parameters.iter().map(|value| if value.is_nan() { 0.0 } else { *value }) {
                write!(text, "\t{value:.8}").expect("a string can be written");
            }
            let [x, y, z] = item.place;
            writeln!(text, "\t{x:.8}\t{y:.8}\t{z:.6}\t1").expect("a string can be written");
        }
        text
    }

    /// Mission of PX4 as a plan of its ground station.
    pub(super) fn plan(&self) -> Value {
        let number = |value: f64| if value.is_nan() { Value::Null } else { json!(value) };
        let items = self.px4.iter().enumerate().map(|(place, item)| {
            let parameters: Vec<Value> =
                item.parameters.iter().chain(&item.place).map(|value| number(*value)).collect();
            json!({
                "type": "SimpleItem", "autoContinue": true, "doJumpId": place + 1,
                "command": item.command, "frame": item.frame, "params": parameters,
            })
        });
        let MissionStart { latitude_deg, longitude_deg, .. } = self.start;
        json!({
            "fileType": "Plan", "version": 1, "groundStation": "QGroundControl",
            "mission": {
                "version": 2, "firmwareType": 12, "vehicleType": 2,
                "cruiseSpeed": self.speed_m_per_s, "hoverSpeed": self.speed_m_per_s,
                "plannedHomePosition": [latitude_deg, longitude_deg, 0.0],
                "items": items.collect::<Vec<Value>>(),
            },
            "geoFence": { "version": 2, "circles": [], "polygons": [] },
            "rallyPoints": { "version": 2, "points": [] },
        })
    }
}

/// Says what the missions contain and what they do not express.
impl Display for Mission {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let MissionLimits { waypoints, step_s, roll_deg, corner_m } = self.limits;
        writeln!(f, "mission: {waypoints} waypoints, one per {step_s:.0} s, at most {:.2} m/s", self.speed_m_per_s)?;
        writeln!(f, "  not in it: the times at the waypoints, and the movement of joints and vehicle between them;")?;
        write!(f, "  it cuts corners of the motion by up to {corner_m:.2} m")?;
        if roll_deg > 1.0 {
            write!(f, ", and rotations of the image of up to {roll_deg:.0}° about the optical axis are left out")?;
        }
        writeln!(f)?;
        writeln!(f, "  ArduPilot: set WPNAV_RADIUS to {ACCEPTANCE_RADIUS_M} m, it ignores the radius of a waypoint")
    }
}

impl Item {
    fn at(command: u16, parameters: [f64; 4], place: [f64; 3]) -> Self {
        Self { frame: GLOBAL_RELATIVE, command, parameters, place }
    }

    fn without_place(command: u16, parameters: [f64; 4], further: [f64; 3]) -> Self {
        Self { frame: MISSION, command, parameters, place: further }
    }
}

/// Message `trajectory_msgs/msg/JointTrajectory` as YAML, a point every 0.1 s.
pub(super) fn joint_trajectory(motion: &MotionSplines, joint_names: &[String]) -> String {
    const POINT_S: f64 = 0.1;
    let list = |numbers: &[f64]| numbers.iter().map(|number| format!("{number:.6}")).collect::<Vec<_>>().join(", ");
    let names: Vec<String> = joint_names.iter().map(|name| json!(name).to_string()).collect();
    let mut text = format!(
        "# ros2 topic pub --once /TOPIC trajectory_msgs/msg/JointTrajectory \"$(cat joint_trajectory.yaml)\"\n\
         joint_names: [{}]\npoints:\n",
        names.join(", ")
    );
    let steps = (motion.duration_s() / POINT_S - 1e-9).ceil().max(1.0) as usize;
    for step in 0..=steps {
        let time_s = (POINT_S * step as f64).min(motion.duration_s());
        let rates: Vec<f64> = (0..motion.joint_count()).map(|joint| motion.value(joint, time_s, 1)).collect();
        let (seconds, rest) = (time_s.trunc(), time_s.fract());
        writeln!(
            text,
            "- {{positions: [{}], velocities: [{}], time_from_start: {{sec: {seconds:.0}, nanosec: {:.0}}}}}",
            list(&motion.joints_rad(time_s)),
            list(&rates),
            (rest * 1e9).round()
        )
        .expect("a string can be written");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::PrescribedMotion;

    /// A gimbal whose only joint turns the camera to the left, and a motion forward, to the left and up.
    fn mission(text: &str) -> (Mission, MotionSplines) {
        let samples = (0..=80).map(|step| {
            let time_s = 0.1 * f64::from(step);
            let ratio = (time_s / 8.0_f64).powi(3) * (10.0 - 15.0 * time_s / 8.0 + 6.0 * (time_s / 8.0_f64).powi(2));
            MotionSample {
                time_s,
                joints_rad: vec![0.5 * ratio],
                position_m: Vector3::new(2.0, 1.0, 0.5) * ratio,
                heading_rad: 0.3 * ratio,
            }
        });
        let motion = PrescribedMotion { joint_names: vec!["yaw".to_owned()], samples: samples.collect() };
        let motion = MotionSplines::through(&motion);
        // The camera looks along x of the IMU: its z is forward, its x to the right, its y down.
        let looks_forward = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
            0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0,
        ));
        let chain = ClassicalChain {
            links: vec![crate::gimbal::DhLink::default()],
            effector_from_camera: crate::geometry::RigidTransform::new(
                UnitQuaternion::from_rotation_matrix(&looks_forward),
                Vector3::zeros(),
            ),
            ..ClassicalChain::default()
        };
        (Mission::new(&motion, &chain, text.parse().unwrap()), motion)
    }

    fn items(mission: &Mission, command: u16) -> Vec<&Item> {
        mission.px4.iter().filter(|item| item.command == command).collect()
    }

    #[test]
    fn waypoints_and_gimbal_angles_are_those_of_the_motion() {
        // The vehicle starts to the east: forward is east, left is north.
        let (mission, _) = mission("47.4,8.5,20,90");
        let waypoints = items(&mission, NAV_WAYPOINT);
        assert_eq!(waypoints.len(), 9);
        let origin = Geodetic::from_deg(47.4, 8.5, 0.0).unwrap();
        let [latitude_deg, longitude_deg, height_m] = waypoints[8].place;
        let moved = Geodetic::from_deg(latitude_deg, longitude_deg, 0.0).unwrap().east_north_up_m(origin);
        assert!((moved.xy() - nalgebra::Vector2::new(2.0, 1.0)).norm() < 1e-3, "{moved}");
        assert!((height_m - 20.5).abs() < 1e-6);
        // A rotation to the left reduces the heading.
        let heading_deg = waypoints[8].parameters[3];
        assert!((heading_deg - (90.0 - 0.3_f64.to_degrees())).abs() < 1e-6, "{heading_deg}");
        let gimbal = items(&mission, DO_GIMBAL_MANAGER_PITCHYAW);
        assert_eq!(gimbal.len(), 9);
        // Yaw of MAVLink is positive to the right.
        let [pitch_deg, yaw_deg, ..] = gimbal[8].parameters;
        assert!(pitch_deg.abs() < 1e-6 && (yaw_deg + 0.5_f64.to_degrees()).abs() < 1e-6, "{pitch_deg} {yaw_deg}");
        assert!(mission.limits.roll_deg < 1e-6);
        let said = mission.to_string();
        assert!(said.contains("9 waypoints") && !said.contains("optical axis"), "{said}");
    }

    #[test]
    fn files_have_the_formats_of_the_ground_stations() {
        let (mission, motion) = mission("-33.9,151.2");
        let text = mission.waypoints();
        let lines: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split('\t').collect()).collect();
        assert!(text.starts_with("QGC WPL 110\n0\t1\t0\t16\t"), "{text}");
        assert!(lines.iter().enumerate().all(|(number, cells)| cells.len() == 12 && cells[0] == number.to_string()));
        assert_eq!(lines[1][3], "22", "takeoff");
        let headings = lines.iter().filter(|cells| cells[3] == "115").count();
        assert!((8..=9).contains(&headings), "{headings}");
        assert!(!text.contains("NaN"), "{text}");
        let plan = mission.plan();
        let items = plan["mission"]["items"].as_array().unwrap();
        assert!(items.iter().all(|item| item["params"].as_array().is_some_and(|all| all.len() == 7)));
        assert_eq!(plan["mission"]["plannedHomePosition"][1], 151.2);
        let joints = joint_trajectory(&motion, &["yaw".to_owned()]);
        assert!(joints.contains("joint_names: [\"yaw\"]\n"), "{joints}");
        assert_eq!(joints.lines().filter(|line| line.starts_with("- {")).count(), 81);
        let last = joints.lines().last().unwrap();
        assert!(last.contains("positions: [0.5000") && last.contains("sec: 8, nanosec: 0"), "{last}");
    }

    #[test]
    fn the_rotation_about_the_optical_axis_is_named() {
        let level = Pointing::of(&UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2));
        assert!(level.pitch_deg.abs() + level.yaw_deg.abs() + level.roll_deg.abs() < 1e-9, "{level:?}");
        let forward = UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
        let rolled = Pointing::of(&(forward * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.2)));
        assert!(
            (rolled.roll_deg.abs() - 0.2_f64.to_degrees()).abs() < 1e-9 && rolled.yaw_deg.abs() < 1e-9,
            "{rolled:?}"
        );
    }

    #[test]
    fn a_start_is_on_the_earth() {
        let start: MissionStart = "47.4, 8.5, 25".parse().unwrap();
        assert_eq!((start.height_m, start.heading_deg), (25.0, 0.0));
        for wrong in ["", "47", "95,8", "0,0", "47,8,x", "47,8,0.1", "47,8,10,400", "47,8,10,0,1", "nan,8"] {
            assert!(wrong.parse::<MissionStart>().is_err(), "{wrong}");
        }
    }
}
