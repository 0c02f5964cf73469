use std::ops::Range;

use nalgebra::Vector3;

use super::raster::{Eye, Prepared, SKY, Workspace};
use super::shadow::ShadowMap;
use super::view::{OFFSETS_PX, PixelRay, Rays, RenderedView, SAMPLES};
use crate::geometry::RigidTransform;
use crate::simulated_log::world::{Footprints, World, axes, lanes};

/// Number of rows of pixels whose samples are drawn together.
const BAND_ROWS: usize = 8;
/// Number of pixels that are shaded together if they show the same face.
const LANES: usize = 8;
/// Marks a pixel whose samples show several faces.
const MIXED: u32 = SKY - 1;

/// Ratio of ambient light from the sky.
const AMBIENT: f32 = 0.6;
/// Total light of sky and sun on a surface perpendicular to the sun, relative to the texture's grey.
const BRIGHTNESS: f32 = 1.38;
/// Grey of the haze, equal to the grey of the horizon.
const HAZE: f32 = 186.0;
/// Distance at which half of a surface's grey is replaced by haze.
const HAZE_M: f32 = 420.0;

/// Environment prepared for rendering, shared by any number of threads.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceShader<'a> {
    world: &'a World,
    shadows: ShadowMap,
}

/// Data for shading in addition to the face: linear maps from rays into the sky and the shadow map.
struct Light {
    world_from_ray: [[f32; 3]; 3],
    shadow_from_ray: [[f32; 3]; 3],
    shadow_offset: [f32; 3],
}

#[inline]
fn dot(linear: &[f32; 3], ray: [f32; 2]) -> f32 {
    linear[0] * ray[0] + linear[1] * ray[1] + linear[2]
}

fn rows(matrix: &nalgebra::Matrix3<f64>) -> [[f32; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)] as f32))
}

impl<'a> SurfaceShader<'a> {
    /// Prepares the shadows of a world.
    pub(crate) fn new(world: &'a World) -> Self {
        Self { world, shadows: ShadowMap::new(world) }
    }

    /// Renders some rows of the image of a camera at a pose: linear gray values, added to the rows of `radiance` (the whole
    /// image) times `fraction`.
    pub(crate) fn render(
        &self,
        view: &RenderedView,
        shown: Range<usize>,
        world_from_camera: &RigidTransform,
        fraction: f32,
        workspace: &mut Workspace,
        radiance: &mut [f32],
    ) {
        let eye = Eye::new(world_from_camera);
        workspace.prepare(self.world, &eye, &view.grid, &view.sample_rows(shown.clone()));
        let world_from_ray = eye.camera_from_world.transpose();
        let offset: Vector3<f64> = self.shadows.linear * eye.centre_m + self.shadows.offset;
        let light = Light {
            world_from_ray: rows(&world_from_ray),
            shadow_from_ray: rows(&(self.shadows.linear * world_from_ray)),
            shadow_offset: [offset.x as f32, offset.y as f32, offset.z as f32],
        };
        // The samples of a band stay in the cache; if the lens distorts rows, all are needed at once.
        let band = if view.places.is_some() { view.height } else { BAND_ROWS };
        for top in shown.clone().step_by(band) {
            let bottom = (top + band).min(shown.end);
            let samples = view.sample_rows(top..bottom);
            workspace.draw(&view.grid, samples.clone());
            for row in top..bottom {
                let pixels = &mut radiance[row * view.width..][..view.width];
                self.shade_row(view, &light, row, samples.start, fraction, workspace, pixels);
            }
        }
    }

    /// Adds a row of pixels; `first_sample` is the first row of the grid in the workspace.
    #[expect(clippy::too_many_arguments, reason = "a row of an image needs all that the image needs")]
    fn shade_row(
        &self,
        view: &RenderedView,
        light: &Light,
        row: usize,
        first_sample: usize,
        fraction: f32,
        workspace: &mut Workspace,
        pixels: &mut [f32],
    ) {
        let faces_of = |face: &[u32], column: usize| -> [u32; SAMPLES] {
            if let Some(places) = &view.places {
                let first = first_sample * view.grid.columns;
                // Pixels outside the lens have no samples; the placeholders are not used.
                let places = &places[row * view.width + column];
                lanes(|sample| face[(places[sample] as usize).saturating_sub(first)])
            } else {
                let first = (row * SAMPLES - first_sample) * view.grid.columns + column;
                lanes(|sample| face[first + sample * view.grid.columns])
            }
        };
        let Workspace { face, prepared, seen, differs, .. } = workspace;
        seen.clear();
        if view.places.is_some() {
            seen.extend((0..view.width).map(|column| {
                let faces = faces_of(face, column);
                if faces.iter().all(|other| *other == faces[0]) { faces[0] } else { MIXED }
            }));
        } else {
            // Line by line, so that the loops are vectorized.
            let line = |sample: usize| {
                &face[(row * SAMPLES - first_sample + sample) * view.grid.columns..][..view.grid.columns]
            };
            seen.extend_from_slice(line(0));
            differs.clear();
            differs.resize(view.width, 0);
            for sample in 1..SAMPLES {
                for ((differs, first), other) in differs.iter_mut().zip(line(0)).zip(line(sample)) {
                    *differs |= first ^ other;
                }
            }
            for (seen, differs) in seen.iter_mut().zip(differs.iter()) {
                *seen = if *differs == 0 { *seen } else { MIXED };
            }
        }
        let mut column = 0;
        while column < view.width {
            let face_here = seen[column];
            let Some(ray) = view.pixel_ray(column, row) else {
                column += 1;
                continue;
            };
            if face_here == MIXED {
                pixels[column] += fraction * self.mixed(prepared, light, faces_of(face, column), ray);
                column += 1;
            } else if face_here == SKY {
                pixels[column] += fraction * self.sky(light, ray.ray);
                column += 1;
            } else {
                let dark = |at: usize| view.places.is_some() && view.pixel_ray(at, row).is_none();
                let last = (column + LANES).min(view.width);
                let end = (column + 1..last).find(|at| seen[*at] != face_here || dark(*at)).unwrap_or(last);
                let rays = view.rays::<LANES>(column..end, row);
                let greys = self.shade(&prepared[face_here as usize], light, &rays, end - column);
                for (pixel, grey) in pixels[column..end].iter_mut().zip(greys) {
                    *pixel += fraction * grey;
                }
                column = end;
            }
        }
    }

    /// Mean over a pixel's samples; each visible face is shaded once, at the mean of its samples.
    fn mixed(&self, prepared: &[Prepared], light: &Light, faces: [u32; SAMPLES], ray: PixelRay) -> f32 {
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
            let within = axes(|axis| ray.ray[axis] + ray.right[axis] * x + ray.down[axis] * y);
            let grey = if *face == SKY {
                self.sky(light, within)
            } else {
                let [grey] = self.shade(&prepared[*face as usize], light, &PixelRay { ray: within, ..ray }.into(), 1);
                grey
            };
            sum += count * grey;
        }
        sum / SAMPLES as f32
    }

    /// Grey values of a face along the first `count` rays.
    fn shade<const N: usize>(&self, face: &Prepared, light: &Light, at: &Rays<N>, count: usize) -> [f32; N] {
        let along = |linear: &[f32; 3]| -> [f32; N] {
            lanes(|k| linear[0] * at.ray[0][k] + linear[1] * at.ray[1][k] + linear[2])
        };
        let inverse_depth = along(&face.inverse_depth);
        let depth_m: [f32; N] = lanes(|k| 1.0 / inverse_depth[k].max(1e-5));
        let times_depth = |values: [f32; N]| -> [f32; N] { lanes(|k| values[k] * depth_m[k]) };
        let place: [[f32; N]; 2] = axes(|axis| times_depth(along(&face.texture_m[axis])));
        // Quotient rule: d(u)/d(ray) = (u's linear part − u · inverse depth's) · depth.
        let change = |step: &[[f32; N]; 2]| -> [[f32; N]; 2] {
            axes(|axis| {
                let along =
                    |k: usize, part: usize| face.texture_m[axis][part] - place[axis][k] * face.inverse_depth[part];
                lanes(|k| (along(k, 0) * step[0][k] + along(k, 1) * step[1][k]) * depth_m[k])
            })
        };
        let footprints = Footprints { centre: place, sides: [change(&at.right), change(&at.down)] };
        let material = &self.world.materials[face.material as usize];
        let texture = &self.world.textures[material.texture];
        let mut greys = texture.sample(&footprints.scaled(texture.texels_per_m()), count);
        if let Some(overlay) = material.overlay {
            let overlay = &self.world.textures[overlay];
            let shades = overlay.sample_roughly(&footprints.scaled(overlay.texels_per_m()), count);
            for (grey, shade) in greys.iter_mut().zip(shades) {
                *grey *= shade * (1.0 / 128.0);
            }
        }
        let sun = times_depth(along(&face.sun));
        let mut sun: [f32; N] = lanes(|k| sun[k].clamp(0.0, 1.0));
        let in_shadow_map = |axis: usize| -> [f32; N] {
            let scaled = times_depth(along(&light.shadow_from_ray[axis]));
            lanes(|k| scaled[k] + light.shadow_offset[axis])
        };
        let (columns, rows, heights) = (in_shadow_map(0), in_shadow_map(1), in_shadow_map(2));
        for k in 0..count.min(N) {
            if sun[k] > 0.01 {
                sun[k] *= self.shadows.lit(columns[k], rows[k], heights[k]);
            }
        }
        lanes(|k| {
            let grey = greys[k] * (BRIGHTNESS * (AMBIENT + (1.0 - AMBIENT) * sun[k]));
            grey + (HAZE - grey) * (depth_m[k] / (depth_m[k] + HAZE_M))
        })
    }

    /// The sky: brighter upwards, with soft clouds on a plane high above.
    fn sky(&self, light: &Light, ray: [f32; 2]) -> f32 {
        let direction: [f32; 3] = lanes(|axis| dot(&light.world_from_ray[axis], ray));
        let norm = (direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]).sqrt();
        let height = (direction[2] / norm).max(0.0);
        let base = HAZE + 26.0 * height;
        let lift = 1.0 / (height + 0.14);
        let place = [direction[0] / norm * lift * 62.0, direction[1] / norm * lift * 62.0];
        let stretch = 0.0028 * 62.0 * lift;
        let side = [stretch, 0.0];
        let far = [0.0, stretch * lift];
        let lane = |[x, y]: [f32; 2]| [[x], [y]];
        let footprint = Footprints { centre: lane(place), sides: [lane(side), lane(far)] };
        let [cloud] = self.world.textures[self.world.clouds].sample(&footprint, 1);
        base + (cloud - 128.0) * (height * 3.0).min(1.0) * 0.55
    }
}
