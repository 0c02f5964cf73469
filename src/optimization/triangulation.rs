//! Triangulation of a point from the rays of the cameras that observe it.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, Vector3};

/// Line of sight of one observation, in a frame common to all rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray {
    /// Centre of the camera, in metres (or the unit of a map without scale).
    pub(crate) centre: Vector3<f64>,
    /// Unit direction to the point.
    pub(crate) direction: Vector3<f64>,
}

impl Ray {
    /// Angle between the ray and the direction to a point, in radians.
    fn angle_to(&self, point: &Vector3<f64>) -> f64 {
        let to_point = point - self.centre;
        to_point.cross(&self.direction).norm().atan2(to_point.dot(&self.direction))
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangulationOptions {
    /// Rounds of least squares; each after the first weights a ray by the inverse square of its length.
    pub(crate) rounds: usize,
    /// Smallest parallax (its sine), in radians.
    pub(crate) min_parallax_rad: f64,
    /// True if the parallax is the largest angle between any two rays, false if between the first ray and another.
    pub(crate) of_all_pairs: bool,
    /// Upper bound of the angle between a ray and the direction to the point, in radians; with π/2 every point in front
    /// of the cameras is accepted.
    pub(crate) max_error_rad: f64,
}

impl TriangulationOptions {
    /// Two rounds, the parallax relative to the first ray, and every point in front of the cameras.
    pub(crate) fn of_anchored(min_parallax_rad: f64) -> Self {
        Self { rounds: 2, min_parallax_rad, of_all_pairs: false, max_error_rad: FRAC_PI_2 }
    }
}

/// Shortest ray in the weights.
const MIN_LENGTH: f64 = 1e-3;

/// Point nearest to the rays: least squares of the distances perpendicular to them, as angles after the first round.
///
/// `None` when the parallax is too small, or when the direction to the point differs too much from a ray.
pub(crate) fn triangulate(rays: &[Ray], options: &TriangulationOptions) -> Option<Vector3<f64>> {
    let compared = if options.of_all_pairs { rays.len() } else { 1 };
    let sines =
        rays.iter().take(compared).enumerate().flat_map(|(place, ray)| {
            rays[place + 1..].iter().map(|other| ray.direction.cross(&other.direction).norm())
        });
    if sines.fold(0.0, f64::max) < options.min_parallax_rad {
        return None;
    }
    let mut point: Option<Vector3<f64>> = None;
    for _ in 0..options.rounds {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for Ray { centre, direction } in rays {
            let length = point.map_or(1.0, |known| (known - centre).norm().max(MIN_LENGTH));
            let across = (Matrix3::identity() - direction * direction.transpose()) / (length * length);
            normal += across;
            right += across * centre;
        }
        point = Some(normal.cholesky()?.solve(&right));
    }
    point.filter(|point| rays.iter().all(|ray| ray.angle_to(point) < options.max_error_rad))
}
