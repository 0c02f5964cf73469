//! Laid-out text as runs of letters: one for each colour and font on a row.

use egui::epaint::TextShape;
use egui::epaint::text::{Glyph, LayoutSection};
use egui::{Color32, FontFamily, Rect, Stroke, Vec2, pos2, vec2};

use super::element::{Element, Letter, TextRun};

pub(super) fn add_text(elements: &mut Vec<Element>, shape: &TextShape) {
    let is_rotated = shape.angle != 0.0;
    if is_rotated {
        elements.push(Element::Rotation(Some((shape.angle, shape.pos))));
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
                add_run(elements, shape, row.pos.to_vec2(), &run, section_of_run);
                run.clear();
                section_of_run = section;
            }
            run.push(glyph);
        }
        add_run(elements, shape, row.pos.to_vec2(), &run, section_of_run);
    }
    if is_rotated {
        elements.push(Element::Rotation(None));
    }
}

fn section_at(sections: &[LayoutSection], at: usize) -> Option<&LayoutSection> {
    sections.iter().rfind(|section| section.byte_range.start.0 <= at)
}

fn add_run(elements: &mut Vec<Element>, shape: &TextShape, row: Vec2, run: &[&Glyph], section: Option<&LayoutSection>) {
    let Some(format) = section.or_else(|| shape.galley.job.sections.first()).map(|section| &section.format) else {
        return;
    };
    let offset = shape.pos.to_vec2() + row;
    let opaque = |color: Color32| color.gamma_multiply(shape.opacity_factor);
    if let (true, Some(first), Some(last)) = (format.background.a() > 0, run.first(), run.last()) {
        let corner = pos2(first.pos.x, first.pos.y - first.font_ascent) + offset;
        let size = vec2(last.pos.x + last.advance_width - first.pos.x, first.line_height);
        let rect = Rect::from_min_size(corner, size);
        let fill = opaque(format.background);
        elements.push(Element::Rect { rect, corner_radius: 0.0, angle_rad: 0.0, fill, stroke: Stroke::NONE });
    }
    // Spaces at both ends only shift the text.
    let begin = run.iter().position(|glyph| !glyph.chr.is_whitespace());
    let end = run.iter().rposition(|glyph| !glyph.chr.is_whitespace());
    let (Some(begin), Some(end)) = (begin, end) else { return };
    let run = &run[begin..=end];
    let [Some(first), Some(last)] = [run.first(), run.last()] else { return };
    let color = match shape.override_text_color {
        Some(color) => color,
        None if format.color == Color32::PLACEHOLDER => shape.fallback_color,
        None => format.color,
    };
    let at = first.pos + offset;
    let width = last.pos.x + last.advance_width - first.pos.x;
    let size = format.font_id.size;
    let letter = |glyph: &&Glyph| Letter { letter: glyph.chr, x: glyph.pos.x + offset.x, width: glyph.advance_width };
    let mut letters: Vec<Letter> = run.iter().map(letter).collect();
    split_ligatures(&mut letters);
    elements.push(Element::Text(TextRun {
        y: at.y,
        size,
        monospace: format.font_id.family == FontFamily::Monospace,
        italics: format.italics,
        color: opaque(color),
        letters,
    }));
    for (stroke, y) in [(format.underline, at.y + 2.0), (format.strikethrough, at.y - 0.3 * size)] {
        if !stroke.is_empty() {
            elements.push(Element::Lines { lines: vec![[pos2(at.x, y), pos2(at.x + width, y)]], stroke });
        }
    }
}

/// Gives the letters of a ligature, of which the first has all of its width, equal parts.
fn split_ligatures(letters: &mut [Letter]) {
    let joined = |_: &Letter, next: &Letter| next.width == 0.0;
    for ligature in letters.chunk_by_mut(joined) {
        let (count, Some(first)) = (ligature.len(), ligature.first().copied()) else { continue };
        let width = first.width / count as f32;
        for (place, letter) in ligature.iter_mut().enumerate() {
            (letter.x, letter.width) = (first.x + place as f32 * width, width);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_of_a_ligature_share_its_width() {
        let letter = |letter: char, x: f32, width: f32| Letter { letter, x, width };
        let mut letters =
            [letter('o', 0.0, 5.0), letter('f', 5.0, 6.0), letter('i', 11.0, 0.0), letter('t', 11.0, 4.0)];
        split_ligatures(&mut letters);
        assert_eq!(
            letters,
            [letter('o', 0.0, 5.0), letter('f', 5.0, 3.0), letter('i', 8.0, 3.0), letter('t', 11.0, 4.0)]
        );
    }
}
