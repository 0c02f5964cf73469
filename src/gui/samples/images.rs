//! Ray-cast images of the artificial yard: brick walls, a tiled ground and a plain sky.

use std::sync::Arc;

use nalgebra::Vector3;

use super::yard::{FlightState, INTRINSICS_PX, RESOLUTION_PX, WALL_HEIGHT_M, YARD_HALF_SIDE_M, true_chain};
use crate::gui::ImageSource;
use crate::sensors::GrayImage;

/// The image of `cam0` at any frame.
pub(crate) struct SampleImages;

impl ImageSource for SampleImages {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> Option<Arc<GrayImage>> {
        (camera_key == "cam0").then(|| Arc::new(cast(frame_index)))
    }
}

fn cast(frame_index: usize) -> GrayImage {
    let [width, height] = RESOLUTION_PX;
    let [fx, fy, cx, cy] = INTRINSICS_PX;
    let pose = FlightState::at(frame_index, &true_chain()).world_from_camera;
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let ray = pose.rotation * Vector3::new((column as f64 - cx) / fx, (row as f64 - cy) / fy, 1.0);
            pixels.push(grey(&pose.translation_m, &ray));
        }
    }
    GrayImage { width, height, pixels }
}

fn grey(origin: &Vector3<f64>, ray: &Vector3<f64>) -> u8 {
    let to_wall = |from: f64, along: f64| {
        if along.abs() < 1e-9 { f64::INFINITY } else { (YARD_HALF_SIDE_M * along.signum() - from) / along }
    };
    let (to_x, to_y) = (to_wall(origin.x, ray.x), to_wall(origin.y, ray.y));
    let to_ground = if ray.z < -1e-9 { -origin.z / ray.z } else { f64::INFINITY };
    let to_side = to_x.min(to_y);
    if to_ground < to_side {
        let hit = origin + ray * to_ground;
        return shade(tile(hit.x, hit.y, 1.0, 1.0), noise(hit.x, hit.y, 1), 105.0, to_ground);
    }
    let hit = origin + ray * to_side;
    if hit.z > WALL_HEIGHT_M {
        return 205;
    }
    let (along, base) = if to_x < to_y { (hit.y, 135.0) } else { (hit.x, 165.0) };
    let wall = (if to_x < to_y { 2 } else { 4 }) + i64::from(hit.x + hit.y > 0.0);
    shade(tile(along, hit.z, 1.6, 0.8), noise(along * 2.0, hit.z * 2.0, wall), base, to_side)
}

/// Brightness of a tile: 1 inside, 0.6 at its edge.
fn tile(u: f64, v: f64, width: f64, height: f64) -> f64 {
    let row = (v / height).floor();
    let (along, up) = ((u / width + 0.5 * row).rem_euclid(1.0), (v / height).rem_euclid(1.0));
    if along < 0.06 || up < 0.1 { 0.6 } else { 1.0 }
}

/// Value noise on a lattice, 0 to 1.
fn noise(u: f64, v: f64, layer: i64) -> f64 {
    let lattice = |i: i64, j: i64| {
        let mixed = (i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663) ^ layer.wrapping_mul(83_492_791)) as u64;
        let mixed = (mixed ^ (mixed >> 13)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        (mixed >> 40) as f64 / (1u64 << 24) as f64
    };
    let (i, j) = (u.floor(), v.floor());
    let (s, t) = (u - i, v - j);
    let (i, j) = (i as i64, j as i64);
    let low = lattice(i, j) * (1.0 - s) + lattice(i + 1, j) * s;
    let high = lattice(i, j + 1) * (1.0 - s) + lattice(i + 1, j + 1) * s;
    low * (1.0 - t) + high * t
}

fn shade(joints: f64, texture: f64, base: f64, distance_m: f64) -> u8 {
    let haze = (distance_m / 90.0).min(0.6);
    let value = base * joints * (0.6 + 0.8 * texture);
    (value * (1.0 - haze) + 190.0 * haze).clamp(0.0, 255.0) as u8
}
