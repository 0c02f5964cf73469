//! Tokens of a condition's text.

use super::expression::{ComparisonOperator, ConditionProblem, TextRange};

#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    Number(f64),
    Name(String),
    Quoted(String),
    Compare(ComparisonOperator),
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
    ("<=", Token::Compare(ComparisonOperator::LessOrEqual)),
    (">=", Token::Compare(ComparisonOperator::GreaterOrEqual)),
    ("==", Token::Compare(ComparisonOperator::Equal)),
    ("!=", Token::Compare(ComparisonOperator::Unequal)),
    ("&&", Token::And),
    ("||", Token::Or),
    ("<", Token::Compare(ComparisonOperator::Less)),
    (">", Token::Compare(ComparisonOperator::Greater)),
    ("≤", Token::Compare(ComparisonOperator::LessOrEqual)),
    ("≥", Token::Compare(ComparisonOperator::GreaterOrEqual)),
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

/// The tokens with their positions; the last one is [`Token::End`]. With `single_equals` a single `=` compares as `==`
/// does.
pub(super) fn tokens(text: &str, single_equals: bool) -> Result<Vec<(Token, TextRange)>, ConditionProblem> {
    let characters: Vec<char> = text.chars().collect();
    let problem = |at: usize, message: String| ConditionProblem { text: text.to_owned(), column: at + 1, message };
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(character) = characters.get(at) {
        let begin = at;
        if character.is_whitespace() {
            at += 1;
            continue;
        }
        let token = if character.is_ascii_digit() || *character == '.' {
            at = end_of_number(&characters, at);
            let written: String = characters[begin..at].iter().collect();
            let value = written.parse::<f64>().ok().filter(|value| value.is_finite());
            Token::Number(value.ok_or_else(|| problem(begin, format!("'{written}' is not a number")))?)
        } else if character.is_alphabetic() || *character == '_' || *character == '°' {
            at = end_of_run(&characters, at, |character| character.is_alphanumeric() || "_.°".contains(character));
            let name: String = characters[begin..at].iter().collect();
            match name.to_ascii_lowercase().as_str() {
                "and" => Token::And,
                "or" => Token::Or,
                "not" => Token::Not,
                _ => Token::Name(name),
            }
        } else if *character == '"' || *character == '\'' {
            let close = characters[at + 1..].iter().position(|other| other == character);
            let close = close.ok_or_else(|| problem(begin, format!("the quote {character} is not closed")))?;
            at += close + 2;
            Token::Quoted(characters[begin + 1..at - 1].iter().collect())
        } else {
            let rest: String = characters[at..].iter().take(2).collect();
            let single = ("=", Token::Compare(ComparisonOperator::Equal));
            let signs = SIGNS.iter().chain(single_equals.then_some(&single));
            let Some((sign, token)) = signs.into_iter().find(|(sign, _)| rest.starts_with(sign)) else {
                let hint = if *character == '=' { ": write == to compare" } else { "" };
                return Err(problem(begin, format!("'{character}' has no meaning here{hint}")));
            };
            at += sign.chars().count();
            token.clone()
        };
        tokens.push((token, TextRange { begin, end: at }));
    }
    tokens.push((Token::End, TextRange { begin: characters.len(), end: characters.len() }));
    Ok(tokens)
}

fn end_of_run(characters: &[char], begin: usize, belongs: impl Fn(char) -> bool) -> usize {
    characters[begin..]
        .iter()
        .position(|character| !belongs(*character))
        .map_or(characters.len(), |length| begin + length)
}

/// End of a number literal: digits, decimal point, optional exponent.
fn end_of_number(characters: &[char], begin: usize) -> usize {
    let end = end_of_run(characters, begin, |character| character.is_ascii_digit() || character == '.');
    let exponent = characters.get(end).is_some_and(|character| "eE".contains(*character));
    let signed = usize::from(characters.get(end + 1).is_some_and(|character| "+-".contains(*character)));
    let digits = end + 1 + signed;
    if exponent && characters.get(digits).is_some_and(char::is_ascii_digit) {
        end_of_run(characters, digits, |character| character.is_ascii_digit())
    } else {
        end
    }
}
