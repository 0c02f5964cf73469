//! Alignment of the numbers of a column by spaces, for a font whose characters have one width.

/// Aligns the texts of a column: the decimal points of their first numbers are below each other, then the points of their
/// second numbers, and so on; a unit after a space begins at one place, any other stays at its number. A text without a
/// number is not changed.
pub fn align_numbers<'t>(column: impl IntoIterator<Item = &'t mut String>) {
    let mut column: Vec<&mut String> = column.into_iter().collect();
    let texts: Vec<(Vec<NumberText>, String)> = column.iter().map(|text| split(text)).collect();
    let most = texts.iter().map(|(numbers, _)| numbers.len()).max().unwrap_or(0);
    let widths: Vec<Widths> = (0..most).map(|place| Widths::of(&texts, place)).collect();
    for (text, (numbers, rest)) in column.iter_mut().zip(texts).filter(|(_, (numbers, _))| !numbers.is_empty()) {
        let last = numbers.len() - 1;
        let padded = numbers.iter().zip(&widths).enumerate().map(|(place, (number, widths))| {
            let NumberText { before, whole, fraction, unit } = number;
            let [before_width, whole_width] = [widths.before, widths.whole];
            let width = if place == last { widths.fraction } else { widths.fraction.max(widths.with_unit) };
            let fraction = format!("{fraction}{unit}");
            format!("{before:<before_width$}{whole:>whole_width$}{fraction:<width$}")
        });
        let aligned: String = padded.chain([rest]).collect();
        aligned.trim_end().clone_into(text);
    }
}

/// A number in a text.
struct NumberText {
    /// Text since the number before.
    before: String,
    /// Digits before the decimal point, with the sign.
    whole: String,
    /// Rest of the number from the decimal point or the exponent.
    fraction: String,
    /// Letters after the number without a space.
    unit: String,
}

/// Largest numbers of characters of the parts of one number of each text.
struct Widths {
    before: usize,
    whole: usize,
    fraction: usize,
    /// Fraction with unit of the numbers that are not the last ones of their texts.
    with_unit: usize,
}

impl Widths {
    fn of(texts: &[(Vec<NumberText>, String)], place: usize) -> Self {
        let most = |length: &dyn Fn(&NumberText, bool) -> usize| {
            let lengths = texts.iter().filter_map(|(all, _)| Some(length(all.get(place)?, place + 1 == all.len())));
            lengths.max().unwrap_or(0)
        };
        let count = |text: &str| text.chars().count();
        Self {
            before: most(&|number, _| count(&number.before)),
            whole: most(&|number, _| count(&number.whole)),
            fraction: most(&|number, _| count(&number.fraction)),
            with_unit: most(&|number, is_last| if is_last { 0 } else { count(&number.fraction) + count(&number.unit) }),
        }
    }
}

/// Splits a text into its numbers and the text after the last one; digits after a letter are no number.
fn split(text: &str) -> (Vec<NumberText>, String) {
    let mut numbers = Vec::new();
    let (mut rest, mut from) = (text, 0);
    while let Some(at) = rest[from..].find(|letter: char| letter.is_ascii_digit()).map(|at| from + at) {
        let digits = |from: usize| rest[from..].bytes().take_while(u8::is_ascii_digit).count();
        let point = at + digits(at);
        let before = rest[..at].chars().next_back();
        if before.is_some_and(|letter| letter.is_alphanumeric() || letter == '_' || letter == '.') {
            from = point;
            continue;
        }
        let mut end = point;
        if rest[end..].starts_with('.') && digits(end + 1) > 0 {
            end += 1 + digits(end + 1);
        }
        let exponent = rest[end..].strip_prefix('e').map(|text| usize::from(text.starts_with(['-', '+'])));
        if let Some(sign) = exponent
            && digits(end + 1 + sign) > 0
        {
            end += 1 + sign + digits(end + 1 + sign);
        }
        let sign = before.filter(|letter| matches!(letter, '-' | '−' | '+' | '±')).map_or(0, char::len_utf8);
        let unit = rest[end..].find(|letter: char| letter.is_whitespace() || letter.is_ascii_digit());
        let unit_end = unit.map_or(rest.len(), |length| end + length);
        let [before, whole, fraction, unit] =
            [0..at - sign, at - sign..point, point..end, end..unit_end].map(|part| rest[part].to_owned());
        numbers.push(NumberText { before, whole, fraction, unit });
        (rest, from) = (&rest[unit_end..], 0);
    }
    (numbers, rest.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aligned<const N: usize>(texts: [&str; N]) -> [String; N] {
        let mut texts = texts.map(str::to_owned);
        align_numbers(&mut texts);
        texts
    }

    #[test]
    fn decimal_points_and_units_are_below_each_other() {
        let of_one = aligned(["-92.45 ± 0.24°", "30.0 ± 12.2 mm", "–", "7 ± 1"]);
        assert_eq!(of_one, ["-92.45 ±  0.24°", " 30.0  ± 12.2  mm", "–", "  7    ±  1"]);
        assert_eq!(aligned(["1.2e-4 m", "0.0038 px", "12"]), [" 1.2e-4 m", " 0.0038 px", "12"]);
        assert_eq!(aligned(["0.2° of 3°", "12.25 s of 14 s", "7°"]), [" 0.2° of    3°", "12.25 s of 14 s", " 7°"]);
        assert_eq!(aligned(["≥ 1", "≥ 0.0100 m/s²"]), ["≥ 1", "≥ 0.0100 m/s²"]);
    }

    #[test]
    fn signs_stand_at_their_numbers_and_names_stay_whole() {
        assert_eq!(aligned(["+0.5", "−12"]), [" +0.5", "−12"]);
        assert_eq!(aligned(["cam0 12", "cam1 3"]), ["cam0 12", "cam1  3"]);
        assert_eq!(aligned(["frame", ""]), ["frame", ""]);
    }
}
