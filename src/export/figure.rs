//! Figures of panels for papers as bytes of a file.

use super::screenshot::{ScreenshotError, png_bytes};
use crate::gui::desktop::DrawnFigure;
use crate::gui::window::{FigureFormat, FigureInput, FigureSpec};

/// Draws a figure; `command` is the command that repeats it. It is kept with the caption in the metadata of PDF and SVG
/// files.
///
/// # Errors
/// If the figure cannot be encoded.
pub fn figure_bytes(
    spec: &FigureSpec,
    format: FigureFormat,
    command: &str,
    input: FigureInput<'_>,
) -> Result<Vec<u8>, ScreenshotError> {
    let description = format!("{} Command: {command}", spec.text(input.recording).caption());
    match spec.draw(format, &description, input) {
        Some(DrawnFigure::File(bytes)) => Ok(bytes),
        Some(DrawnFigure::Pixels(pixels)) => png_bytes(&pixels),
        None => Err(ScreenshotError::Font),
    }
}
