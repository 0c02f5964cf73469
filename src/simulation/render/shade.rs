use nalgebra::Vector3;

use super::raster::{Eye, Prepared, SKY};
use super::shadow::ShadowMap;
use super::view::{OFFSETS_PX, PixelRay, SAMPLES, View, Workspace};
use crate::geometry::RigidTransform;
use crate::simulation::world::{Texture, World};

/// Share of the light that comes from the sky on all sides.
const AMBIENT: f32 = 0.6;
/// Light of sky and sun together on a surface square to the sun, against the texture's own grey.
const BRIGHTNESS: f32 = 1.38;
/// Grey of the haze, which is that of the horizon.
const HAZE: f32 = 186.0;
/// Distance at which half of a surface's grey has gone into haze.
const HAZE_M: f32 = 420.0;

/// A world ready to be pictured, from any number of threads at once.
#[derive(Clone, Debug)]
pub(crate) struct Renderer<'a> {
    world: &'a World,
    shadows: ShadowMap,
}

/// What shading needs besides the face: the rays' linear maps into the sky and the shadow map.
struct Light {
    world_from_ray: [[f32; 3]; 3],
    shadow_from_ray: [[f32; 3]; 3],
    shadow_offset: [f32; 3],
}

fn dot(linear: &[f32; 3], ray: [f32; 2]) -> f32 {
    linear[0] * ray[0] + linear[1] * ray[1] + linear[2]
}

fn rows(matrix: &nalgebra::Matrix3<f64>) -> [[f32; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)] as f32))
}

impl<'a> Renderer<'a> {
    /// Prepares a world: its shadows.
    pub(crate) fn new(world: &'a World) -> Self {
        Self { world, shadows: ShadowMap::new(world) }
    }

    /// Renders what a camera sees from a pose: linear grey values, row by row, added to `picture` times `share`.
    pub(crate) fn render(
        &self,
        view: &View,
        world_from_camera: &RigidTransform,
        share: f32,
        workspace: &mut Workspace,
        picture: &mut [f32],
    ) {
        let eye = Eye::new(world_from_camera);
        workspace.rasterize(self.world, &eye, &view.grid);
        let world_from_ray = eye.camera_from_world.transpose();
        let offset: Vector3<f64> = self.shadows.linear * eye.centre_m + self.shadows.offset;
        let light = Light {
            world_from_ray: rows(&world_from_ray),
            shadow_from_ray: rows(&(self.shadows.linear * world_from_ray)),
            shadow_offset: [offset.x as f32, offset.y as f32, offset.z as f32],
        };
        for row in 0..view.height {
            for column in 0..view.width {
                let pixel = row * view.width + column;
                let Some(ray) = view.pixel_ray(column, row) else { continue };
                let faces = if let Some(places) = &view.places {
                    places[pixel].map(|place| workspace.face[place as usize])
                } else {
                    let first = row * SAMPLES * view.grid.columns + column;
                    std::array::from_fn(|sample| workspace.face[first + sample * view.grid.columns])
                };
                picture[pixel] += share * self.pixel(&workspace.prepared, &light, faces, ray);
            }
        }
    }

    /// The mean over a pixel's samples; each face in it is shaded once, in the middle of its samples.
    fn pixel(&self, prepared: &[Prepared], light: &Light, faces: [u32; SAMPLES], ray: PixelRay) -> f32 {
        if faces[1..].iter().all(|face| *face == faces[0]) {
            return self.shade(prepared, light, faces[0], ray);
        }
        let mut sum = 0.0;
        for (index, face) in faces.iter().enumerate() {
            if faces[..index].contains(face) {
                continue;
            }
            let (mut count, mut x, mut y) = (0.0, 0.0, 0.0);
            for (offset, other) in OFFSETS_PX.iter().zip(&faces) {
                if other == face {
                    count += 1.0;
                    x += offset[0];
                    y += offset[1];
                }
            }
            let (x, y) = (x / count, y / count);
            let within = [0, 1].map(|axis: usize| ray.ray[axis] + ray.right[axis] * x + ray.down[axis] * y);
            sum += count * self.shade(prepared, light, *face, PixelRay { ray: within, ..ray });
        }
        sum / SAMPLES as f32
    }

    /// The grey of one face (or the sky) along a ray.
    fn shade(&self, prepared: &[Prepared], light: &Light, face: u32, at: PixelRay) -> f32 {
        if face == SKY {
            return self.sky(light, at.ray);
        }
        let face = &prepared[face as usize];
        let inverse_depth = dot(&face.inverse_depth, at.ray).max(1e-5);
        let depth_m = 1.0 / inverse_depth;
        let place = face.texture_m.map(|linear| dot(&linear, at.ray) * depth_m);
        // Quotient rule: d(u)/d(ray) = (u's linear part − u · inverse depth's) · depth.
        let change = |axis: usize, step: [f32; 2]| {
            let along = |k: usize| face.texture_m[axis][k] - place[axis] * face.inverse_depth[k];
            (along(0) * step[0] + along(1) * step[1]) * depth_m
        };
        let right = [change(0, at.right), change(1, at.right)];
        let down = [change(0, at.down), change(1, at.down)];
        let material = &self.world.materials[face.material as usize];
        let footprint = |texture: &Texture| {
            let scale = texture.texels_per_m();
            [place, right, down].map(|side| [side[0] * scale, side[1] * scale])
        };
        let texture = &self.world.textures[material.texture];
        let [centre, side_x, side_y] = footprint(texture);
        let mut grey = texture.sample(centre, side_x, side_y);
        if let Some(overlay) = material.overlay {
            let overlay = &self.world.textures[overlay];
            let [centre, side_x, side_y] = footprint(overlay);
            grey *= overlay.sample_roughly(centre, side_x, side_y) * (1.0 / 128.0);
        }
        let mut sun = (dot(&face.sun, at.ray) * depth_m).clamp(0.0, 1.0);
        if sun > 0.01 {
            let [column, row, height] =
                [0, 1, 2].map(|k: usize| dot(&light.shadow_from_ray[k], at.ray) * depth_m + light.shadow_offset[k]);
            sun *= self.shadows.lit(column, row, height);
        }
        grey *= BRIGHTNESS * (AMBIENT + (1.0 - AMBIENT) * sun);
        grey + (HAZE - grey) * (depth_m / (depth_m + HAZE_M))
    }

    /// The sky: brighter upwards, with soft clouds on a plane high above.
    fn sky(&self, light: &Light, ray: [f32; 2]) -> f32 {
        let direction = light.world_from_ray.map(|linear| dot(&linear, ray));
        let norm = (direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]).sqrt();
        let height = (direction[2] / norm).max(0.0);
        let base = HAZE + 26.0 * height;
        let lift = 1.0 / (height + 0.14);
        let place = [direction[0] / norm * lift * 62.0, direction[1] / norm * lift * 62.0];
        let stretch = 0.0028 * 62.0 * lift;
        let side = [stretch, 0.0];
        let far = [0.0, stretch * lift];
        let cloud = self.world.textures[self.world.clouds].sample(place, side, far) - 128.0;
        base + cloud * (height * 3.0).min(1.0) * 0.55
    }
}
