//! Tracks of the front end on simulated images, compared with the visible surfaces.

#![expect(clippy::print_stdout, reason = "docs/experiments/images_and_front_end.md has the printed errors")]

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Vector2, Vector3};

use super::super::disturbances::{EXPOSURE_DRIFT, VIGNETTING};
use super::super::render::{RenderedView, Sensor, SensorOptions, SurfaceShader, Workspace};
use super::super::world::{self, World};
use super::flight::experiment_scenario;
use crate::camera::CameraModel;
use crate::frontend::{FeatureId, FrontEnd, FrontEndOptions};
use crate::geometry::{RigidTransform, median};
use crate::simulation::experiment::{Experiment, WorldKind};

const IMAGES: usize = 120;
const PERIOD_S: f64 = 0.05;
/// Error beyond which a track is lost rather than shifted.
const OUTLIER_PX: f64 = 0.3;
/// Scale of the loss on clean images.
const LOSS_SCALE_PX: f64 = 0.13;
/// Least age in images of each group of tracks whose errors are averaged.
const AGES: [u32; 4] = [0, 5, 10, 20];
/// Ratio by which the depths of a window may differ from the plane under the feature without being a depth edge.
const SAME_DEPTH: f64 = 0.05;

/// Mean with the weights of Cauchy's loss.
#[derive(Clone, Copy, Debug, Default)]
struct WeightedMean {
    sum: f64,
    weight: f64,
}

impl WeightedMean {
    fn add(&mut self, value: f64, error_px: f64) {
        let weight = 1.0 / (1.0 + (error_px / LOSS_SCALE_PX).powi(2));
        self.sum += weight * value;
        self.weight += weight;
    }

    fn value(&self) -> f64 {
        self.sum / self.weight
    }
}

/// Content of the window around a new feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum WindowContent {
    Plane,
    /// Several planes at one depth.
    Crease,
    DepthEdge,
}

/// Plane of the world: `normal · point = distance`.
#[derive(Clone, Copy, Debug)]
struct ScenePlane {
    normal: Vector3<f64>,
    distance: f64,
}

impl ScenePlane {
    /// Plane of the face that a ray meets first, with its distance in units of the ray.
    fn first_on(world: &World, origin_m: &Vector3<f64>, ray: &Vector3<f64>) -> Option<(Self, f64)> {
        let mut first: Option<(Self, f64)> = None;
        for face in &world.faces {
            let plane = Self { normal: face.normal, distance: face.distance };
            let to_centre_m = face.bounds.centre_m - origin_m;
            let past = to_centre_m.cross(ray).norm() > face.bounds.radius_m * ray.norm() * (1.0 + 1e-9);
            if past || plane.normal.dot(ray) >= 0.0 {
                continue;
            }
            let along = plane.along(origin_m, ray);
            if along <= 0.0 || first.as_ref().is_some_and(|(_, nearest)| *nearest <= along) {
                continue;
            }
            let point = origin_m + ray * along;
            let nexts = face.corners.iter().cycle().skip(1);
            let inside = face
                .corners
                .iter()
                .zip(nexts)
                .all(|(from, to)| (to - from).cross(&(point - from)).dot(&face.normal) >= 0.0);
            if inside {
                first = Some((plane, along));
            }
        }
        first
    }

    /// Distance of the plane along a ray, in units of the ray.
    fn along(&self, origin_m: &Vector3<f64>, ray: &Vector3<f64>) -> f64 {
        (self.distance - self.normal.dot(origin_m)) / self.normal.dot(ray)
    }

    fn is(&self, other: &Self) -> bool {
        (self.normal - other.normal).norm() < 1e-6 && (self.distance - other.distance).abs() < 1e-6
    }
}

/// Plane of a feature and the camera that observed it first.
struct Surface {
    uv_px: Vector2<f64>,
    world_from_camera: RigidTransform,
    plane: ScenePlane,
    content: WindowContent,
}

impl Surface {
    /// Plane under the feature; `None` if it shows the sky.
    fn new(world: &World, model: &CameraModel, world_from_camera: RigidTransform, uv_px: Vector2<f64>) -> Option<Self> {
        let origin_m = &world_from_camera.translation_m;
        let ray_at = |offset_px| Some(world_from_camera.rotation * model.unproject(&(uv_px + offset_px))?);
        let (plane, _) = ScenePlane::first_on(world, origin_m, &ray_at(Vector2::zeros())?)?;
        let grid = [-10.0, -5.0, 0.0, 5.0, 10.0];
        let mut content = WindowContent::Plane;
        for offset_px in grid.iter().flat_map(|y| grid.map(|x| Vector2::new(x, *y))) {
            let Some(ray) = ray_at(offset_px) else { continue };
            match ScenePlane::first_on(world, origin_m, &ray) {
                Some((other, _)) if other.is(&plane) => {}
                Some((_, along)) if (along / plane.along(origin_m, &ray) - 1.0).abs() < SAME_DEPTH => {
                    if content == WindowContent::Plane {
                        content = WindowContent::Crease;
                    }
                }
                _ => content = WindowContent::DepthEdge,
            }
        }
        Some(Self { uv_px, world_from_camera, plane, content })
    }

    /// Position of a pixel of the first image in the image from another pose.
    fn seen_from(&self, model: &CameraModel, pose: &RigidTransform, uv_px: &Vector2<f64>) -> Option<Vector2<f64>> {
        let centre_m = self.world_from_camera.translation_m;
        let ray = self.world_from_camera.rotation * model.unproject(uv_px)?;
        model.project(&pose.inverse().transform(&(centre_m + ray * self.plane.along(&centre_m, &ray))))
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
    let mut lags: BTreeMap<(WindowContent, u32), WeightedMean> = BTreeMap::new();
    let mut workspace = Workspace::default();
    for image in 0..IMAGES {
        let time_s = 2.0 + image as f64 * PERIOD_S;
        let pose = scenario.world_from_camera(camera, time_s);
        let mut grey = vec![0.0; view.pixels()];
        renderer.render(&view, 0..model.resolution_px[1], &pose, 1.0, &mut workspace, &mut grey);
        let frame = front_end.process(&sensor.expose(&grey, image, time_s), image as i64, None).unwrap();
        for feature in &frame.features {
            if feature.age == 0 {
                let surface = Surface::new(&world, model, pose, feature.uv_px);
                surfaces.extend(surface.map(|surface| (feature.id, surface)));
                continue;
            }
            let Some(surface) = surfaces.get(&feature.id) else { continue };
            let Some(seen) = surface.seen_from(model, &pose, &surface.uv_px) else { continue };
            let error_px = (feature.uv_px - seen).norm();
            let oldest = AGES.into_iter().rev().find(|least| feature.age >= *least).unwrap();
            lags.entry((surface.content, oldest)).or_default().add(feature.uv_px.x - seen.x, error_px);
            if surface.content != WindowContent::Plane {
                continue;
            }
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
    for ((content, least_age), lag) in &lags {
        println!("{content:?}, {least_age} images and more: {:+.4} px across, weight {:.0}", lag.value(), lag.weight);
        assert!(*content != WindowContent::Plane || lag.value().abs() < 0.01, "{least_age}: {} px", lag.value());
    }
    // Without the correction for perspective such features lie 0.04 px too far along their motion.
    let mean_px = slanted.iter().sum::<f64>() / slanted.len() as f64;
    println!("along the motion at 1.5 to 1.9 times the area: {mean_px:+.4} px, {} observations", slanted.len());
    assert!(slanted.len() > 150 && mean_px.abs() < 0.02, "{mean_px} px over {} observations", slanted.len());
    for (name, errors_px, least, limit_px) in [
        ("all", all, 3000, 0.05),
        ("grown to twice the area", grown, 150, 0.1),
        ("near the border", at_border, 100, 0.14),
    ] {
        let count = errors_px.len();
        let median_px = median(errors_px).unwrap();
        println!("{name}: {median_px:.4} px, {count} observations");
        assert!(count > least, "{name}: {count} observations");
        assert!(median_px < limit_px, "{name}: {median_px} px");
    }
}
