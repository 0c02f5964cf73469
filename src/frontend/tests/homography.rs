//! Textured plane observed through known homographies, for the tests and the benchmark: the true motion of every pixel
//! is known.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use super::GrayImage;

/// Texture pixels per image pixel, so that interpolation is accurate enough.
const OVERSAMPLING: f64 = 2.0;

/// Small random number generator (xorshift64*), equal on all platforms.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// Uniform in `0 .. 1`.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Normal with variance 1.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Periodic texture with edges, corners and noise of all wavelengths, as grey values about 128.
pub(crate) struct Texture {
    size: usize,
    values: Vec<f32>,
}

impl Texture {
    pub(crate) fn new(size: usize, seed: u64) -> Self {
        let mut dice = Dice(seed);
        let mut values = vec![0.0_f32; size * size];
        let mut wavelength = 128_usize;
        while wavelength >= 4 {
            add_noise(&mut values, size, wavelength, 5.0 * (wavelength as f32 / 8.0).powf(0.4), &mut dice);
            wavelength /= 2;
        }
        for _ in 0..size * size / 2500 {
            add_rectangle(&mut values, size, &mut dice);
        }
        soften(&mut values, size);
        Self { size, values }
    }

    /// Constant grey texture.
    #[expect(clippy::allow_attributes, reason = "the bench does not use it")]
    #[allow(dead_code, reason = "the bench does not use it")]
    pub(crate) fn flattened(mut self) -> Self {
        self.values.fill(0.0);
        self
    }

    /// Grey value at a point in texture pixels, by cubic convolution.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor(), y.floor());
        let (weights_x, weights_y) = (cubic_weights((x - column) as f32), cubic_weights((y - row) as f32));
        let wrap = |index: f64, offset: usize| (index as i64 - 1 + offset as i64).rem_euclid(self.size as i64) as usize;
        let mut sum = 0.0;
        for (j, weight_y) in weights_y.iter().enumerate() {
            let line = &self.values[wrap(row, j) * self.size..][..self.size];
            let along: f32 = weights_x.iter().enumerate().map(|(i, weight)| weight * line[wrap(column, i)]).sum();
            sum += weight_y * along;
        }
        f64::from(sum) + 128.0
    }
}

fn cubic_weights(t: f32) -> [f32; 4] {
    [
        ((2.0 - t) * t - 1.0) * t * 0.5,
        ((3.0 * t - 5.0) * t * t + 2.0) * 0.5,
        ((4.0 - 3.0 * t) * t + 1.0) * t * 0.5,
        (t - 1.0) * t * t * 0.5,
    ]
}

fn add_noise(values: &mut [f32], size: usize, wavelength: usize, amplitude: f32, dice: &mut Dice) {
    let cells = size / wavelength;
    let lattice: Vec<f32> = (0..cells * cells).map(|_| amplitude * dice.normal() as f32).collect();
    for y in 0..size {
        for x in 0..size {
            let (u, v) = (x as f32 / wavelength as f32, y as f32 / wavelength as f32);
            let (weights_x, weights_y) = (cubic_weights(u.fract()), cubic_weights(v.fract()));
            for (j, weight_y) in weights_y.iter().enumerate() {
                for (i, weight_x) in weights_x.iter().enumerate() {
                    let row = (v as usize + cells + j - 1) % cells;
                    let column = (u as usize + cells + i - 1) % cells;
                    values[y * size + x] += weight_x * weight_y * lattice[row * cells + column];
                }
            }
        }
    }
}

fn add_rectangle(values: &mut [f32], size: usize, dice: &mut Dice) {
    let centre = [dice.uniform() * size as f64, dice.uniform() * size as f64];
    let half = [4.0 + 26.0 * dice.uniform(), 4.0 + 26.0 * dice.uniform()];
    let (sine, cosine) = (std::f64::consts::TAU * dice.uniform()).sin_cos();
    let grey = 25.0 * dice.normal() as f32;
    let reach = half[0].hypot(half[1]).ceil() as i64;
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let along = cosine * dx as f64 + sine * dy as f64;
            let across = cosine * dy as f64 - sine * dx as f64;
            if along.abs() <= half[0] && across.abs() <= half[1] {
                let column = (centre[0] as i64 + dx).rem_euclid(size as i64) as usize;
                let row = (centre[1] as i64 + dy).rem_euclid(size as i64) as usize;
                values[row * size + column] += grey;
            }
        }
    }
}

/// Blur of a lens: the binomial filter `1 4 6 4 1` in both directions.
fn soften(values: &mut [f32], size: usize) {
    let weights = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
    for (stride, line_stride) in [(1, size), (size, 1)] {
        for line in 0..size {
            let old: Vec<f32> = (0..size).map(|k| values[line * line_stride + k * stride]).collect();
            for k in 0..size {
                let tap = |(offset, weight): (usize, &f32)| weight * old[(k + size + offset - 2) % size];
                values[line * line_stride + k * stride] = weights.iter().enumerate().map(tap).sum();
            }
        }
    }
}

/// Motion of the camera in front of the plane, and errors of the image sensor.
#[derive(Clone, Copy)]
pub(crate) struct Scene {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) focal_px: f64,
    /// Factor of the motion per image.
    pub(crate) motion_scale: f64,
    /// Standard deviation of the pixel noise in grey levels.
    pub(crate) noise: f64,
    /// Relative amplitude of the gain's change from image to image.
    pub(crate) flicker: f64,
}

impl Scene {
    pub(crate) fn camera_matrix(&self) -> Matrix3<f64> {
        let (cx, cy) = (0.5 * self.width as f64 - 0.3, 0.5 * self.height as f64 + 0.2);
        Matrix3::new(self.focal_px, 0.0, cx, 0.0, self.focal_px, cy, 0.0, 0.0, 1.0)
    }

    /// Rotation `camera_from_plane` of image `index`.
    pub(crate) fn camera_from_plane(&self, index: usize) -> Rotation3<f64> {
        let phase = index as f64;
        let angle = |rate: f64, period: f64, shift: f64| {
            // Integral of `rate · sin`, so that `rate` is the largest change per image.
            -rate * period / std::f64::consts::TAU * (std::f64::consts::TAU * (phase / period + shift)).cos()
        };
        let axis = Vector3::new(angle(0.02, 17.0, 0.0), angle(0.034, 23.0, 0.2), angle(0.012, 13.0, 0.5));
        Rotation3::new(axis * self.motion_scale)
    }

    /// Translation `camera_from_plane` of image `index`, in distances of the plane.
    pub(crate) fn translation(&self, index: usize) -> Vector3<f64> {
        let phase = index as f64;
        Vector3::new((phase / 9.0).sin(), (phase / 7.0).cos(), (phase / 6.0).sin()) * (0.06 * self.motion_scale)
    }

    /// Maps pixels of image `index` to texture pixels.
    pub(crate) fn texture_from_image(&self, index: usize) -> Matrix3<f64> {
        let shift = self.translation(index);
        let mut camera_from_plane = self.camera_from_plane(index).into_inner();
        // The plane z = 1: its points (x, y, 1) go to R·(x, y, 1) + t.
        camera_from_plane.column_mut(2).axpy(1.0, &shift, 1.0);
        let image_from_plane = self.camera_matrix() * camera_from_plane;
        let texture_from_plane = Matrix3::new_scaling(self.focal_px * OVERSAMPLING);
        texture_from_plane * image_from_plane.try_inverse().expect("the camera stays before the plane")
    }

    /// Position in image `to` of a pixel of image `from`.
    pub(crate) fn flow(&self, from: usize, to: usize, uv_px: &Vector2<f64>) -> Vector2<f64> {
        let back = self.texture_from_image(to).try_inverse().expect("the camera stays before the plane");
        let moved = back * self.texture_from_image(from) * uv_px.push(1.0);
        moved.xy() / moved.z
    }

    /// Image of the camera at `index`.
    pub(crate) fn render(&self, texture: &Texture, index: usize) -> GrayImage {
        let texture_from_image = self.texture_from_image(index);
        let mut dice = Dice(0x9e37_79b9_7f4a_7c15 ^ (index as u64 + 1));
        let gain = 1.0 + self.flicker * (1.3 * index as f64).sin();
        let offset = 60.0 * self.flicker * (0.9 * index as f64).cos();
        let mut pixels = Vec::with_capacity(self.width * self.height);
        for y in 0..self.height {
            for x in 0..self.width {
                let mut sum = 0.0;
                for (dx, dy) in [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)] {
                    let at = texture_from_image * Vector3::new(x as f64 + dx, y as f64 + dy, 1.0);
                    sum += 0.25 * texture.at(at.x / at.z, at.y / at.z);
                }
                let observed = gain * sum + offset + self.noise * dice.normal();
                pixels.push(observed.round().clamp(0.0, 255.0) as u8);
            }
        }
        GrayImage { width: self.width, height: self.height, pixels }
    }

    /// True if a pixel is inside the image.
    pub(crate) fn sees(&self, uv_px: &Vector2<f64>) -> bool {
        let (right, bottom) = ((self.width - 1) as f64, (self.height - 1) as f64);
        uv_px.x >= 0.0 && uv_px.y >= 0.0 && uv_px.x <= right && uv_px.y <= bottom
    }
}
