//! Environment 2: blocks of buildings between roads.
//!
//! Roads lie on a grid (see the experiments' streets); 4 m of carriageway and 2 m of pavement to each side of the axis
//! are free of walls.

use nalgebra::Vector3;

use super::facade::{Front, front};
use super::furniture::{bench, car, crates, lamp, walls};
use super::landscape::{Palette, begin, ground, hills, litter, tree, without_texture};
use super::mesh::{MaterialId, World};
use super::surface::Wall;
use crate::simulation::experiment::{TOWN_PITCH_M, TOWN_ROADS};
use crate::simulation::random::RandomStream;

/// Half the side of a block with its pavement.
const BLOCK_HALF_M: f64 = 11.0;
/// Half the side of a block without pavement.
const LOT_HALF_M: f64 = 9.0;
/// Height of the pavement above the road.
const KERB_M: f64 = 0.12;
/// Width of a painted front.
const FRONT_M: f64 = 9.0;

/// Painted fronts of one height.
struct Storeys {
    height_m: f64,
    fronts: Vec<MaterialId>,
}

/// The town, or its `buildings_alone` on even ground.
pub(super) fn build(buildings_alone: bool, seed: u64) -> World {
    let random = &mut RandomStream::new(seed, 102);
    let (mut world, mut palette) = begin(Vector3::new(0.52, -0.4, 0.8), 78.0, random);
    if buildings_alone {
        palette = without_texture(&mut world, &palette);
    }
    ground(&mut world, [-320.0, -320.0], [320.0, 320.0], -0.05, palette.grass);
    let edge = 0.5 * TOWN_PITCH_M * TOWN_ROADS as f64 + 14.0;
    ground(&mut world, [-edge, -edge], [edge, edge], 0.0, palette.asphalt);
    if !buildings_alone {
        hills(&mut world, &palette, random);
    }
    let pool = paint_fronts(&mut world, random);
    let blocks = TOWN_ROADS as i32 + 1;
    for i in 0..blocks {
        for j in 0..blocks {
            let centre = |k: i32| (f64::from(k) - 0.5 * f64::from(blocks - 1)) * TOWN_PITCH_M;
            let centre = [centre(i), centre(j)];
            if buildings_alone {
                bare_block(&mut world, &palette, &pool, centre, random);
            } else {
                block(&mut world, &palette, &pool, centre, random);
            }
        }
    }
    if !buildings_alone {
        roads(&mut world, &palette, random);
    }
    world
}

fn paint_fronts(world: &mut World, random: &mut RandomStream) -> Vec<Storeys> {
    let mut pool = Vec::new();
    for (floors, variants) in [(2, 8), (3, 9), (4, 6)] {
        let height_m = 2.95 * floors as f64;
        let fronts = (0..variants)
            .map(|variant| {
                let painted = front(
                    &Front {
                        wall: Wall::ALL[(variant + floors) % Wall::ALL.len()],
                        width_m: FRONT_M as f32,
                        height_m: height_m as f32,
                        floors,
                        windows_per_floor: 2 + (variant + floors) % 3,
                        texels_per_m: 64.0,
                        shops: true,
                    },
                    random,
                );
                world.material(painted)
            })
            .collect();
        pool.push(Storeys { height_m, fronts });
    }
    pool
}

/// Block: pavement with its kerb, with buildings, a yard or a small park.
fn block(world: &mut World, palette: &Palette, pool: &[Storeys], centre: [f64; 2], random: &mut RandomStream) {
    let around = |half: f64| ([centre[0] - half, centre[1] - half], [centre[0] + half, centre[1] + half]);
    let (low, high) = around(BLOCK_HALF_M);
    walls(world, low, high, [0.0, KERB_M], &[palette.concrete; 4]);
    ground(world, low, high, KERB_M, palette.slabs);
    let middle = centre[0].abs() < 1.0 && centre[1].abs() < 1.0;
    if middle {
        park(world, palette, centre, random);
    } else {
        for quarter in 0..4 {
            let sign = |bit: usize| if quarter >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let (sx, sy) = (sign(0), sign(1));
            let lot = [centre[0] + 0.5 * sx * LOT_HALF_M, centre[1] + 0.5 * sy * LOT_HALF_M];
            if random.chance(0.87) {
                let back = random.uniform(0.0, 1.2) * f64::from(u8::from(random.chance(0.5)));
                building(world, palette, pool, lot, [sx * back, sy * back], random);
            } else {
                tree(world, palette, lot, random.uniform(5.0, 8.0), random.uniform(1.8, 2.8), random);
                crates(world, palette, [lot[0] + 1.5, lot[1] - 2.0], 6, random);
                bench(world, palette, [lot[0] - 2.0, lot[1] + 2.0], 0.7, random);
            }
        }
    }
    // Street furniture near the kerb, except near the inner corners of the crossings.
    for side in 0..4 {
        let (out, along) =
            ([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]][side], [[1.0, 0.0], [0.0, 1.0]][side % 2]);
        let place = |shift: f64, off: f64| {
            [centre[0] + out[0] * off + along[0] * shift, centre[1] + out[1] * off + along[1] * shift]
        };
        let towards = f64::atan2(out[1], out[0]);
        lamp(world, palette, place(random.uniform(-4.0, 4.0), BLOCK_HALF_M - 0.35), towards, random);
        for _ in 0..2 {
            let at = place(random.uniform(-7.0, 7.0), LOT_HALF_M + 0.55);
            match random.index(4) {
                0 => crates(world, palette, at, 3, random),
                1 => bench(world, palette, at, towards + std::f64::consts::FRAC_PI_2, random),
                2 => world.column(Vector3::new(at[0], at[1], KERB_M), 0.3, 0.9, 9, palette.dark_metal, random),
                _ => tree(world, palette, at, random.uniform(3.2, 4.2), random.uniform(0.7, 1.0), random),
            }
        }
        if random.chance(0.75) {
            let at = place(random.uniform(-6.0, 6.0), BLOCK_HALF_M + 1.0);
            car(world, palette, at, towards + std::f64::consts::FRAC_PI_2, random);
        }
    }
}

/// Block of buildings and nothing else; the kerb has no texture.
fn bare_block(world: &mut World, palette: &Palette, pool: &[Storeys], centre: [f64; 2], random: &mut RandomStream) {
    let around = |half: f64| ([centre[0] - half, centre[1] - half], [centre[0] + half, centre[1] + half]);
    let (low, high) = around(BLOCK_HALF_M);
    walls(world, low, high, [0.0, KERB_M], &[palette.slabs; 4]);
    ground(world, low, high, KERB_M, palette.slabs);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let lot = [centre[0] + 0.5 * sx * LOT_HALF_M, centre[1] + 0.5 * sy * LOT_HALF_M];
        let back = random.uniform(0.0, 1.2) * f64::from(u8::from(random.chance(0.5)));
        building(world, palette, pool, lot, [sx * back, sy * back], random);
    }
}

/// Building on a quarter of a block, set back from its corner by `back`, with objects on its walls and its roof.
fn building(
    world: &mut World,
    palette: &Palette,
    pool: &[Storeys],
    lot: [f64; 2],
    back: [f64; 2],
    random: &mut RandomStream,
) {
    let storeys = &pool[[0, 1, 1, 2, 2][random.index(5)]];
    let half = 0.5 * FRONT_M;
    let centre = [lot[0] - back[0], lot[1] - back[1]];
    let (low, high) = ([centre[0] - half, centre[1] - half], [centre[0] + half, centre[1] + half]);
    let first = random.index(storeys.fronts.len());
    let fronts = std::array::from_fn(|side| storeys.fronts[(first + side * 2) % storeys.fronts.len()]);
    let height = storeys.height_m;
    walls(world, low, high, [KERB_M, KERB_M + height], &fronts);
    let top = KERB_M + height;
    // A ledge around the roof.
    world.cuboid(Vector3::new(centre[0], centre[1], top), Vector3::new(9.3, 9.3, 0.3), 0.0, palette.concrete, random);
    for _ in 0..3 {
        let (x, y) = (random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
        let size = Vector3::new(random.uniform(0.6, 1.8), random.uniform(0.6, 1.8), random.uniform(0.5, 1.6));
        let material = [palette.light_metal, palette.planks, palette.concrete][random.index(3)];
        world.cuboid(Vector3::new(centre[0] + x, centre[1] + y, top + 0.3), size, 0.0, material, random);
    }
    for side in 0..4 {
        let out = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]][side];
        let yaw = f64::atan2(out[1], out[0]);
        for _ in 0..2 {
            // Boxes, balconies and awnings: shallow, above head height.
            let shift = random.uniform(-3.4, 3.4);
            let deep = random.uniform(0.25, 0.6);
            let off = half + 0.5 * deep;
            let (x, y) = (centre[0] + out[0] * off - out[1] * shift, centre[1] + out[1] * off + out[0] * shift);
            let floor = random.uniform(2.6, height - 1.2);
            let size = Vector3::new(deep, random.uniform(0.5, 1.6), random.uniform(0.15, 0.7));
            let material = [palette.light_metal, palette.planks, palette.dark_metal][random.index(3)];
            world.cuboid(Vector3::new(x, y, floor), size, yaw, material, random);
        }
    }
}

/// Block in the centre: lawn, trees, benches and a kiosk.
fn park(world: &mut World, palette: &Palette, centre: [f64; 2], random: &mut RandomStream) {
    let half = LOT_HALF_M - 0.5;
    let (low, high) = ([centre[0] - half, centre[1] - half], [centre[0] + half, centre[1] + half]);
    ground(world, low, high, KERB_M + 0.02, palette.grass);
    for k in 0..7 {
        let angle = 0.9 * f64::from(k);
        let place = [centre[0] + 5.8 * angle.cos(), centre[1] + 5.8 * angle.sin()];
        tree(world, palette, place, random.uniform(4.5, 7.5), random.uniform(1.4, 2.2), random);
    }
    for k in 0..4 {
        let angle = 1.57 * f64::from(k) + 0.4;
        bench(world, palette, [centre[0] + 7.4 * angle.cos(), centre[1] + 7.4 * angle.sin()], angle + 1.57, random);
    }
    world.cuboid(Vector3::new(centre[0], centre[1], KERB_M), Vector3::new(3.0, 3.0, 2.6), 0.4, palette.planks, random);
    world.cuboid(Vector3::new(centre[0], centre[1], 2.72), Vector3::new(3.8, 3.8, 0.2), 0.4, palette.slabs, random);
}

/// Markings, manholes, patches and litter on the roads.
fn roads(world: &mut World, palette: &Palette, random: &mut RandomStream) {
    let paint = palette.paint;
    let place = |k: usize| (k as f64 - 0.5 * (TOWN_ROADS - 1) as f64) * TOWN_PITCH_M;
    for k in 0..TOWN_ROADS {
        for cross in 0..=TOWN_ROADS {
            let (axis, from) = (place(k), place(cross) - TOWN_PITCH_M);
            // Between two crossings, along y and along x.
            for flip in [false, true] {
                let mut mark = |low: [f64; 2], high: [f64; 2]| {
                    let turned = |point: [f64; 2]| if flip { [point[1], point[0]] } else { point };
                    let (a, b) = (turned(low), turned(high));
                    ground(world, [a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])], 0.012, paint);
                };
                for dash in 0..5 {
                    let start = from + 7.6 + 3.2 * f64::from(dash);
                    mark([axis - 0.08, start], [axis + 0.08, start + 1.6]);
                }
                for end in [from + 4.6, from + TOWN_PITCH_M - 6.4] {
                    for stripe in 0..6 {
                        let x = axis - 3.35 + 1.2 * f64::from(stripe);
                        mark([x, end], [x + 0.6, end + 1.8]);
                    }
                }
            }
        }
    }
    let reach = 0.5 * TOWN_PITCH_M * TOWN_ROADS as f64;
    let on_block = |x: f64, y: f64| {
        let off = |value: f64| {
            let shifted = (value / TOWN_PITCH_M + 0.5 * (TOWN_ROADS - 1) as f64).rem_euclid(1.0);
            (shifted.min(1.0 - shifted)) * TOWN_PITCH_M
        };
        off(x) > 3.8 && off(y) > 3.8
    };
    let materials = [palette.dark_metal, palette.concrete, palette.bark, palette.light_metal, palette.slabs];
    litter(world, &materials, reach, 2600, on_block, random);
}
