//! Materials of surfaces: bricks, boards, plaster, tiles, slabs, grass, asphalt, leaves.

use super::canvas::{Canvas, CanvasRectangle};
use super::texture::WorldTexture;
use crate::simulation::random::RandomStream;

/// Material of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wall {
    Brick,
    Plaster,
    Boards,
    Stone,
    Panels,
}

impl Wall {
    pub(crate) const ALL: [Self; 5] = [Self::Brick, Self::Plaster, Self::Boards, Self::Stone, Self::Panels];
}

fn number(random: &mut RandomStream, low: f32, high: f32) -> f32 {
    random.uniform(f64::from(low), f64::from(high)) as f32
}

/// Paints a wall's material over a whole canvas.
pub(crate) fn wall(canvas: &mut Canvas, kind: Wall, random: &mut RandomStream) {
    let area = canvas.area();
    match kind {
        Wall::Brick => {
            let base = number(random, 88.0, 125.0);
            canvas.rectangle(area, base + 52.0);
            courses(canvas, area, [0.24, 0.085], 0.016, base, 20.0, random);
            canvas.noise(1.7, 16.0, 3, random);
        }
        Wall::Plaster => {
            canvas.rectangle(area, number(random, 120.0, 165.0));
            canvas.noise(1.3, 24.0, 5, random);
            canvas.dots((area.w * area.h * 5.0) as usize, [0.01, 0.035], [70.0, 190.0], 0.5, random);
        }
        Wall::Boards => {
            let base = number(random, 95.0, 140.0);
            boards(canvas, area, 0.16, base, random);
            canvas.noise(1.9, 12.0, 3, random);
        }
        Wall::Stone => {
            let base = number(random, 100.0, 135.0);
            canvas.rectangle(area, base - 45.0);
            courses(canvas, area, [0.52, 0.27], 0.025, base, 30.0, random);
            canvas.noise(0.3, 20.0, 3, random);
        }
        Wall::Panels => {
            let base = number(random, 125.0, 160.0);
            canvas.rectangle(area, base - 55.0);
            courses(canvas, area, [1.5, 1.0], 0.02, base, 9.0, random);
            canvas.noise(0.8, 17.0, 4, random);
            canvas.dots((area.w * area.h * 6.0) as usize, [0.008, 0.03], [60.0, 110.0], 0.6, random);
        }
    }
    canvas.grain(7.0, random);
    // Rain and splashes darken the foot of every wall.
    canvas.shade(CanvasRectangle::new(0.0, area.h - 0.28, area.w, 0.28), 0.8);
}

/// Rows of stones, every other one shifted by half a stone, each stone with a random grey.
fn courses(
    canvas: &mut Canvas,
    area: CanvasRectangle,
    stone: [f32; 2],
    joint: f32,
    base: f32,
    spread: f32,
    random: &mut RandomStream,
) {
    let rows = (area.h / stone[1]).ceil() as usize;
    let columns = (area.w / stone[0]).ceil() as usize + 1;
    for row in 0..rows {
        let shift = if row % 2 == 0 { 0.0 } else { -0.5 * stone[0] };
        for column in 0..columns {
            let value = base + spread * random.normal().clamp(-2.0, 2.0) as f32;
            let x = area.x + shift + column as f32 * stone[0];
            let y = area.y + row as f32 * stone[1];
            canvas.rectangle(CanvasRectangle::new(x, y, stone[0], stone[1]).inset(0.5 * joint), value);
        }
    }
}

/// Upright boards with grain, knots and dark gaps.
fn boards(canvas: &mut Canvas, area: CanvasRectangle, width: f32, base: f32, random: &mut RandomStream) {
    let count = (area.w / width).ceil() as usize;
    for index in 0..count {
        let x = area.x + index as f32 * width;
        let mut y = area.y;
        while y < area.y + area.h {
            let length = number(random, 0.9, 2.6).min(area.y + area.h - y);
            let value = base + 18.0 * random.normal().clamp(-2.0, 2.0) as f32;
            let board = CanvasRectangle::new(x, y, width, length);
            let phase = number(random, 0.0, 90.0);
            canvas.fill(board, |u, v| {
                let gap = u < 0.013 || v < 0.013;
                let wave = ((u * 210.0 + (v * 2.2 + phase).sin() * 1.7 + phase).sin() + (u * 47.0 + phase).sin()) * 7.0;
                (if gap { base * 0.45 } else { value + wave }, 1.0)
            });
            for _ in 0..random.index(4) {
                let knot = [x + number(random, 0.03, width - 0.03), y + number(random, 0.0, length)];
                canvas.ellipse(knot, [0.016, 0.026], 0.0, base * 0.5, 0.9);
            }
            y += length;
        }
    }
}

/// A slope of roof tiles.
pub(crate) fn roof(width_m: f32, height_m: f32, texels_per_m: f32, random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(width_m, height_m, texels_per_m, false, 60.0);
    let base = number(random, 80.0, 115.0);
    let tile = [0.3, 0.34];
    let rows = (height_m / tile[1]).ceil() as usize;
    let columns = (width_m / tile[0]).ceil() as usize + 1;
    for row in 0..rows {
        for column in 0..columns {
            let value = base + 24.0 * random.normal().clamp(-2.0, 2.0) as f32;
            let shift = if row % 2 == 0 { 0.0 } else { -0.15 };
            let area = CanvasRectangle::new(column as f32 * tile[0] + shift, row as f32 * tile[1], tile[0], tile[1]);
            canvas.fill(area, |u, v| {
                let gap = u < 0.018 || v > 0.34 - 0.03;
                (if gap { 38.0 } else { value + 70.0 * (v - 0.17) + 10.0 * (u * 21.0).cos() }, 1.0)
            });
        }
    }
    canvas.noise(1.6, 20.0, 4, random);
    canvas.dots((width_m * height_m * 1.5) as usize, [0.03, 0.14], [55.0, 165.0], 0.5, random);
    canvas.grain(6.0, random);
    canvas.finish()
}

/// Lawn whose texture repeats every 10 m.
pub(crate) fn grass(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(10.0, 10.0, 102.4, true, 96.0);
    canvas.noise(2.5, 22.0, 4, random);
    canvas.hatch(21_000, 0.13, 0.016, [48.0, 168.0], random);
    canvas.dots(900, [0.02, 0.055], [40.0, 205.0], 0.9, random);
    canvas.dots(70, [0.05, 0.2], [55.0, 150.0], 0.6, random);
    canvas.grain(7.0, random);
    canvas.finish()
}

pub(crate) fn asphalt(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(10.0, 10.0, 102.4, true, 92.0);
    canvas.noise(3.3, 16.0, 5, random);
    canvas.dots(26_000, [0.008, 0.026], [45.0, 160.0], 0.75, random);
    canvas.dots(240, [0.05, 0.22], [52.0, 80.0], 0.55, random);
    for _ in 0..26 {
        let start = [number(random, 0.0, 10.0), number(random, 0.0, 10.0)];
        let length = number(random, 0.7, 3.0);
        canvas.wander(start, length, 0.025, 38.0, random);
    }
    for _ in 0..7 {
        let (x, y) = (number(random, 0.0, 8.0), number(random, 0.0, 8.0));
        let patch = CanvasRectangle::new(x, y, number(random, 0.5, 1.8), number(random, 0.4, 1.2));
        canvas.shade(patch, number(random, 0.62, 0.82));
    }
    canvas.grain(10.0, random);
    canvas.finish()
}

/// Paving slabs whose texture repeats every 8 m.
pub(crate) fn slabs(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(8.0, 8.0, 64.0, true, 75.0);
    for row in 0..16 {
        for column in 0..16 {
            let value = 138.0 + 17.0 * random.normal().clamp(-2.0, 2.0) as f32;
            let slab = CanvasRectangle::new(column as f32 * 0.5, row as f32 * 0.5, 0.5, 0.5).inset(0.013);
            canvas.rectangle(slab, value);
        }
    }
    canvas.noise(1.0, 17.0, 4, random);
    canvas.dots(1500, [0.01, 0.04], [60.0, 100.0], 0.6, random);
    canvas.dots(60, [0.05, 0.2], [85.0, 165.0], 0.5, random);
    for _ in 0..16 {
        let start = [number(random, 0.0, 8.0), number(random, 0.0, 8.0)];
        canvas.wander(start, number(random, 0.4, 1.2), 0.02, 60.0, random);
    }
    canvas.grain(8.0, random);
    canvas.finish()
}

/// Repeating foliage: leaves in light and shade.
pub(crate) fn leaves(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(4.0, 4.0, 128.0, true, 58.0);
    canvas.noise(0.7, 26.0, 3, random);
    canvas.dots(2600, [0.03, 0.085], [26.0, 60.0], 0.8, random);
    canvas.dots(3000, [0.025, 0.07], [62.0, 150.0], 0.9, random);
    canvas.dots(260, [0.02, 0.05], [150.0, 215.0], 0.9, random);
    canvas.grain(6.0, random);
    canvas.finish()
}

/// Repeating bark, weathered wood or other rough dark material.
pub(crate) fn bark(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(2.0, 2.0, 128.0, true, 82.0);
    let area = canvas.area();
    boards(&mut canvas, area, 0.125, 90.0, random);
    canvas.noise(0.4, 24.0, 4, random);
    canvas.dots(160, [0.01, 0.05], [30.0, 160.0], 0.7, random);
    canvas.grain(8.0, random);
    canvas.finish()
}

/// Repeating boards, for fences and sheds.
pub(crate) fn planks(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(8.0, 4.0, 64.0, true, 100.0);
    let area = canvas.area();
    boards(&mut canvas, area, 0.16, 112.0, random);
    canvas.noise(1.4, 18.0, 4, random);
    canvas.dots(160, [0.02, 0.1], [55.0, 190.0], 0.6, random);
    canvas.grain(6.0, random);
    canvas.finish()
}

/// Repeating rough stone or concrete.
pub(crate) fn concrete(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(4.0, 4.0, 64.0, true, 130.0);
    canvas.noise(0.9, 30.0, 5, random);
    canvas.dots(900, [0.01, 0.035], [70.0, 190.0], 0.7, random);
    for _ in 0..9 {
        let start = [number(random, 0.0, 4.0), number(random, 0.0, 4.0)];
        canvas.wander(start, number(random, 0.4, 1.2), 0.025, 60.0, random);
    }
    canvas.grain(8.0, random);
    canvas.finish()
}

/// Painted metal with dents, rust and stickers, for cars and boxes.
pub(crate) fn metal(base: f32, random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(4.0, 4.0, 64.0, true, base);
    canvas.noise(1.0, 12.0, 4, random);
    canvas.dots(130, [0.02, 0.09], [45.0, 105.0], 0.6, random);
    for _ in 0..22 {
        let (x, y) = (number(random, 0.0, 3.5), number(random, 0.0, 3.5));
        let sticker = CanvasRectangle::new(x, y, number(random, 0.12, 0.45), number(random, 0.1, 0.3));
        canvas.rectangle(sticker, number(random, 160.0, 235.0));
        canvas.letters(sticker.inset(0.03), number(random, 0.06, 0.1), 40.0, random);
    }
    for _ in 0..14 {
        let from = [number(random, 0.0, 4.0), number(random, 0.0, 4.0)];
        canvas.wander(from, number(random, 0.3, 1.0), 0.016, base * 0.55, random);
    }
    canvas.grain(5.0, random);
    canvas.finish()
}

/// Repeating worn white paint, for road markings.
pub(crate) fn paint(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(4.0, 4.0, 64.0, true, 188.0);
    canvas.noise(0.8, 20.0, 4, random);
    canvas.dots(420, [0.012, 0.05], [95.0, 135.0], 0.8, random);
    for _ in 0..10 {
        let start = [number(random, 0.0, 4.0), number(random, 0.0, 4.0)];
        canvas.wander(start, number(random, 0.4, 1.4), 0.022, 92.0, random);
    }
    canvas.grain(7.0, random);
    canvas.finish()
}

/// Repeating slow blotches around mid grey; as an overlay they hide the repetition of other textures.
pub(crate) fn blotches(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(64.0, 64.0, 8.0, true, 128.0);
    canvas.noise(9.0, 40.0, 5, random);
    canvas.dots(420, [0.3, 1.4], [96.0, 150.0], 0.4, random);
    canvas.finish()
}

/// Wooded hills in the distance, hazy.
pub(crate) fn woods(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(256.0, 64.0, 4.0, true, 118.0);
    canvas.noise(24.0, 13.0, 5, random);
    canvas.dots(5200, [0.8, 2.6], [92.0, 140.0], 0.5, random);
    canvas.finish()
}

/// Soft clouds whose texture repeats every 512 m.
pub(crate) fn clouds(random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(512.0, 512.0, 1.0, true, 128.0);
    canvas.noise(128.0, 42.0, 6, random);
    canvas.finish()
}
