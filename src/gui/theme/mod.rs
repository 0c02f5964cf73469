//! All colours, dash patterns and sizes of the window and of exported screenshots.
//!
//! Runs differ in Okabe–Ito colours *and* dash patterns, never in colour alone.

mod color;
mod style;

use egui::Color32;
use serde::{Deserialize, Serialize};

use self::color::{contrast, rgb};
pub use self::color::{mix, viridis};
pub(crate) use self::style::{dialog_frame, fonts};
pub use self::style::{label_font, number_font};
use crate::text::Named;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ThemeName {
    /// Dark background, for the screen.
    #[default]
    Dark,
    /// Light background, for the screen.
    Light,
    /// White background and dark text, for reports and paper.
    Print,
}

impl Named for ThemeName {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Dark, "dark"), (Self::Light, "light"), (Self::Print, "print")];
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunStyle {
    /// Colour of the Okabe–Ito palette.
    pub color: Color32,
    /// Lengths of dash, gap, dash, gap, … in points; empty for a solid line.
    pub dashes: &'static [f32],
}

/// Dash, gap, … of run 0, 1, 2, 3: solid, long, dash-dot, short.
const RUN_DASHES: [&[f32]; 4] = [&[], &[11.0, 4.0], &[8.0, 3.0, 2.0, 3.0], &[4.0, 3.0]];

const GROUND_TRUTH_DASHES: &[f32] = &[5.0, 4.0];

/// Dashes and gaps of trajectories of other programs: each has dots.
const TRAJECTORY_DASHES: [&[f32]; 4] =
    [&[1.5, 3.0], &[1.5, 3.0, 7.0, 3.0], &[1.5, 3.0, 1.5, 3.0, 7.0, 3.0], &[1.5, 7.0]];

/// Maximum number of distinguishable runs.
pub const MAX_RUNS: usize = RUN_DASHES.len();

/// Corner radius of frames and buttons in points.
pub const CORNER_RADIUS: u8 = 3;
/// Space around the content of a panel in points.
pub const PANEL_MARGIN: i8 = 6;
/// Size of the smallest text in points; texts of plots are not smaller, even in a small plot.
pub const SMALLEST_TEXT: f32 = 11.0;
/// Height of one line of a table or list in points.
pub const ROW_HEIGHT: f32 = 16.0;
/// Height of a lane of the timeline in points.
pub const LANE_HEIGHT: f32 = 18.0;
/// Width of the lane names in points.
pub const LANE_LABEL_WIDTH: f32 = 118.0;
pub const CURVE_WIDTH: f32 = 1.5;
/// Width of a thin line such as a grid in points.
pub const HAIRLINE_WIDTH: f32 = 1.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Theme {
    pub name: ThemeName,
    pub background: Color32,
    /// Background of panels and bars.
    pub surface: Color32,
    /// Background of buttons and header rows.
    pub surface_raised: Color32,
    pub plot_background: Color32,
    /// Lines between panels and around frames.
    pub outline: Color32,
    /// Grid lines of plots and of the scene's floor.
    pub grid: Color32,
    /// Hatching of ranges without information.
    pub hatch: Color32,
    pub text: Color32,
    /// Text of headings and values.
    pub text_strong: Color32,
    /// Text of labels, units and axes.
    pub text_weak: Color32,
    /// Selection, focus and links.
    pub accent: Color32,
    /// The cursor over time.
    pub cursor: Color32,
    /// X axis, softened red.
    pub axis_x: Color32,
    /// Y axis, softened green.
    pub axis_y: Color32,
    /// Z axis, softened blue.
    pub axis_z: Color32,
    /// Ground truth, always dashed.
    pub ground_truth: Color32,
    /// Values within their limits.
    pub ok: Color32,
    pub warn: Color32,
    pub error: Color32,
    /// Runs 0 to 3 (Okabe–Ito).
    pub runs: [Color32; MAX_RUNS],
    /// Colours of the trajectories 0 to 3 of other programs.
    pub trajectories: [Color32; TRAJECTORY_DASHES.len()],
    /// Colours of −1, 0 and +1 in the diverging map.
    diverging: [Color32; 3],
}

impl Default for Theme {
    fn default() -> Self {
        Self::of(ThemeName::default())
    }
}

impl Theme {
    pub fn of(name: ThemeName) -> Self {
        match name {
            ThemeName::Dark => Self {
                name,
                background: rgb(0x101216),
                surface: rgb(0x181b20),
                surface_raised: rgb(0x272c34),
                plot_background: rgb(0x0e1013),
                outline: rgb(0x343a43),
                grid: rgb(0x24282f),
                hatch: rgb(0x3a4049),
                text: rgb(0xc4cad3),
                text_strong: rgb(0xf0f3f7),
                text_weak: rgb(0x8d96a3),
                accent: rgb(0x5aa9e6),
                cursor: rgb(0xf5f0d8),
                axis_x: rgb(0xe5746c),
                axis_y: rgb(0x77c277),
                axis_z: rgb(0x6ea3ec),
                ground_truth: rgb(0xa3a9b2),
                ok: rgb(0x3fbf8f),
                warn: rgb(0xf0b429),
                error: rgb(0xf0655b),
                // The orange of Okabe and Ito is too close to `warn`; the vermillion of the light theme, brighter.
                runs: [rgb(0x56b4e9), rgb(0xe0691a), rgb(0x1fb88a), rgb(0xcc79a7)],
                trajectories: [rgb(0xf0e442), rgb(0xf28e6b), rgb(0xa6a2f2), rgb(0xd9d9d9)],
                diverging: [rgb(0x3f9ae0), rgb(0x23272e), rgb(0xf07a35)],
            },
            ThemeName::Light => Self {
                name,
                background: rgb(0xe7eaee),
                surface: rgb(0xf6f7f9),
                surface_raised: rgb(0xe2e6eb),
                plot_background: rgb(0xffffff),
                outline: rgb(0xc6ccd4),
                grid: rgb(0xe6e9ed),
                hatch: rgb(0xd3d8de),
                text: rgb(0x333a44),
                text_strong: rgb(0x0d1117),
                text_weak: rgb(0x616b78),
                accent: rgb(0x1466b8),
                cursor: rgb(0x222222),
                axis_x: rgb(0xc9473f),
                axis_y: rgb(0x3f9143),
                axis_z: rgb(0x3a6fc4),
                ground_truth: rgb(0x747b85),
                ok: rgb(0x087f5b),
                warn: rgb(0x9a6700),
                error: rgb(0xc4261d),
                runs: [rgb(0x0072b2), rgb(0xd55e00), rgb(0x009e73), rgb(0xb5578c)],
                trajectories: [rgb(0x8a7400), rgb(0x8c3b1e), rgb(0x5e52b8), rgb(0x3f3f3f)],
                diverging: [rgb(0x2f86cf), rgb(0xf1f3f5), rgb(0xe06520)],
            },
            ThemeName::Print => Self {
                name,
                background: Color32::WHITE,
                surface: Color32::WHITE,
                surface_raised: rgb(0xf0f0f0),
                outline: rgb(0xb0b0b0),
                hatch: rgb(0xd0d0d0),
                text: rgb(0x1a1a1a),
                text_strong: Color32::BLACK,
                text_weak: rgb(0x4a4a4a),
                cursor: Color32::BLACK,
                ground_truth: rgb(0x666666),
                diverging: [rgb(0x2f86cf), Color32::WHITE, rgb(0xe06520)],
                ..Self::of(ThemeName::Light)
            },
        }
    }

    pub fn is_dark(&self) -> bool {
        self.name == ThemeName::Dark
    }

    /// Style of run `index`; indices past the last repeat.
    pub fn run(&self, index: usize) -> RunStyle {
        RunStyle { color: self.runs[index % MAX_RUNS], dashes: RUN_DASHES[index % MAX_RUNS] }
    }

    /// Style of trajectory `index` of another program; indices past the last repeat.
    pub fn trajectory(&self, index: usize) -> RunStyle {
        let index = index % TRAJECTORY_DASHES.len();
        RunStyle { color: self.trajectories[index], dashes: TRAJECTORY_DASHES[index] }
    }

    pub fn ground_truth_style(&self) -> RunStyle {
        RunStyle { color: self.ground_truth, dashes: GROUND_TRUTH_DASHES }
    }

    /// Diverging colour of a signed weight in −1 to 1: blue, background, orange; NaN gives the background.
    pub fn diverging(&self, weight: f64) -> Color32 {
        let weight = if weight.is_nan() { 0.0 } else { weight.clamp(-1.0, 1.0) as f32 };
        let [negative, zero, positive] = self.diverging;
        mix(zero, if weight < 0.0 { negative } else { positive }, weight.abs())
    }

    /// Viridis over heights, without the end of low contrast with this theme's background.
    pub fn height_color(&self, fraction: f64) -> Color32 {
        let (low, high) = if self.is_dark() { (0.3, 1.0) } else { (0.0, 0.75) };
        viridis(low + (high - low) * fraction.clamp(0.0, 1.0))
    }

    /// The text colour with the best contrast on a background.
    pub fn text_on(ground: Color32) -> Color32 {
        let (dark, light) = (rgb(0x0d1117), rgb(0xf0f3f7));
        if contrast(dark, ground) > contrast(light, ground) { dark } else { light }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_reach_their_ends_and_accept_nan() {
        assert_eq!(viridis(0.0), rgb(0x440154));
        assert_eq!(viridis(1.0), rgb(0xfde725));
        assert_eq!(viridis(f64::NAN), viridis(-3.0));
        let theme = Theme::of(ThemeName::Print);
        assert_eq!(theme.diverging(0.0), Color32::WHITE);
        assert_eq!(theme.diverging(-2.0), theme.diverging(-1.0));
        assert_ne!(theme.diverging(-1.0), theme.diverging(1.0));
        assert_eq!(theme.diverging(f64::NAN), Color32::WHITE);
    }

    #[test]
    fn everything_that_is_read_can_be_read() {
        for name in [ThemeName::Dark, ThemeName::Light, ThemeName::Print] {
            let theme = Theme::of(name);
            for text in [theme.text, theme.text_strong, theme.text_weak, theme.ok, theme.warn, theme.error] {
                assert!(contrast(text, theme.surface) >= 4.5, "{name:?} {text:?}");
            }
            for line in theme.runs.into_iter().chain(theme.trajectories).chain([
                theme.ground_truth,
                theme.axis_x,
                theme.axis_y,
                theme.axis_z,
            ]) {
                assert!(contrast(line, theme.plot_background) >= 3.0, "{name:?} {line:?}");
            }
            for fraction in [0.0, 0.5, 1.0] {
                assert!(contrast(theme.height_color(fraction), theme.plot_background) >= 1.8, "{name:?} {fraction}");
            }
            for weight in [-1.0, -0.5, 0.0, 0.5, 1.0] {
                let ground = theme.diverging(weight);
                assert!(contrast(Theme::text_on(ground), ground) >= 4.0, "{name:?} {weight}");
            }
        }
    }

    #[test]
    fn no_run_has_the_colour_of_a_warning_or_an_error() {
        let distance = |a: Color32, b: Color32| {
            let parts = [(a.r(), b.r()), (a.g(), b.g()), (a.b(), b.b())];
            parts.map(|(a, b)| f64::from(a) - f64::from(b)).iter().map(|part| part * part).sum::<f64>().sqrt()
        };
        for name in [ThemeName::Dark, ThemeName::Light, ThemeName::Print] {
            let theme = Theme::of(name);
            for (number, run) in theme.runs.into_iter().enumerate() {
                for state in [theme.warn, theme.error] {
                    assert!(distance(run, state) > 55.0, "{name:?}: run {number} {run:?}, state {state:?}");
                }
            }
        }
    }

    #[test]
    fn runs_differ_by_dashes_too() {
        for a in 0..MAX_RUNS {
            for b in 0..a {
                assert_ne!(RUN_DASHES[a], RUN_DASHES[b]);
            }
        }
    }
}
