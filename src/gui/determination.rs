//! Look of a verdict on a calibration parameter, the same in every panel.

use egui::Color32;

use super::theme::{Theme, mix};
use crate::observability::{Determination, WEAKLY_DETERMINED_RATIO};

/// Symbol and colour of a verdict; the symbol is unique without the colour.
pub(crate) fn look_of(verdict: Determination, theme: &Theme) -> (&'static str, Color32) {
    let (mark, tone) = verdict.look();
    (mark, theme.tone(tone))
}

/// Number of levels of [`level_of`].
pub(crate) const LEVELS: u8 = 10;

/// Level of a cell in a map of verdicts: 0 without a value, then from the best to the worst, with several shades of one
/// verdict by the ratio of σ and required accuracy; redundant and unknown parameters have the last two.
pub(crate) fn level_of(verdict: Determination, ratio: f32) -> u8 {
    let ratio = f64::from(ratio);
    match verdict {
        Determination::Initializing | Determination::Fixed => 0,
        Determination::Determined if ratio < 1.0 / 3.0 => 1,
        Determination::Determined if ratio < 2.0 / 3.0 => 2,
        Determination::Determined => 3,
        Determination::Given => 4,
        Determination::WeaklyDetermined if ratio < 0.5 * (1.0 + WEAKLY_DETERMINED_RATIO) => 5,
        Determination::WeaklyDetermined => 6,
        Determination::NotDetermined => 7,
        Determination::Redundant => LEVELS - 2,
        Determination::Unknown => LEVELS - 1,
    }
}

/// Colour of a level: the colours of the verdicts, paler towards the limit of the next better one.
pub(crate) fn level_color(level: u8, theme: &Theme) -> Color32 {
    let ground = theme.plot_background;
    match level {
        1 => theme.ok,
        2 => mix(ground, theme.ok, 0.72),
        3 => mix(ground, theme.ok, 0.45),
        4 => mix(ground, theme.accent, 0.6),
        5 => mix(ground, theme.warn, 0.6),
        6 => theme.warn,
        7 => theme.error,
        8 => mix(ground, theme.text_weak, 0.55),
        9 => mix(ground, theme.text_weak, 0.25),
        _ => ground,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Named as _;

    #[test]
    fn levels_change_at_the_limits_of_the_scale() {
        let level = |ratio: f32| {
            let sigma = f64::from(ratio);
            level_of(Determination::of(sigma, sigma, 1.0, false), ratio)
        };
        assert_eq!([0.3, 0.4, 0.9, 1.1, 2.1, 3.1].map(level), [1, 2, 3, 5, 6, 7]);
        assert_eq!(level_of(Determination::Given, 0.5), 4);
        assert_eq!(level_of(Determination::Initializing, f32::NAN), 0);
        assert_eq!(level_of(Determination::Redundant, 0.7), LEVELS - 2);
        let theme = Theme::default();
        let marks: std::collections::BTreeSet<&str> = Determination::all().map(|it| look_of(it, &theme).0).collect();
        assert_eq!(marks.len(), Determination::NAMES.len());
    }
}
