//! Tokens of a condition's text.

use super::expression::{Comparison, ConditionProblem, Span};

/// A token of the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Number(f64),
    Name(String),
    /// A quoted name.
    Quoted(String),
    Compare(Comparison),
    Plus,
    Minus,
    Times,
    Over,
    Open,
    Close,
    Comma,
    And,
    Or,
    Not,
    Percent,
    End,
}

/// Operators and punctuation, longer ones first.
const SIGNS: [(&str, Token); 19] = [
    ("<=", Token::Compare(Comparison::AtMost)),
    (">=", Token::Compare(Comparison::AtLeast)),
    ("==", Token::Compare(Comparison::Equal)),
    ("!=", Token::Compare(Comparison::Unequal)),
    ("&&", Token::And),
    ("||", Token::Or),
    ("<", Token::Compare(Comparison::Less)),
    (">", Token::Compare(Comparison::Greater)),
    ("≤", Token::Compare(Comparison::AtMost)),
    ("≥", Token::Compare(Comparison::AtLeast)),
    ("!", Token::Not),
    ("+", Token::Plus),
    ("-", Token::Minus),
    ("*", Token::Times),
    ("/", Token::Over),
    ("(", Token::Open),
    (")", Token::Close),
    (",", Token::Comma),
    ("%", Token::Percent),
];

/// The tokens with their positions; the last one is [`Token::End`].
pub(super) fn words(text: &str) -> Result<Vec<(Token, Span)>, ConditionProblem> {
    let letters: Vec<char> = text.chars().collect();
    let problem = |at: usize, message: String| ConditionProblem { text: text.to_owned(), column: at + 1, message };
    let mut words = Vec::new();
    let mut at = 0;
    while let Some(letter) = letters.get(at) {
        let begin = at;
        if letter.is_whitespace() {
            at += 1;
            continue;
        }
        let token = if letter.is_ascii_digit() || *letter == '.' {
            at = end_of_number(&letters, at);
            let written: String = letters[begin..at].iter().collect();
            let value = written.parse::<f64>().ok().filter(|value| value.is_finite());
            Token::Number(value.ok_or_else(|| problem(begin, format!("'{written}' is no number")))?)
        } else if letter.is_alphabetic() || *letter == '_' || *letter == '°' {
            at = run_of(&letters, at, |letter| letter.is_alphanumeric() || "_.°".contains(letter));
            let name: String = letters[begin..at].iter().collect();
            match name.to_ascii_lowercase().as_str() {
                "and" => Token::And,
                "or" => Token::Or,
                "not" => Token::Not,
                _ => Token::Name(name),
            }
        } else if *letter == '"' || *letter == '\'' {
            let close = letters[at + 1..].iter().position(|other| other == letter);
            let close = close.ok_or_else(|| problem(begin, format!("the quote {letter} is not closed")))?;
            at += close + 2;
            Token::Quoted(letters[begin + 1..at - 1].iter().collect())
        } else {
            let rest: String = letters[at..].iter().take(2).collect();
            let Some((sign, token)) = SIGNS.iter().find(|(sign, _)| rest.starts_with(sign)) else {
                let hint = if *letter == '=' { ": write == to compare" } else { "" };
                return Err(problem(begin, format!("'{letter}' has no meaning here{hint}")));
            };
            at += sign.chars().count();
            token.clone()
        };
        words.push((token, Span { begin, end: at }));
    }
    words.push((Token::End, Span { begin: letters.len(), end: letters.len() }));
    Ok(words)
}

fn run_of(letters: &[char], begin: usize, belongs: impl Fn(char) -> bool) -> usize {
    letters[begin..].iter().position(|letter| !belongs(*letter)).map_or(letters.len(), |length| begin + length)
}

/// End of a number literal: digits, decimal point, optional exponent.
fn end_of_number(letters: &[char], begin: usize) -> usize {
    let end = run_of(letters, begin, |letter| letter.is_ascii_digit() || letter == '.');
    let exponent = letters.get(end).is_some_and(|letter| "eE".contains(*letter));
    let signed = usize::from(letters.get(end + 1).is_some_and(|letter| "+-".contains(*letter)));
    let digits = end + 1 + signed;
    if exponent && letters.get(digits).is_some_and(char::is_ascii_digit) {
        run_of(letters, digits, |letter| letter.is_ascii_digit())
    } else {
        end
    }
}
