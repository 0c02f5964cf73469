//! User settings, stored for the next start.

use egui::Vec2;
use serde::{Deserialize, Serialize};

use crate::gui::theme::ThemeName;
use crate::session::DEFAULT_MEMORY_BUDGET_BYTES;

pub const SCALES: std::ops::RangeInclusive<f32> = 0.5..=3.0;
/// Range of the memory budget of a recording in MiB.
pub(super) const MEMORY_MIB: std::ops::RangeInclusive<usize> = 64..=65_536;

/// Name of the initial layout that restores the layout at the end of the last use.
pub(super) const LAST_LAYOUT: &str = "Last used";

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub struct Settings {
    pub theme: ThemeName,
    /// Scale factor of the whole window; 1 is the scale of the screen.
    pub scale: f32,
    /// Memory budget of a recording in MiB.
    pub memory_mib: usize,
    /// Initial layout: the last one, or the name of a preset or of a saved layout.
    pub layout: String,
    /// Initial speed of playback in log seconds per second.
    pub speed: f64,
    /// True if all plots show events and rank losses as vertical lines.
    pub event_lines: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: ThemeName::default(),
            scale: 1.0,
            memory_mib: DEFAULT_MEMORY_BUDGET_BYTES >> 20,
            layout: LAST_LAYOUT.to_owned(),
            speed: 1.0,
            event_lines: false,
        }
    }
}

/// Scale at the first start, given the size of the screen in points: larger on a screen of many pixels that the desktop
/// does not scale.
pub(in crate::gui) fn first_scale(screen: Option<Vec2>, native_pixels_per_point: Option<f32>) -> f32 {
    /// Width in points of a screen on which the text would be too small at a scale of 1.
    const MANY_POINTS: f32 = 3200.0;
    let scaled = native_pixels_per_point.is_some_and(|pixels| pixels > 1.0);
    if !scaled && screen.is_some_and(|screen| screen.x >= MANY_POINTS) { 1.5 } else { 1.0 }
}

impl Settings {
    /// Reads the text of [`Settings::to_text`]; missing and invalid entries get their defaults.
    pub fn from_text(text: &str, theme: ThemeName) -> Self {
        let standard = Self { theme, ..Self::default() };
        let mut value: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
        // One invalid entry does not discard the others.
        let Some(entries) = value.as_object_mut() else { return standard };
        let Ok(serde_json::Value::Object(known)) = serde_json::to_value(&standard) else { return standard };
        for (name, usual) in &known {
            let alone = |value: &serde_json::Value| {
                serde_json::from_value::<Self>(serde_json::json!({ name.as_str(): value })).is_ok()
            };
            if !entries.get(name).is_some_and(alone) {
                entries.insert(name.clone(), usual.clone());
            }
        }
        serde_json::from_value(value).map_or(standard, Self::within_ranges)
    }

    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Limits every number to its range.
    fn within_ranges(mut self) -> Self {
        let clamp = |value: f32| value.clamp(*SCALES.start(), *SCALES.end());
        self.scale = if self.scale.is_finite() { clamp(self.scale) } else { 1.0 };
        self.memory_mib = self.memory_mib.clamp(*MEMORY_MIB.start(), *MEMORY_MIB.end());
        self.speed = if self.speed.is_finite() { self.speed.clamp(0.01, 100.0) } else { 1.0 };
        self
    }

    /// Memory budget of a recording in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.memory_mib << 20
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_unscaled_screen_of_many_pixels_enlarges_the_window() {
        let screen = |width: f32| Some(Vec2::new(width, 0.5625 * width));
        assert_eq!(first_scale(screen(3840.0), Some(1.0)), 1.5);
        assert_eq!(first_scale(screen(3840.0), None), 1.5);
        assert_eq!(first_scale(screen(3840.0), Some(1.25)), 1.0);
        assert_eq!(first_scale(screen(2560.0), Some(1.0)), 1.0);
        assert_eq!(first_scale(None, None), 1.0);
    }

    #[test]
    fn settings_are_restored_and_invalid_entries_affect_nothing_else() {
        let settings = Settings {
            theme: ThemeName::Print,
            scale: 1.5,
            memory_mib: 700,
            layout: "mine".to_owned(),
            speed: 0.5,
            event_lines: true,
        };
        assert_eq!(Settings::from_text(&settings.to_text(), ThemeName::Light), settings);
        let standard = Settings { theme: ThemeName::Light, ..Settings::default() };
        for text in ["", "no json", "[]", "{}", "{\"scale\": \"large\", \"theme\": \"pink\"}"] {
            assert_eq!(Settings::from_text(text, ThemeName::Light), standard, "{text}");
        }
        let mixed = "{\"theme\": 7, \"scale\": 1e9, \"memory_mib\": 0, \"speed\": -1, \"later\": true}";
        let read = Settings::from_text(mixed, ThemeName::Dark);
        assert_eq!((read.theme, read.scale, read.memory_mib, read.speed), (ThemeName::Dark, 3.0, 64, 0.01));
    }
}
