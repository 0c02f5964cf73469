//! Parser of conditions, with an error message for every mistake.

use super::expression::{Arithmetic, ConditionProblem, Number, Predicate, TextRange};
use super::lexer::{Token, tokens};

/// Limit of nested brackets and signs; deeper nesting is an error, because it could overflow the stack.
const MAX_DEPTH: usize = 60;
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

/// Names in a condition, and the differences of its grammar.
pub trait Language: Sized {
    /// A quantity that is a number.
    type Quantity;
    /// A property that is true or false.
    type Flag;

    /// Limit of the bytes of a condition.
    const MAX_BYTES: usize;
    /// Limit of the operators that join terms: the tree of a chain of `and` is as deep as the chain is long, and its
    /// evaluation needs stack in proportion.
    const MAX_OPERATORS: usize;
    /// True if a single `=` compares.
    const SINGLE_EQUALS: bool;
    /// A comparison and a whole condition, for messages.
    const EXAMPLES: [&str; 2];

    /// Parses an operand that is neither a literal number nor a bracket; `number` is true where only a number is
    /// meaningful.
    fn operand(parser: &mut Parser<'_, Self>, number: bool) -> Result<Expression<Self>>;
}

/// A sub-expression that may be a number or a predicate.
pub enum Expression<L: Language> {
    Number(Number<L::Quantity>),
    Predicate(Condition<L>),
}

/// A whole condition of a language.
pub(crate) type Condition<L> = Predicate<<L as Language>::Quantity, <L as Language>::Flag>;

/// Position of the parser in the tokens of a text.
pub struct Parser<'a, L> {
    pub language: &'a L,
    text: &'a str,
    tokens: Vec<(Token, TextRange)>,
    at: usize,
    depth: usize,
    operators: usize,
    number: bool,
}

type Result<T> = std::result::Result<T, ConditionProblem>;

/// Error for a text that is too long to be shown.
fn too_long(text: &str, message: &str) -> ConditionProblem {
    let text = format!("{}…", text.chars().take(60).collect::<String>());
    ConditionProblem { text, column: 1, message: format!("the condition is too long: {message}") }
}

/// Parses a condition in a language.
pub fn parse<L: Language>(text: &str, language: &L) -> Result<Condition<L>> {
    if text.len() > L::MAX_BYTES {
        return Err(too_long(text, &format!("{} bytes, expected at most {}", text.len(), L::MAX_BYTES)));
    }
    let tokens = tokens(text, L::SINGLE_EQUALS)?;
    let mut parser = Parser { language, text, tokens, at: 0, depth: 0, operators: 0, number: false };
    if matches!(parser.peek(), Token::End) {
        return Err(parser.problem_at(0, format!("a condition is missing, such as '{}'", L::EXAMPLES[1])));
    }
    let begin = parser.begin();
    let expression = parser.alternatives()?;
    match parser.peek() {
        Token::End => {}
        Token::Close => return Err(parser.problem("unmatched closing bracket")),
        Token::Compare(_) => return Err(parser.problem("comparisons do not chain: write 'a < b and b < c'")),
        _ => return Err(parser.problem("expected 'and', 'or' or the end of the condition")),
    }
    parser.predicate(expression, begin)
}

impl<L: Language> Parser<'_, L> {
    pub fn peek(&self) -> &Token {
        &self.tokens[self.at.min(self.tokens.len() - 1)].0
    }

    fn span(&self) -> TextRange {
        self.tokens[self.at.min(self.tokens.len() - 1)].1
    }

    /// Start position of the next token.
    pub fn begin(&self) -> usize {
        self.span().begin
    }

    /// Range from a position to the end of the previous token.
    pub fn since(&self, begin: usize) -> TextRange {
        TextRange { begin, end: self.tokens[self.at.saturating_sub(1)].1.end }
    }

    pub fn next_token(&mut self) -> Token {
        let token = self.peek().clone();
        self.at += 1;
        token
    }

    pub fn take(&mut self, wanted: &Token) -> bool {
        let found = self.peek() == wanted;
        self.at += usize::from(found);
        found
    }

    /// Takes the name of a function with its opening bracket.
    pub fn take_call(&mut self, function: &str) -> bool {
        let is_name = matches!(self.peek(), Token::Name(name) if name == function);
        let found = is_name && self.tokens.get(self.at + 1).is_some_and(|(token, _)| *token == Token::Open);
        self.at += 2 * usize::from(found);
        found
    }

    pub fn problem(&self, message: impl Into<String>) -> ConditionProblem {
        self.problem_at(self.begin(), message)
    }

    pub fn problem_at(&self, at: usize, message: impl Into<String>) -> ConditionProblem {
        ConditionProblem { text: self.text.to_owned(), column: at + 1, message: message.into() }
    }

    fn predicate(&self, expression: Expression<L>, begin: usize) -> Result<Condition<L>> {
        match expression {
            Expression::Predicate(predicate) => Ok(predicate),
            Expression::Number(_) => {
                let message = format!("this is a number; compare it, as in '{}'", L::EXAMPLES[0]);
                Err(self.problem_at(begin, message))
            }
        }
    }

    fn number(&self, expression: Expression<L>, begin: usize) -> Result<Number<L::Quantity>> {
        match expression {
            Expression::Number(number) => Ok(number),
            Expression::Predicate(_) => Err(self.problem_at(begin, "this is true or false, expected a number")),
        }
    }

    fn count_operator(&mut self) -> Result<()> {
        self.operators += 1;
        if self.operators > L::MAX_OPERATORS {
            let message = format!("more than {} operators such as 'and', 'or' and '+'", L::MAX_OPERATORS);
            return Err(too_long(self.text, &message));
        }
        Ok(())
    }

    fn alternatives(&mut self) -> Result<Expression<L>> {
        self.joined(&Token::Or, Self::conjunction)
    }

    fn conjunction(&mut self) -> Result<Expression<L>> {
        self.joined(&Token::And, Self::negation)
    }

    fn joined(
        &mut self,
        operator: &Token,
        expression: fn(&mut Self) -> Result<Expression<L>>,
    ) -> Result<Expression<L>> {
        let begin = self.begin();
        let mut left = expression(self)?;
        while self.take(operator) {
            self.count_operator()?;
            let right_begin = self.begin();
            let right = expression(self)?;
            let (first, second) = (self.predicate(left, begin)?, self.predicate(right, right_begin)?);
            let (first, second) = (Box::new(first), Box::new(second));
            left = Expression::Predicate(match operator {
                Token::Or => Predicate::Or(first, second),
                _ => Predicate::And(first, second),
            });
        }
        Ok(left)
    }

    fn negation(&mut self) -> Result<Expression<L>> {
        if !self.take(&Token::Not) {
            return self.comparison();
        }
        let begin = self.begin();
        let inner = self.deeper(Self::negation)?;
        Ok(Expression::Predicate(Predicate::Not(Box::new(self.predicate(inner, begin)?))))
    }

    fn comparison(&mut self) -> Result<Expression<L>> {
        let begin = self.begin();
        let left = self.sum()?;
        let Token::Compare(comparison) = *self.peek() else { return Ok(left) };
        self.at += 1;
        let right = self.operand_number(Self::sum)?;
        Ok(Expression::Predicate(Predicate::Compared(comparison, self.number(left, begin)?, right)))
    }

    fn sum(&mut self) -> Result<Expression<L>> {
        self.combined(Self::product, |token| match token {
            Token::Plus => Some(Arithmetic::Sum),
            Token::Minus => Some(Arithmetic::Difference),
            _ => None,
        })
    }

    fn product(&mut self) -> Result<Expression<L>> {
        self.combined(Self::signed, |token| match token {
            Token::Times => Some(Arithmetic::Product),
            Token::Over => Some(Arithmetic::Quotient),
            _ => None,
        })
    }

    fn combined(
        &mut self,
        expression: fn(&mut Self) -> Result<Expression<L>>,
        operator: fn(&Token) -> Option<Arithmetic>,
    ) -> Result<Expression<L>> {
        let begin = self.begin();
        let mut left = expression(self)?;
        while let Some(arithmetic) = operator(self.peek()) {
            self.at += 1;
            self.count_operator()?;
            let second = self.operand_number(expression)?;
            let first = self.number(left, begin)?;
            left = Expression::Number(Number::Combined(arithmetic, Box::new(first), Box::new(second)));
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Expression<L>> {
        if !self.take(&Token::Minus) {
            return self.primary();
        }
        let inner = self.operand_number(|parser| parser.deeper(Self::signed))?;
        Ok(Expression::Number(Number::Negated(Box::new(inner))))
    }

    /// Parses an expression that has to be a number.
    fn operand_number(&mut self, expression: fn(&mut Self) -> Result<Expression<L>>) -> Result<Number<L::Quantity>> {
        let begin = self.begin();
        let outside = std::mem::replace(&mut self.number, true);
        let parsed = expression(self)?;
        self.number = outside;
        self.number(parsed, begin)
    }

    fn deeper(&mut self, expression: fn(&mut Self) -> Result<Expression<L>>) -> Result<Expression<L>> {
        if self.depth == MAX_DEPTH {
            return Err(self.problem(format!("brackets and signs are nested more than {MAX_DEPTH} deep")));
        }
        self.depth += 1;
        let result = expression(self);
        self.depth -= 1;
        result
    }

    fn primary(&mut self) -> Result<Expression<L>> {
        let begin = self.begin();
        match *self.peek() {
            Token::Number(value) => {
                self.at += 1;
                Ok(Expression::Number(Number::Literal(value * self.unit()?)))
            }
            Token::Open => {
                self.at += 1;
                let inner = self.deeper(Self::alternatives)?;
                if !self.take(&Token::Close) {
                    let message = format!("expected ')' for the bracket at column {}", begin + 1);
                    return Err(self.problem(message));
                }
                Ok(inner)
            }
            _ => L::operand(self, self.number),
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

    /// Parses the argument of a function, a number.
    pub fn argument(&mut self) -> Result<Number<L::Quantity>> {
        self.operand_number(|parser| parser.deeper(Self::sum))
    }

    /// Parses a name, with or without quotes; `expected` is its description in the message.
    pub fn name(&mut self, expected: &str) -> Result<String> {
        let begin = self.begin();
        match self.next_token() {
            Token::Name(name) | Token::Quoted(name) => Ok(name),
            _ => Err(self.problem_at(begin, format!("expected {expected}"))),
        }
    }

    /// Parses the closing bracket of an expression that begins at a position.
    pub fn close(&mut self, begin: usize) -> Result<()> {
        if self.take(&Token::Close) {
            return Ok(());
        }
        Err(self.problem(format!("expected ')' for the expression that begins at column {}", begin + 1)))
    }

    /// Parses a quoted text, or everything up to the next space or bracket, such as `not-initialized`; `None` if there
    /// is nothing.
    pub fn word(&mut self) -> Option<String> {
        if let Token::Quoted(text) = self.peek().clone() {
            self.at += 1;
            return Some(text);
        }
        let begin = self.begin();
        let mut end = begin;
        while !matches!(self.peek(), Token::End | Token::Open | Token::Close) && self.begin() == end {
            end = self.span().end;
            self.at += 1;
        }
        (end > begin).then(|| self.text.chars().skip(begin).take(end - begin).collect())
    }
}
