use super::view::RenderedView;
use crate::sensors::GrayImage;
use crate::simulation::random::mix;

/// Options of an image sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SensorOptions {
    /// Standard deviation of the noise, in grey values.
    pub(crate) noise: f64,
    /// Drift of the exposure as a ratio of its mean.
    pub(crate) exposure_drift: f64,
    /// Vignetting: ratio by which the farthest corner is darker.
    pub(crate) vignetting: f64,
}

/// Image sensor with slow drift of the exposure, vignetting, and noise on every pixel.
#[derive(Clone, Debug)]
pub(crate) struct Sensor {
    options: SensorOptions,
    width: usize,
    height: usize,
    shading: Vec<f32>,
    seed: u64,
}

impl Sensor {
    /// Sensor whose noise is a function of this seed, the frame number and the pixel.
    pub(crate) fn new(view: &RenderedView, options: SensorOptions, seed: u64) -> Self {
        let half = [0.5 * view.width as f64, 0.5 * view.height as f64];
        let corner = half[0] * half[0] + half[1] * half[1];
        let mut shading = Vec::with_capacity(view.pixels());
        for row in 0..view.height {
            for column in 0..view.width {
                let (x, y) = (column as f64 + 0.5 - half[0], row as f64 + 0.5 - half[1]);
                shading.push((1.0 - options.vignetting * (x * x + y * y) / corner) as f32);
            }
        }
        Self { options, width: view.width, height: view.height, shading, seed }
    }

    /// Converts linear gray values to an image.
    pub(crate) fn expose(&self, radiance: &[f32], frame_index: usize, time_s: f64) -> GrayImage {
        let phase = (self.seed % 628) as f64 * 0.01;
        let gain =
            1.0 + self.options.exposure_drift * (0.41 * time_s + phase).sin() * (0.173 * time_s + 2.0 * phase).cos();
        let gain = gain as f32;
        // The sum of four bytes is nearly normal; this is one over its standard deviation.
        let noise = (self.options.noise / 147.8) as f32;
        let key = mix(self.seed ^ (frame_index as u64).wrapping_mul(0xA24B_AED4_963E_E407));
        let mut pixels = Vec::with_capacity(radiance.len());
        let mut word = 0;
        for (index, value) in (0_u64..).zip(radiance) {
            // One random word is used for two pixels.
            word = if index % 2 == 0 { mix(key.wrapping_add(index / 2)) } else { word >> 32 };
            let [a, b, c, d] = (word as u32).to_le_bytes();
            let sum = i32::from(a) + i32::from(b) + i32::from(c) + i32::from(d);
            let grey = value * self.shading[index as usize] * gain + (sum - 510) as f32 * noise;
            pixels.push((grey + 0.5).clamp(0.0, 255.0) as u8);
        }
        GrayImage { width: self.width, height: self.height, pixels }
    }
}
