//! Front end on images with known motion: time per image, tracked points, errors.
//!
//! `cargo bench --bench frontend` prints the table of the motion tracker from one image to the next, and of the whole
//! front end over all images: the drift of features from their first observation, by age, with and without refinement
//! against it.
//! With `-- --export DIR` the frames (PGM) and the points with their true motion (CSV) are written there, to run other
//! trackers on the same data; `-- --flicker RATIO` sets the change of brightness from image to image.

#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "a bench measures time and prints it")]

#[path = "../src/frontend/tests/homography.rs"]
mod homography;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Parser;
use dcvins::camera::CameraModel;
use dcvins::frontend::lucas_kanade::{LucasKanadeOptions, track};
use dcvins::frontend::{FeatureId, FrontEnd, FrontEndOptions, Pyramid, ReferenceOptions};
use dcvins::sensors::GrayImage;
use homography::{Dice, Scene, Texture};
use nalgebra::Vector2;

const FRAMES: usize = 30;
const REPETITIONS: usize = 5;

#[derive(Parser)]
struct Arguments {
    /// Writes the frames and the true motion into this folder.
    #[arg(long, value_name = "DIR")]
    export: Option<PathBuf>,
    /// Change of brightness from image to image, a ratio.
    #[arg(long, value_name = "RATIO", default_value_t = 0.02)]
    flicker: f64,
    /// Cargo passes it to every bench.
    #[arg(long, hide = true)]
    bench: bool,
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

struct Sequence {
    name: &'static str,
    scene: Scene,
    frames: Vec<GrayImage>,
    /// Points in the first image of every pair.
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

    fn export(&self, folder: &Path) {
        for (index, frame) in self.frames.iter().enumerate() {
            let mut bytes = format!("P5\n{} {}\n255\n", frame.width, frame.height).into_bytes();
            bytes.extend_from_slice(&frame.pixels);
            std::fs::write(folder.join(format!("{}_{index:02}.pgm", self.name)), bytes)
                .expect("the folder can be written");
        }
        let mut table = String::new();
        for (index, points) in self.points.iter().enumerate() {
            for uv in points {
                let ground_truth = self.scene.flow(index, index + 1, uv);
                writeln!(table, "{index},{},{},{},{}", uv.x, uv.y, ground_truth.x, ground_truth.y)
                    .expect("a string takes it");
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
                let ground_truth = sequence.scene.flow(index, index + 1, uv);
                flows.push((ground_truth - uv).norm());
                total += 1;
                if let Some(found) = found {
                    errors.push((found - ground_truth).norm());
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

/// Smallest age of each group of the drift table, in images.
const AGES: [usize; 5] = [1, 2, 5, 9, 17];

fn bench_front_end(sequence: &Sequence, label: &str, options: &FrontEndOptions) {
    let scene = &sequence.scene;
    let matrix = scene.camera_matrix();
    let intrinsics_px = [matrix[(0, 0)], matrix[(1, 1)], matrix[(0, 2)], matrix[(1, 2)]];
    let camera = CameraModel::pinhole(intrinsics_px, [scene.width, scene.height]).expect("a sound camera");
    let mut best_ms = vec![f64::INFINITY; FRAMES];
    let mut drift: [Vec<f64>; AGES.len()] = Default::default();
    let mut tracked = 0;
    for repetition in 0..REPETITIONS {
        let mut front_end = FrontEnd::new(camera.clone(), *options);
        let mut births = BTreeMap::<FeatureId, (usize, Vector2<f64>)>::new();
        for (index, image) in sequence.frames.iter().enumerate() {
            let start = Instant::now();
            let frame = front_end.process(image, index as i64, None).expect("images of the camera's size");
            best_ms[index] = best_ms[index].min(start.elapsed().as_secs_f64() * 1e3);
            if repetition > 0 {
                continue;
            }
            tracked += frame.statistics.tracked;
            for feature in &frame.features {
                let (birth, uv) = *births.entry(feature.id).or_insert((index, feature.uv_px));
                if let Some(group) = AGES.iter().rposition(|age| *age <= index - birth) {
                    drift[group].push((feature.uv_px - scene.flow(birth, index, &uv)).norm());
                }
            }
        }
    }
    print!(
        "{:<6} front end {label:<18} {:6.2} ms  {} tracked  drift by age (median):",
        sequence.name,
        median(&mut best_ms),
        tracked / (FRAMES - 1)
    );
    for (age, errors) in AGES.iter().zip(&mut drift) {
        print!("  {age}+ {:.3} px", median(errors));
    }
    println!();
}

fn main() {
    let arguments = Arguments::parse();
    let texture = Texture::new(2048, 1);
    let scene =
        Scene { width: 752, height: 480, focal_px: 458.0, motion_scale: 1.0, noise: 2.0, flicker: arguments.flicker };
    let slow = Sequence::new("slow", Scene { motion_scale: 0.27, ..scene }, &texture);
    let fast = Sequence::new("fast", scene, &texture);
    for sequence in [&slow, &fast] {
        if let Some(folder) = &arguments.export {
            sequence.export(folder);
        }
        let forward = LucasKanadeOptions { forward_backward_px: None, ..Default::default() };
        bench_tracker(sequence, "forward", &forward);
        bench_tracker(sequence, "forward and backward", &LucasKanadeOptions::default());
        // No window exceeds a correlation of 1: this disables the refinement.
        let without = ReferenceOptions { min_correlation: 2.0, ..Default::default() };
        bench_front_end(sequence, "without reference", &FrontEndOptions { reference: without, ..Default::default() });
        bench_front_end(sequence, "with reference", &FrontEndOptions::default());
    }
}
