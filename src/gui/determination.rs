//! Look of a verdict on a calibration parameter, the same in every panel.

use egui::Color32;

use super::theme::{Theme, mix};
use crate::observability::{DETERMINED_RATIO, Determination, NOT_DETERMINED_RATIO};

/// Symbol and colour of a verdict; the symbol is unique without the colour.
pub(crate) fn look_of(verdict: Determination, theme: &Theme) -> (&'static str, Color32) {
    let (mark, tone) = verdict.look();
    (mark, theme.tone(tone))
}

/// Number of levels of [`level_of`].
pub(crate) const LEVELS: u8 = 8;

/// Level of a cell in a map of σ over prior σ: 0 without a value, then from the smallest ratio to the largest, in steps
/// that begin at the limits of the scale; redundant parameters have the last one.
pub(crate) fn level_of(verdict: Determination, ratio: f32) -> u8 {
    let ratio = f64::from(ratio);
    match verdict {
        Determination::Initializing | Determination::Fixed => 0,
        Determination::Redundant => LEVELS - 1,
        _ if ratio < 0.1 * DETERMINED_RATIO => 1,
        _ if ratio < 0.4 * DETERMINED_RATIO => 2,
        _ if ratio < DETERMINED_RATIO => 3,
        _ if ratio < 0.5 * (DETERMINED_RATIO + NOT_DETERMINED_RATIO) => 4,
        _ if ratio < NOT_DETERMINED_RATIO => 5,
        _ => 6,
    }
}

/// Colour of a level: the colours of the verdicts, paler towards the limit of the next better one.
pub(crate) fn level_color(level: u8, theme: &Theme) -> Color32 {
    let ground = theme.plot_background;
    match level {
        1 => theme.ok,
        2 => mix(ground, theme.ok, 0.72),
        3 => mix(ground, theme.ok, 0.45),
        4 => mix(ground, theme.warn, 0.6),
        5 => theme.warn,
        6 => theme.error,
        7 => mix(ground, theme.text_weak, 0.55),
        _ => ground,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Named as _;

    #[test]
    fn levels_change_at_the_limits_of_the_scale() {
        let level = |ratio: f32| level_of(Determination::of(f64::from(ratio), 1.0, false), ratio);
        assert_eq!([0.01, 0.1, 0.29, 0.31, 0.7, 0.89, 0.91].map(level), [1, 2, 3, 4, 5, 5, 6]);
        assert_eq!(level_of(Determination::Initializing, f32::NAN), 0);
        assert_eq!(level_of(Determination::Redundant, 0.7), LEVELS - 1);
        let theme = Theme::default();
        let marks: std::collections::BTreeSet<&str> = Determination::all().map(|it| look_of(it, &theme).0).collect();
        assert_eq!(marks.len(), Determination::NAMES.len());
    }
}
