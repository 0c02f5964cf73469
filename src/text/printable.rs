//! Readable text: names of logs and rigs, safe for a terminal and short enough for a table, with a search of similar
//! names; counts with their noun; commands for a shell.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

/// File name of a log without its folder.
pub fn log_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// True if a character can change the display of the text around it: control characters (C0, DEL, C1), line and
/// paragraph separators, marks that reorder text (bidirectional overrides, embeddings and isolates).
fn is_unprintable(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str, keeps: impl Fn(char) -> bool) -> Cow<'_, str> {
    let escapes = |letter: char| is_unprintable(letter) && !keeps(letter);
    if !text.contains(escapes) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for letter in text.chars() {
        match letter {
            letter if !escapes(letter) => out.push(letter),
            '\n' | '\r' | '\t' => out.extend(letter.escape_default()),
            // Writing to a string cannot fail.
            letter => {
                let _infallible = write!(out, "\\u{{{:x}}}", u32::from(letter));
            }
        }
    }
    Cow::Owned(out)
}

/// Text without the byte order mark that some editors and spreadsheets write at its start.
pub fn without_bom(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// Name of external origin (topic, frame, joint, file) for one line of text: characters that control a terminal or
/// reorder text are written as escapes such as `\u{1b}` and `\n`.
pub fn printable(name: &str) -> Cow<'_, str> {
    escaped(name, |_| false)
}

/// [`printable`] for a text of several lines, whose line breaks and tabs are kept.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |letter| letter == '\n' || letter == '\t')
}

/// Printable name of at most `max_length` characters; the middle of a longer one is replaced by an ellipsis.
pub fn shortened(name: &str, max_length: usize) -> Cow<'_, str> {
    let name = printable(name);
    let count = name.chars().count();
    if count <= max_length {
        return name;
    }
    let kept = max_length.saturating_sub(1);
    let head: String = name.chars().take(kept.div_ceil(2)).collect();
    let tail: String = name.chars().skip(count - kept / 2).collect();
    Cow::Owned(format!("{head}…{tail}"))
}

/// Text in which zeros have no minus sign: `-0.0 ms` becomes `0.0 ms`.
pub fn without_signed_zeros(text: String) -> String {
    let is_number = |letter: char| letter.is_ascii_digit() || letter == '.';
    let mut out = String::new();
    let mut rest = text.as_str();
    while let Some(at) = rest.find("-0") {
        let (before, number) = rest.split_at(at);
        out.push_str(before);
        let end = number[1..].find(|letter| !is_number(letter)).map_or(number.len(), |end| end + 1);
        let (digits, behind) = (&number[1..end], &number[end..]);
        // A range `3-0`, a date or a name is no negative number, nor is the start of `-0e5` or `-0x1`.
        let begins = !out.ends_with(|letter: char| letter.is_alphanumeric() || "/._-".contains(letter));
        let ends = !behind.starts_with(|letter: char| letter.is_alphanumeric() || "_-".contains(letter));
        let is_zero = digits.chars().all(|letter| letter == '0' || letter == '.');
        out.push_str(if begins && ends && is_zero { digits } else { &number[..end] });
        rest = behind;
    }
    if out.is_empty() {
        return text;
    }
    out.push_str(rest);
    out
}

/// Edit distance: number of characters to replace, insert or delete.
pub fn edit_distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (index, letter) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], index + 1);
        for (place, other) in to.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[place + 1];
            row[place + 1] = changed.min(diagonal + 1).min(row[place] + 1);
        }
    }
    row[to.len()]
}

/// Known name with the smallest edit distance, and that distance; the first in the alphabet among equals.
pub fn nearest_name<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<(usize, &'a str)> {
    // Bounds the time for a name of a megabyte.
    let name: String = name.chars().take(256).collect();
    known.into_iter().map(|known| (edit_distance(&name, known), known)).min()
}

/// A count with its noun: `1 run`, `2 runs`.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The words of a command, quoted where a shell needs it; the first one is the program.
pub fn command_line(words: impl IntoIterator<Item = String>) -> String {
    words.into_iter().map(quoted).collect::<Vec<_>>().join(" ")
}

fn quoted(word: String) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "/._-:=,+".contains(letter);
    if !word.is_empty() && word.chars().all(plain) { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_controls_are_escaped() {
        assert_eq!(printable("/camera/größe"), "/camera/größe");
        assert_eq!(printable("a\u{1b}[2Jb\n\u{7f}\u{9b}"), r"a\u{1b}[2Jb\n\u{7f}\u{9b}");
        assert_eq!(printable("\u{202e}gpj.exe\u{2066}"), r"\u{202e}gpj.exe\u{2066}");
        assert_eq!(printable_lines("a\tb\nc\rd\u{1b}"), "a\tb\nc\\rd\\u{1b}");
    }

    #[test]
    fn zeros_have_no_sign() {
        let check = |text: &str, expected: &str| assert_eq!(without_signed_zeros(text.to_owned()), expected);
        check("readout -0.0 ms ± 0.4 ms, (-0.00, -0, +0.0)", "readout 0.0 ms ± 0.4 ms, (0.00, 0, +0.0)");
        check("-0", "0");
        check("-0.0 s. Then -0.", "0.0 s. Then 0.");
        for same in ["-0.01 s", "-10.0", "2020-00-00", "cam-0", "a -0.05e3", "-0x10", "3-0", "", "no number", "--0.0"] {
            check(same, same);
        }
    }

    #[test]
    fn long_names_are_cut_in_their_middle() {
        assert_eq!(shortened("/imu", 4), "/imu");
        assert_eq!(shortened("/abcdefgh", 5), "/a…gh");
        assert_eq!(shortened(&"x".repeat(100_000), 40).chars().count(), 40);
        assert_eq!(shortened("\u{1b}", 3), r"\…}");
    }

    #[test]
    fn the_nearest_name_is_found() {
        let known = ["timeshift_cam_imu", "T_cam_imu", "limits"];
        assert_eq!(nearest_name("timeshift_cam_imuu", known), Some((1, "timeshift_cam_imu")));
        assert_eq!(nearest_name("limit", known), Some((1, "limits")));
        assert_eq!(nearest_name("x", []), None);
    }

    #[test]
    fn one_is_singular() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "topic")), ["0 topics", "1 topic", "2 topics"]);
    }

    #[test]
    fn commands_can_be_typed_again() {
        let words = ["dcvins", "report", "my log.mcap", "--run", "auto:name=it's", ""].map(str::to_owned);
        assert_eq!(command_line(words), r"dcvins report 'my log.mcap' --run 'auto:name=it'\''s' ''");
    }
}
