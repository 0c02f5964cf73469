//! Elements common to several sections of the page.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::content::{ReportDrawing, ReportFigure};
use crate::log_check::Severity;
use crate::table::{Column, Medium};

/// Maximum number of rows of a table that is not split between printed pages.
const MAX_UNBROKEN_ROWS: usize = 14;
/// Style sheet for screens and for paper, where rows of tables and figures are not split between pages.
const STYLE: &str = include_str!("../../assets/report/style.css");

pub(super) fn document(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}

/// An unordered list of texts, empty if there are none.
pub(super) fn list(items: &[String]) -> Markup {
    html! {
        @if !items.is_empty() {
            ul { @for item in items { li { (item) } } }
        }
    }
}

/// An unordered list of texts in two columns, empty if there are none.
pub(super) fn list_in_columns(items: &[String]) -> Markup {
    html! {
        @if !items.is_empty() {
            ul.columns { @for item in items { li { (unbroken(item)) } } }
        }
    }
}

/// True for a cell that is aligned as a number: it begins with a digit, a sign or ±.
pub(super) fn is_number(cell: &str) -> bool {
    cell.starts_with(|first: char| first.is_ascii_digit() || "−-±".contains(first))
}

/// Texts of a row on a page.
pub(super) fn cells<Row>(columns: &[Column<'_, Row>], row: &Row) -> Vec<String> {
    columns.iter().map(|column| column.shown_text(row, Medium::Page)).collect()
}

/// A table whose first column contains the names of the rows.
pub(super) fn table<Row>(caption: &str, columns: &[Column<'_, Row>], rows: &[Row]) -> Markup {
    let texts: Vec<Vec<String>> = rows.iter().map(|row| cells(columns, row)).collect();
    table_of_texts(caption, columns.iter().filter_map(|column| column.heading(Medium::Page)), &texts)
}

pub(super) fn table_of_texts<'a>(
    caption: &str,
    header: impl IntoIterator<Item = &'a str>,
    rows: &[Vec<String>],
) -> Markup {
    html! {
        table.short[rows.len() <= MAX_UNBROKEN_ROWS] {
            caption { (caption) }
            thead { tr { @for cell in header { th scope="col" { (cell) } } } }
            tbody {
                @for row in rows {
                    tr {
                        @for (column, cell) in row.iter().enumerate() {
                            @if column == 0 {
                                th scope="row" { (breakable(cell)) }
                            } @else if is_hash(cell) {
                                td.hash { (cell) }
                            } @else if is_number(cell) {
                                td.number { (cell) }
                            } @else {
                                td { (breakable(cell)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// True for a hexadecimal hash, which may be broken anywhere.
fn is_hash(cell: &str) -> bool {
    cell.len() >= 40 && cell.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// A text that may be broken after slashes, as topics and paths are; words are not broken.
fn breakable(text: &str) -> Markup {
    html! {
        @for (place, part) in text.split_inclusive('/').enumerate() {
            @if place > 0 { wbr; }
            (part)
        }
    }
}

pub(super) fn figure(number: usize, figure: &ReportFigure) -> Markup {
    let ReportFigure { title, reading, drawing, .. } = figure;
    html! {
        figure id={ "figure-" (number) } {
            @match drawing {
                ReportDrawing::Png(png) => {
                    img alt=(title) src={ "data:image/png;base64," (STANDARD.encode(png)) };
                }
                // SVG inside HTML needs no name space; without it the page contains nothing that looks like a URL.
                ReportDrawing::Svg(svg) => {
                    (PreEscaped(svg.trim_end().replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)))
                }
            }
            figcaption { b { "Figure " (number) ". " (title) "." } " " (reading) }
        }
    }
}

/// The icon of a severity, drawn in the page so that it needs no symbol font.
pub(super) fn icon(severity: Severity) -> Markup {
    let svg = match severity {
        Severity::Good => include_str!("../../assets/report/icons/good.svg"),
        Severity::Note => include_str!("../../assets/report/icons/note.svg"),
        Severity::Warning => include_str!("../../assets/report/icons/warning.svg"),
        Severity::Error => include_str!("../../assets/report/icons/error.svg"),
    };
    PreEscaped(svg.trim_end().to_owned())
}

/// The text with non-breaking spaces between numbers and their units.
pub(super) fn unbroken(text: &str) -> String {
    const UNITS: [&str; 5] = [" mm", " m", " s", " px", " %"];
    let mut words = String::new();
    for (at, letter) in text.char_indices() {
        let (before, after) = text.split_at(at);
        let number = before.ends_with(|last: char| last.is_ascii_digit());
        let unit = UNITS.iter().filter_map(|unit| after.strip_prefix(unit));
        let mut ends = unit.filter(|rest| !rest.starts_with(|next: char| next.is_alphanumeric()));
        words.push(if letter == ' ' && number && ends.next().is_some() { '\u{a0}' } else { letter });
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_log_says_cannot_become_markup() {
        let text =
            table_of_texts("a & b", ["<name>"], &[vec!["<script>alert(\"x\")</script>".to_owned(), "-1".to_owned()]])
                .into_string();
        assert!(!text.contains("<script>") && text.contains("&lt;script&gt;"), "{text}");
        assert!(text.contains("a &amp; b") && text.contains("&lt;name&gt;"), "{text}");
        assert!(text.contains("<td class=\"number\">-1</td>"), "{text}");
        let shown = |drawing: ReportDrawing| {
            let [heading, title, reading] = ["h", "<p>", "r & s"].map(str::to_owned);
            figure(3, &ReportFigure { heading, title, reading, half: false, drawing }).into_string()
        };
        let image = shown(ReportDrawing::Png(b"abc".to_vec()));
        assert_eq!(image.matches("base64,YWJj").count(), 1);
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\"></svg>\n".to_owned();
        let drawing = shown(ReportDrawing::Svg(svg));
        let expected = "<figure id=\"figure-3\"><svg width=\"1\"></svg><figcaption><b>Figure 3. &lt;p&gt;.</b> r &amp; s\
                        </figcaption></figure>";
        assert_eq!(drawing, expected);
    }

    #[test]
    fn only_hashes_are_broken_inside_words_and_topics_after_slashes() {
        let hash = "0123456789abcdef0123456789abcdef01234567".to_owned();
        let text = table_of_texts("t", ["a", "b"], &[vec!["/imu/data".to_owned(), hash.clone()]]).into_string();
        assert!(text.contains("<th scope=\"row\">/<wbr>imu/<wbr>data</th>"), "{text}");
        assert!(text.contains(&format!("<td class=\"hash\">{hash}</td>")), "{text}");
    }

    #[test]
    fn units_stay_with_their_numbers() {
        assert_eq!(unbroken("over 5 m 47.3 mm, 2 more"), "over 5\u{a0}m 47.3\u{a0}mm, 2 more");
        assert_eq!(unbroken("for 4 s; 4 seconds; 0.05 % of"), "for 4\u{a0}s; 4 seconds; 0.05\u{a0}% of");
    }
}
