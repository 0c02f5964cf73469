//! Heading errors of trajectories that turn.

use nalgebra::{UnitQuaternion, Vector3};

use crate::geometry::RigidTransform;
use crate::session::accuracy::{StampedPose, heading_drift_rad};

/// Pairs of poses over a number of turns (positive to the left), the vehicle tilted, and an estimate that turns by this
/// factor.
fn drift_rad(turns: f64, factor: f64) -> Option<f64> {
    let pairs: Vec<_> = (0..200)
        .map(|step| {
            let heading_rad = std::f64::consts::TAU * turns * f64::from(step) / 199.0;
            let pose = |heading_rad: f64| StampedPose {
                stamp_s: f64::from(step),
                pose: RigidTransform::new(
                    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading_rad)
                        * UnitQuaternion::from_euler_angles(0.3, -0.2, 0.0),
                    Vector3::zeros(),
                ),
            };
            (pose(1.0 + factor * heading_rad), pose(heading_rad))
        })
        .collect();
    heading_drift_rad(&pairs)
}

#[test]
fn the_drift_of_the_heading_is_counted_along_the_turn() {
    for turns in [4.3, -4.3, 0.6] {
        for (factor, degrees) in [(0.99, -3.6), (1.0, 0.0), (1.01, 3.6)] {
            let drift_deg = drift_rad(turns, factor).unwrap().to_degrees();
            assert!((drift_deg - degrees).abs() < 1e-6, "{turns} turns, factor {factor}: {drift_deg}°");
        }
    }
    assert_eq!(drift_rad(0.4, 0.9), None);
}
