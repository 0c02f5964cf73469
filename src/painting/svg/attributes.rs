//! Elements and attributes of SVG.

use std::fmt::{Arguments, Write as _};

use egui::{Color32, Pos2, Stroke};

pub(super) fn put(text: &mut String, piece: Arguments<'_>) {
    text.write_fmt(piece).expect("writing into a string cannot fail");
}

/// A number with at most two decimals, without trailing zeros.
pub(super) fn number(value: f32) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

pub(super) fn attribute(name: &str, value: f32) -> String {
    format!(" {name}=\"{}\"", number(value))
}

/// A paint (`fill` or `stroke`) with its opacity.
pub(super) fn paint(name: &str, color: Color32) -> String {
    if color.a() == 0 {
        return format!(" {name}=\"none\"");
    }
    let [red, green, blue, alpha] = color.to_srgba_unmultiplied();
    let mut text = format!(" {name}=\"#{red:02x}{green:02x}{blue:02x}\"");
    if alpha < u8::MAX {
        let opacity = (f32::from(alpha) / 255.0 * 1e3).round() / 1e3;
        put(&mut text, format_args!(" {name}-opacity=\"{opacity}\""));
    }
    text
}

/// A stroke with its width; empty for an empty stroke.
pub(super) fn stroke(stroke: Stroke) -> String {
    if stroke.is_empty() {
        return String::new();
    }
    [paint("stroke", stroke.color), attribute("stroke-width", stroke.width)].concat()
}

/// Path commands: move to the first point, lines to the others.
pub(super) fn lines_through(path: &mut String, points: &[Pos2], closed: bool) {
    for (index, point) in points.iter().enumerate() {
        path.push(if index == 0 { 'M' } else { 'L' });
        path.push_str(&number(point.x));
        path.push(' ');
        path.push_str(&number(point.y));
    }
    if closed {
        path.push('Z');
    }
}

/// XML-escaped text; characters that XML does not allow are omitted.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            control if control < ' ' => {}
            other => escaped.push(other),
        }
    }
    escaped
}
