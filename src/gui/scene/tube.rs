//! Outline of the 3σ tube of the position covariances around a trajectory.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

const SIGMAS: f64 = 3.0;
/// Largest number of cross-sections of a path without interruption.
const MAX_RINGS: f64 = 180.0;
/// Points of a cross-section.
const RING_POINTS: usize = 20;
/// Shortest distance of two cross-sections in metres; longer distances are this times a power of two.
const MIN_SPACING_M: f64 = 0.02;
/// Lines along the trajectory.
const SIDES: usize = 4;

/// Cross-sections at equal distances along the path, perpendicular to it, and lines along it on four sides.
///
/// `place` and `covariance` return the position in metres and its covariance in m² of a step; steps without a position
/// interrupt the tube. A cross-section is the 3σ ellipse of the position across the path. The distance of two
/// cross-sections doubles as the path gets longer; between two doublings the cross-sections do not move.
pub(super) fn outline(
    steps: usize,
    place: impl Fn(usize) -> Option<Vector3<f64>>,
    covariance: impl Fn(usize) -> Matrix3<f64>,
) -> Vec<Vec<Vector3<f64>>> {
    let places: Vec<Option<(usize, Vector3<f64>)>> = (0..steps).map(|step| Some((step, place(step)?))).collect();
    let way = |pair: &[Option<(usize, Vector3<f64>)>]| Some((pair[1]?.1 - pair[0]?.1).norm());
    let length_m: f64 = places.windows(2).filter_map(way).sum();
    let mut spacing_m = MIN_SPACING_M;
    while spacing_m * MAX_RINGS < length_m {
        spacing_m *= 2.0;
    }
    let mut lines = Vec::new();
    for part in places.split(Option::is_none) {
        let rings = rings(part.iter().flatten(), spacing_m, &covariance);
        for side in 0..SIDES {
            lines.push(rings.iter().map(|ring| ring[side * RING_POINTS / SIDES]).collect());
        }
        lines.extend(rings);
    }
    lines.retain(|line| line.len() > 1);
    lines
}

/// The cross-sections of an uninterrupted part of a path, each closed.
fn rings<'a>(
    mut part: impl Iterator<Item = &'a (usize, Vector3<f64>)>,
    spacing_m: f64,
    covariance: impl Fn(usize) -> Matrix3<f64>,
) -> Vec<Vec<Vector3<f64>>> {
    let mut rings = Vec::new();
    let Some(&(_, mut last)) = part.next() else { return rings };
    for (step, place) in part {
        let way = place - last;
        if way.norm() < spacing_m {
            continue;
        }
        last = *place;
        let covariance = covariance(*step);
        if covariance.iter().all(|number| number.is_finite()) {
            rings.push(ring(place, &covariance, &way.normalize()));
        }
    }
    rings
}

/// The 3σ ellipse across a direction, starting at the right-hand side.
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
        let place = |step: usize| (step != 20).then(|| Vector3::new(0.5 * step as f64, 0.0, 0.0));
        let lines = outline(40, place, |_| covariance);
        let rings: Vec<_> = lines.iter().filter(|line| (line[0] - line[line.len() - 1]).norm() < 1e-12).collect();
        // The first position of each of the two parts has no direction.
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
        let lines = outline(4, |step| Some(Vector3::new(0.0, 0.0, step as f64)), |_| Matrix3::identity());
        assert!(lines.iter().flatten().all(|point| point.iter().all(|x| x.is_finite())));
        assert!(outline(9, |_| Some(Vector3::zeros()), |_| Matrix3::identity()).is_empty());
        assert!(outline(0, |_| None, |_| Matrix3::identity()).is_empty());
    }

    #[test]
    fn cross_sections_stay_in_place_until_their_distance_doubles() {
        let places_of = |steps: usize| -> Vec<f64> {
            let place = |step: usize| Some(Vector3::new(0.011 * step as f64, 0.0, 0.0));
            outline(steps, place, |_| Matrix3::identity()).iter().skip(SIDES).map(|ring| ring[0].x).collect()
        };
        let (before, longer, doubled) = (places_of(300), places_of(327), places_of(400));
        assert_eq!((before.len(), longer.len(), doubled.len()), (149, 163, 99));
        assert!(longer.starts_with(&before));
        assert!(longer.iter().skip(1).step_by(2).zip(&doubled).all(|(place, kept)| place == kept));
    }
}
