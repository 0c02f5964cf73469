use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use super::comparison::Parameter;
use super::orientations::Orientations;
use super::source::Source;
use super::statement::Statement;
use super::{Compared, Pair, Quantity, Rotations, culprits, motion_culprits, rotation};
use crate::faults::FaultKind;
use crate::files::RigFile as _;
use crate::geometry::{RigidTransform, so3};
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::Findings;
use crate::log_check::survey::Survey;
use crate::log_check::tests::{Noise, rig_text};
use crate::sensors::{AngularRates, ImuSample, Rig};

fn rate_at(time_s: f64) -> Vector3<f64> {
    Vector3::new(0.5 * (1.3 * time_s).sin(), 0.4 * (1.9 * time_s).cos(), 0.3 * (0.7 * time_s).sin())
}

/// Orientations over 25 s by a source with a step, a noise per orientation in radians, and an error of its rates at each time.
fn source(source: Source, step_s: f64, noise_rad: f64, error: impl Fn(f64) -> Vector3<f64>) -> Orientations {
    let mut noise = Noise(7);
    let mut orientation = UnitQuaternion::identity();
    let mut nodes = Vec::new();
    for number in 0..5000_i32 {
        let time_s = f64::from(number) * 0.005;
        if (time_s / step_s).fract() < 0.005 / step_s - 1e-9 {
            nodes.push((time_s, so3::plus(&orientation, &(noise.vector() * noise_rad)), 0.0, noise_rad.powi(2)));
        }
        let middle_s = time_s + 0.0025;
        orientation = so3::plus(&orientation, &((rate_at(middle_s) + error(middle_s)) * 0.005));
    }
    Orientations::of_nodes(source, nodes.into_iter())
}

fn pairs(sources: &[Orientations]) -> Vec<Pair> {
    let both = |one: usize, other: usize| rotation::compare(&sources[one], &sources[other]);
    let numbers = (0..sources.len()).flat_map(|one| (one + 1..sources.len()).map(move |other| (one, other)));
    let pair = |(one, other)| {
        let (sources, fit, offsets) = both(one, other)?;
        Some(Pair { quantity: Quantity::Rotation, sources, first_from_second: offsets.first_from_second, fit })
    };
    numbers.filter_map(pair).collect()
}

fn statement(sources: &[Orientations]) -> Option<Statement> {
    let pairs = pairs(sources);
    Statement::of(
        &culprits(&pairs.iter().map(Pair::verdict).collect::<Vec<_>>()),
        &pairs,
        &Rig::from_yaml(&rig_text(), Path::new("some.rig.yaml")).unwrap(),
    )
}

fn images() -> Source {
    Source::Images { camera_key: "cam0".to_owned(), with_joints: false }
}

/// Samples and poses of a flight over 25 s with accelerations of up to 2 m/s², whose driver changes samples by the time and the
/// orientation `world_from_imu`.
fn flight(change: impl Fn(f64, &UnitQuaternion<f64>, &mut ImuSample)) -> (ImuFacts, Vec<(i64, RigidTransform)>) {
    flight_with(rate_at, change)
}

/// A flight with other angular rates.
fn flight_with(
    rate_at: impl Fn(f64) -> Vector3<f64>,
    change: impl Fn(f64, &UnitQuaternion<f64>, &mut ImuSample),
) -> (ImuFacts, Vec<(i64, RigidTransform)>) {
    let position = |t: f64| Vector3::new((2.0 * t).sin(), 0.5 * (1.6 * t).cos(), 0.3 * (2.4 * t).sin()) * 0.5;
    let mut world_from_imu = UnitQuaternion::identity();
    let (mut samples, mut poses) = (Vec::new(), Vec::new());
    for number in 0..5000_i64 {
        let t = number as f64 * 0.005;
        let acceleration = (position(t + 0.01) - 2.0 * position(t) + position(t - 0.01)) / 1e-4;
        let mut sample = ImuSample {
            stamp_ns: number * 5_000_000,
            angular_velocity_rad_per_s: rate_at(t),
            specific_force_m_per_s2: world_from_imu.inverse() * (acceleration + Vector3::new(0.0, 0.0, 9.81)),
            unmeasured_s: 0.0,
        };
        change(t, &world_from_imu, &mut sample);
        samples.push(sample);
        poses.push((number * 5_000_000, RigidTransform::new(world_from_imu, position(t))));
        world_from_imu = so3::plus(&world_from_imu, &(rate_at(t + 0.0025) * 0.005));
    }
    let rates = samples.iter().map(|it| (it.stamp_ns as f64 * 1e-9, it.angular_velocity_rad_per_s));
    let gyroscope = AngularRates::new(rates);
    (ImuFacts { samples, gyroscope, ..ImuFacts::default() }, poses)
}

/// Statements about a flight whose driver changes its samples.
fn statements(change: impl Fn(f64, &UnitQuaternion<f64>, &mut ImuSample)) -> Vec<Statement> {
    let (imu_facts, poses) = flight(change);
    statements_of(&imu_facts, &poses)
}

fn statements_of(imu_facts: &ImuFacts, poses: &[(i64, RigidTransform)]) -> Vec<Statement> {
    let rig = Rig::from_yaml(&rig_text(), Path::new("some.rig.yaml")).unwrap();
    let compared = Compared {
        survey: &Survey::default(),
        rig: &rig,
        imu_facts,
        joint_noise_ratios: Vec::new(),
        images: &[],
        measured: &BTreeMap::new(),
        poses,
    };
    let Rotations { pairs, truth } = Rotations::of(&compared);
    let motion = truth.map_or_else(Vec::new, |truth| compared.motion(&truth, &[], &Findings::default()));
    let of_rotation = compared.statement(&pairs);
    of_rotation.into_iter().chain(Statement::of(&motion_culprits(&motion), &motion, &rig)).collect()
}

#[test]
fn axes_and_units_of_the_accelerometer_that_change_are_named_with_their_time() {
    assert_eq!(statements(|_, _, _| ()).len(), 0);
    let changed = |change: fn(Vector3<f64>) -> Vector3<f64>| {
        let found = statements(|t, _, sample| {
            if t >= 12.0 {
                sample.specific_force_m_per_s2 = change(sample.specific_force_m_per_s2);
            }
        });
        found[0].cause.clone().unwrap()
    };
    let axes = changed(|force| Vector3::new(force.y, -force.x, force.z));
    assert_eq!(axes.kind, FaultKind::AccelerometerAxes);
    assert!((axes.since_s.unwrap() - 12.0).abs() < 0.5, "{axes:?}");
    let unit = changed(|force| force / 9.80665);
    assert_eq!((unit.kind, unit.values.as_slice()), (FaultKind::AccelerometerScale, &[9.80665][..]));
    assert!((unit.since_s.unwrap() - 12.0).abs() < 0.5, "{unit:?}");
}

#[test]
fn positions_of_a_left_handed_world_are_named() {
    let (imu_facts, mut poses) = flight(|_, _, _| ());
    for (_, pose) in &mut poses {
        pose.translation_m.y = -pose.translation_m.y;
    }
    let titles: Vec<String> = statements_of(&imu_facts, &poses).into_iter().map(|it| it.title).collect();
    assert_eq!(titles, ["the axes of the ground truth's positions form a left-handed world: y reversed"]);
}

#[test]
fn measurements_in_the_axes_of_the_world_are_named() {
    let title = |change: fn(f64, &UnitQuaternion<f64>, &mut ImuSample)| {
        let titles = statements(change).into_iter().map(|statement| statement.title);
        titles.collect::<Vec<_>>().join("; ")
    };
    let forces = title(|_, world_from_imu, sample| {
        sample.specific_force_m_per_s2 = world_from_imu * sample.specific_force_m_per_s2;
    });
    assert_eq!(forces, "the specific forces have the axes of the world, not of the IMU");
    let level = title(|_, world_from_imu, sample| {
        let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), world_from_imu.euler_angles().2);
        sample.specific_force_m_per_s2 = heading.inverse() * (world_from_imu * sample.specific_force_m_per_s2);
    });
    assert_eq!(level, "the specific forces are levelled: they lack roll and pitch of the IMU");
    let rates = title(|_, world_from_imu, sample| {
        sample.angular_velocity_rad_per_s = world_from_imu * sample.angular_velocity_rad_per_s;
    });
    assert!(rates.starts_with("the angular rates have the axes of the world, not of the IMU"), "{rates}");
}

#[test]
fn wrong_measurements_in_a_short_stretch_are_found() {
    let held = |time_s: f64| if (12.0..14.5).contains(&time_s) { -rate_at(time_s) } else { Vector3::zeros() };
    let sound = |_: f64| Vector3::zeros();
    let all = [
        source(Source::Gyroscope, 0.005, 0.0, held),
        source(images(), 0.05, 3e-4, sound),
        source(Source::GroundTruth, 0.005, 1e-4, sound),
    ];
    let found = statement(&all).unwrap();
    assert!(found.title.starts_with("the gyroscope disagrees with"), "{}", found.title);
    let (since_s, until_s) = (found.interval.since_s.unwrap(), found.interval.until_s.unwrap());
    assert!((since_s - 12.0).abs() < 1.1 && (until_s - 14.5).abs() < 1.1, "{}", found.title);
}

#[test]
fn a_bias_that_drifts_is_named_with_its_size() {
    let sound = |_: f64| Vector3::zeros();
    let drift = |time_s: f64| Vector3::new(0.1, -0.06, 0.08) * (time_s / 25.0);
    let all = [
        source(Source::Gyroscope, 0.005, 0.0, drift),
        source(images(), 0.05, 3e-4, sound),
        source(Source::GroundTruth, 0.005, 1e-4, sound),
    ];
    let found = statement(&all).unwrap();
    assert!(found.title.contains("its angular rates drift by (+0.09"), "{}", found.title);
}

#[test]
fn a_step_of_the_bias_is_isolated_with_its_time_and_size() {
    let shift = |time_s: f64| if time_s < 12.0 { Vector3::zeros() } else { Vector3::new(0.03, -0.05, 0.04) };
    let sound = |_: f64| Vector3::zeros();
    let all = |error: &dyn Fn(f64) -> Vector3<f64>| {
        [
            source(Source::Gyroscope, 0.005, 0.0, error),
            source(images(), 0.05, 3e-4, sound),
            source(Source::GroundTruth, 0.005, 1e-4, sound),
        ]
    };
    assert!(statement(&all(&sound)).is_none());
    let found = statement(&all(&shift)).unwrap();
    assert!(found.title.starts_with("the gyroscope disagrees with the images of cam0 and the ground truth from 1"));
    assert!(found.title.contains("its angular rates shift by (+0.03"), "{}", found.title);
    assert!((found.interval.since_s.unwrap() - 12.0).abs() < 0.4 && found.is_isolated, "{}", found.title);
    let only_two = statement(&all(&shift)[..2]).unwrap();
    assert!(only_two.title.starts_with("the gyroscope or the images of cam0 is wrong: they disagree from 1"));
}

#[test]
fn axes_that_change_are_isolated_with_their_time_even_if_the_first_ones_hold_for_less_than_half_of_the_log() {
    let turned = |time_s: f64| {
        let rate = rate_at(time_s);
        if time_s < 9.0 { Vector3::zeros() } else { Vector3::new(0.0, -2.0 * rate.y, -2.0 * rate.z) }
    };
    let sound = |_: f64| Vector3::zeros();
    let all = [
        source(Source::Gyroscope, 0.005, 0.0, turned),
        source(images(), 0.05, 3e-4, sound),
        source(Source::GroundTruth, 0.005, 1e-4, sound),
    ];
    let found = statement(&all).unwrap();
    assert!(found.title.starts_with("the gyroscope disagrees with"), "{}", found.title);
    assert!((found.interval.since_s.unwrap() - 9.0).abs() < 0.4 && found.is_isolated, "{}", found.title);
}

#[test]
fn the_scale_of_an_isolated_gyroscope_is_its_cause() {
    let scaled = |time_s: f64| 0.2 * rate_at(time_s);
    let sound = |_: f64| Vector3::zeros();
    let all = [
        source(Source::Gyroscope, 0.005, 0.0, scaled),
        source(images(), 0.05, 3e-4, sound),
        source(Source::GroundTruth, 0.005, 1e-4, sound),
    ];
    let cause = statement(&all).unwrap().cause.unwrap();
    assert_eq!(cause.kind, FaultKind::GyroscopeScale);
    assert!((cause.value(0) * 1.2 - 1.0).abs() < 0.01 && cause.since_s.is_none(), "{cause:?}");
}

#[test]
fn a_constant_bias_and_other_axes_of_a_ground_truth_are_sound_but_a_scale_is_not() {
    let gyroscope = source(Source::Gyroscope, 0.005, 0.0, |_| Vector3::new(0.02, 0.0, -0.01));
    let images_of = |scale: f64| source(images(), 0.05, 3e-4, move |time_s| rate_at(time_s) * (scale - 1.0));
    assert!(statement(&[gyroscope.clone(), images_of(1.01)]).is_none());
    let pairs = pairs(&[gyroscope, images_of(1.3)]);
    let change = pairs[0].fit.change.clone().unwrap();
    assert_eq!(change.parameter, Parameter::Scale);
    assert!((change.values[0] - 0.3).abs() < 0.01, "{change:?}");
}

#[test]
fn scales_are_judged_on_axes_whose_forces_exceed_what_is_tolerated() {
    let level = |axis: usize, factor: f64| {
        let (imu_facts, poses) =
            flight_with(|_| Vector3::zeros(), |_, _, sample| sample.specific_force_m_per_s2[axis] *= factor);
        statements_of(&imu_facts, &poses).into_iter().map(|it| it.title).next()
    };
    assert_eq!(level(1, 1.12), None);
    assert_eq!(level(0, 1.12).unwrap(), "the accelerometer or the motion of the ground truth is wrong: they disagree");
}
