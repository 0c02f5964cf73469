//! Mixing colours, their contrast, and the viridis colour map.

use egui::Color32;

/// An opaque colour of 0xRRGGBB.
pub(super) const fn rgb(hex: u32) -> Color32 {
    Color32::from_rgb((hex >> 16) as u8, (hex >> 8) as u8, hex as u8)
}

/// Mixes two opaque colours in their 8-bit values: `fraction` 0 is the first, 1 the second.
pub fn mix(from: Color32, to: Color32, fraction: f32) -> Color32 {
    let fraction = if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) };
    let blend = |a: u8, b: u8| (f32::from(a) + (f32::from(b) - f32::from(a)) * fraction).round() as u8;
    Color32::from_rgb(blend(from.r(), to.r()), blend(from.g(), to.g()), blend(from.b(), to.b()))
}

/// Contrast ratio of WCAG 2.1 between two opaque colours.
pub(super) fn contrast(a: Color32, b: Color32) -> f64 {
    let luminance = |color: Color32| {
        let linear = |value: u8| {
            let value = f64::from(value) / 255.0;
            if value <= 0.03928 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
    };
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Matplotlib's viridis from 0 to 1 in steps of a ninth, interpolated linearly between.
const VIRIDIS: [u32; 10] =
    [0x440154, 0x482878, 0x3e4a89, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6dcd59, 0xb4de2c, 0xfde725];

/// Viridis at a fraction in 0 to 1, clamped; NaN counts as 0.
pub fn viridis(fraction: f64) -> Color32 {
    let fraction = if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) };
    let position = fraction * (VIRIDIS.len() - 1) as f64;
    let lower = (position as usize).min(VIRIDIS.len() - 2);
    mix(rgb(VIRIDIS[lower]), rgb(VIRIDIS[lower + 1]), (position - lower as f64) as f32)
}
