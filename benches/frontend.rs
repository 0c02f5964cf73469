//! The front end on images whose true motion is known: time per image, tracked points, errors.
//!
//! `cargo bench --bench frontend` prints the table of the motion tracker and of the whole front end.
//! With `FRONTEND_BENCH_EXPORT=DIR` the frames (PGM) and the points with their true motion (CSV) are written there, to run
//! other trackers on the same.

#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "a bench measures time and prints it")]

#[path = "../src/frontend/tests/homography.rs"]
mod homography;

use std::fmt::Write as _;
use std::time::Instant;

use dcvins::flight_log::GrayImage;
use dcvins::frontend::Pyramid;
use dcvins::frontend::lucas_kanade::{LucasKanadeOptions, track};
use homography::{Dice, Scene, Texture};
use nalgebra::Vector2;

const FRAMES: usize = 30;
const REPETITIONS: usize = 5;

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

struct Sequence {
    name: &'static str,
    scene: Scene,
    frames: Vec<GrayImage>,
    /// For every pair the points in its first image.
    points: Vec<Vec<Vector2<f64>>>,
}

impl Sequence {
    fn new(name: &'static str, scene: Scene, texture: &Texture) -> Self {
        let frames: Vec<GrayImage> = (0..FRAMES).map(|index| scene.render(texture, index)).collect();
        let mut dice = Dice(7);
        let points = (0..FRAMES - 1)
            .map(|index| {
                let all = (0..180).map(|_| {
                    Vector2::new(
                        (dice.uniform() * scene.width as f64).floor(),
                        (dice.uniform() * scene.height as f64).floor(),
                    )
                });
                all.filter(|uv| scene.sees(&scene.flow(index, index + 1, uv))).collect()
            })
            .collect();
        Self { name, scene, frames, points }
    }

    fn export(&self, folder: &str) {
        let folder = std::path::Path::new(folder);
        for (index, frame) in self.frames.iter().enumerate() {
            let mut bytes = format!("P5\n{} {}\n255\n", frame.width, frame.height).into_bytes();
            bytes.extend_from_slice(&frame.pixels);
            std::fs::write(folder.join(format!("{}_{index:02}.pgm", self.name)), bytes)
                .expect("the folder can be written");
        }
        let mut table = String::new();
        for (index, points) in self.points.iter().enumerate() {
            for uv in points {
                let truth = self.scene.flow(index, index + 1, uv);
                writeln!(table, "{index},{},{},{},{}", uv.x, uv.y, truth.x, truth.y).expect("a string takes it");
            }
        }
        std::fs::write(folder.join(format!("{}.csv", self.name)), table).expect("the folder can be written");
    }
}

fn bench_tracker(sequence: &Sequence, label: &str, options: &LucasKanadeOptions) {
    let mut pyramids = [Pyramid::default(), Pyramid::default()];
    let mut best_ms = vec![f64::INFINITY; FRAMES - 1];
    let mut errors = Vec::new();
    let mut flows = Vec::new();
    let mut total = 0;
    for repetition in 0..REPETITIONS {
        pyramids[0].build(&sequence.frames[0], options.levels);
        for index in 0..FRAMES - 1 {
            let start = Instant::now();
            pyramids[1].build(&sequence.frames[index + 1], options.levels);
            let found: Vec<_> =
                sequence.points[index].iter().map(|uv| track(&pyramids[0], &pyramids[1], uv, uv, options)).collect();
            best_ms[index] = best_ms[index].min(start.elapsed().as_secs_f64() * 1e3);
            pyramids.swap(0, 1);
            if repetition > 0 {
                continue;
            }
            for (uv, found) in sequence.points[index].iter().zip(found) {
                let truth = sequence.scene.flow(index, index + 1, uv);
                flows.push((truth - uv).norm());
                total += 1;
                if let Some(found) = found {
                    errors.push((found - truth).norm());
                }
            }
        }
    }
    let wrong = errors.iter().filter(|error| **error > 1.0).count();
    let tracked = errors.len();
    let largest_flow = flows.iter().copied().fold(0.0, f64::max);
    let fine: Vec<f64> = errors.iter().copied().filter(|e| *e <= 1.0).collect();
    let rms = (fine.iter().map(|e| e * e).sum::<f64>() / fine.len() as f64).sqrt();
    println!(
        "{:<6} {label:<28} {:6.2} ms  {tracked:>5} of {total} tracked  median error {:.4} px rms {rms:.4}  > 1 px {:.2} %  (flow median {:.1} px, largest {:.1} px)",
        sequence.name,
        median(&mut best_ms),
        median(&mut errors),
        100.0 * wrong as f64 / tracked.max(1) as f64,
        median(&mut flows),
        largest_flow,
    );
}

fn main() {
    let texture = Texture::new(2048, 1);
    let scene = Scene {
        width: 752,
        height: 480,
        focal_px: 458.0,
        speed: 1.0,
        noise: 2.0,
        flicker: std::env::var("FLICKER").ok().and_then(|t| t.parse().ok()).unwrap_or(0.02),
    };
    let slow = Sequence::new("slow", Scene { speed: 0.27, ..scene }, &texture);
    let fast = Sequence::new("fast", scene, &texture);
    let export = std::env::var("FRONTEND_BENCH_EXPORT").ok();
    for sequence in [&slow, &fast] {
        if let Some(folder) = &export {
            sequence.export(folder);
        }
        let forward = LucasKanadeOptions { forward_backward_px: None, ..Default::default() };
        bench_tracker(sequence, "forward", &forward);
        bench_tracker(sequence, "forward and backward", &LucasKanadeOptions::default());
    }
}
