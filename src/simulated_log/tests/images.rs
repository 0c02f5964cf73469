use nalgebra::Vector3;

use super::super::render::{RenderedView, Sensor, SensorOptions, SurfaceShader, Workspace};
use super::super::world::{self, World};
use super::flight::experiment_trajectory;
use crate::geometry::{RigidTransform, so3};
use crate::sensors::GrayImage;
use crate::simulation::equipment::{Lens, camera_model};
use crate::simulation::experiment::{Environment, Experiment, WorldKind};
use crate::simulation::random::RandomStream;
use crate::text::Named as _;

/// Image from a position along a heading, 8° down.
pub(super) fn radiance(world: &World, lens: Lens, place_m: [f64; 3], heading_deg: f64) -> GrayImage {
    let view = RenderedView::new(&camera_model(0, lens, [640, 480]));
    let optical = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let optical = nalgebra::UnitQuaternion::from_matrix(&optical);
    let heading = so3::exp(&Vector3::new(0.0, 0.0, heading_deg.to_radians())) * so3::exp(&Vector3::new(0.0, 0.14, 0.0));
    let mut grey = vec![0.0; view.pixels()];
    let pose = RigidTransform::new(heading * optical, Vector3::from(place_m));
    SurfaceShader::new(world).render(
        &view,
        view.bands(usize::MAX).next().unwrap(),
        &pose,
        1.0,
        &mut Workspace::default(),
        &mut grey,
    );
    let options = SensorOptions { noise: 2.0, exposure_drift: 0.0, vignetting: 0.12 };
    Sensor::new(&view, options, 5).expose(&grey, 0, 0.0)
}

/// Number of cells of 32 × 32 pixels with a strong corner (smaller eigenvalue of the gradient's 7 × 7 structure
/// tensor).
pub(super) fn cells_with_corners(image: &GrayImage) -> usize {
    let at = |x: usize, y: usize| f64::from(image.pixels[y * image.width + x]);
    let mut cells = std::collections::BTreeSet::new();
    for y in (8..image.height - 8).step_by(3) {
        for x in (8..image.width - 8).step_by(3) {
            let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
            for dy in 0..7 {
                for dx in 0..7 {
                    let (px, py) = (x + dx - 3, y + dy - 3);
                    let gx = 0.5 * (at(px + 1, py) - at(px - 1, py));
                    let gy = 0.5 * (at(px, py + 1) - at(px, py - 1));
                    xx += gx * gx;
                    xy += gx * gy;
                    yy += gy * gy;
                }
            }
            let smaller = 0.5 * (xx + yy - ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt()) / 49.0;
            // Noise of two grey values alone gives 2.
            if smaller > 40.0 {
                cells.insert((x / 32, y / 32));
            }
        }
    }
    cells.len()
}

#[test]
fn both_worlds_have_many_corners_and_good_exposure() {
    for (environment, place_m) in [(Environment::House, [-13.0, -11.0, 2.6]), (Environment::Town, [-15.0, -4.0, 2.9])] {
        let world = world::build(environment, WorldKind::Textured, 1);
        for lens in [Lens::Pinhole, Lens::Radtan] {
            for heading_deg in [0.0, 50.0, 90.0, 180.0] {
                let image = radiance(&world, lens, place_m, heading_deg);
                let mean = image.pixels.iter().map(|pixel| f64::from(*pixel)).sum::<f64>() / image.pixels.len() as f64;
                let clipped = image.pixels.iter().filter(|pixel| matches!(**pixel, 0 | 255)).count();
                let cells = cells_with_corners(&image);
                let case = format!("{environment:?} {lens:?} {heading_deg}°");
                assert!(cells > 100, "{case}: corners in {cells} of 300 cells only");
                assert!((70.0..190.0).contains(&mean), "{case}: mean grey {mean}");
                assert!(clipped < image.pixels.len() / 50, "{case}: {clipped} pixels at black or white");
            }
        }
    }
}

#[test]
fn a_pixel_sees_what_its_ray_hits() {
    // A point of the house's corner edge projects to the image edge between two walls.
    let world = world::build(Environment::House, WorldKind::Textured, 1);
    let model = camera_model(0, Lens::Radtan, [640, 480]);
    let view = RenderedView::new(&model);
    let place = Vector3::new(-13.0, -11.0, 2.6);
    let corner = Vector3::new(-6.0, -4.5, 2.6);
    let forward = (corner - place).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let rotation = nalgebra::Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let pose = RigidTransform::new(nalgebra::UnitQuaternion::from_matrix(&rotation), place);
    let depths = Workspace::default().depths_m(&view, &world, &pose);
    for height_m in [1.9, 2.3, 2.9, 3.4] {
        let edge = Vector3::new(corner.x, corner.y, height_m);
        let uv = model.project(&pose.inverse().transform(&edge)).unwrap();
        // Left of the edge lies the western wall (x = −6), right of it the southern one (y = −4.5).
        let mut sides = [0.0; 2];
        for (side, offset) in [(0, -2.0), (1, 2.0)] {
            let ray = pose.rotation * model.unproject(&(uv + nalgebra::Vector2::new(offset, 0.0))).unwrap();
            let along = if side == 0 { (corner.x - place.x) / ray.x } else { (corner.y - place.y) / ray.y };
            sides[side] = along * model.unproject(&(uv + nalgebra::Vector2::new(offset, 0.0))).unwrap().z;
        }
        for (side, offset) in [(0, -2.0), (1, 2.0)] {
            let depth = depths[uv.y.round() as usize * view.width() + (uv.x + offset).round() as usize];
            assert!(
                (depth - sides[side]).abs() < 0.06,
                "side {side} at {height_m} m: {depth} instead of {}",
                sides[side]
            );
        }
    }
}

#[test]
fn textures_do_not_flicker_under_slow_motion() {
    // Between shifts of a hundredth of a pixel, a tracked patch must change smoothly: neighbouring images are much more
    // similar than images a pixel apart.
    let world = world::build(Environment::Town, WorldKind::Textured, 1);
    let renderer = SurfaceShader::new(&world);
    let view = RenderedView::new(&camera_model(0, Lens::Pinhole, [320, 240]));
    let optical = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let optical = nalgebra::UnitQuaternion::from_matrix(&optical);
    let shot = |turn_px: f64| {
        let heading = so3::exp(&Vector3::new(0.0, 0.0, 0.4 + turn_px / 180.0));
        let mut grey = vec![0.0; view.pixels()];
        let pose = RigidTransform::new(heading * optical, Vector3::new(-15.0, -4.0, 2.9));
        renderer.render(
            &view,
            view.bands(usize::MAX).next().unwrap(),
            &pose,
            1.0,
            &mut Workspace::default(),
            &mut grey,
        );
        grey
    };
    let first = shot(0.0);
    let difference = |other: &[f32]| {
        let sum: f64 = first.iter().zip(other).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (sum / first.len() as f64).sqrt()
    };
    let (tenth, half, whole) = (difference(&shot(0.1)), difference(&shot(0.5)), difference(&shot(1.0)));
    assert!(tenth < 0.2 * whole && half < 0.65 * whole, "{tenth} {half} {whole}");
    assert!(whole > 3.0, "{whole}");
}

#[test]
fn rows_rendered_apart_are_those_of_the_whole_image() {
    let world = world::build(Environment::House, WorldKind::Textured, 1);
    let renderer = SurfaceShader::new(&world);
    let optical = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = nalgebra::UnitQuaternion::from_matrix(&optical) * so3::exp(&Vector3::new(0.1, 0.7, 0.2));
    let pose = RigidTransform::new(rotation, Vector3::new(-13.0, -11.0, 2.6));
    for lens in [Lens::Pinhole, Lens::Radtan] {
        let view = RenderedView::new(&camera_model(0, lens, [160, 120]));
        let render = |rows: usize| {
            let mut grey = vec![0.0; view.pixels()];
            for rows in view.bands(rows) {
                renderer.render(&view, rows, &pose, 1.0, &mut Workspace::default(), &mut grey);
            }
            grey
        };
        let whole = render(usize::MAX);
        assert_eq!(view.bands(7).count(), 18);
        assert!(whole.iter().all(|grey| *grey > 0.0));
        assert_eq!(render(7), whole, "{lens:?}");
        assert_eq!(render(1), whole, "{lens:?}");
    }
}

#[test]
fn flights_keep_clear_of_everything_built() {
    for experiment in Experiment::all() {
        let world = world::build(experiment.environment(), WorldKind::Textured, 1);
        for seed in 1..4 {
            let trajectory = experiment_trajectory(experiment, seed, 160.0);
            for step in 0..800 {
                let place = trajectory.at(f64::from(step) * 0.2).world_from_imu.translation_m;
                for face in &world.faces {
                    let off = face.normal.dot(&place) - face.distance;
                    if off.abs() > 0.45 || (face.corners[0] - place).norm() > 700.0 {
                        continue;
                    }
                    let foot = place - face.normal * off;
                    let outside = (0..face.corners.len())
                        .map(|k| {
                            let (from, to) = (face.corners[k], face.corners[(k + 1) % face.corners.len()]);
                            (foot - from).dot(&(to - from).cross(&face.normal).normalize())
                        })
                        .fold(f64::MIN, f64::max);
                    assert!(outside > 0.45, "{experiment:?} seed {seed} hits a face near {place:?}");
                }
            }
        }
    }
}

#[test]
fn noise_follows_from_frame_and_pixel_alone() {
    let view = RenderedView::new(&camera_model(0, Lens::Pinhole, [64, 48]));
    let options = SensorOptions { noise: 3.0, exposure_drift: 0.0, vignetting: 0.0 };
    let sensor = Sensor::new(&view, options, RandomStream::new(2, 0).next_u64());
    let flat = vec![100.0; view.pixels()];
    let (first, again, next) =
        (sensor.expose(&flat, 4, 0.0), sensor.expose(&flat, 4, 0.0), sensor.expose(&flat, 5, 0.0));
    assert_eq!(first, again);
    assert_ne!(first, next);
    let squares: f64 = first.pixels.iter().map(|pixel| (f64::from(*pixel) - 100.0).powi(2)).sum();
    let sigma = (squares / first.pixels.len() as f64).sqrt();
    assert!((sigma - 3.0).abs() < 0.2, "{sigma}");
}
