//! Environment 1: a house in its garden, with neighbours beyond the fence.
//!
//! Experiments T1 and T2 stay above the lawn between the house (6 m and 4.5 m from the centre) and the fence (22 m).

use nalgebra::{Vector2, Vector3};

use super::facade::{Front, front};
use super::furniture::{Shell, bench, car, crates, fence, gable_roof, lamp, plain_house, walls};
use super::landscape::{Palette, begin, bush, ground, hills, litter, tree, without_texture};
use super::mesh::{MaterialId, World};
use super::surface::{Wall, roof};
use crate::simulation::random::RandomStream;

/// Half of the house's length and width.
const HALF_M: [f64; 2] = [6.0, 4.5];
/// Height of the eaves and of the ridge.
const EAVES_M: f64 = 5.2;
const RIDGE_M: f64 = 8.0;
/// Distance of the fence from the centre.
const FENCE_M: f64 = 22.5;

/// The house with its garden and its neighbours, or `alone` on even ground.
pub(super) fn build(alone: bool, seed: u64) -> World {
    let random = &mut RandomStream::new(seed, 101);
    let (mut world, palette) = begin(Vector3::new(-0.45, -0.62, 0.72), 46.0, random);
    if alone {
        let even = without_texture(&mut world, &palette);
        ground(&mut world, [-320.0, -320.0], [320.0, 320.0], 0.0, even.grass);
        house(&mut world, &palette, random);
        return world;
    }
    ground(&mut world, [-320.0, -320.0], [320.0, 320.0], 0.0, palette.grass);
    hills(&mut world, &palette, random);
    house(&mut world, &palette, random);
    garden(&mut world, &palette, random);
    neighbours(&mut world, &palette, random);
    world
}

fn painted(
    world: &mut World,
    wall: Wall,
    size_m: [f64; 2],
    counts: [usize; 2],
    random: &mut RandomStream,
) -> MaterialId {
    let texture = front(
        &Front {
            wall,
            width_m: size_m[0] as f32,
            height_m: size_m[1] as f32,
            floors: counts[0],
            windows_per_floor: counts[1],
            texels_per_m: 84.0,
            shops: false,
        },
        random,
    );
    world.material(texture)
}

fn house(world: &mut World, palette: &Palette, random: &mut RandomStream) {
    let [x, y] = HALF_M;
    let (low, high) = ([-x, -y], [x, y]);
    let long = [2.0 * x, EAVES_M];
    let short = [2.0 * y, EAVES_M];
    let fronts = [
        painted(world, Wall::Brick, long, [2, 4], random),
        painted(world, Wall::Plaster, short, [2, 3], random),
        painted(world, Wall::Stone, long, [2, 4], random),
        painted(world, Wall::Boards, short, [2, 3], random),
    ];
    walls(world, low, high, [0.0, EAVES_M], &fronts);
    let tiles = world.material(roof(13.0, 6.0, 72.0, random));
    gable_roof(world, low, high, EAVES_M, RIDGE_M, tiles, palette.planks);
    // Chimney with its cap, and an antenna.
    world.cuboid(Vector3::new(3.1, 1.3, 6.4), Vector3::new(0.85, 0.85, 2.5), 0.0, palette.concrete, random);
    world.cuboid(Vector3::new(3.1, 1.3, 8.9), Vector3::new(1.05, 1.05, 0.14), 0.0, palette.slabs, random);
    world.column(Vector3::new(-4.2, 0.3, 7.6), 0.035, 2.0, 5, palette.dark_metal, random);
    // A dormer on the southern slope and roof windows on the northern one.
    let dormer = painted(world, Wall::Boards, [2.0, 1.5], [1, 1], random);
    world.cuboid(Vector3::new(-2.6, -2.1, 5.7), Vector3::new(2.0, 2.2, 1.5), 0.0, palette.planks, random);
    world.wall(Vector2::new(-3.6, -3.21), Vector2::new(-1.6, -3.21), [5.7, 7.2], [0.0, 0.0], dormer);
    world.cuboid(Vector3::new(-2.6, -2.2, 7.2), Vector3::new(2.4, 2.6, 0.1), 0.0, palette.slabs, random);
    // Porch before the door.
    world.cuboid(Vector3::new(1.2, -5.6, 0.0), Vector3::new(3.6, 2.2, 0.22), 0.0, palette.slabs, random);
    world.cuboid(Vector3::new(1.2, -5.6, 2.55), Vector3::new(3.8, 2.4, 0.14), 0.0, palette.planks, random);
    for post in [-0.4, 2.8] {
        world.cuboid(Vector3::new(post, -6.5, 0.22), Vector3::new(0.16, 0.16, 2.33), 0.0, palette.bark, random);
    }
    // A flat annex to the east and a bay to the north.
    let annex = [
        painted(world, Wall::Plaster, [2.6, 2.8], [1, 1], random),
        painted(world, Wall::Panels, [4.5, 2.8], [1, 2], random),
        painted(world, Wall::Plaster, [2.6, 2.8], [1, 1], random),
    ];
    walls(world, [x, -2.5], [x + 2.6, 2.0], [0.0, 2.8], &[annex[0], annex[1], annex[2], annex[0]]);
    ground(world, [x - 0.1, -2.6], [x + 2.7, 2.1], 2.8, palette.concrete);
    let bay = painted(world, Wall::Boards, [3.0, 2.6], [1, 2], random);
    world.cuboid(Vector3::new(-2.0, y + 0.6, 0.0), Vector3::new(3.0, 1.2, 2.6), 0.0, palette.planks, random);
    world.wall(Vector2::new(-0.5, y + 1.21), Vector2::new(-3.5, y + 1.21), [0.0, 2.6], [0.0, 0.0], bay);
    // Balcony and boxes on the walls add depth to the fronts.
    for (place, size) in [
        ([-6.5, 0.4, 2.5], [1.0, 3.2, 0.16]),
        ([-6.95, 0.4, 2.66], [0.08, 3.2, 0.85]),
        ([-3.6, -4.7, 2.72], [1.3, 0.35, 0.25]),
        ([4.2, -4.7, 2.72], [1.3, 0.35, 0.25]),
        ([4.6, 4.72, 2.2], [0.8, 0.4, 0.6]),
        ([-5.0, 4.72, 1.1], [0.5, 0.35, 0.8]),
    ] {
        let material = if random.chance(0.5) { palette.planks } else { palette.light_metal };
        world.cuboid(Vector3::from(place), Vector3::from(size), 0.0, material, random);
    }
}

fn garden(world: &mut World, palette: &Palette, random: &mut RandomStream) {
    // Paths and a terrace.
    ground(world, [0.4, -FENCE_M], [2.0, -6.7], 0.012, palette.slabs);
    ground(world, [-5.0, 5.8], [3.5, 8.6], 0.012, palette.slabs);
    ground(world, [13.0, -FENCE_M], [17.5, -4.0], 0.012, palette.asphalt);
    ground(world, [-10.5, -4.0], [-6.2, -2.8], 0.012, palette.slabs);
    let taken = |x: f64, y: f64| {
        (x.abs() < HALF_M[0] + 2.8 && y.abs() < HALF_M[1] + 2.0)
            || (x > 12.0 && x < 18.0 && y < -3.5)
            || (x - 1.2).abs() < 1.2
    };
    let materials = [palette.concrete, palette.slabs, palette.leaves, palette.bark, palette.light_metal];
    litter(world, &materials, FENCE_M - 0.5, 620, taken, random);
    // Beds and bushes along the walls.
    for (x, y) in [
        (-5.2, -5.3),
        (-4.0, -5.4),
        (-2.6, -5.2),
        (3.9, -5.4),
        (5.3, -5.2),
        (-6.9, -3.4),
        (-7.0, 3.2),
        (-6.9, 4.1),
        (-5.2, 5.5),
        (0.8, 5.4),
        (2.4, 5.5),
        (5.4, 5.2),
        (7.4, 3.0),
        (9.2, -1.6),
        (9.2, 0.9),
    ] {
        bush(world, palette, [x, y], random.uniform(0.4, 0.75), random);
    }
    for _ in 0..26 {
        let angle = random.uniform(0.0, std::f64::consts::TAU);
        let (x, y) = (7.9 * angle.cos(), 6.3 * angle.sin());
        let radius = random.uniform(0.12, 0.3);
        let centre = Vector3::new(x, y, 0.4 * radius);
        world.blob(centre, Vector3::new(radius, radius, 0.7 * radius), 0.12, palette.concrete, random);
    }
    // Fence with two gates.
    let f = FENCE_M;
    for (from, to) in [
        ([-f, -f], [0.2, -f]),
        ([2.2, -f], [12.8, -f]),
        ([17.7, -f], [f, -f]),
        ([f, -f], [f, f]),
        ([f, f], [-f, f]),
        ([-f, f], [-f, -f]),
    ] {
        fence(world, palette, from, to, 1.5, random);
    }
    // Trees inside the fence, outside the flight area.
    for (x, y) in [
        (-20.0, -19.6),
        (-19.8, -11.0),
        (-20.2, -2.5),
        (-20.0, 6.8),
        (-19.6, 19.8),
        (-11.5, 20.0),
        (-2.2, 20.2),
        (6.6, 19.9),
        (19.9, 19.8),
        (20.0, 11.0),
        (20.3, 2.0),
        (-11.4, -20.8),
        (20.3, -20.3),
    ] {
        tree(world, palette, [x, y], random.uniform(4.2, 6.4), random.uniform(1.3, 1.75), random);
    }
    // Shed, car, crates, benches, a well.
    world.cuboid(Vector3::new(-20.2, 13.0, 0.0), Vector3::new(2.6, 3.4, 2.1), 0.0, palette.planks, random);
    world.cuboid(Vector3::new(-20.2, 13.0, 2.1), Vector3::new(3.0, 3.8, 0.12), 0.0, palette.slabs, random);
    car(world, palette, [15.3, -20.3], std::f64::consts::FRAC_PI_2, random);
    car(world, palette, [15.2, -6.4], 1.5, random);
    for (x, y) in [(-7.6, 1.6), (8.0, -4.2), (-6.8, -5.4), (17.9, 16.0), (-17.9, -16.6)] {
        crates(world, palette, [x, y], 4, random);
    }
    bench(world, palette, [-1.0, 7.9], 0.0, random);
    bench(world, palette, [4.6, -6.2], std::f64::consts::PI, random);
    bench(world, palette, [-9.8, -0.5], 1.5, random);
    world.column(Vector3::new(9.6, 5.8, 0.0), 0.7, 0.8, 12, palette.concrete, random);
    world.cuboid(Vector3::new(-3.6, 7.3, 0.68), Vector3::new(1.6, 0.9, 0.08), 0.3, palette.planks, random);
    world.cuboid(Vector3::new(-3.6, 7.3, 0.0), Vector3::new(0.3, 0.3, 0.68), 0.3, palette.bark, random);
}

fn neighbours(world: &mut World, palette: &Palette, random: &mut RandomStream) {
    ground(world, [-150.0, -32.5], [150.0, -26.5], 0.01, palette.asphalt);
    ground(world, [-150.0, -26.5], [150.0, -24.5], 0.014, palette.slabs);
    for k in -12..12 {
        let x = f64::from(k) * 6.0;
        ground(world, [x, -29.6], [x + 2.2, -29.4], 0.02, palette.paint);
    }
    let tiles = world.material(roof(14.0, 7.0, 40.0, random));
    let mut pool = Vec::new();
    for index in 0..8 {
        let wall = Wall::ALL[index % 5];
        let texture = front(
            &Front {
                wall,
                width_m: 11.0,
                height_m: 5.6,
                floors: 2,
                windows_per_floor: 3,
                texels_per_m: 46.0,
                shops: index % 3 == 0,
            },
            random,
        );
        pool.push(world.material(texture));
    }
    for (k, (x, y)) in [
        (-38.0, -42.0),
        (-20.0, -44.0),
        (-3.0, -43.0),
        (16.0, -44.5),
        (36.0, -43.0),
        (41.0, -14.0),
        (42.0, 6.0),
        (39.0, 27.0),
        (20.0, 40.0),
        (2.0, 42.0),
        (-17.0, 40.0),
        (-38.0, 33.0),
        (-41.0, 12.0),
        (-40.0, -12.0),
    ]
    .into_iter()
    .enumerate()
    {
        let fronts = std::array::from_fn(|side| pool[(3 * k + side * 5 + 1) % pool.len()]);
        plain_house(world, palette, [x, y], [11.0, 9.0], 5.6, &Shell { fronts, roof: tiles });
    }
    for k in 0..34 {
        let angle = std::f64::consts::TAU * (f64::from(k) + random.uniform(-0.3, 0.3)) / 34.0;
        let radius = random.uniform(29.5, 33.5) * if k % 3 == 0 { 1.75 } else { 1.0 };
        let (x, y) = (radius * angle.cos(), radius * angle.sin());
        if !(-34.5..=-24.0).contains(&y) {
            tree(world, palette, [x, y], random.uniform(5.5, 9.5), random.uniform(1.8, 3.0), random);
        }
    }
    for k in 0..6 {
        lamp(world, palette, [-31.0 + 12.0 * f64::from(k), -25.2], -1.57, random);
    }
    for (x, y) in [(-16.0, -31.4), (-4.0, -27.6), (9.5, -31.4), (23.0, -27.6)] {
        car(world, palette, [x, y], if y < -30.0 { 0.0 } else { std::f64::consts::PI }, random);
    }
}
