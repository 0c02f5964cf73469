//! Drawing of the alignment of a video.

use std::fmt::Write as _;
use std::path::Path;

use maud::{Markup, html};

use super::{AlignmentEvidence, VideoAlignment};
use crate::export::ExportError;
use crate::files::output::write_file;
use crate::geometry::ticks;
use crate::log_check::ClockAlignment;

/// Size of the drawing, and margins of both plots in it.
const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 560.0;
const LEFT: f64 = 60.0;
const RIGHT: f64 = 940.0;
/// Maximum number of drawn points; points of a longer recording are skipped.
const MAX_POINTS: usize = 4000;
/// Colours of images and reference.
const IMAGES: &str = "#c2410c";
const REFERENCE: &str = "#1d4ed8";

/// One plot: ranges of its axes and its position.
struct Plot {
    x: (f64, f64),
    y: (f64, f64),
    top: f64,
    bottom: f64,
}

impl Plot {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let fraction = |value: f64, (low, high): (f64, f64)| (value - low) / (high - low).max(1e-12);
        let along = LEFT + fraction(x, self.x) * (RIGHT - LEFT);
        (along, self.bottom - fraction(y, self.y).clamp(0.0, 1.0) * (self.bottom - self.top))
    }

    /// A line through points; a step in x larger than `gap` interrupts it.
    fn line(&self, points: impl Iterator<Item = (f64, f64)>, gap: f64, color: &str) -> Markup {
        let mut path = String::new();
        let mut before = f64::NEG_INFINITY;
        for (x, y) in points {
            let (along, up) = self.at(x, y);
            let command = if x - before > gap { 'M' } else { 'L' };
            // Writing to a string cannot fail.
            let _infallible = write!(path, "{command}{along:.1} {up:.1}");
            before = x;
        }
        html! { path d=(path) fill="none" stroke=(color) stroke-width="1" {} }
    }

    fn frame(&self, title: &str, x_label: &str, y_label: &str) -> Markup {
        let name = |value: f64| format!("{}", (value * 1e6).round() / 1e6);
        html! {
            rect x=(LEFT) y=(self.top) width=(RIGHT - LEFT) height=(self.bottom - self.top) fill="none" stroke="#999" {}
            text x=(LEFT) y=(self.top - 10.0) font-weight="bold" { (title) }
            text x=(RIGHT) y=(self.bottom + 34.0) text-anchor="end" { (x_label) }
            text x="16" y=(0.5 * (self.top + self.bottom)) text-anchor="middle"
                transform={ "rotate(-90 16 " (0.5 * (self.top + self.bottom)) ")" } { (y_label) }
            @for value in ticks(self.x.0, self.x.1, 8).0 {
                line x1=(self.at(value, 0.0).0) x2=(self.at(value, 0.0).0) y1=(self.bottom) y2=(self.bottom + 5.0) stroke="#999" {}
                text x=(self.at(value, 0.0).0) y=(self.bottom + 18.0) text-anchor="middle" { (name(value)) }
            }
            @for value in ticks(self.y.0, self.y.1, 8).0 {
                line x1=(LEFT - 5.0) x2=(LEFT) y1=(self.at(0.0, value).1) y2=(self.at(0.0, value).1) stroke="#999" {}
                text x=(LEFT - 8.0) y=(self.at(0.0, value).1 + 4.0) text-anchor="end" { (name(value)) }
            }
        }
    }
}

fn drawing(aligned: &VideoAlignment, reference: &str, found: &ClockAlignment) -> String {
    let offsets = found.correlation.iter().map(|(offset_s, _)| *offset_s);
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low < high { (low, high) } else { (low - 1.0, low + 1.0) }
    };
    let search = Plot { x: range(&mut offsets.into_iter()), y: (-1.0, 1.0), top: 50.0, bottom: 220.0 };
    let step = found.speeds.len().div_ceil(MAX_POINTS).max(1);
    let speeds: Vec<(f64, f64, f64)> = found.speeds.iter().copied().step_by(step).collect();
    let fastest = speeds.iter().map(|(_, _, reference)| *reference).fold(0.0, f64::max);
    let times = Plot {
        x: range(&mut speeds.iter().map(|(time_s, _, _)| *time_s)),
        y: (0.0, (1.3 * fastest).max(1e-3)),
        top: 320.0,
        bottom: 500.0,
    };
    let mark = search.at(found.offset_s, 0.0).0;
    let markup = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(WIDTH) height=(HEIGHT) viewBox={ "0 0 " (WIDTH) " " (HEIGHT) }
            font-family="sans-serif" font-size="12" {
            rect width=(WIDTH) height=(HEIGHT) fill="white" {}
            (search.frame("Correlation of angular speeds by offset", "offset of the video from the first guess, s", "correlation"))
            line x1=(mark) x2=(mark) y1=(search.top) y2=(search.bottom) stroke=(IMAGES) stroke-width="2" {}
            (search.line(found.correlation.iter().copied(), 0.1, REFERENCE))
            (times.frame("Angular speed at the offset found", "time of the log, s", "rad/s"))
            (times.line(speeds.iter().map(|(time_s, _, reference)| (*time_s, *reference)), 0.5 * step as f64, REFERENCE))
            (times.line(speeds.iter().map(|(time_s, images, _)| (*time_s, *images)), 0.5 * step as f64, IMAGES))
            text x=(RIGHT) y="310" text-anchor="end" {
                tspan fill=(IMAGES) { "images" } "   " tspan fill=(REFERENCE) { (reference) }
            }
            text x=(LEFT) y=(HEIGHT - 8.0) font-size="11" { (summary(aligned, found)) }
        }
    };
    format!("{}\n", markup.into_string())
}

fn summary(aligned: &VideoAlignment, found: &ClockAlignment) -> String {
    format!(
        "offset {:+.4} s (σ {:.1} ms), drift {:+.0} ± {:.0} ppm, {:.0} % of the rotation explained",
        aligned.clock.offset_s,
        1e3 * found.offset_sigma_s,
        found.drift_ppm,
        found.drift_sigma_ppm,
        100.0 * found.explained
    )
}

/// Draws the search and the angular rates at the estimated offset, as SVG; false for an alignment by specific forces, which
/// has no drawing.
///
/// # Errors
/// If the file cannot be written.
pub fn write_alignment_plot(aligned: &VideoAlignment, path: &Path) -> Result<bool, ExportError> {
    let AlignmentEvidence::Rotations { reference, alignment } = &aligned.evidence else { return Ok(false) };
    let text = drawing(aligned, &reference.to_string(), alignment);
    write_file(path, text.as_bytes()).map_err(ExportError::write(path)).map(|()| true)
}
