//! Tracks of the front end on simulated images, compared with the visible surfaces.

#![expect(clippy::print_stdout, reason = "docs/experiments/images_and_front_end.md has the printed errors")]

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Vector2, Vector3};

use super::super::disturbances::{EXPOSURE_DRIFT, VIGNETTING};
use super::super::experiment::{Experiment, WorldKind};
use super::super::render::{RenderedView, Sensor, SensorOptions, SurfaceShader, Workspace};
use super::super::world::{self, World};
use super::flight::experiment_scenario;
use crate::camera::CameraModel;
use crate::frontend::{FeatureId, FrontEnd, FrontEndOptions};
use crate::geometry::{RigidTransform, median};

const IMAGES: usize = 120;
const PERIOD_S: f64 = 0.05;
/// Error beyond which a track is lost rather than shifted.
const OUTLIER_PX: f64 = 0.3;

/// Plane of a feature, in the frame of the camera that observed it first.
struct Surface {
    uv_px: Vector2<f64>,
    world_from_camera: RigidTransform,
    normal: Vector3<f64>,
    distance: f64,
}

impl Surface {
    /// `None` if the window around the feature shows more than one plane.
    fn new(
        world: &World,
        model: &CameraModel,
        depths_m: &[f64],
        world_from_camera: RigidTransform,
        uv_px: Vector2<f64>,
    ) -> Option<Self> {
        let [width, height] = model.resolution_px;
        let point = |offset: [f64; 2]| {
            let pixel = (uv_px + Vector2::from(offset)).map(f64::round);
            let bounds = Vector2::new(width as f64, height as f64);
            let pixel = pixel.zip_map(&bounds, |at, count| at.clamp(0.0, count - 1.0));
            let ray = model.unproject(&pixel)?;
            let depth_m = depths_m[pixel.y as usize * width + pixel.x as usize];
            let point = world_from_camera.transform(&(ray / ray.z * depth_m));
            point.iter().all(|x| x.is_finite()).then_some(point)
        };
        let middle = point([0.0, 0.0])?;
        let range_m = (middle - world_from_camera.translation_m).norm();
        let grid = [-10.0, -5.0, 0.0, 5.0, 10.0];
        let window: Option<Vec<_>> = grid.iter().flat_map(|y| grid.map(|x| point([x, *y]))).collect();
        let window = window?;
        let face = world.faces.iter().find(|face| {
            let on = |point: &Vector3<f64>| (face.normal.dot(point) - face.distance).abs() < 1e-3 * range_m;
            face.normal.dot(&world_from_camera.translation_m) > face.distance && window.iter().all(on)
        })?;
        Some(Self { uv_px, world_from_camera, normal: face.normal, distance: face.distance })
    }

    /// Position of a pixel of the first image in the image from another pose.
    fn seen_from(&self, model: &CameraModel, pose: &RigidTransform, uv_px: &Vector2<f64>) -> Option<Vector2<f64>> {
        let centre_m = self.world_from_camera.translation_m;
        let ray = self.world_from_camera.rotation * model.unproject(uv_px)?;
        let along_m = (self.distance - self.normal.dot(&centre_m)) / self.normal.dot(&ray);
        model.project(&pose.inverse().transform(&(centre_m + ray * along_m)))
    }

    /// Factor by which areas around the feature have grown since the first image.
    fn growth(&self, model: &CameraModel, pose: &RigidTransform) -> Option<f64> {
        let side = |axis: Vector2<f64>| {
            let from = self.seen_from(model, pose, &(self.uv_px - axis))?;
            Some(self.seen_from(model, pose, &(self.uv_px + axis))? - from)
        };
        Some(Matrix2::from_columns(&[side(Vector2::new(0.5, 0.0))?, side(Vector2::new(0.0, 0.5))?]).determinant())
    }
}

#[test]
fn tracks_follow_the_surfaces() {
    let experiment = Experiment::T1;
    let scenario = experiment_scenario(experiment, 1, 10.0, false);
    let world = world::build(experiment.environment(), WorldKind::Textured, 1);
    let camera = &scenario.true_rig.cameras[0];
    let (model, view, renderer) = (&camera.model, RenderedView::new(&camera.model), SurfaceShader::new(&world));
    let sensor =
        Sensor::new(&view, SensorOptions { noise: 2.0, exposure_drift: EXPOSURE_DRIFT, vignetting: VIGNETTING }, 7);

    let mut front_end = FrontEnd::new(model.clone(), FrontEndOptions::default());
    let mut surfaces: BTreeMap<FeatureId, Surface> = BTreeMap::new();
    let [mut all, mut grown, mut at_border, mut slanted] = [const { Vec::new() }; 4];
    let mut workspace = Workspace::default();
    for image in 0..IMAGES {
        let time_s = 2.0 + image as f64 * PERIOD_S;
        let pose = scenario.world_from_camera(camera, time_s);
        let mut grey = vec![0.0; view.pixels()];
        renderer.render(&view, 0..model.resolution_px[1], &pose, 1.0, &mut workspace, &mut grey);
        let depths_m = workspace.depths_m(&view, &world, &pose);
        let frame = front_end.process(&sensor.expose(&grey, image, time_s), image as i64, None).unwrap();
        for feature in &frame.features {
            if feature.age == 0 {
                let surface = Surface::new(&world, model, &depths_m, pose, feature.uv_px);
                surfaces.extend(surface.map(|surface| (feature.id, surface)));
                continue;
            }
            let Some(surface) = surfaces.get(&feature.id) else { continue };
            let Some(seen) = surface.seen_from(model, &pose, &surface.uv_px) else { continue };
            let error_px = (feature.uv_px - seen).norm();
            all.push(error_px);
            let along = (seen - surface.uv_px).normalize().dot(&(feature.uv_px - seen));
            if error_px < OUTLIER_PX && surface.growth(model, &pose).is_some_and(|growth| growth > 1.5 && growth < 1.9)
            {
                slanted.push(along);
            }
            // Past a factor of two the reference has been replaced.
            if surface.growth(model, &pose).is_some_and(|growth| growth > 2.2 && growth < 4.0) {
                grown.push(error_px);
            }
            if !model.contains(&feature.uv_px, 12.0) {
                at_border.push(error_px);
            }
        }
    }
    // Without the correction for perspective such features lie 0.04 px too far along their motion.
    let mean_px = slanted.iter().sum::<f64>() / slanted.len() as f64;
    println!("along the motion at 1.5 to 1.9 times the area: {mean_px:+.4} px, {} observations", slanted.len());
    assert!(slanted.len() > 150 && mean_px.abs() < 0.02, "{mean_px} px over {} observations", slanted.len());
    for (name, errors_px, least, limit_px) in [
        ("all", all, 3000, 0.05),
        ("grown to twice the area", grown, 150, 0.16),
        ("near the border", at_border, 100, 0.14),
    ] {
        let count = errors_px.len();
        let median_px = median(errors_px).unwrap();
        println!("{name}: {median_px:.4} px, {count} observations");
        assert!(count > least, "{name}: {count} observations");
        assert!(median_px < limit_px, "{name}: {median_px} px");
    }
}
