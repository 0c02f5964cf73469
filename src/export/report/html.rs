//! Small pieces of HTML.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::ReportDrawing;

/// Text as HTML.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// An element with a text in it.
pub(super) fn element(tag: &str, text: &str) -> String {
    format!("<{tag}>{}</{tag}>\n", escape(text))
}

/// A list of texts, nothing when there are none.
pub(super) fn list(items: &[String]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let items: Vec<String> = items.iter().map(|item| element("li", item)).collect();
    format!("<ul>\n{}</ul>\n", items.concat())
}

/// A table whose first column names the rows.
pub(super) fn table(caption: &str, header: &[&str], rows: &[Vec<String>]) -> String {
    let head: Vec<String> = header.iter().map(|cell| format!("<th scope=\"col\">{}</th>", escape(cell))).collect();
    let mut text = format!(
        "<table>\n<caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>\n",
        escape(caption),
        head.concat()
    );
    for row in rows {
        text.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let number = cell.starts_with(|first: char| first.is_ascii_digit() || "−-±".contains(first));
            let cell = escape(cell);
            let (open, close) = match (column, number) {
                (0, _) => ("<th scope=\"row\">", "</th>"),
                (_, true) => ("<td class=\"number\">", "</td>"),
                (_, false) => ("<td>", "</td>"),
            };
            text.extend([open, &cell, close]);
        }
        text.push_str("</tr>\n");
    }
    text.push_str("</tbody>\n</table>\n");
    text
}

/// A picture within the page.
pub(super) fn picture(caption: &str, drawing: &ReportDrawing) -> String {
    let caption = escape(caption);
    let shown = match drawing {
        ReportDrawing::Png(png) => {
            format!("<img alt=\"{caption}\" src=\"data:image/png;base64,{}\">", STANDARD.encode(png))
        }
        // Within HTML a drawing needs no name space, and then nothing in the page looks like an address.
        ReportDrawing::Svg(svg) => svg.trim_end().replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1),
    };
    format!("<figure>{shown}<figcaption>{caption}</figcaption></figure>\n")
}

/// A number of the table with a true minus sign.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|digit| digit == '0' || digit == '.') => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_log_says_cannot_become_markup() {
        let text = table("a & b", &["<name>"], &[vec!["<script>alert(\"x\")</script>".to_owned(), "-1".to_owned()]]);
        assert!(!text.contains("<script>") && text.contains("&lt;script&gt;"), "{text}");
        assert!(text.contains("a &amp; b") && text.contains("&lt;name&gt;"), "{text}");
        assert!(text.contains("<td class=\"number\">-1</td>"), "{text}");
        assert_eq!(picture("p", &ReportDrawing::Png(b"abc".to_vec())).matches("base64,YWJj").count(), 1);
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\"></svg>\n".to_owned();
        let figure = picture("<p>", &ReportDrawing::Svg(svg));
        assert_eq!(figure, "<figure><svg width=\"1\"></svg><figcaption>&lt;p&gt;</figcaption></figure>\n");
    }

    #[test]
    fn numbers_have_a_minus_sign_and_no_negative_zero() {
        assert_eq!(number(-1.25, 1), "−1.2");
        assert_eq!(number(-0.001, 2), "0.00");
        assert_eq!(number(3.0, 0), "3");
    }
}
