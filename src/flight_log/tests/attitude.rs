//! Joint angles from every kind of attitude: a flight with known chain and joint angles, written as each kind.

use nalgebra::UnitQuaternion;

use super::super::messages::MessageKind;
use super::*;
use crate::flight_log::messages::cdr::CdrWriter;
use crate::geometry::{seconds_from_ns, wrap_angle};
use crate::sensors::{BodyAxes, JointAngles, NamedAxes};

/// Yaw, roll and pitch with a base and a camera that are slightly misaligned with the axes.
const GIMBAL_RIG: &str = "\
rig_version: 1
name: test
gravity: 9.81
imu0: {rostopic: /imu, frame_id: imu, update_rate: 200.0, accelerometer_noise_density: 0.004,
       accelerometer_random_walk: 0.006, gyroscope_noise_density: 3.4e-4, gyroscope_random_walk: 3.9e-5}
cam0:
  mount: gimbal
  rostopic: /camera
  update_rate: 20.0
  camera_model: pinhole
  intrinsics: [50.0, 50.0, 31.5, 23.5]
  distortion_model: none
  resolution: [64, 48]
gimbal:
  SOURCE
  update_rate: 50.0
  encoder_sigma: 0.0087
  prior: {translation_bound: 0.003, rotation_bound: 0.0087}
  T_I_B: [[0.9998547905917815, 0.016935252979663796, 0.0018960319563643617, 0.1],
          [0.01694309849636608, -0.9998476289414527, -0.004201227617909472, 0.0],
          [0.0018245942034336837, 0.004232742216322223, -0.9999893773182408, -0.05], [0, 0, 0, 1]]
  links:
  - {joint: yaw, theta_offset: -1.6113, d: 0.04, a: 0.02, alpha: -1.6155, limits: [-3.14159, 3.14159]}
  - {joint: roll, theta_offset: 1.5370, d: -0.03, a: 0.03, alpha: -1.5882, limits: ROLL}
  - {joint: pitch, theta_offset: -1.5298, d: 0.03, a: 0.01, alpha: -1.5240, limits: [-2.0944, 0.5236]}
  T_E_C: [[0.01918304234397819, -0.0009405346671259029, 0.9998155461288691, 0.03],
          [-0.9998150844218829, -0.0013628552001871963, 0.01918175143635853, 0.0],
          [0.001344562714067632, -0.9999986290091816, -0.0009665044566280478, 0.0], [0, 0, 0, 1]]
";

fn rig_text(source: &str) -> String {
    GIMBAL_RIG.replace("SOURCE", source).replace("ROLL", "[-0.4363, 0.4363]")
}

/// Joint angles of the flight: yaw beyond half a revolution, roll and pitch like a stabilized gimbal.
fn true_angles(stamp_ns: i64) -> Vec<f64> {
    let time_s = seconds_from_ns(stamp_ns);
    vec![wrap_angle(2.8 + 0.5 * time_s), 0.3 * (1.7 * time_s).sin(), -0.6 + 0.4 * (2.3 * time_s).cos()]
}

/// Attitude of the vehicle in FLU and ENU, tilted by up to 25° with a heading that changes.
fn enu_from_flu(stamp_ns: i64) -> UnitQuaternion<f64> {
    let time_s = seconds_from_ns(stamp_ns);
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.9 + 0.4 * time_s);
    heading * so3::exp(&Vector3::new(0.4 * (1.9 * time_s).sin(), 0.35 * (2.6 * time_s).cos(), 0.0))
}

/// Content of a written flight.
struct Recording {
    /// Period of the gimbal's attitude.
    period_ms: i64,
    /// Added to the stamps of the gimbal's attitude.
    delay_ms: i64,
    angles: fn(i64) -> Vec<f64>,
    /// Writes the gimbal's attitude `flu_from_gimbal` (gimbal in FLU too), given the vehicle's attitude.
    gimbal: fn(&mut LogWriter, MessageTimes, UnitQuaternion<f64>, UnitQuaternion<f64>),
    /// Writes the vehicle's attitude in FLU and ENU.
    vehicle: fn(&mut LogWriter, MessageTimes, UnitQuaternion<f64>),
}

impl Recording {
    fn of(gimbal: fn(&mut LogWriter, MessageTimes, UnitQuaternion<f64>, UnitQuaternion<f64>)) -> Self {
        Self { period_ms: 20, delay_ms: 0, angles: true_angles, gimbal, vehicle: |_, _, _| {} }
    }

    fn write(&self, path: &Path) {
        let rig = rig_from(&rig_text("rostopic: null"));
        let chain = rig.gimbal.unwrap().chain;
        let mut writer = LogWriter::create(path, &LogWriterOptions::default()).unwrap();
        for millisecond in 0..4000 {
            let stamp_ns = millisecond * MS;
            let times = MessageTimes { stamp_ns: EPOCH_NS + stamp_ns, log_time_ns: EPOCH_NS + stamp_ns + MS };
            if millisecond % 5 == 0 {
                writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::new(0.0, 0.0, 9.81)).unwrap();
            }
            if millisecond % 10 == 3 {
                (self.vehicle)(&mut writer, times, enu_from_flu(stamp_ns));
            }
            if millisecond % self.period_ms == 4 {
                let taken_ns = stamp_ns - self.delay_ms * MS;
                let imu_from_camera = chain.imu_from_camera(&(self.angles)(taken_ns)).rotation;
                let flu_from_gimbal = imu_from_camera * NamedAxes::RDF.flu_from_axes().inverse();
                (self.gimbal)(&mut writer, times, flu_from_gimbal, enu_from_flu(taken_ns));
            }
            if millisecond % 50 == 27 {
                let image = image_at(stamp_ns, [WIDTH, HEIGHT]);
                writer.write_raw_image("/camera", "camera", times, [WIDTH, HEIGHT], "mono8", &image.pixels).unwrap();
            }
        }
        writer.finish().unwrap();
    }

    /// Joint angles at the images for a rig, and the warnings.
    fn play(&self, rig: &str, start_s: f64) -> (Vec<(i64, Option<JointAngles>)>, Vec<LogWarning>) {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("flight.mcap");
        self.write(&path);
        let (frames, warnings) = play_file(&path, rig, start_s);
        (frames.into_iter().map(|frame| (frame.stamp_ns, frame.joint_angles)).collect(), warnings)
    }

    /// Checks the angles of all frames within the recording against the true ones.
    fn check(&self, source: &str, tolerance_rad: f64) {
        let (frames, warnings) = self.play(&rig_text(source), 0.0);
        assert_eq!(warnings, [], "{source}");
        let mut compared = 0;
        for (stamp_ns, angles) in &frames {
            let Some(angles) = angles else { continue };
            compared += 1;
            for (joint, (angle, truth)) in angles.angles_rad.iter().zip((self.angles)(*stamp_ns)).enumerate() {
                let error = wrap_angle(angle - truth).abs();
                assert!(error < tolerance_rad, "{source}: joint {joint} at {stamp_ns}: {error} rad");
                assert!(error < 3.0 * angles.sigmas_rad[joint], "{source}: σ {}", angles.sigmas_rad[joint]);
            }
        }
        assert!(compared >= 75 && compared + 2 >= frames.len(), "{source}: {compared} of {}", frames.len());
    }
}

fn message(times: MessageTimes) -> CdrWriter {
    let mut out = CdrWriter::new();
    out.i32((times.stamp_ns / 1_000_000_000) as i32);
    out.u32((times.stamp_ns % 1_000_000_000) as u32);
    out.string("frame");
    out
}

fn put_f32s(out: &mut CdrWriter, values: &[f64]) {
    for value in values {
        out.f32(*value as f32);
    }
}

fn xyzw(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.i, rotation.j, rotation.k, rotation.w]
}

fn write_quaternion(writer: &mut LogWriter, topic: &str, times: MessageTimes, rotation: &UnitQuaternion<f64>) {
    let mut out = message(times);
    out.f64s(&xyzw(rotation));
    writer.write(topic, MessageKind::QuaternionStamped, times, &out.finish()).unwrap();
}

/// Converts a rotation between FLU frames to one between FRD frames.
fn in_frd(rotation: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let flu_from_frd = BodyAxes::Frd.flu_from_axes();
    flu_from_frd.inverse() * rotation * flu_from_frd
}

/// Converts an attitude in ENU and FLU to one in NED and FRD.
fn in_ned(rotation: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    BodyAxes::Frd.enu_from_earth().inverse() * rotation * BodyAxes::Frd.flu_from_axes()
}

/// Attitude relative to the levelled frame at the heading.
fn levelled(flu_from_gimbal: UnitQuaternion<f64>, attitude: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let (_, _, heading) = attitude.euler_angles();
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -heading) * attitude * flu_from_gimbal
}

/// Angles of a rotation about z, y and x in this order, in degrees.
fn yaw_pitch_roll_deg(rotation: UnitQuaternion<f64>) -> [f64; 3] {
    let (roll, pitch, yaw) = rotation.euler_angles();
    [yaw, pitch, roll].map(f64::to_degrees)
}

fn write_vector(writer: &mut LogWriter, times: MessageTimes, vector: [f64; 3]) {
    let mut out = message(times);
    out.f64s(&vector);
    writer.write("/gimbal", MessageKind::Vector3Stamped, times, &out.finish()).unwrap();
}

fn write_px4_vehicle(writer: &mut LogWriter, times: MessageTimes, attitude: UnitQuaternion<f64>) {
    let mut out = CdrWriter::new();
    out.u64(times.stamp_ns as u64 / 1000);
    out.u64(times.stamp_ns as u64 / 1000);
    let q = in_ned(attitude);
    put_f32s(&mut out, &[q.w, q.i, q.j, q.k]);
    writer.write("/vehicle", MessageKind::Px4VehicleAttitude, times, &out.finish()).unwrap();
}

/// Flags with yaw lock in every other second, with or without the newer flags of the frame.
fn flags_at(stamp_ns: i64) -> (u16, bool) {
    match (stamp_ns - EPOCH_NS) / 1_000_000_000 % 4 {
        0 => (12, false),
        1 => (12 + 16, true),
        2 => (12 + 16 + 32, false),
        _ => (12 + 64, true),
    }
}

/// 2e-4 rad is the error of a parabola through attitudes of 50 Hz; 32-bit numbers add 1e-6.
const TOLERANCE_RAD: f64 = 2e-4;

#[test]
fn attitudes_relative_to_the_body_return_the_joint_angles() {
    let flu = Recording::of(|writer, times, rotation, _| write_quaternion(writer, "/gimbal", times, &rotation));
    flu.check("source: {topic: /gimbal, type: quaternion, frame: body, axes: flu}", TOLERANCE_RAD);
    let frd = Recording::of(|writer, times, rotation, _| write_quaternion(writer, "/gimbal", times, &in_frd(rotation)));
    frd.check("source: {topic: /gimbal, type: quaternion, frame: body, axes: frd}", TOLERANCE_RAD);
    // Camera axes, and the negative quaternion, which is the same rotation.
    let camera = Recording::of(|writer, times, rotation, _| {
        let rotation = rotation * NamedAxes::RDF.flu_from_axes();
        let negative = UnitQuaternion::new_unchecked(-rotation.into_inner());
        write_quaternion(writer, "/gimbal", times, if times.stamp_ns % 3 == 0 { &negative } else { &rotation });
    });
    let source = "source: {topic: /gimbal, type: quaternion, frame: body, axes: flu, gimbal_axes: rdf}";
    camera.check(source, TOLERANCE_RAD);
    let poses = Recording {
        gimbal: |writer, times, rotation, _| {
            let pose = RigidTransform::new(rotation, Vector3::zeros());
            writer.write_transform("/gimbal", "base", "gimbal", times, &pose).unwrap();
        },
        ..Recording::of(|_, _, _, _| {})
    };
    poses.check("source: {topic: /gimbal, type: pose, frame: body, axes: flu}", TOLERANCE_RAD);
}

#[test]
fn euler_angles_of_any_order_sign_and_unit_return_the_joint_angles() {
    let degrees = Recording::of(|writer, times, rotation, _| {
        let [yaw, pitch, roll] = yaw_pitch_roll_deg(in_frd(rotation));
        write_vector(writer, times, [pitch, roll, yaw]);
    });
    let source =
        "source: {topic: /gimbal, type: euler, frame: body, axes: frd, order: yaw=z pitch=x roll=y, unit: deg}";
    degrees.check(source, TOLERANCE_RAD);
    let radians = Recording::of(|writer, times, rotation, _| {
        let [yaw, pitch, roll] = yaw_pitch_roll_deg(rotation).map(f64::to_radians);
        write_vector(writer, times, [roll, -pitch, yaw]);
    });
    let source =
        "source: {topic: /gimbal, type: euler, frame: body, axes: flu, order: yaw=z pitch=-y roll=x, unit: rad}";
    radians.check(source, TOLERANCE_RAD);
    // The camera rolls about the axis after yaw, then pitches.
    let yaw_roll_pitch = Recording::of(|writer, times, rotation, _| {
        let matrix = in_frd(rotation).to_rotation_matrix();
        let (yaw, roll) = ((-matrix[(0, 1)]).atan2(matrix[(1, 1)]), matrix[(2, 1)].asin());
        write_vector(writer, times, [roll, (-matrix[(2, 0)]).atan2(matrix[(2, 2)]), yaw].map(f64::to_degrees));
    });
    let source =
        "source: {topic: /gimbal, type: euler, frame: body, axes: frd, order: yaw=z roll=x pitch=y, unit: deg}";
    yaw_roll_pitch.check(source, TOLERANCE_RAD);
}

#[test]
fn attitudes_relative_to_the_levelled_vehicle_or_the_earth_return_the_joint_angles() {
    let earth_enu = Recording {
        vehicle: |writer, times, attitude| write_quaternion(writer, "/vehicle", times, &attitude),
        ..Recording::of(|writer, times, rotation, attitude| {
            write_quaternion(writer, "/gimbal", times, &(attitude * rotation));
        })
    };
    let source = "source: {topic: /gimbal, type: quaternion, frame: earth, axes: flu, vehicle: /vehicle}";
    earth_enu.check(source, 3e-4);
    let earth_ned = Recording {
        vehicle: |writer, times, attitude| write_quaternion(writer, "/vehicle", times, &in_ned(attitude)),
        ..Recording::of(|writer, times, rotation, attitude| {
            write_quaternion(writer, "/gimbal", times, &in_ned(attitude * rotation));
        })
    };
    earth_ned.check("source: {topic: /gimbal, type: quaternion, frame: earth, axes: frd, vehicle: /vehicle}", 3e-4);
    // The vehicle's attitude by other messages, in other axes than the gimbal's.
    let levelled_frd = Recording {
        vehicle: |writer, times, attitude| {
            let pose = RigidTransform::new(attitude, Vector3::zeros());
            writer.write_pose("/vehicle", "map", times, &pose).unwrap();
        },
        ..Recording::of(|writer, times, rotation, attitude| {
            write_quaternion(writer, "/gimbal", times, &in_frd(levelled(rotation, attitude)));
        })
    };
    let source =
        "source: {topic: /gimbal, type: quaternion, frame: vehicle, axes: frd, vehicle: /vehicle, vehicle_axes: flu}";
    levelled_frd.check(source, 3e-4);
    let levelled_flu = Recording {
        vehicle: write_px4_vehicle,
        ..Recording::of(|writer, times, rotation, attitude| {
            write_quaternion(writer, "/gimbal", times, &levelled(rotation, attitude));
        })
    };
    levelled_flu
        .check("source: {topic: /gimbal, type: quaternion, frame: vehicle, axes: flu, vehicle: /vehicle}", 3e-4);
}

#[test]
fn the_flags_of_mavlink_messages_decide_the_frame_of_each() {
    let mavros = Recording {
        vehicle: |writer, times, attitude| {
            let pose = RigidTransform::new(attitude, Vector3::zeros());
            writer.write_odometry("/vehicle", times, &Odometry::at_rest("map", "base_link", pose)).unwrap();
        },
        ..Recording::of(|writer, times, rotation, attitude| {
            let (flags, earth) = flags_at(times.stamp_ns);
            let rotation = if earth { in_ned(attitude * rotation) } else { in_frd(levelled(rotation, attitude)) };
            let mut out = message(times);
            out.u8(1);
            out.u8(154);
            out.u16(flags);
            out.f64s(&xyzw(&rotation));
            put_f32s(&mut out, &[0.0; 3]);
            out.u32(0);
            writer.write("/gimbal", MessageKind::MavrosGimbalAttitude, times, &out.finish()).unwrap();
        })
    };
    mavros.check("source: {topic: /gimbal, type: mavros, vehicle: /vehicle, vehicle_axes: flu}", 3e-4);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    mavros.write(&path);
    let log = Arc::new(FlightLog::open(&path).unwrap());
    let rig = rig_from(&rig_text("source: {topic: /gimbal, type: mavros, vehicle: /vehicle}"));
    let error = FrameStream::new(Arc::clone(&log), &rig, "cam0", 0.0, None).unwrap_err().to_string();
    assert!(error.contains("gimbal.source.vehicle_axes: missing, expected frd or flu"), "{error}");
    let px4 = Recording {
        vehicle: write_px4_vehicle,
        ..Recording::of(|writer, times, rotation, attitude| {
            let (flags, earth) = flags_at(times.stamp_ns);
            let q = if earth { in_ned(attitude * rotation) } else { in_frd(levelled(rotation, attitude)) };
            let mut out = CdrWriter::new();
            out.u64(times.stamp_ns as u64 / 1000);
            out.u8(0);
            out.u8(0);
            out.u16(flags);
            put_f32s(&mut out, &[q.w, q.i, q.j, q.k]);
            writer.write("/gimbal", MessageKind::Px4GimbalAttitude, times, &out.finish()).unwrap();
        })
    };
    px4.check("source: {topic: /gimbal, type: px4, vehicle: /vehicle}", 3e-4);
}

/// Writes transforms of one message: parent, child, rotation.
fn write_transforms(
    writer: &mut LogWriter,
    topic: &str,
    times: MessageTimes,
    all: &[(&str, &str, UnitQuaternion<f64>)],
) {
    let mut out = CdrWriter::new();
    out.u32(all.len() as u32);
    for (parent, child, rotation) in all {
        out.i32((times.stamp_ns / 1_000_000_000) as i32);
        out.u32((times.stamp_ns % 1_000_000_000) as u32);
        out.string(parent);
        out.string(child);
        out.f64s(&[0.1, 0.2, 0.3]);
        out.f64s(&xyzw(rotation));
    }
    writer.write(topic, MessageKind::Transforms, times, &out.finish()).unwrap();
}

/// Static transforms from the vehicle to the gimbal's base, and from the base to the gimbal's housing.
fn mounts() -> [UnitQuaternion<f64>; 2] {
    [so3::exp(&Vector3::new(0.3, -0.2, 2.0)), so3::exp(&Vector3::new(-1.0, 0.4, 0.1))]
}

#[test]
fn transforms_along_a_chain_of_frames_return_the_joint_angles() {
    // body ← mount (static) ← yaw ← pan (half of the rotation) ← gimbal (static), with another robot's frames on the topic.
    let chain = Recording {
        vehicle: |writer, times, attitude| {
            let other = [("map", "odom", attitude), ("odom", "body", UnitQuaternion::identity())];
            write_transforms(writer, "/tf", times, &other);
            if (times.stamp_ns - EPOCH_NS) < 100 * MS {
                let [mount, housing] = mounts();
                write_transforms(
                    writer,
                    "/tf_static",
                    times,
                    &[("body", "mount", mount), ("/tilt", "/gimbal", housing)],
                );
            }
        },
        ..Recording::of(|writer, times, rotation, _| {
            let [mount, housing] = mounts();
            let moving = mount.inverse() * rotation * housing.inverse();
            let half = UnitQuaternion::identity().try_slerp(&moving, 0.5, 1e-9).unwrap_or_default();
            write_transforms(writer, "/tf", times, &[("tilt_base", "tilt", half.inverse() * moving)]);
            write_transforms(writer, "/tf", times, &[("mount", "tilt_base", half)]);
        })
    };
    chain.check("source: {topic: /tf, type: tf, frame: body, axes: flu, parent: body, child: gimbal}", TOLERANCE_RAD);
    // From the odometry's frame: the path to the gimbal leads through the vehicle.
    let rig = |parent: &str, child: &str| {
        let source =
            format!("source: {{topic: /tf, type: tf, frame: body, axes: flu, parent: {parent}, child: {child}}}");
        rig_from(&rig_text(&source))
    };
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    chain.write(&path);
    let log = Arc::new(FlightLog::open(&path).unwrap());
    let check = |parent: &str, child: &str, expected: &str| {
        let error = FrameStream::new(Arc::clone(&log), &rig(parent, child), "cam0", 0.0, None).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    };
    check("body", "lens", "there is no frame 'lens'; the frames are body, gimbal, mount, odom, tilt, tilt_base");
    check("body", "mount", "all transforms between 'body' and 'mount' are static");
    assert!(FrameStream::new(Arc::clone(&log), &rig("gimbal", "odom"), "cam0", 0.0, None).is_ok());
}

#[test]
fn a_replay_from_the_middle_has_the_same_joint_angles() {
    // Limits that admit both solutions of the roll, and a pitch axis that passes through the yaw axis's direction at 2
    // s.
    let through = |stamp_ns: i64| {
        let time_s = seconds_from_ns(stamp_ns);
        vec![0.4 + 0.2 * time_s, 1.5 * (0.9 * time_s).sin() + 0.12 * time_s, -0.6 + 0.3 * (2.0 * time_s).cos()]
    };
    let recording = Recording {
        angles: through,
        ..Recording::of(|writer, times, rotation, _| {
            write_quaternion(writer, "/gimbal", times, &(so3::exp(&Vector3::new(1e-3, 0.0, 2e-3)) * rotation));
        })
    };
    let source = "source: {topic: /gimbal, type: quaternion, frame: body, axes: flu}";
    let rig = GIMBAL_RIG.replace("SOURCE", source).replace("ROLL", "[-3.1, 3.1]");
    let (all, warnings) = recording.play(&rig, 0.0);
    assert_eq!(warnings, []);
    for start_s in [0.4, 1.7, 2.2, 3.5] {
        let (late, _) = recording.play(&rig, start_s);
        let before = all.len() - late.len();
        assert!(late.len() > 5 && before > 5);
        for (late, all) in late[1..].iter().zip(&all[before + 1..]) {
            assert_eq!(late, all, "from {start_s} s");
        }
    }
    for (stamp_ns, angles) in &all[..all.len() - 1] {
        let truth = through(*stamp_ns);
        for (angle, truth) in angles.as_ref().unwrap().angles_rad.iter().zip(&truth) {
            assert!(wrap_angle(angle - truth).abs() < 0.12, "{stamp_ns}: {angle} of {truth}");
        }
    }
}

#[test]
fn slow_attitudes_are_interpolated_with_an_uncertainty_that_grows() {
    let mut before = 0.0;
    for period_ms in [20, 100, 200] {
        let recording = Recording {
            period_ms,
            ..Recording::of(|writer, times, rotation, _| write_quaternion(writer, "/gimbal", times, &rotation))
        };
        let rig = rig_text("source: {topic: /gimbal, type: quaternion, frame: body, axes: flu}");
        let (frames, warnings) = recording.play(&rig, 0.0);
        assert_eq!(warnings, []);
        let mut sigmas = Vec::new();
        for (stamp_ns, angles) in &frames[4..frames.len() - 5] {
            let angles = angles.as_ref().unwrap();
            for (joint, truth) in true_angles(*stamp_ns).into_iter().enumerate() {
                let error = wrap_angle(angles.angles_rad[joint] - truth).abs();
                assert!(error < 3.0 * angles.sigmas_rad[joint] && error < 0.02, "{period_ms} ms: {error}");
            }
            assert!((angles.rates_rad_per_s[0] - 0.5).abs() < 0.02, "{}", angles.rates_rad_per_s[0]);
            sigmas.push(angles.sigmas_rad[0]);
        }
        let mean = sigmas.iter().sum::<f64>() / sigmas.len() as f64;
        assert!(mean > 1.2 * before, "{period_ms} ms: {mean} after {before}");
        before = mean;
    }
}

#[test]
fn the_rigs_time_offset_of_the_gimbal_counts_for_its_stamps_alone() {
    let recording = Recording {
        delay_ms: 100,
        vehicle: |writer, times, attitude| write_quaternion(writer, "/vehicle", times, &attitude),
        ..Recording::of(|writer, times, rotation, attitude| {
            write_quaternion(writer, "/gimbal", times, &(attitude * rotation));
        })
    };
    let source = "source: {topic: /gimbal, type: quaternion, frame: earth, axes: flu, vehicle: /vehicle}
  timeshift_gimbal_imu: -0.1";
    let (frames, warnings) = recording.play(&rig_text(source), 0.0);
    assert_eq!(warnings, []);
    for (stamp_ns, angles) in &frames[..frames.len() - 4] {
        for (angle, truth) in angles.as_ref().unwrap().angles_rad.iter().zip(true_angles(*stamp_ns)) {
            assert!(wrap_angle(angle - truth).abs() < 3e-4, "{stamp_ns}: {angle} of {truth}");
        }
    }
}

#[test]
fn attitudes_without_a_vehicle_or_beyond_the_joints_are_named() {
    let gap = Recording {
        vehicle: |writer, times, attitude| {
            let at_ms = (times.stamp_ns - EPOCH_NS) / MS;
            if !(1000..1500).contains(&at_ms) {
                write_quaternion(writer, "/vehicle", times, &attitude);
            }
        },
        ..Recording::of(|writer, times, rotation, attitude| {
            write_quaternion(writer, "/gimbal", times, &(attitude * rotation));
        })
    };
    let source = "source: {topic: /gimbal, type: quaternion, frame: earth, axes: flu, vehicle: /vehicle}";
    let (_, warnings) = gap.play(&rig_text(source), 0.0);
    let warning = warning_with(&warnings, &["/gimbal: attitudes from 1.004 s to 1.484 s are not used", "/vehicle"]);
    assert_eq!(warning.stamp_ns, 1004 * MS);
    let beyond = Recording {
        angles: |stamp_ns| {
            let roll = if (2000..2400).contains(&(stamp_ns / MS)) { 0.8 } else { 0.1 };
            vec![0.2, roll, -0.5]
        },
        ..Recording::of(|writer, times, rotation, _| write_quaternion(writer, "/gimbal", times, &rotation))
    };
    let source = "source: {topic: /gimbal, type: quaternion, frame: body, axes: flu}";
    let (_, warnings) = beyond.play(&rig_text(source), 0.0);
    // 0.8 rad are 45.8°, the limit with its tolerance is at 27.0°.
    warning_with(&warnings, &["/gimbal: up to 18.8° of the attitude from 2.004 s to 2.384 s", "cannot be reached"]);
}

#[test]
fn stamps_since_px4_started_give_way_to_the_times_of_recording() {
    let boot = Recording::of(|writer, times, rotation, _| {
        let mut out = CdrWriter::new();
        out.u64((times.stamp_ns - EPOCH_NS) as u64 / 1000 + 77_000_000);
        out.u8(0);
        out.u8(0);
        out.u16(12);
        let q = in_frd(rotation);
        put_f32s(&mut out, &[q.w, q.i, q.j, q.k]);
        writer.write("/gimbal", MessageKind::Px4GimbalAttitude, times, &out.finish()).unwrap();
    });
    let (frames, warnings) = boot.play(&rig_text("source: {topic: /gimbal, type: px4, frame: body}"), 0.0);
    warning_with(
        &warnings,
        &["/gimbal: the stamps count from PX4's start (the first is 77.004 s)", "the log times are used"],
    );
    for (stamp_ns, angles) in &frames[..frames.len() - 1] {
        // Messages are recorded 1 ms after their stamp.
        for (angle, truth) in angles.as_ref().unwrap().angles_rad.iter().zip(true_angles(*stamp_ns - MS)) {
            assert!(wrap_angle(angle - truth).abs() < 3e-4);
        }
    }
}
