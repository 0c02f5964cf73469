//! Painted fronts: a wall with windows, doors, signs, pipes, cracks and stains.

use super::canvas::{Canvas, CanvasRectangle};
use super::surface::{Wall, wall};
use super::texture::WorldTexture;
use crate::simulation::random::RandomStream;

/// Options of a front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Front {
    pub(crate) wall: Wall,
    pub(crate) width_m: f32,
    pub(crate) height_m: f32,
    pub(crate) floors: usize,
    pub(crate) windows_per_floor: usize,
    pub(crate) texels_per_m: f32,
    /// Signs, posters and graffiti at street level.
    pub(crate) shops: bool,
}

fn number(random: &mut RandomStream, low: f32, high: f32) -> f32 {
    random.uniform(f64::from(low), f64::from(high)) as f32
}

pub(crate) fn front(front: &Front, random: &mut RandomStream) -> WorldTexture {
    let mut canvas = Canvas::new(front.width_m, front.height_m, front.texels_per_m, false, 128.0);
    wall(&mut canvas, front.wall, random);
    let storey = front.height_m / front.floors as f32;
    let bay = front.width_m / front.windows_per_floor as f32;
    let door_at = random.index(front.windows_per_floor);
    for floor in 0..front.floors {
        let top = floor as f32 * storey;
        let ground = floor + 1 == front.floors;
        for column in 0..front.windows_per_floor {
            let middle = (column as f32 + 0.5) * bay + number(random, -0.12, 0.12) * bay;
            if ground && column == door_at {
                let height = 2.1_f32.min(storey - 0.3);
                door(&mut canvas, CanvasRectangle::new(middle - 0.5, top + storey - height, 1.0, height), random);
            } else if ground && front.shops && random.chance(0.45) {
                let width = (0.78 * bay).min(2.4);
                shop(&mut canvas, CanvasRectangle::new(middle - 0.5 * width, top + 0.35, width, storey - 0.75), random);
            } else if random.chance(0.9) {
                let width = number(random, 0.85, 1.25).min(0.6 * bay);
                let height = number(random, 1.15, 1.5).min(storey - 1.2);
                window(&mut canvas, CanvasRectangle::new(middle - 0.5 * width, top + 0.6, width, height), random);
            }
        }
        if !ground && random.chance(0.7) {
            // A band of lighter stone between the storeys.
            let band = CanvasRectangle::new(0.0, top + storey - 0.09, front.width_m, 0.14);
            canvas.shade(band, 1.3);
            canvas.rectangle(CanvasRectangle::new(0.0, band.y + band.h, front.width_m, 0.03), 62.0);
        }
    }
    clutter(&mut canvas, front, random);
    canvas.finish()
}

/// Window: frame, bars, dark glass with varied content, sill, sometimes blinds or shutters.
fn window(canvas: &mut Canvas, area: CanvasRectangle, random: &mut RandomStream) {
    let frame = number(random, 175.0, 232.0);
    let glass = number(random, 24.0, 58.0);
    if random.chance(0.35) {
        for side in [area.x - 0.42, area.x + area.w + 0.07] {
            let shutter = CanvasRectangle::new(side, area.y, 0.35, area.h);
            let base = number(random, 60.0, 110.0);
            canvas.fill(shutter, |_, v| (if (v * 22.0).fract() < 0.35 { base * 0.5 } else { base }, 1.0));
        }
    }
    canvas.rectangle(area.inset(-0.07), frame);
    canvas.rectangle(area, glass);
    // Slanted reflection, and sometimes a curtain or a plant.
    let slope = number(random, 0.3, 1.2);
    let start = number(random, 0.0, area.w);
    canvas.fill(area, |u, v| {
        let inside = (u - start + slope * v).abs() < 0.16;
        (glass + 48.0, if inside { 0.75 } else { 0.0 })
    });
    match random.index(4) {
        0 => canvas.fill(CanvasRectangle::new(area.x, area.y, area.w, area.h * 0.55), |_, v| {
            (if (v * 17.0).fract() < 0.5 { 205.0 } else { 120.0 }, 0.95)
        }),
        1 => {
            for side in [area.x, area.x + area.w * 0.74] {
                canvas.fill(CanvasRectangle::new(side, area.y, area.w * 0.26, area.h), |u, _| {
                    (150.0 + 45.0 * (u * 75.0).sin(), 0.9)
                });
            }
        }
        2 => {
            for _ in 0..26 {
                let at = [area.x + number(random, 0.1, 0.9) * area.w, area.y + area.h * number(random, 0.55, 0.98)];
                canvas.ellipse(at, [0.05, 0.025], number(random, 0.0, 3.0), number(random, 55.0, 150.0), 0.9);
            }
        }
        _ => {}
    }
    let bar = 0.035;
    canvas.rectangle(CanvasRectangle::new(area.x + 0.5 * area.w - 0.5 * bar, area.y, bar, area.h), frame);
    let crossing = area.y + area.h * number(random, 0.35, 0.6);
    canvas.rectangle(CanvasRectangle::new(area.x, crossing, area.w, bar), frame);
    canvas.rectangle(CanvasRectangle::new(area.x - 0.14, area.y + area.h + 0.06, area.w + 0.28, 0.07), 215.0);
    canvas.rectangle(CanvasRectangle::new(area.x - 0.12, area.y + area.h + 0.13, area.w + 0.24, 0.05), 48.0);
    // Rain streaks below the sill.
    for side in [area.x - 0.1, area.x + area.w + 0.02] {
        canvas.shade(CanvasRectangle::new(side, area.y + area.h + 0.18, 0.08, number(random, 0.1, 0.5)), 0.72);
    }
}

/// Door with panels, a handle, a number and a step.
fn door(canvas: &mut Canvas, area: CanvasRectangle, random: &mut RandomStream) {
    let leaf = number(random, 42.0, 105.0);
    canvas.rectangle(
        CanvasRectangle::new(area.x - 0.1, area.y - 0.1, area.w + 0.2, area.h + 0.1),
        number(random, 170.0, 225.0),
    );
    canvas.fill(area, |u, _| (leaf + if (u * 8.0).fract() < 0.08 { -22.0 } else { 0.0 }, 1.0));
    for (x, y) in [(0.14, 0.15), (0.56, 0.15), (0.14, 1.15), (0.56, 1.15)] {
        let panel = CanvasRectangle::new(area.x + x, area.y + y, 0.3, 0.75);
        canvas.rectangle(panel, leaf * 0.55);
        canvas.rectangle(panel.inset(0.035), leaf * 1.25);
    }
    canvas.ellipse([area.x + 0.92, area.y + 1.06], [0.035, 0.035], 0.0, 220.0, 1.0);
    let plate = CanvasRectangle::new(area.x + area.w + 0.2, area.y + 0.35, 0.3, 0.2);
    canvas.rectangle(plate, 228.0);
    canvas.letters(plate.inset(0.03), 0.13, 30.0, random);
    canvas.rectangle(CanvasRectangle::new(area.x - 0.2, area.y + area.h - 0.09, area.w + 0.4, 0.09), 165.0);
}

/// Shop window with a sign above it and goods behind the glass.
fn shop(canvas: &mut Canvas, area: CanvasRectangle, random: &mut RandomStream) {
    canvas.rectangle(area.inset(-0.06), number(random, 45.0, 85.0));
    canvas.rectangle(CanvasRectangle::new(area.x, area.y + 0.5, area.w, area.h - 0.5), 36.0);
    let dark = random.chance(0.5);
    let (board, ink) = if dark { (48.0, 225.0) } else { (218.0, 38.0) };
    let sign = CanvasRectangle::new(area.x, area.y, area.w, 0.44);
    canvas.rectangle(sign, board);
    canvas.letters(sign.inset(0.09), 0.26, ink, random);
    for _ in 0..34 {
        let at =
            [area.x + number(random, 0.05, 0.95) * area.w, area.y + 0.6 + number(random, 0.1, 0.9) * (area.h - 0.7)];
        let size = [number(random, 0.04, 0.14), number(random, 0.04, 0.16)];
        let value = number(random, 60.0, 220.0);
        if random.chance(0.5) {
            canvas
                .rectangle(CanvasRectangle::new(at[0] - size[0], at[1] - size[1], 2.0 * size[0], 2.0 * size[1]), value);
        } else {
            canvas.ellipse(at, size, 0.0, value, 0.95);
        }
    }
    let bar = 0.05;
    canvas.rectangle(CanvasRectangle::new(area.x + 0.5 * area.w, area.y + 0.5, bar, area.h - 0.5), 150.0);
    canvas.rectangle(CanvasRectangle::new(area.x, area.y + area.h - bar, area.w, bar), 170.0);
}

/// Posters, graffiti, cracks, pipes, vents and stains at any position.
fn clutter(canvas: &mut Canvas, front: &Front, random: &mut RandomStream) {
    let (w, h) = (front.width_m, front.height_m);
    let area = w * h;
    for _ in 0..(area * 0.10) as usize {
        let start = [number(random, 0.0, w), number(random, 0.0, h)];
        canvas.wander(start, number(random, 0.4, 1.5), 0.02, 45.0, random);
    }
    for _ in 0..(area * 0.08) as usize {
        let patch = CanvasRectangle::new(
            number(random, 0.0, w),
            number(random, 0.0, h),
            number(random, 0.2, 0.9),
            number(random, 0.2, 0.8),
        );
        canvas.shade(patch, number(random, 0.78, 1.22));
    }
    for _ in 0..=random.index(2) {
        // A rain pipe with its brackets.
        let x = number(random, 0.2, w - 0.3);
        canvas.fill(CanvasRectangle::new(x, 0.0, 0.1, h), |u, v| {
            let bracket = (v / 1.3).fract() < 0.045;
            (if bracket { 205.0 } else { 60.0 + 500.0 * u }, 1.0)
        });
    }
    for _ in 0..=(area * 0.05) as usize {
        let vent = CanvasRectangle::new(number(random, 0.1, w - 0.5), number(random, 0.2, h - 0.4), 0.32, 0.24);
        canvas.rectangle(vent.inset(-0.025), 190.0);
        canvas.fill(vent, |_, v| (if (v * 24.0).fract() < 0.5 { 40.0 } else { 125.0 }, 1.0));
    }
    let posters = if front.shops { 2 + random.index(4) } else { random.index(2) };
    for _ in 0..posters {
        let size = [number(random, 0.45, 0.8), number(random, 0.6, 1.0)];
        let poster =
            CanvasRectangle::new(number(random, 0.1, w - size[0]), h - number(random, 1.25, 2.4), size[0], size[1]);
        canvas.rectangle(poster, number(random, 180.0, 232.0));
        let picture = CanvasRectangle::new(poster.x + 0.06, poster.y + 0.06, poster.w - 0.12, poster.h * 0.5);
        canvas.rectangle(picture, number(random, 60.0, 130.0));
        for _ in 0..9 {
            let at =
                [picture.x + number(random, 0.1, 0.9) * picture.w, picture.y + number(random, 0.1, 0.9) * picture.h];
            canvas.ellipse(
                at,
                [number(random, 0.03, 0.12), 0.05],
                number(random, 0.0, 3.0),
                number(random, 30.0, 235.0),
                0.9,
            );
        }
        let text = CanvasRectangle::new(poster.x + 0.06, poster.y + poster.h * 0.6, poster.w - 0.12, poster.h * 0.36);
        canvas.letters(text, 0.085, 35.0, random);
    }
    if front.shops && random.chance(0.6) {
        // Graffiti: thick curved strokes at arm's height.
        let value = if random.chance(0.5) { 230.0 } else { 32.0 };
        let x = number(random, 0.3, w - 1.6);
        for letter in 0..4 {
            let start = [x + 0.35 * letter as f32, h - number(random, 0.7, 1.5)];
            canvas.wander(start, number(random, 0.9, 1.7), 0.065, value, random);
        }
    }
}
