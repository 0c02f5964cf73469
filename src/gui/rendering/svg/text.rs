//! Laid-out text as SVG text: one element per run of one colour and font on a row, with its laid-out width.

use egui::epaint::TextShape;
use egui::epaint::text::{Glyph, LayoutSection, TextFormat};
use egui::{Color32, FontFamily, Rect, pos2, vec2};

use super::element::{attribute, escape, number, paint, put, stroke};
use super::symbols::outline;

pub(super) fn text(svg: &mut String, shape: &TextShape) {
    let is_rotated = shape.angle != 0.0;
    if is_rotated {
        let [x, y] = [number(shape.pos.x), number(shape.pos.y)];
        put(svg, format_args!("<g transform=\"rotate({} {x} {y})\">\n", number(shape.angle.to_degrees())));
    }
    let job = &shape.galley.job;
    let mut letters = job.text.char_indices().peekable();
    for row in &shape.galley.rows {
        let mut run: Vec<&Glyph> = Vec::new();
        let mut section_of_run = None;
        for glyph in &row.row.glyphs {
            // Line breaks have no glyph; the ellipsis of truncated text belongs to no section.
            while letters.peek().is_some_and(|(_, letter)| *letter == '\n') {
                letters.next();
            }
            let at = letters.next_if(|(_, letter)| *letter == glyph.chr).map(|(at, _)| at);
            let section = at.and_then(|at| section_at(&job.sections, at)).or(section_of_run);
            if section != section_of_run {
                write_run(svg, shape, row.pos.to_vec2(), &run, section_of_run);
                run.clear();
                section_of_run = section;
            }
            run.push(glyph);
        }
        write_run(svg, shape, row.pos.to_vec2(), &run, section_of_run);
    }
    if is_rotated {
        svg.push_str("</g>\n");
    }
}

fn section_at(sections: &[LayoutSection], at: usize) -> Option<&LayoutSection> {
    sections.iter().rfind(|section| section.byte_range.start.0 <= at)
}

fn write_run(svg: &mut String, shape: &TextShape, row: egui::Vec2, run: &[&Glyph], section: Option<&LayoutSection>) {
    let Some(format) = section.or_else(|| shape.galley.job.sections.first()).map(|section| &section.format) else {
        return;
    };
    let offset = shape.pos.to_vec2() + row;
    let opaque = |color: Color32| color.gamma_multiply(shape.opacity_factor);
    if let (true, Some(first), Some(last)) = (format.background.a() > 0, run.first(), run.last()) {
        let top = first.pos.y - first.font_ascent;
        let corner = pos2(first.pos.x, top) + offset;
        let size = vec2(last.pos.x + last.advance_width - first.pos.x, first.line_height);
        let ground = Rect::from_min_size(corner, size);
        let [x, y, width, height] = [ground.left(), ground.top(), ground.width(), ground.height()].map(number);
        let fill = paint("fill", opaque(format.background));
        put(svg, format_args!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{fill}/>\n"));
    }
    // Spaces at both ends only shift the text.
    let begin = run.iter().position(|glyph| !glyph.chr.is_whitespace());
    let end = run.iter().rposition(|glyph| !glyph.chr.is_whitespace());
    let (Some(begin), Some(end)) = (begin, end) else { return };
    let color = match shape.override_text_color {
        Some(color) => color,
        None if format.color == Color32::PLACEHOLDER => shape.fallback_color,
        None => format.color,
    };
    let family = match format.font_id.family {
        FontFamily::Monospace => "Hack, 'DejaVu Sans Mono', Menlo, Consolas, monospace",
        FontFamily::Proportional | FontFamily::Name(_) => "Ubuntu, 'DejaVu Sans', 'Segoe UI', sans-serif",
    };
    for part in run[begin..=end].chunk_by(|a, b| outline(a.chr).is_none() && outline(b.chr).is_none()) {
        match part {
            [glyph] if outline(glyph.chr).is_some() => symbol(svg, glyph, offset, opaque(color), format.font_id.size),
            letters => write_letters(svg, letters, offset, opaque(color), format, family),
        }
    }
}

/// Writes a symbol as an outline of the height of capital letters, centred in its advance width.
fn symbol(svg: &mut String, glyph: &Glyph, offset: egui::Vec2, color: Color32, font_size: f32) {
    const SIZE_RATIO: f32 = 0.75;
    let Some(path) = outline(glyph.chr) else { return };
    let size = SIZE_RATIO * font_size;
    let corner = glyph.pos + offset + vec2(0.5 * (glyph.advance_width - size), -size);
    let [x, y] = [corner.x, corner.y].map(number);
    let scale = number(size / 16.0);
    let fill = paint("fill", color);
    put(
        svg,
        format_args!(
            "<path transform=\"translate({x} {y}) scale({scale})\" d=\"{path}\"{fill} fill-rule=\"evenodd\"/>\n"
        ),
    );
}

/// Writes letters of one colour and font with their laid-out width.
fn write_letters(
    svg: &mut String,
    run: &[&Glyph],
    offset: egui::Vec2,
    color: Color32,
    format: &TextFormat,
    family: &str,
) {
    let begin = run.iter().position(|glyph| !glyph.chr.is_whitespace());
    let end = run.iter().rposition(|glyph| !glyph.chr.is_whitespace());
    let (Some(begin), Some(end)) = (begin, end) else { return };
    let run = &run[begin..=end];
    let [Some(first), Some(last)] = [run.first(), run.last()] else { return };
    let at = first.pos + offset;
    let width = last.pos.x + last.advance_width - first.pos.x;
    svg.push_str("<text");
    svg.push_str(&attribute("x", at.x));
    svg.push_str(&attribute("y", at.y));
    put(svg, format_args!(" font-family=\"{family}\""));
    svg.push_str(&attribute("font-size", format.font_id.size));
    if run.len() > 1 {
        svg.push_str(&attribute("textLength", width));
        svg.push_str(" lengthAdjust=\"spacingAndGlyphs\"");
    }
    if format.italics {
        svg.push_str(" font-style=\"italic\"");
    }
    svg.push_str(&paint("fill", color));
    let letters: String = run.iter().map(|glyph| glyph.chr).collect();
    put(svg, format_args!(" xml:space=\"preserve\">{}</text>\n", escape(&letters)));
    for (line, y) in [(format.underline, at.y + 2.0), (format.strikethrough, at.y - 0.3 * format.font_id.size)] {
        if !line.is_empty() {
            let [left, right, y] = [at.x, at.x + width, y].map(number);
            put(svg, format_args!("<path d=\"M{left} {y}H{right}\" fill=\"none\"{}/>\n", stroke(line)));
        }
    }
}
