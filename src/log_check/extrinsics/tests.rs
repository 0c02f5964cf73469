//! Faults in the rotations of a camera: each is planted in synthetic image rotations and must be named.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::frontend::readout::{RowObservation, RowTrack};
use crate::geometry::so3;
use crate::log_check::report::{CheckReport, ImageRotation, Severity};
use crate::log_check::tests::{Flight, MS, Noise, rate_at, rig_text};

/// Image rotations of a camera, and what is wrong with them.
struct Images {
    /// Delay of the stamps in seconds.
    late_s: f64,
    /// Rotation of the camera against the rig at a time in seconds.
    mount: fn(f64) -> Vector3<f64>,
    /// Ratio of the focal length to the rig's at a time in seconds.
    focal: fn(f64) -> f64,
    /// Coefficient of the division model of a distortion that the rig lacks.
    radial: f64,
    /// Seconds from the stamp of the image with a number to its exposure.
    exposed_s: fn(i64) -> f64,
    /// Rotation of the IMU from its rotation vector, as if its driver changed the axes the other way.
    of_imu: fn(Vector3<f64>) -> Vector3<f64>,
    /// Angle of the joint on which the camera is, in radians at a time in seconds; `None` for a rigid camera.
    joint: Option<fn(f64) -> f64>,
}

impl Default for Images {
    fn default() -> Self {
        Self {
            late_s: 0.0,
            mount: |_| Vector3::zeros(),
            focal: |_| 1.0,
            radial: 0.0,
            exposed_s: |_| 0.0,
            of_imu: |vector| vector,
            joint: None,
        }
    }
}

/// `camera_from_imu` of the rig's rigid camera.
fn camera_from_imu() -> UnitQuaternion<f64> {
    UnitQuaternion::from_matrix(&Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0))
}

/// Angle of the joint of [`Flight`] without noise.
fn joint_at(time_s: f64) -> f64 {
    0.7 * (0.9 * time_s).sin()
}

/// Rotation `second_from_first` of the IMU between two times in any order.
fn imu_rotation(from_s: f64, to_s: f64) -> UnitQuaternion<f64> {
    let length_s = (to_s - from_s) / 500.0;
    let step = |step: i32| so3::exp(&(rate_at(from_s + (f64::from(step) + 0.5) * length_s) * length_s));
    (0..500).map(step).fold(UnitQuaternion::identity(), |all, next| all * next).inverse()
}

impl Images {
    fn rotations(&self) -> Vec<ImageRotation> {
        let mut noise = Noise(23);
        let chain_at = |time_s: f64| {
            let mount = so3::exp(&(self.mount)(time_s));
            // By the chain of the rig: a joint about the IMU's z axis, a twist, and the camera at its end.
            let Some(joint) = self.joint else { return mount * camera_from_imu() };
            let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -1.55);
            let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), joint(time_s));
            let end = UnitQuaternion::from_matrix(&Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0));
            mount * (yaw * twist * end).inverse()
        };
        let rotation = |number: i64| {
            let from_s = number as f64 * 0.05;
            let exposed = |number: i64| number as f64 * 0.05 + self.late_s + (self.exposed_s)(number);
            let of_imu = imu_rotation(exposed(number), exposed(number + 1));
            let imu = so3::exp(&(self.of_imu)(so3::log(&of_imu)));
            // The mount does not move within a pair.
            let to = chain_at(from_s + 0.05);
            let from = if (self.mount)(from_s) == (self.mount)(from_s + 0.05) { chain_at(from_s) } else { to };
            let second_from_first = to * imu * from.inverse();
            let [focal, next] = [from_s, from_s + 0.05].map(self.focal);
            let vector = so3::log(&second_from_first);
            let from_ns = number * 50 * MS;
            ImageRotation {
                camera_key: "cam0".into(),
                from_ns,
                to_ns: from_ns + 50 * MS,
                second_from_first: so3::exp(&Vector3::new(vector.x * focal, vector.y * focal, vector.z)),
                tracks: tracks(&second_from_first, [focal, next], self.radial, &mut noise),
            }
        };
        (60..200).map(rotation).collect()
    }

    fn check(&self, flight: &Flight) -> CheckReport {
        flight.check(&self.rotations())
    }
}

/// Features of two images between which the camera rotates, with noise of 0.1 px, by focal lengths that are these ratios of
/// the rig's and a distortion that the rig lacks.
fn tracks(second_from_first: &UnitQuaternion<f64>, focal: [f64; 2], radial: f64, noise: &mut Noise) -> Vec<RowTrack> {
    let observation = |bearing: Vector3<f64>, focal: f64| {
        let [x, y] = [bearing.x / bearing.z, bearing.y / bearing.z];
        // From x = x' / (1 + λ r'²) follows r' by iteration.
        let (size, mut distorted) = (x.hypot(y), x.hypot(y));
        for _ in 0..20 {
            distorted = size * (1.0 + radial * distorted * distorted);
        }
        let ratio = focal * if size > 0.0 { distorted / size } else { 1.0 };
        RowObservation { bearing: Vector3::new(ratio * x, ratio * y, 1.0).normalize(), row: 0.5 }
    };
    (0..60)
        .map(|_| {
            let point = 0.3 * noise.vector();
            let bearing = Vector3::new(point.x, point.y, 1.0).normalize();
            let now = second_from_first * bearing + 0.1 / 80.0 * noise.vector();
            RowTrack { previous: observation(bearing, focal[0]), now: observation(now, focal[1]) }
        })
        .collect()
}

/// Checks that exactly one finding of this severity contains all these words in its title or remedy.
fn expect(report: &CheckReport, severity: Severity, words: &[&str]) {
    let found = report.findings.iter().filter(|finding| {
        finding.severity == severity
            && words.iter().all(|word| format!("{} {}", finding.title, finding.remedy).contains(word))
    });
    assert_eq!(found.count(), 1, "{severity:?} {words:?} in\n{report}");
}

/// The flight with its camera on the joint.
fn on_gimbal() -> Flight {
    let rigid = "  mount: static\n";
    let matrix = "  T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 0.05], [1, 0, 0, -0.1], [0, 0, 0, 1]]\n";
    let rig = rig_text().replace(rigid, "  mount: gimbal\n").replace(matrix, "");
    assert_ne!(rig, rig_text());
    Flight { rig, ..Flight::default() }
}

#[test]
fn image_rotations_detect_time_offsets_and_wrong_extrinsics() {
    let check = |images: Images, severity: Severity, words: &[&str]| {
        expect(&images.check(&Flight::default()), severity, words);
    };
    let late = |late_s: f64| Images { late_s, ..Images::default() };
    check(late(0.0), Severity::Good, &["the orientation of cam0 agrees with the rig"]);
    check(late(0.0), Severity::Good, &["cam0 and the gyroscope are synchronized"]);
    check(late(0.03), Severity::Warning, &["the stamps of cam0 are 29.6 ms earlier", "cam0.timeshift_cam_imu: 0.0296"]);
    check(late(0.03), Severity::Good, &["the orientation of cam0 agrees with the rig"]);
    let turned = Images { mount: |_| Vector3::new(0.0, 0.2, 0.0), ..Images::default() };
    check(turned, Severity::Warning, &["the orientation of cam0 differs from the rig by 11."]);
    let wrong = Images { late_s: -0.05, mount: |_| Vector3::new(1.5, 0.0, 0.0), ..Images::default() };
    check(wrong, Severity::Error, &["the orientation of cam0 differs from the rig"]);
}

#[test]
fn exchanged_axes_of_the_imu_are_named() {
    let of =
        |of_imu: fn(Vector3<f64>) -> Vector3<f64>| Images { of_imu, ..Images::default() }.check(&Flight::default());
    let swapped = of(|vector| Vector3::new(vector.y, vector.x, vector.z));
    expect(&swapped, Severity::Error, &["axes of the gyroscope form a left-handed frame (x and y swapped)"]);
    assert!(!swapped.findings.iter().any(|finding| finding.title.contains("orientation of cam0")), "{swapped}");
    let reversed = of(|vector| Vector3::new(vector.x, vector.y, -vector.z));
    expect(&reversed, Severity::Error, &["axes of the gyroscope form a left-handed frame (z reversed)"]);
    let scaled = of(|vector| 0.5 * vector);
    expect(&scaled, Severity::Error, &["the gyroscope measures 2.0", "range setting"]);
}

#[test]
fn a_wrong_focal_length_is_named_with_its_value_and_its_time() {
    let of = |focal: fn(f64) -> f64| Images { focal, ..Images::default() }.check(&Flight::default());
    let long = of(|_| 1.0 / 1.25);
    expect(&long, Severity::Error, &["the focal length of cam0 in the rig is 1.2", "times too long"]);
    let short = of(|_| 1.2);
    expect(&short, Severity::Error, &["the focal length of cam0 in the rig is 1.2", "times too short"]);
    let zoom = of(|time_s| if time_s < 6.0 { 1.0 } else { 1.4 });
    // The focal lengths of the search differ by 1.6 %.
    expect(&zoom, Severity::Error, &["the focal length of cam0 changes: 1.00 times", "1.39 from 6.0 s on"]);
}

#[test]
fn a_focal_length_that_varies_and_a_missing_distortion_are_named() {
    let hunting = |time_s: f64| 1.0 + 0.35 * (TAU * time_s / 2.5).sin();
    let report = Images { focal: hunting, ..Images::default() }.check(&Flight::default());
    expect(&report, Severity::Error, &["the focal length of cam0 varies by ±3", "with a period of 2.5 s"]);
    let report = Images { radial: -0.3, ..Images::default() }.check(&Flight::default());
    expect(&report, Severity::Error, &["a radial distortion that the rig lacks, k1 of about -0.29"]);
}

#[test]
fn images_in_another_order_than_their_stamps_are_named() {
    let of = |exposed_s: fn(i64) -> f64| Images { exposed_s, ..Images::default() }.check(&Flight::default());
    // Decoding order: the third image of each cycle comes first.
    let decoded = of(|number| if number % 3 == 0 { 0.1 } else { -0.05 });
    expect(&decoded, Severity::Error, &["images of cam0 are not in the order of their stamps: in cycles of 3"]);
    let alternating = of(|number| if number % 2 == 0 { 0.012 } else { -0.012 });
    expect(&alternating, Severity::Error, &["the stamps of cam0 are wrong in a cycle of 2 images", "12"]);
}

#[test]
fn a_mount_that_moves_is_named_with_its_time() {
    let images = Images {
        mount: |time_s| if time_s < 6.5 { Vector3::zeros() } else { Vector3::new(0.0, 0.2, 0.1) },
        ..Images::default()
    };
    expect(
        &images.check(&Flight::default()),
        Severity::Error,
        &["the mount of cam0 moves: rotated by 12", "from about 6."],
    );
}

#[test]
fn faults_of_a_joint_are_named() {
    let of = |joint: fn(f64) -> f64| Images { joint: Some(joint), ..Images::default() }.check(&on_gimbal());
    expect(&of(joint_at), Severity::Good, &["the orientation of cam0 agrees with the rig"]);
    expect(&of(|time_s| -joint_at(time_s)), Severity::Error, &["joint 'yaw' counts in the other direction"]);
    expect(
        &of(|time_s| joint_at(time_s + 0.12)),
        Severity::Error,
        &["the stamps of the joint angles are 1", "ms later"],
    );
    let halved = of(|time_s| 2.0 * joint_at(time_s));
    expect(&halved, Severity::Error, &["readings of joint 'yaw' are 0.5", "gear ratio"]);
}

#[test]
fn the_play_of_a_joint_is_named() {
    fn fast_at(time_s: f64) -> f64 {
        0.4 * (4.0 * time_s).sin()
    }
    let play = |ms: i64, angle: &mut f64| {
        let time_s = ms as f64 * 1e-3;
        let noise_rad = *angle - joint_at(time_s);
        *angle = fast_at(time_s) + noise_rad + if (4.0 * time_s).cos() > 0.0 { 0.06 } else { -0.06 };
    };
    let images = Images { joint: Some(fast_at), ..Images::default() };
    let report = images.check(&Flight { joint: play, ..on_gimbal() });
    expect(&report, Severity::Warning, &["the reading of joint 'yaw' depends on its direction of motion: play of 6."]);
}

#[test]
fn joint_angles_that_are_held_are_named() {
    let held = |ms: i64, angle: &mut f64| *angle = joint_at((ms - ms % 100) as f64 * 1e-3);
    let images = Images { joint: Some(joint_at), ..Images::default() };
    let report = images.check(&Flight { joint: held, ..on_gimbal() });
    expect(&report, Severity::Warning, &["the joint angles hold their values: 10.", "in messages at 50 Hz"]);
    expect(&report, Severity::Note, &["the rotations of cam0 are not compared"]);
}

#[test]
fn images_that_are_turned_or_mirrored_are_named() {
    let of = |mount: fn(f64) -> Vector3<f64>| Images { mount, ..Images::default() }.check(&Flight::default());
    let words = |images: &str| format!("the images of cam0 are {images}, or its orientation differs from the rig");
    let quarter = of(|_| Vector3::new(0.0, 0.0, FRAC_PI_2));
    expect(&quarter, Severity::Error, &[&words("rotated by 90°")]);
    expect(&of(|_| Vector3::new(0.0, 0.0, PI)), Severity::Error, &[&words("upside down (rotated by 180°)")]);
    // Rotations in mirrored images equal the rotations of a camera that is rotated by 180°.
    let mirrored = of(|_| Vector3::new(PI, 0.0, 0.0));
    expect(&mirrored, Severity::Error, &[&words("mirrored (left and right exchanged)"), "look at text"]);
}

#[test]
fn faults_within_the_noise_of_single_rotations_are_named() {
    // The rotations of two thirds of the flight fit the rig.
    let late = Images {
        mount: |time_s| if time_s < 7.5 { Vector3::zeros() } else { Vector3::new(0.0, 0.15, 0.1) },
        ..Images::default()
    };
    expect(
        &late.check(&Flight::default()),
        Severity::Error,
        &["the mount of cam0 moves: rotated by ", "from about 7."],
    );
    let jump = |time_s: f64| joint_at(time_s) + if time_s < 7.5 { 0.0 } else { 0.2 };
    let report = Images { joint: Some(jump), ..Images::default() }.check(&on_gimbal());
    expect(&report, Severity::Error, &["the readings of joint 'yaw' jump by -11.", "at about 7."]);
}

#[test]
fn faults_that_begin_at_a_time_are_named() {
    let mount = |time_s: f64| if time_s < 6.0 { Vector3::zeros() } else { Vector3::new(PI, 0.0, 0.0) };
    let mirrored = Images { mount, ..Images::default() }.check(&Flight::default());
    expect(&mirrored, Severity::Error, &["the images of cam0 are mirrored", "from about 6.0 s on"]);
    let reversed = |time_s: f64| if time_s < 6.0 { joint_at(time_s) } else { -joint_at(time_s) };
    let report = Images { joint: Some(reversed), ..Images::default() }.check(&on_gimbal());
    expect(&report, Severity::Error, &["joint 'yaw' counts in the other direction", "from about 5.8 s on"]);
}

#[test]
fn units_of_joint_angles_are_named() {
    let of = |joint: fn(i64, &mut f64)| {
        let images = Images { joint: Some(joint_at), ..Images::default() };
        images.check(&Flight { joint, ..on_gimbal() })
    };
    let degrees = of(|_, angle| *angle = angle.to_degrees());
    expect(&degrees, Severity::Error, &["readings of 'yaw' appear to be in degrees"]);
    expect(&degrees, Severity::Error, &["joint angles are in degrees"]);
    let counts = of(|_, angle| *angle = (*angle * 4096.0 / TAU).round());
    expect(&counts, Severity::Error, &["readings of 'yaw' appear to be in encoder counts or whole degrees"]);
    expect(&counts, Severity::Error, &["joint angles are in encoder counts, 4096 per turn"]);
    let turned = of(|ms, angle| *angle += if ms > 6000 { TAU } else { 0.0 });
    expect(&turned, Severity::Note, &["readings of 'yaw' contain whole turns", "nothing to do"]);
    expect(&turned, Severity::Good, &["the orientation of cam0 agrees with the rig"]);
}

#[test]
fn joint_angles_that_end_before_the_images_are_an_error() {
    let ends = |ms: i64, angle: &mut f64| {
        if ms > 7000 {
            *angle = f64::NAN;
        }
    };
    let report = Flight { joint: ends, ..on_gimbal() }.check(&[]);
    expect(&report, Severity::Error, &["joint angles end at 7.0 s"]);
    let begins = |ms: i64, angle: &mut f64| {
        if ms < 700 {
            *angle = f64::NAN;
        }
    };
    expect(&Flight { joint: begins, ..on_gimbal() }.check(&[]), Severity::Warning, &["joint angles begin at 0.7 s"]);
}
