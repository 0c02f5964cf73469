//! Fuzzy match of a text with typed words.

/// Match of a text with typed words, in any order and with letters omitted. Higher is better; `None` if a word does not
/// match. An empty input matches every text equally.
pub(super) fn score(typed: &str, text: &str) -> Option<i32> {
    let text = text.to_lowercase();
    typed.to_lowercase().split_whitespace().map(|word| word_score(word, &text)).sum()
}

/// The best match of: at the start of a word, within a word, as letters in order.
fn word_score(word: &str, text: &str) -> Option<i32> {
    /// Largest penalty for the distance of a match from the start.
    const MAX_PENALTY: usize = 20;
    let begins = |at: usize| !text[..at].chars().next_back().is_some_and(char::is_alphanumeric);
    let places = text.match_indices(word).map(|(at, _)| at);
    let near = |at: usize| i32::try_from(at.min(MAX_PENALTY)).unwrap_or(0);
    let whole = places.map(|at| if begins(at) { 100 - near(at) } else { 60 - near(at) }).max();
    whole.or_else(|| scattered(word, text))
}

/// Match of letters in order with others in between; starts of words increase the result, gaps reduce it.
fn scattered(word: &str, text: &str) -> Option<i32> {
    /// Maximum number of skipped letters between the first and the last match.
    const MAX_GAP: i32 = 16;
    let mut wanted = word.chars().peekable();
    let (mut begins, mut holes, mut begun, mut before) = (0, 0, false, ' ');
    for letter in text.chars() {
        let Some(next) = wanted.peek() else { break };
        if letter == *next {
            begins += i32::from(!before.is_alphanumeric());
            begun = true;
            wanted.next();
        } else if begun {
            holes += 1;
        }
        before = letter;
    }
    (wanted.peek().is_none() && holes <= MAX_GAP).then(|| 20 + 4 * begins - holes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn begins_of_words_come_before_middles_before_scattered_letters() {
        let of = |text: &str| score("br", text).unwrap();
        assert!(of("Breakpoint") > of("Set a breakpoint") && of("Set a breakpoint") > of("Abroad"));
        assert!(of("Abroad") > of("Back to the rank"));
        assert_eq!(score("xq", "Back to the rank"), None);
    }

    #[test]
    fn words_may_come_in_any_order_and_all_must_be_there() {
        assert!(score("layout cal", "Layout: calibration").is_some());
        assert!(score("cal LAY", "Layout: calibration").is_some());
        assert_eq!(score("cal scene", "Layout: calibration"), None);
        assert_eq!(score("", "anything"), Some(0));
        assert!(score("°", "5° and more").is_some());
    }
}
