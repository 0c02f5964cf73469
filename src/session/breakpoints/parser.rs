//! Parser of conditions, with an error message for every mistake.

use std::str::FromStr;

use super::expression::{Arithmetic, Condition, ConditionProblem, Number, Predicate, TextRange};
use super::lexer::{Token, tokens};
use super::quantities::{CAUSES, EVENTS, FLAGS, NAMED, NUMBERS, NamedNumber};
use crate::estimator::FactorKind;
use crate::flight_log::nearest_name;
use crate::text::Named as _;

/// Limit of nested parentheses and signs; deeper nesting is an error, because it could overflow the stack.
const MAX_DEPTH: usize = 60;
/// Limit of the characters of a condition.
const MAX_CHARACTERS: usize = 1_000_000;
/// Limit on the operators that join terms: the tree of a chain of `and` is as deep as the chain is long, and its
/// evaluation needs stack in proportion.
const MAX_OPERATORS: usize = 500;
/// Unit suffixes and their factors to radians, metres, seconds or pixels.
const UNITS: [(&str, f64); 11] = [
    ("deg", std::f64::consts::PI / 180.0),
    ("°", std::f64::consts::PI / 180.0),
    ("mrad", 1e-3),
    ("rad", 1.0),
    ("um", 1e-6),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("m", 1.0),
    ("ms", 1e-3),
    ("s", 1.0),
    ("px", 1.0),
];
/// Factor of a unit suffix to radians, metres, seconds or pixels.
pub(crate) fn factor_of_unit(unit: &str) -> Option<f64> {
    UNITS.iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor)
}

const FUNCTIONS: [&str; 5] = ["singular", "rise", "abs", "min", "max"];

/// A sub-expression that may be a number or a predicate.
enum Expression {
    Number(Number),
    Predicate(Predicate),
}

struct Parser<'a> {
    text: &'a str,
    tokens: Vec<(Token, TextRange)>,
    at: usize,
    depth: usize,
    operators: usize,
}

type Result<T> = std::result::Result<T, ConditionProblem>;

impl FromStr for Condition {
    type Err = ConditionProblem;

    fn from_str(text: &str) -> Result<Self> {
        parse(text)
    }
}

/// Error for a text that is too long to be shown.
fn too_long(text: &str, message: &str) -> ConditionProblem {
    let text = format!("{}…", text.chars().take(60).collect::<String>());
    ConditionProblem { text, column: 1, message: format!("the condition is too long: {message}") }
}

fn parse(text: &str) -> Result<Condition> {
    if text.len() > MAX_CHARACTERS {
        return Err(too_long(text, &format!("{} bytes, expected at most {MAX_CHARACTERS}", text.len())));
    }
    let mut parser = Parser { text, tokens: tokens(text)?, at: 0, depth: 0, operators: 0 };
    if matches!(parser.peek(), Token::End) {
        return Err(parser.problem_at(0, "a condition is missing, such as 'rank < 18 or features < 40'"));
    }
    let begin = parser.begin();
    let expression = parser.alternatives()?;
    match parser.peek() {
        Token::End => {}
        Token::Close => return Err(parser.problem("unmatched closing bracket")),
        Token::Compare(_) => return Err(parser.problem("comparisons do not chain: write 'a < b and b < c'")),
        _ => return Err(parser.problem("expected 'and', 'or' or the end of the condition")),
    }
    let predicate = parser.predicate(expression, begin)?;
    Ok(Condition { text: text.to_owned(), predicate })
}

impl Parser<'_> {
    fn peek(&self) -> &Token {
        &self.tokens[self.at.min(self.tokens.len() - 1)].0
    }

    fn span(&self) -> TextRange {
        self.tokens[self.at.min(self.tokens.len() - 1)].1
    }

    fn begin(&self) -> usize {
        self.span().begin
    }

    /// End position of the previous token.
    fn end(&self) -> usize {
        self.tokens[self.at.saturating_sub(1)].1.end
    }

    fn next(&mut self) -> Token {
        let token = self.peek().clone();
        self.at += 1;
        token
    }

    fn take(&mut self, wanted: &Token) -> bool {
        let found = self.peek() == wanted;
        self.at += usize::from(found);
        found
    }

    fn problem(&self, message: impl Into<String>) -> ConditionProblem {
        self.problem_at(self.begin(), message)
    }

    fn problem_at(&self, at: usize, message: impl Into<String>) -> ConditionProblem {
        ConditionProblem { text: self.text.to_owned(), column: at + 1, message: message.into() }
    }

    fn predicate(&self, expression: Expression, begin: usize) -> Result<Predicate> {
        match expression {
            Expression::Predicate(predicate) => Ok(predicate),
            Expression::Number(_) => Err(self.problem_at(begin, "this is a number; compare it, as in 'rank < 18'")),
        }
    }

    fn number(&self, expression: Expression, begin: usize) -> Result<Number> {
        match expression {
            Expression::Number(number) => Ok(number),
            Expression::Predicate(_) => Err(self.problem_at(begin, "this is true or false, expected a number")),
        }
    }

    fn count_operator(&mut self) -> Result<()> {
        self.operators += 1;
        if self.operators > MAX_OPERATORS {
            let message = format!("more than {MAX_OPERATORS} operators such as 'and', 'or' and '+'");
            return Err(too_long(self.text, &message));
        }
        Ok(())
    }

    fn alternatives(&mut self) -> Result<Expression> {
        self.joined(&Token::Or, Self::conjunction, Predicate::Or)
    }

    fn conjunction(&mut self) -> Result<Expression> {
        self.joined(&Token::And, Self::negation, Predicate::And)
    }

    fn joined(
        &mut self,
        operator: &Token,
        expression: fn(&mut Self) -> Result<Expression>,
        join: fn(Box<Predicate>, Box<Predicate>) -> Predicate,
    ) -> Result<Expression> {
        let begin = self.begin();
        let mut left = expression(self)?;
        while self.take(operator) {
            self.count_operator()?;
            let right_begin = self.begin();
            let right = expression(self)?;
            let (first, second) = (self.predicate(left, begin)?, self.predicate(right, right_begin)?);
            left = Expression::Predicate(join(Box::new(first), Box::new(second)));
        }
        Ok(left)
    }

    fn negation(&mut self) -> Result<Expression> {
        if !self.take(&Token::Not) {
            return self.comparison();
        }
        let begin = self.begin();
        let inner = self.deeper(Self::negation)?;
        Ok(Expression::Predicate(Predicate::Not(Box::new(self.predicate(inner, begin)?))))
    }

    fn comparison(&mut self) -> Result<Expression> {
        let begin = self.begin();
        let left = self.sum()?;
        let Token::Compare(comparison) = *self.peek() else { return Ok(left) };
        self.at += 1;
        let right_begin = self.begin();
        let right = self.sum()?;
        let (left, right) = (self.number(left, begin)?, self.number(right, right_begin)?);
        Ok(Expression::Predicate(Predicate::Compared(comparison, left, right)))
    }

    fn sum(&mut self) -> Result<Expression> {
        self.combined(Self::product, |token| match token {
            Token::Plus => Some(Arithmetic::Sum),
            Token::Minus => Some(Arithmetic::Difference),
            _ => None,
        })
    }

    fn product(&mut self) -> Result<Expression> {
        self.combined(Self::signed, |token| match token {
            Token::Times => Some(Arithmetic::Product),
            Token::Over => Some(Arithmetic::Quotient),
            _ => None,
        })
    }

    fn combined(
        &mut self,
        expression: fn(&mut Self) -> Result<Expression>,
        operator: fn(&Token) -> Option<Arithmetic>,
    ) -> Result<Expression> {
        let begin = self.begin();
        let mut left = expression(self)?;
        while let Some(arithmetic) = operator(self.peek()) {
            self.at += 1;
            self.count_operator()?;
            let right_begin = self.begin();
            let right = expression(self)?;
            let (first, second) = (self.number(left, begin)?, self.number(right, right_begin)?);
            left = Expression::Number(Number::Combined(arithmetic, Box::new(first), Box::new(second)));
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Expression> {
        if !self.take(&Token::Minus) {
            return self.primary();
        }
        let begin = self.begin();
        let inner = self.deeper(Self::signed)?;
        Ok(Expression::Number(Number::Negated(Box::new(self.number(inner, begin)?))))
    }

    fn deeper(&mut self, expression: fn(&mut Self) -> Result<Expression>) -> Result<Expression> {
        if self.depth == MAX_DEPTH {
            return Err(self.problem(format!("brackets and signs are nested more than {MAX_DEPTH} deep")));
        }
        self.depth += 1;
        let result = expression(self);
        self.depth -= 1;
        result
    }

    fn primary(&mut self) -> Result<Expression> {
        let begin = self.begin();
        match self.next() {
            Token::Number(value) => Ok(Expression::Number(Number::Literal(value * self.unit()?))),
            Token::Open => {
                let inner = self.deeper(Self::alternatives)?;
                if !self.take(&Token::Close) {
                    let message = format!("expected ')' for the bracket at column {}", begin + 1);
                    return Err(self.problem(message));
                }
                Ok(inner)
            }
            Token::Name(name) if *self.peek() == Token::Open => self.call(&name, begin),
            Token::Name(name) => self.plain(&name, begin),
            Token::End => Err(self.problem_at(begin, "the condition ends here: expected a quantity, a number or '('")),
            _ => Err(self.problem_at(begin, "expected a quantity such as 'rank', a number or '('")),
        }
    }

    /// Factor of the unit after a number; 1 without a unit.
    fn unit(&mut self) -> Result<f64> {
        if self.take(&Token::Percent) {
            return Ok(0.01);
        }
        let Token::Name(name) = self.peek() else { return Ok(1.0) };
        let unit = UNITS.iter().find(|(unit, _)| unit == name).map(|(_, factor)| *factor);
        let unit = unit.ok_or_else(|| {
            let known: Vec<&str> = UNITS.iter().map(|(unit, _)| *unit).collect();
            self.problem(format!("expected 'and', 'or' or a unit ({} or %) in place of '{name}'", known.join(", ")))
        })?;
        self.at += 1;
        Ok(unit)
    }

    fn plain(&self, name: &str, begin: usize) -> Result<Expression> {
        let span = TextRange { begin, end: self.end() };
        if let Some(number) = NUMBERS.iter().find(|known| known.name == name) {
            return Ok(Expression::Number(Number::Quantity(*number, span)));
        }
        if let Some(flag) = FLAGS.iter().find(|known| known.name == name) {
            return Ok(Expression::Predicate(Predicate::Flag(*flag)));
        }
        match name {
            "true" => return Ok(Expression::Predicate(Predicate::Literal(true))),
            "false" => return Ok(Expression::Predicate(Predicate::Literal(false))),
            _ => {}
        }
        if let Some((name, _, example, _)) = NAMED.iter().find(|(known, ..)| *known == name) {
            return Err(self.problem_at(begin, format!("'{name}' needs a name in brackets: {name}({example})")));
        }
        if name == "event" {
            return Err(self.problem_at(begin, "'event' needs a kind in brackets: event(marginalized)"));
        }
        if FUNCTIONS.contains(&name) {
            return Err(self.problem_at(begin, format!("'{name}' needs brackets: {name}(…)")));
        }
        let known = NUMBERS.iter().map(|known| known.name).chain(FLAGS.iter().map(|known| known.name));
        let known = known.chain(NAMED.iter().map(|(name, ..)| *name)).chain(FUNCTIONS).chain(["event"]);
        Err(self.problem_at(begin, unknown("quantity", name, known)))
    }

    /// A name with an argument list.
    fn call(&mut self, name: &str, begin: usize) -> Result<Expression> {
        self.at += 1;
        let inside = self.begin();
        let expression = match name {
            "event" => {
                let kind = self.name("a kind of event")?;
                let kinds = EVENTS.iter().find(|(known, _)| *known == kind).map(|(_, kinds)| kinds.to_vec());
                let known = EVENTS.iter().map(|(known, _)| *known);
                let kinds = kinds.ok_or_else(|| self.problem_at(inside, unknown("kind of event", &kind, known)))?;
                self.close(begin)?;
                Expression::Predicate(Predicate::Event(kinds, TextRange { begin, end: self.end() }))
            }
            "singular" => {
                let Token::Number(number) = self.next() else {
                    return Err(self.problem_at(inside, "expected the number of a singular value, 1 for the largest"));
                };
                if number < 1.0 || number.fract() != 0.0 || number > 1e6 {
                    return Err(self.problem_at(inside, "singular values are counted from 1, the largest first"));
                }
                self.close(begin)?;
                Expression::Number(Number::Singular(number as usize, TextRange { begin, end: self.end() }))
            }
            "rise" => {
                let inner = self.argument()?;
                self.close(begin)?;
                Expression::Number(Number::Rise(Box::new(inner), TextRange { begin, end: self.end() }))
            }
            "abs" => {
                let inner = self.argument()?;
                self.close(begin)?;
                Expression::Number(Number::Absolute(Box::new(inner)))
            }
            "min" | "max" => {
                let first = self.argument()?;
                if !self.take(&Token::Comma) {
                    return Err(self.problem(format!("expected ',' and a second number: {name}(x, y)")));
                }
                let second = self.argument()?;
                self.close(begin)?;
                let arithmetic = if name == "min" { Arithmetic::Min } else { Arithmetic::Max };
                Expression::Number(Number::Combined(arithmetic, Box::new(first), Box::new(second)))
            }
            _ => Expression::Number(self.named(name, begin)?),
        };
        Ok(expression)
    }

    fn named(&mut self, function: &str, begin: usize) -> Result<Number> {
        let inside = self.begin();
        let Some((_, kind, example, _)) = NAMED.iter().find(|(known, ..)| *known == function) else {
            let plain =
                NUMBERS.iter().any(|known| known.name == function) || FLAGS.iter().any(|known| known.name == function);
            if plain {
                return Err(self.problem_at(inside - 1, format!("'{function}' takes no brackets")));
            }
            let known = NAMED.iter().map(|(name, ..)| *name).chain(FUNCTIONS).chain(["event"]);
            return Err(self.problem_at(begin, unknown("function", function, known)));
        };
        let name = self.name(&format!("a name, as in {function}({example})"))?;
        let choices: Vec<&str> = match kind {
            NamedNumber::Lost => CAUSES.into(),
            NamedNumber::Chi2 | NamedNumber::Nis => FactorKind::all().map(FactorKind::name).collect(),
            _ => Vec::new(),
        };
        if !choices.is_empty() && !choices.contains(&name.as_str()) {
            let what = if *kind == NamedNumber::Lost { "cause" } else { "factor" };
            return Err(self.problem_at(inside, unknown(what, &name, choices.iter().copied())));
        }
        self.close(begin)?;
        Ok(Number::Named(*kind, name, TextRange { begin, end: self.end() }))
    }

    fn argument(&mut self) -> Result<Number> {
        let begin = self.begin();
        let expression = self.deeper(Self::sum)?;
        self.number(expression, begin)
    }

    fn name(&mut self, expected: &str) -> Result<String> {
        let begin = self.begin();
        match self.next() {
            Token::Name(name) | Token::Quoted(name) => Ok(name),
            _ => Err(self.problem_at(begin, format!("expected {expected}"))),
        }
    }

    fn close(&mut self, begin: usize) -> Result<()> {
        if self.take(&Token::Close) {
            return Ok(());
        }
        Err(self.problem(format!("expected ')' for the expression that begins at column {}", begin + 1)))
    }
}

/// The message for an unknown name, with the nearest known name where one is similar, else with all known names.
fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.collect();
    let near = nearest_name(name, known.iter().copied()).filter(|(far, _)| *far <= 2);
    match near {
        Some((_, near)) => format!("unknown {what} '{name}'; did you mean '{near}'?"),
        None => format!("unknown {what} '{name}'; expected one of {}", known.join(", ")),
    }
}
