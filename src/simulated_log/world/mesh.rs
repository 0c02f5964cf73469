//! Geometry of a world: convex planar faces with a material each.

use nalgebra::{Vector2, Vector3};

use super::texture::WorldTexture;
use crate::simulation::random::RandomStream;

/// Index of a material in its world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MaterialId(pub(crate) usize);

#[derive(Clone, Debug)]
pub(crate) struct Material {
    /// Index of the texture.
    pub(crate) texture: usize,
    /// Second texture that multiplies the first (128: factor 1).
    pub(crate) overlay: Option<usize>,
}

/// Affine function of a point of the world: `gradient · point + offset`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Affine {
    pub(crate) gradient: Vector3<f64>,
    pub(crate) offset: f64,
}

impl Affine {
    fn constant(offset: f64) -> Self {
        Self { gradient: Vector3::zeros(), offset }
    }

    /// Function with the value `start` at `origin` that grows by one per metre along `axis`.
    fn along(axis: Vector3<f64>, origin: &Vector3<f64>, start: f64) -> Self {
        Self { gradient: axis, offset: start - axis.dot(origin) }
    }
}

/// Convex planar polygon that is visible from its front only, where its corners are counter-clockwise.
#[derive(Clone, Debug)]
pub(crate) struct MeshFace {
    pub(crate) corners: Vec<Vector3<f64>>,
    pub(crate) bounds: Bounds,
    /// Outward unit normal and its distance: `normal · point = distance`.
    pub(crate) normal: Vector3<f64>,
    pub(crate) distance: f64,
    /// Texture coordinates in metres.
    pub(crate) texture_m: [Affine; 2],
    /// Cosine of the angle between the normal and the sun, 0 to 1.
    pub(crate) sun: Affine,
    pub(crate) material: MaterialId,
}

/// Bounding sphere of a face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) centre_m: Vector3<f64>,
    pub(crate) radius_m: f64,
}

impl Bounds {
    fn of(corners: &[Vector3<f64>]) -> Self {
        let centre_m = corners.iter().sum::<Vector3<f64>>() / corners.len().max(1) as f64;
        let radius_m = corners.iter().map(|corner| (corner - centre_m).norm()).fold(0.0, f64::max);
        Self { centre_m, radius_m }
    }
}

/// World: faces, materials, textures, sun and sky.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) faces: Vec<MeshFace>,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<WorldTexture>,
    /// Unit direction towards the sun.
    pub(crate) to_sun: Vector3<f64>,
    /// Half the side of the square around the origin with shadows.
    pub(crate) shadow_reach_m: f64,
    /// Index of the texture of the clouds.
    pub(crate) clouds: usize,
}

impl World {
    pub(crate) fn new(to_sun: Vector3<f64>, shadow_reach_m: f64, clouds: WorldTexture) -> Self {
        Self {
            faces: Vec::new(),
            materials: Vec::new(),
            textures: vec![clouds],
            to_sun: to_sun.normalize(),
            shadow_reach_m,
            clouds: 0,
        }
    }

    /// Adds a texture as a separate material.
    pub(crate) fn material(&mut self, texture: WorldTexture) -> MaterialId {
        self.textures.push(texture);
        self.materials.push(Material { texture: self.textures.len() - 1, overlay: None });
        MaterialId(self.materials.len() - 1)
    }

    /// Adds a material with a repeating texture and a second one that hides the repetition.
    pub(crate) fn overlaid(&mut self, material: MaterialId, overlay: MaterialId) -> MaterialId {
        let (texture, overlay) = (self.materials[material.0].texture, self.materials[overlay.0].texture);
        self.materials.push(Material { texture, overlay: Some(overlay) });
        MaterialId(self.materials.len() - 1)
    }

    /// Adds a face with these corners (counter-clockwise from outside) and texture axes along `right` and `down`, whose
    /// coordinates at the first corner are `start_m`.
    pub(crate) fn polygon(
        &mut self,
        corners: Vec<Vector3<f64>>,
        right: Vector3<f64>,
        down: Vector3<f64>,
        start_m: [f64; 2],
        material: MaterialId,
    ) {
        let origin = corners[0];
        let normal = area_normal(&corners);
        let Some(normal) = normal.try_normalize(1e-12) else { return };
        let sun = normal.dot(&self.to_sun).max(0.0);
        self.faces.push(MeshFace {
            bounds: Bounds::of(&corners),
            distance: normal.dot(&origin),
            normal,
            texture_m: [Affine::along(right, &origin, start_m[0]), Affine::along(down, &origin, start_m[1])],
            sun: Affine::constant(sun),
            material,
            corners,
        });
    }

    /// Adds a parallelogram with an image: its upper left corner, its side to the right and its side downwards.
    pub(crate) fn quad(
        &mut self,
        origin: Vector3<f64>,
        right: Vector3<f64>,
        down: Vector3<f64>,
        start_m: [f64; 2],
        material: MaterialId,
    ) {
        let corners = vec![origin, origin + down, origin + down + right, origin + right];
        self.polygon(corners, right.normalize(), down.normalize(), start_m, material);
    }

    /// Adds an upright wall over the foot line from `from` to `to`, left to right from outside.
    pub(crate) fn wall(
        &mut self,
        from: Vector2<f64>,
        to: Vector2<f64>,
        height_m: [f64; 2],
        start_m: [f64; 2],
        material: MaterialId,
    ) {
        let along = to - from;
        let origin = Vector3::new(from.x, from.y, height_m[1]);
        let down = Vector3::new(0.0, 0.0, height_m[0] - height_m[1]);
        self.quad(origin, Vector3::new(along.x, along.y, 0.0), down, start_m, material);
    }

    /// Adds a box centred on its foot and rotated about the vertical; the texture of each side starts at a random
    /// position.
    pub(crate) fn cuboid(
        &mut self,
        foot: Vector3<f64>,
        size: Vector3<f64>,
        yaw_rad: f64,
        material: MaterialId,
        random: &mut RandomStream,
    ) {
        let half = Vector2::new(0.5 * size.x, 0.5 * size.y);
        let (sine, cosine) = yaw_rad.sin_cos();
        let corner = |x: f64, y: f64| {
            Vector2::new(
                foot.x + cosine * x * half.x - sine * y * half.y,
                foot.y + sine * x * half.x + cosine * y * half.y,
            )
        };
        // Counter-clockwise from above: each side runs from left to right from outside.
        let plan = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        self.prism(&plan, [foot.z, foot.z + size.z], material, random);
    }

    /// Adds an upright prism over a convex plan (counter-clockwise from above) with a lid.
    pub(crate) fn prism(
        &mut self,
        plan: &[Vector2<f64>],
        height_m: [f64; 2],
        material: MaterialId,
        random: &mut RandomStream,
    ) {
        let mut start = [random.uniform(0.0, 16.0), random.uniform(0.0, 16.0)];
        for k in 0..plan.len() {
            let (from, to) = (plan[k], plan[(k + 1) % plan.len()]);
            self.wall(from, to, height_m, start, material);
            start[0] += (to - from).norm();
        }
        let lid = plan.iter().map(|point| Vector3::new(point.x, point.y, height_m[1])).collect();
        self.polygon(lid, Vector3::x(), -Vector3::y(), start, material);
    }

    /// Adds a regular upright prism: trunks, posts, barrels.
    pub(crate) fn column(
        &mut self,
        foot: Vector3<f64>,
        radius_m: f64,
        height_m: f64,
        sides: usize,
        material: MaterialId,
        random: &mut RandomStream,
    ) {
        let start_angle = random.uniform(0.0, 1.0);
        let plan: Vec<_> = (0..sides)
            .map(|k| {
                let angle = start_angle + std::f64::consts::TAU * k as f64 / sides as f64;
                Vector2::new(foot.x + radius_m * angle.cos(), foot.y + radius_m * angle.sin())
            })
            .collect();
        self.prism(&plan, [foot.z, foot.z + height_m], material, random);
    }

    /// Adds a flat patch on the ground: manhole lids, stones, puddles.
    pub(crate) fn patch(
        &mut self,
        centre: Vector3<f64>,
        radii_m: [f64; 2],
        sides: usize,
        material: MaterialId,
        random: &mut RandomStream,
    ) {
        let start_angle = random.uniform(0.0, std::f64::consts::TAU);
        let corners = (0..sides)
            .map(|k| {
                let angle = std::f64::consts::TAU * k as f64 / sides as f64;
                let (x, y) = (radii_m[0] * angle.cos(), radii_m[1] * angle.sin());
                let (sine, cosine) = start_angle.sin_cos();
                centre + Vector3::new(cosine * x - sine * y, sine * x + cosine * y, 0.0)
            })
            .collect();
        let start = [random.uniform(0.0, 16.0), random.uniform(0.0, 16.0)];
        self.polygon(corners, Vector3::x(), -Vector3::y(), start, material);
    }

    /// Adds a rounded lump with smooth shading: foliage, bushes, boulders.
    pub(crate) fn blob(
        &mut self,
        centre: Vector3<f64>,
        radii_m: Vector3<f64>,
        roughness: f64,
        material: MaterialId,
        random: &mut RandomStream,
    ) {
        let (points, triangles) = sphere();
        let points: Vec<Vector3<f64>> = points
            .iter()
            .map(|point| point * (1.0 + roughness * random.uniform(-1.0, 1.0)))
            .map(|point| centre + point.component_mul(&radii_m))
            .collect();
        let sunlit = |point: &Vector3<f64>| {
            let outward = (point - centre).component_div(&radii_m).component_div(&radii_m).normalize();
            // Extended beyond the terminator, as light passes through leaves.
            ((outward.dot(&self.to_sun) + 0.35) / 1.35).max(0.0)
        };
        let light: Vec<f64> = points.iter().map(sunlit).collect();
        let start = [random.uniform(0.0, 4.0), random.uniform(0.0, 4.0)];
        for triangle in triangles {
            let corners = triangle.map(|index| points[index]);
            let normal = area_normal(&corners);
            let side = if normal.z.abs() > 0.75 * normal.norm() { Vector3::x() } else { Vector3::z().cross(&normal) };
            let Some(right) = side.try_normalize(1e-12) else { continue };
            let down = right.cross(&normal.normalize());
            self.polygon(corners.to_vec(), right, down, start, material);
            if let Some(face) = self.faces.last_mut() {
                face.sun = through(&corners, triangle.map(|index| light[index]));
            }
        }
    }
}

/// Sum of the corner triangles' normals: outward, with twice the area as length.
fn area_normal(corners: &[Vector3<f64>]) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    for k in 1..corners.len() - 1 {
        sum += (corners[k] - corners[0]).cross(&(corners[k + 1] - corners[0]));
    }
    sum
}

/// Affine function with these values at a triangle's corners, constant along its normal.
fn through(corners: &[Vector3<f64>; 3], values: [f64; 3]) -> Affine {
    let (first, second) = (corners[1] - corners[0], corners[2] - corners[0]);
    let normal = first.cross(&second);
    let square = normal.norm_squared().max(1e-18);
    let gradient =
        ((values[1] - values[0]) * second.cross(&normal) + (values[2] - values[0]) * normal.cross(&first)) / square;
    Affine { gradient, offset: values[0] - gradient.dot(&corners[0]) }
}

/// Unit sphere of 42 points and 80 triangles: an icosahedron subdivided once.
fn sphere() -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
    let golden = 0.5 * (1.0 + 5_f64.sqrt());
    let mut points = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        points.push(Vector3::new(0.0, a, b).normalize());
        points.push(Vector3::new(a, b, 0.0).normalize());
        points.push(Vector3::new(b, 0.0, a).normalize());
    }
    let mut coarse = Vec::new();
    let edge = 1.1;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let near = |i: usize, j: usize| (points[i] - points[j]).norm() < edge;
                if near(a, b) && near(b, c) && near(a, c) {
                    let outward = area_normal(&[points[a], points[b], points[c]]).dot(&points[a]) > 0.0;
                    coarse.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    let mut middles = std::collections::BTreeMap::new();
    let mut fine = Vec::with_capacity(80);
    for [a, b, c] in coarse {
        let mut middle = |i: usize, j: usize| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                points.push((points[i] + points[j]).normalize());
                points.len() - 1
            })
        };
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        fine.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    (points, fine)
}
