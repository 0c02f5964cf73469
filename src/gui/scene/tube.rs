//! The outline of the space around a trajectory that its covariances leave: three standard deviations to each side.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

/// Factor of the standard deviation.
const SIGMAS: f64 = 3.0;
/// Largest number of cross-sections.
const MAX_RINGS: usize = 120;
/// Points of a cross-section.
const RING_POINTS: usize = 20;
/// Shortest distance of two cross-sections in metres.
const MIN_SPACING_M: f64 = 0.02;
/// Lines along the trajectory.
const SIDES: usize = 4;

/// Cross-sections at equal distances along the path, perpendicular to it, and lines along it on four sides.
///
/// A cross-section is the ellipse of 3σ of the position across the path. Places that are not finite interrupt the tube.
pub(super) fn outline(places: impl Iterator<Item = (Vector3<f64>, Matrix3<f64>)>) -> Vec<Vec<Vector3<f64>>> {
    let places: Vec<_> = places.collect();
    let known = |(place, covariance): &(Vector3<f64>, Matrix3<f64>)| {
        place.iter().chain(covariance.iter()).all(|number| number.is_finite())
    };
    let mut lines = Vec::new();
    let length_m: f64 =
        places.windows(2).filter(|pair| pair.iter().all(known)).map(|pair| (pair[1].0 - pair[0].0).norm()).sum();
    let spacing_m = (length_m / MAX_RINGS as f64).max(MIN_SPACING_M);
    for part in places.split(|place| !known(place)) {
        let rings = rings(part, spacing_m);
        for side in 0..SIDES {
            lines.push(rings.iter().map(|ring| ring[side * RING_POINTS / SIDES]).collect());
        }
        lines.extend(rings);
    }
    lines.retain(|line| line.len() > 1);
    lines
}

/// The cross-sections of an uninterrupted part of a path, each closed.
fn rings(part: &[(Vector3<f64>, Matrix3<f64>)], spacing_m: f64) -> Vec<Vec<Vector3<f64>>> {
    let mut rings = Vec::new();
    let Some(&(mut last, _)) = part.first() else { return rings };
    for (place, covariance) in part {
        let way = place - last;
        if way.norm() < spacing_m {
            continue;
        }
        last = *place;
        rings.push(ring(place, covariance, &way.normalize()));
    }
    rings
}

/// The ellipse of 3σ across a direction, from the right-hand side on.
fn ring(place: &Vector3<f64>, covariance: &Matrix3<f64>, direction: &Vector3<f64>) -> Vec<Vector3<f64>> {
    // A vertical path has no right-hand side.
    let across = direction.cross(&Vector3::z());
    let right = if across.norm() > 1e-3 { across.normalize() } else { Vector3::x() };
    let up = right.cross(direction);
    let variance = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(&(covariance * b));
    // The Cholesky factor of the two-dimensional covariance maps the unit circle to the ellipse.
    let sigma_right = variance(&right, &right).max(0.0).sqrt();
    let shear = if sigma_right > 0.0 { variance(&right, &up) / sigma_right } else { 0.0 };
    let rest = (variance(&up, &up) - shear * shear).max(0.0).sqrt();
    (0..=RING_POINTS)
        .map(|index| {
            let (sine, cosine) = (TAU * index as f64 / RING_POINTS as f64).sin_cos();
            let offset = right * (sigma_right * cosine) + up * (shear * cosine + rest * sine);
            place + offset * SIGMAS
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cross_sections_are_ellipses_of_three_sigma_and_gaps_interrupt_them() {
        let covariance = Matrix3::new(0.04, 0.0, 0.0, 0.0, 0.01, 0.004, 0.0, 0.004, 0.04);
        let at = |step: usize| (Vector3::new(0.5 * step as f64, 0.0, 0.0), covariance);
        let mut places: Vec<_> = (0..40).map(at).collect();
        places[20].1[(0, 0)] = f64::NAN;
        let lines = outline(places.into_iter());
        let rings: Vec<_> = lines.iter().filter(|line| (line[0] - line[line.len() - 1]).norm() < 1e-12).collect();
        // The first place of each of the two parts has no direction.
        assert_eq!((rings.len(), lines.len() - rings.len()), (37, 2 * SIDES));
        let inverse = covariance.fixed_view::<2, 2>(1, 1).try_inverse().unwrap();
        for ring in rings {
            let place = ring[0].x;
            for point in ring {
                let across = nalgebra::Vector2::new(point.y, point.z);
                assert!((point.x - place).abs() < 1e-12);
                assert!(((across.dot(&(inverse * across))).sqrt() - SIGMAS).abs() < 1e-9, "{point}");
            }
        }
    }

    #[test]
    fn a_vertical_path_and_one_place_are_no_failure() {
        let places = (0..4).map(|step| (Vector3::new(0.0, 0.0, f64::from(step)), Matrix3::identity()));
        assert!(outline(places).iter().flatten().all(|point| point.iter().all(|x| x.is_finite())));
        assert!(outline(std::iter::repeat_n((Vector3::zeros(), Matrix3::identity()), 9)).is_empty());
        assert!(outline(std::iter::empty()).is_empty());
    }
}
