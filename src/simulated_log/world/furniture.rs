//! Objects: fences, cars, lamps, benches, crates, sheds, plain houses.

use nalgebra::{Vector2, Vector3};

use super::landscape::Palette;
use super::mesh::{MaterialId, World};
use crate::simulation::random::RandomStream;

/// Board fence with posts between two points, visible from both sides.
pub(crate) fn fence(
    world: &mut World,
    palette: &Palette,
    from: [f64; 2],
    to: [f64; 2],
    height_m: f64,
    random: &mut RandomStream,
) {
    let (from, to) = (Vector2::from(from), Vector2::from(to));
    let panels = ((to - from).norm() / 2.0).round().max(1.0) as usize;
    let step = (to - from) / panels as f64;
    let yaw = step.y.atan2(step.x);
    for panel in 0..panels {
        let middle = from + step * (panel as f64 + 0.5);
        let height = height_m * random.uniform(0.93, 1.05);
        let foot = Vector3::new(middle.x, middle.y, 0.06);
        world.cuboid(foot, Vector3::new(step.norm() - 0.08, 0.05, height), yaw, palette.planks, random);
        let post = from + step * panel as f64;
        let size = Vector3::new(0.12, 0.12, height_m + 0.18);
        world.cuboid(Vector3::new(post.x, post.y, 0.0), size, yaw, palette.bark, random);
    }
}

/// Car: body, cabin, wheels, windows.
pub(crate) fn car(world: &mut World, palette: &Palette, place: [f64; 2], yaw_rad: f64, random: &mut RandomStream) {
    let body = if random.chance(0.5) { palette.light_metal } else { palette.dark_metal };
    let (sine, cosine) = yaw_rad.sin_cos();
    let at =
        |x: f64, y: f64, z: f64| Vector3::new(place[0] + cosine * x - sine * y, place[1] + sine * x + cosine * y, z);
    world.cuboid(at(0.0, 0.0, 0.28), Vector3::new(4.1, 1.7, 0.5), yaw_rad, body, random);
    world.cuboid(at(-0.2, 0.0, 0.78), Vector3::new(2.1, 1.5, 0.55), yaw_rad, palette.dark_metal, random);
    world.cuboid(at(-0.2, 0.0, 1.33), Vector3::new(1.8, 1.42, 0.08), yaw_rad, body, random);
    for (x, y) in [(1.3, 0.72), (1.3, -0.72), (-1.3, 0.72), (-1.3, -0.72)] {
        world.cuboid(at(x, y, 0.0), Vector3::new(0.62, 0.3, 0.6), yaw_rad, palette.bark, random);
    }
    for y in [0.55, -0.55] {
        world.cuboid(at(2.05, y, 0.52), Vector3::new(0.06, 0.35, 0.16), yaw_rad, palette.concrete, random);
    }
}

/// Lamp post with its head towards `yaw_rad`.
pub(crate) fn lamp(world: &mut World, palette: &Palette, place: [f64; 2], yaw_rad: f64, random: &mut RandomStream) {
    let foot = Vector3::new(place[0], place[1], 0.0);
    world.column(foot, 0.14, 0.5, 8, palette.concrete, random);
    world.column(foot, 0.065, 5.2, 6, palette.dark_metal, random);
    let head = foot + Vector3::new(0.45 * yaw_rad.cos(), 0.45 * yaw_rad.sin(), 5.2);
    world.cuboid(head, Vector3::new(1.1, 0.22, 0.12), yaw_rad, palette.light_metal, random);
}

pub(crate) fn bench(world: &mut World, palette: &Palette, place: [f64; 2], yaw_rad: f64, random: &mut RandomStream) {
    let (sine, cosine) = yaw_rad.sin_cos();
    let at =
        |x: f64, y: f64, z: f64| Vector3::new(place[0] + cosine * x - sine * y, place[1] + sine * x + cosine * y, z);
    world.cuboid(at(0.0, 0.0, 0.42), Vector3::new(1.7, 0.45, 0.07), yaw_rad, palette.planks, random);
    world.cuboid(at(0.0, 0.24, 0.49), Vector3::new(1.7, 0.06, 0.45), yaw_rad, palette.planks, random);
    for x in [-0.65, 0.65] {
        world.cuboid(at(x, 0.0, 0.0), Vector3::new(0.12, 0.4, 0.42), yaw_rad, palette.concrete, random);
    }
}

pub(crate) fn crates(world: &mut World, palette: &Palette, place: [f64; 2], count: usize, random: &mut RandomStream) {
    let materials = [palette.planks, palette.light_metal, palette.bark, palette.dark_metal];
    let mut height = 0.0;
    for index in 0..count {
        let size = random.uniform(0.45, 0.75);
        let shift = [random.uniform(-0.12, 0.12), random.uniform(-0.12, 0.12)];
        if index % 2 == 0 {
            height = 0.0;
        }
        let beside = 0.8 * (index / 2) as f64;
        let foot = Vector3::new(place[0] + beside + shift[0], place[1] + shift[1], height);
        world.cuboid(foot, Vector3::repeat(size), random.uniform(0.0, 1.5), materials[random.index(4)], random);
        height += size;
    }
}

/// Fronts of a building (south, east, north, west) and its roof.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shell {
    pub(crate) fronts: [MaterialId; 4],
    pub(crate) roof: MaterialId,
}

/// Walls of a rectangular building; each front's texture starts at its upper left corner.
pub(crate) fn walls(world: &mut World, low: [f64; 2], high: [f64; 2], height_m: [f64; 2], fronts: &[MaterialId; 4]) {
    let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]].map(Vector2::from);
    for (side, front) in fronts.iter().enumerate() {
        world.wall(corners[side], corners[(side + 1) % 4], height_m, [0.0, 0.0], *front);
    }
}

/// Roof with its ridge along x, boards in the gables and under the eaves.
pub(crate) fn gable_roof(
    world: &mut World,
    low: [f64; 2],
    high: [f64; 2],
    eaves_m: f64,
    ridge_m: f64,
    slope: MaterialId,
    boards: MaterialId,
) {
    let over = 0.5;
    let middle = 0.5 * (low[1] + high[1]);
    let half = 0.5 * (high[1] - low[1]);
    let steepness = (ridge_m - eaves_m) / half;
    let length = high[0] - low[0] + 2.0 * over;
    let reach = half + over;
    for (sign, start_x) in [(-1.0, low[0] - over), (1.0, high[0] + over)] {
        let origin = Vector3::new(start_x, middle, ridge_m);
        let right = Vector3::new(-sign * length, 0.0, 0.0);
        let down = Vector3::new(0.0, sign * reach, -steepness * reach);
        world.quad(origin, right, down, [0.0, 0.0], slope);
        let under = vec![origin, origin + right, origin + right + down, origin + down];
        let under = under.into_iter().map(|corner| corner - Vector3::z() * 0.09).collect();
        world.polygon(under, -right.normalize(), down.normalize(), [0.0, 0.0], boards);
        // Edge of the eaves.
        let edge = origin + down;
        world.quad(edge, right, Vector3::new(0.0, 0.0, -0.14), [0.0, 0.0], boards);
        let back = vec![edge, edge + right, edge + right - Vector3::z() * 0.14, edge - Vector3::z() * 0.14];
        world.polygon(back, -right.normalize(), -Vector3::z(), [0.0, 0.0], boards);
    }
    for (x, sign) in [(low[0], -1.0), (high[0], 1.0)] {
        let left = Vector3::new(x, middle - sign * half, eaves_m);
        let right = Vector3::new(x, middle + sign * half, eaves_m);
        let top = Vector3::new(x, middle, ridge_m);
        world.polygon(vec![top, left, right], Vector3::y() * sign, -Vector3::z(), [1.3, 0.0], boards);
    }
}

/// Plain house with a gable roof.
pub(crate) fn plain_house(
    world: &mut World,
    palette: &Palette,
    centre: [f64; 2],
    size: [f64; 2],
    height_m: f64,
    shell: &Shell,
) {
    let low = [centre[0] - 0.5 * size[0], centre[1] - 0.5 * size[1]];
    let high = [centre[0] + 0.5 * size[0], centre[1] + 0.5 * size[1]];
    walls(world, low, high, [0.0, height_m], &shell.fronts);
    gable_roof(world, low, high, height_m, height_m + 0.3 * size[1], shell.roof, palette.planks);
}
