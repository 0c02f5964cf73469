//! Runs of letters as SVG text with its laid-out width; symbols that fonts may lack as outlines.

use super::attributes::{attribute, escape, number, paint, put};
use crate::vector::{Letter, TextRun};

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

/// Outline of a symbol as SVG path data in a square of 16 × 16 with y down; `None` for every other character.
fn outline(symbol: char) -> Option<&'static str> {
    Some(match symbol {
        '✔' => "M1.5 8.5L3.5 6.5L6.3 9.3L12.7 2.9L14.5 4.7L6.3 13Z",
        '✖' => "M2.2 4L4 2.2L8 6.2L12 2.2L13.8 4L9.8 8L13.8 12L12 13.8L8 9.8L4 13.8L2.2 12L6.2 8Z",
        '⚠' => "M8 1L15.5 14.5H0.5ZM7.2 5.5V10H8.8V5.5ZM7.2 11.3V12.9H8.8V11.3Z",
        '→' => "M1 7.2H11.2L7.9 3.9L9 2.8L14.2 8L9 13.2L7.9 12.1L11.2 8.8H1Z",
        '←' => "M15 7.2H4.8L8.1 3.9L7 2.8L1.8 8L7 13.2L8.1 12.1L4.8 8.8H15Z",
        '■' => "M2 2H14V14H2Z",
        '▲' => "M8 2L14.5 14H1.5Z",
        '▼' => "M8 14L1.5 2H14.5Z",
        '●' => "M8 2A6 6 0 0 1 8 14A6 6 0 0 1 8 2Z",
        _ => return None,
    })
}
