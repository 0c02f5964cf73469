//! Common parts of both environments: materials, ground, hills and trees.

use nalgebra::{Vector2, Vector3};

use super::canvas::Canvas;
use super::mesh::{MaterialId, World};
use super::surface;
use crate::simulation::random::RandomStream;

/// Materials of everything except fronts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Palette {
    pub(crate) grass: MaterialId,
    pub(crate) asphalt: MaterialId,
    pub(crate) slabs: MaterialId,
    pub(crate) leaves: MaterialId,
    pub(crate) bark: MaterialId,
    pub(crate) planks: MaterialId,
    pub(crate) concrete: MaterialId,
    pub(crate) light_metal: MaterialId,
    pub(crate) dark_metal: MaterialId,
    pub(crate) woods: MaterialId,
    pub(crate) paint: MaterialId,
}

/// Empty world with a sky, and its palette.
pub(crate) fn begin(to_sun: Vector3<f64>, shadow_reach_m: f64, random: &mut RandomStream) -> (World, Palette) {
    let mut world = World::new(to_sun, shadow_reach_m, surface::clouds(random));
    let blotches = world.material(surface::blotches(random));
    let mut add = |texture| world.material(texture);
    let grass = add(surface::grass(random));
    let asphalt = add(surface::asphalt(random));
    let slabs = add(surface::slabs(random));
    let leaves = add(surface::leaves(random));
    let bark = add(surface::bark(random));
    let planks = add(surface::planks(random));
    let concrete = add(surface::concrete(random));
    let light_metal = add(surface::metal(168.0, random));
    let dark_metal = add(surface::metal(72.0, random));
    let woods = add(surface::woods(random));
    let paint = add(surface::paint(random));
    let grass = world.overlaid(grass, blotches);
    let asphalt = world.overlaid(asphalt, blotches);
    let slabs = world.overlaid(slabs, blotches);
    (world, Palette { grass, asphalt, slabs, leaves, bark, planks, concrete, light_metal, dark_metal, woods, paint })
}

/// Replaces the clouds, and in the palette all that covers the ground, by even grey values.
pub(crate) fn without_texture(world: &mut World, palette: &Palette) -> Palette {
    // Sides in metres and texels; any size gives the same.
    let even = |grey: f32| Canvas::new(8.0, 8.0, 1.0, true, grey).finish();
    let clouds = world.clouds;
    world.textures[clouds] = even(128.0);
    let ground = world.material(even(112.0));
    Palette { grass: ground, asphalt: ground, slabs: ground, paint: ground, ..*palette }
}

/// Horizontal rectangle visible from above, from its lower left to its upper right corner.
pub(crate) fn ground(world: &mut World, low: [f64; 2], high: [f64; 2], height_m: f64, material: MaterialId) {
    let origin = Vector3::new(low[0], high[1], height_m);
    let start = [low[0].rem_euclid(640.0), (-high[1]).rem_euclid(640.0)];
    world.quad(origin, Vector3::x() * (high[0] - low[0]), -Vector3::y() * (high[1] - low[1]), start, material);
}

/// Two rings of wooded hills around everything.
pub(crate) fn hills(world: &mut World, palette: &Palette, random: &mut RandomStream) {
    for (radius_m, height_m) in [(150.0, 13.0), (235.0, 27.0)] {
        let count = 64;
        let waves: Vec<[f64; 2]> =
            (0..5).map(|_| [random.uniform(0.0, std::f64::consts::TAU), random.uniform(0.4, 1.0)]).collect();
        let rise = |angle: f64| {
            let frequencies = [1.0, 2.0, 5.0, 9.0, 17.0];
            let sum: f64 = waves
                .iter()
                .zip(frequencies)
                .map(|([phase, weight], frequency)| weight * (frequency * angle + phase).sin() / frequency.sqrt())
                .sum();
            height_m * (0.75 + 0.3 * sum).max(0.15)
        };
        for k in 0..count {
            let place = |index: usize| {
                let angle = std::f64::consts::TAU * index as f64 / count as f64;
                (Vector2::new(radius_m * angle.cos(), radius_m * angle.sin()), rise(angle))
            };
            let ((from, from_rise), (to, to_rise)) = (place(k), place(k + 1));
            // Visible from the inside: the left end has the larger angle.
            let corners = vec![
                Vector3::new(to.x, to.y, to_rise),
                Vector3::new(to.x, to.y, -1.0),
                Vector3::new(from.x, from.y, -1.0),
                Vector3::new(from.x, from.y, from_rise),
            ];
            let right = Vector3::new(from.x - to.x, from.y - to.y, 0.0).normalize();
            let start = [(count - k) as f64 * (to - from).norm(), 64.0 - to_rise];
            world.polygon(corners, right, -Vector3::z(), start, palette.woods);
        }
    }
}

/// Tree: trunk and a crown of several lumps within `crown_m` of the trunk.
pub(crate) fn tree(
    world: &mut World,
    palette: &Palette,
    foot: [f64; 2],
    height_m: f64,
    crown_m: f64,
    random: &mut RandomStream,
) {
    let foot = Vector3::new(foot[0], foot[1], 0.0);
    let trunk = 0.09 + 0.02 * height_m;
    world.column(foot, trunk, 0.7 * height_m, 7, palette.bark, random);
    let lumps = 4 + random.index(3);
    for lump in 0..lumps {
        let angle = 2.4 * lump as f64 + random.uniform(0.0, 0.6);
        let out = if lump == 0 { 0.0 } else { 0.45 * crown_m };
        let radius = crown_m * random.uniform(0.42, 0.55);
        let up = height_m * random.uniform(0.55, 0.82) + if lump == 0 { 0.12 * height_m } else { 0.0 };
        let centre = foot + Vector3::new(out * angle.cos(), out * angle.sin(), up);
        let radii = Vector3::new(radius, radius, radius * random.uniform(0.75, 1.0));
        world.blob(centre, radii, 0.13, palette.leaves, random);
    }
}

pub(crate) fn bush(world: &mut World, palette: &Palette, foot: [f64; 2], radius_m: f64, random: &mut RandomStream) {
    for _ in 0..2 {
        let shift = [random.uniform(-0.3, 0.3) * radius_m, random.uniform(-0.3, 0.3) * radius_m];
        let centre = Vector3::new(foot[0] + shift[0], foot[1] + shift[1], 0.55 * radius_m);
        let radii = Vector3::new(radius_m, radius_m, 0.8 * radius_m) * random.uniform(0.7, 1.0);
        world.blob(centre, radii, 0.16, palette.leaves, random);
    }
}

/// Stones, tufts and other small flat objects over a rectangle, except where `taken` is true.
pub(crate) fn litter(
    world: &mut World,
    materials: &[MaterialId],
    reach_m: f64,
    count: usize,
    taken: impl Fn(f64, f64) -> bool,
    random: &mut RandomStream,
) {
    for index in 0..count {
        let (x, y) = (random.uniform(-reach_m, reach_m), random.uniform(-reach_m, reach_m));
        let size = random.uniform(0.08, 0.3);
        let flat = random.uniform(0.5, 1.0);
        if !taken(x, y) {
            let material = materials[index % materials.len()];
            world.patch(Vector3::new(x, y, 0.015), [size, size * flat], 6, material, random);
        }
    }
}
