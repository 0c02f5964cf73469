use nalgebra::{UnitQuaternion, Vector3};

use super::comparison::Parameter;
use super::orientations::Orientations;
use super::source::Source;
use super::statement::Statement;
use super::{Pair, Quantity, culprits, rotation};
use crate::geometry::so3;
use crate::log_check::tests::Noise;

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
    Statement::of(&culprits(&pairs.iter().map(Pair::verdict).collect::<Vec<_>>()), &pairs)
}

fn images() -> Source {
    Source::Images { camera_key: "cam0".to_owned(), with_joints: false }
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
fn a_constant_bias_and_other_axes_of_a_ground_truth_are_sound_but_a_scale_is_not() {
    let gyroscope = source(Source::Gyroscope, 0.005, 0.0, |_| Vector3::new(0.02, 0.0, -0.01));
    let images_of = |scale: f64| source(images(), 0.05, 3e-4, move |time_s| rate_at(time_s) * (scale - 1.0));
    assert!(statement(&[gyroscope.clone(), images_of(1.01)]).is_none());
    let pairs = pairs(&[gyroscope, images_of(1.3)]);
    let change = pairs[0].fit.change.clone().unwrap();
    assert_eq!(change.parameter, Parameter::Scale);
    assert!((change.values[0] - 0.3).abs() < 0.01, "{change:?}");
}
