//! Panels of a study as images, drawings and tables, without a window.

use std::sync::Arc;

use egui::Ui;
use image::RgbaImage;

use super::screenshot::{Renderer, ScreenshotError, ScreenshotOptions, WHOLE, check};
use crate::gui::rendering::offscreen::Offscreen;
use crate::gui::rendering::{headless, headless::HeadlessOptions};
use crate::gui::study::{StudyOptions, StudyPanel, StudyState, study_panel_ui, study_ui};
use crate::gui::theme::Theme;
use crate::study::view::Study;
use crate::text::Named as _;

fn panel_of(name: &str) -> Result<Option<StudyPanel>, ScreenshotError> {
    let panel = StudyPanel::from_name(name);
    if panel.is_none() && name != WHOLE {
        return Err(ScreenshotError::UnknownStudyPanel { name: name.to_owned() });
    }
    Ok(panel)
}

fn state_of(study: &Arc<Study>, view: &StudyOptions) -> Result<StudyState, ScreenshotError> {
    StudyState::new(Arc::clone(study), view).map_err(|problem| ScreenshotError::StudyOptions { problem })
}

/// Draws one panel, or the whole view, of a study.
///
/// # Errors
/// For an unknown panel, a size out of range, or columns that the study does not have.
pub fn draw_study_panel(
    name: &str,
    study: &Arc<Study>,
    view: &StudyOptions,
    options: &ScreenshotOptions,
) -> Result<RgbaImage, ScreenshotError> {
    with_panel(name, study, view, options, |headless, ui| match options.renderer {
        Renderer::Cpu => Ok(headless::draw(headless, ui)),
        Renderer::Wgpu => Ok(Offscreen::open()?.draw(headless, ui)?),
    })
}

/// The same panel as an SVG drawing; `prefix` is prepended to the ids of its elements, `title` is its title.
///
/// # Errors
/// As [`draw_study_panel`].
pub fn draw_study_panel_svg(
    name: &str,
    study: &Arc<Study>,
    view: &StudyOptions,
    options: &ScreenshotOptions,
    [prefix, title]: [&str; 2],
) -> Result<String, ScreenshotError> {
    with_panel(name, study, view, options, |headless, ui| Ok(headless::svg_of(headless, prefix, title, ui)))
}

/// The values of a panel of a study as CSV.
///
/// # Errors
/// If no single panel has this name, or the study does not have the columns.
pub fn study_panel_csv(name: &str, study: &Arc<Study>, view: &StudyOptions) -> Result<String, ScreenshotError> {
    let panel = panel_of(name)?.ok_or_else(|| ScreenshotError::UnknownStudyPanel { name: name.to_owned() })?;
    Ok(state_of(study, view)?.csv_table(panel))
}

fn with_panel<T>(
    name: &str,
    study: &Arc<Study>,
    view: &StudyOptions,
    options: &ScreenshotOptions,
    draw: impl FnOnce(HeadlessOptions, &mut dyn FnMut(&mut Ui)) -> Result<T, ScreenshotError>,
) -> Result<T, ScreenshotError> {
    let panel = panel_of(name)?;
    check(options)?;
    let mut state = state_of(study, view)?;
    let colors = Theme::of(options.theme);
    let ScreenshotOptions { size_px, pixels_per_point, theme, presentation, .. } = *options;
    let mut ui = |ui: &mut Ui| match panel {
        Some(panel) => study_panel_ui(panel, ui, &mut state, &colors, presentation),
        None => study_ui(ui, &mut state, &colors),
    };
    draw(HeadlessOptions { size_px, pixels_per_point, theme }, &mut ui)
}
