//! Runs of letters as SVG text with its laid-out width; symbols that fonts may lack as outlines.

use super::attributes::{attribute, escape, number, paint, put};
use super::symbols::outline;
use crate::gui::rendering::vector::{Letter, TextRun};

pub(super) fn text(svg: &mut String, run: &TextRun) {
    let plain = |letter: &Letter| outline(letter.letter).is_none();
    for part in run.letters.chunk_by(|a, b| plain(a) && plain(b)) {
        match part {
            [letter] if !plain(letter) => symbol(svg, run, *letter),
            letters => write_letters(svg, run, letters),
        }
    }
}

/// Writes a symbol as an outline of the height of capital letters, centred in its width.
fn symbol(svg: &mut String, run: &TextRun, letter: Letter) {
    const SIZE_RATIO: f32 = 0.75;
    let Some(path) = outline(letter.letter) else { return };
    let size = SIZE_RATIO * run.size;
    let [x, y] = [letter.x + 0.5 * (letter.width - size), run.y - size].map(number);
    let scale = number(size / 16.0);
    let fill = paint("fill", run.color);
    put(
        svg,
        format_args!(
            "<path transform=\"translate({x} {y}) scale({scale})\" d=\"{path}\"{fill} fill-rule=\"evenodd\"/>\n"
        ),
    );
}

/// Writes letters of one colour and font with their laid-out width.
fn write_letters(svg: &mut String, run: &TextRun, letters: &[Letter]) {
    let begin = letters.iter().position(|letter| !letter.letter.is_whitespace());
    let end = letters.iter().rposition(|letter| !letter.letter.is_whitespace());
    let (Some(begin), Some(end)) = (begin, end) else { return };
    let letters = &letters[begin..=end];
    let [Some(first), Some(last)] = [letters.first(), letters.last()] else { return };
    svg.push_str("<text");
    svg.push_str(&attribute("x", first.x));
    svg.push_str(&attribute("y", run.y));
    let family = if run.monospace {
        "Hack, 'DejaVu Sans Mono', Menlo, Consolas, monospace"
    } else {
        "Ubuntu, 'DejaVu Sans', 'Segoe UI', sans-serif"
    };
    put(svg, format_args!(" font-family=\"{family}\""));
    svg.push_str(&attribute("font-size", run.size));
    if letters.len() > 1 {
        svg.push_str(&attribute("textLength", last.x + last.width - first.x));
        svg.push_str(" lengthAdjust=\"spacingAndGlyphs\"");
    }
    if run.italics {
        svg.push_str(" font-style=\"italic\"");
    }
    svg.push_str(&paint("fill", run.color));
    let text: String = letters.iter().map(|letter| letter.letter).collect();
    put(svg, format_args!(" xml:space=\"preserve\">{}</text>\n", escape(&text)));
}
