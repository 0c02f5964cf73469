//! Conditions on the rows of a table, in the language of the breakpoints: `ate_rmse_m < 0.1 and run = auto`.
//!
//! Numbers are compared with columns of numbers and may have a unit (`chain_error_m < 5 mm`) and arithmetic; texts are
//! compared with columns of texts, with or without quotes. A comparison with an empty cell is false.

use crate::flight_log::nearest_name;
use crate::session::breakpoints::{
    ComparisonOperator, ConditionProblem, TextRange, Token, factor_of_unit, tokens_with_single_equals,
};
use crate::study::{ColumnType, StudyTable};

/// Maximum number of characters of a condition.
const MAX_CHARACTERS: usize = 10_000;
/// Maximum nesting depth of brackets, signs and `not`.
const MAX_DEPTH: usize = 60;
/// Maximum number of operators that join terms.
const MAX_OPERATORS: usize = 300;

/// A condition on rows; an empty one lets every row pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowFilter {
    predicate: Option<Predicate>,
}

#[derive(Clone, Debug, PartialEq)]
enum Predicate {
    /// A Boolean column.
    Flag(String),
    /// True if a cell is not empty.
    Has(String),
    /// True if a text column contains a text, case-insensitive.
    Contains(String, String),
    Texts(ComparisonOperator, Text, Text),
    Numbers(ComparisonOperator, Number, Number),
    Not(Box<Self>),
    All(Vec<Self>),
    Any(Vec<Self>),
}

#[derive(Clone, Debug, PartialEq)]
enum Text {
    Literal(String),
    Column(String),
}

#[derive(Clone, Debug, PartialEq)]
enum Number {
    Literal(f64),
    Column(String),
    Negated(Box<Self>),
    Combined(Sign, Box<Self>, Box<Self>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    Plus,
    Minus,
    Times,
    Over,
}

impl RowFilter {
    /// Parses a condition for the columns of a table; an empty text lets every row pass.
    ///
    /// # Errors
    /// For a syntax error, an unknown column, or a comparison of a text with a number; the error has its column in the
    /// text.
    pub fn parse(text: &str, table: &StudyTable) -> Result<Self, ConditionProblem> {
        if text.trim().is_empty() {
            return Ok(Self::default());
        }
        if text.len() > MAX_CHARACTERS {
            let text = format!("{}…", text.chars().take(60).collect::<String>());
            let message = format!("the condition is longer than {MAX_CHARACTERS} bytes");
            return Err(ConditionProblem { text, column: 1, message });
        }
        let tokens = tokens_with_single_equals(text)?;
        let mut parser = Parser { text, table, tokens, at: 0, depth: 0, operators: 0 };
        let predicate = parser.any()?;
        match parser.peek() {
            Token::End => Ok(Self { predicate: Some(predicate) }),
            Token::Close => Err(parser.problem("unmatched closing bracket")),
            _ => Err(parser.problem("expected 'and', 'or' or the end of the condition")),
        }
    }

    pub fn passes(&self, table: &StudyTable, row: usize) -> bool {
        self.predicate.as_ref().is_none_or(|predicate| predicate.holds(table, row))
    }

    /// True if the filter has no condition.
    pub fn is_empty(&self) -> bool {
        self.predicate.is_none()
    }
}

impl Predicate {
    fn holds(&self, table: &StudyTable, row: usize) -> bool {
        match self {
            Self::Flag(column) => table.boolean(row, column) == Some(true),
            Self::Has(column) => table.cell(row, column).column_type().is_some(),
            Self::Contains(column, part) => {
                table.text(row, column).is_some_and(|text| text.to_lowercase().contains(part.as_str()))
            }
            Self::Texts(comparison, left, right) => {
                let (Some(left), Some(right)) = (left.value(table, row), right.value(table, row)) else { return false };
                comparison.holds_for(left.cmp(right))
            }
            Self::Numbers(comparison, left, right) => {
                let (Some(left), Some(right)) = (left.value(table, row), right.value(table, row)) else { return false };
                comparison.holds(left, right)
            }
            Self::Not(inner) => !inner.holds(table, row),
            Self::All(parts) => parts.iter().all(|part| part.holds(table, row)),
            Self::Any(parts) => parts.iter().any(|part| part.holds(table, row)),
        }
    }
}

impl Text {
    fn value<'a>(&'a self, table: &'a StudyTable, row: usize) -> Option<&'a str> {
        match self {
            Self::Literal(text) => Some(text),
            Self::Column(column) => table.text(row, column),
        }
    }
}

impl Number {
    fn value(&self, table: &StudyTable, row: usize) -> Option<f64> {
        match self {
            Self::Literal(number) => Some(*number),
            Self::Column(column) => table.number(row, column),
            Self::Negated(inner) => Some(-inner.value(table, row)?),
            Self::Combined(sign, left, right) => {
                let (left, right) = (left.value(table, row)?, right.value(table, row)?);
                Some(match sign {
                    Sign::Plus => left + right,
                    Sign::Minus => left - right,
                    Sign::Times => left * right,
                    Sign::Over => left / right,
                })
            }
        }
    }
}

struct Parser<'a> {
    text: &'a str,
    table: &'a StudyTable,
    tokens: Vec<(Token, TextRange)>,
    at: usize,
    depth: usize,
    operators: usize,
}

type Result<T, E = ConditionProblem> = std::result::Result<T, E>;

impl Parser<'_> {
    fn peek(&self) -> &Token {
        &self.tokens[self.at.min(self.tokens.len() - 1)].0
    }

    fn span(&self) -> TextRange {
        self.tokens[self.at.min(self.tokens.len() - 1)].1
    }

    fn take(&mut self, wanted: &Token) -> bool {
        let found = self.peek() == wanted;
        self.at += usize::from(found);
        found
    }

    fn problem(&self, message: impl Into<String>) -> ConditionProblem {
        ConditionProblem { text: self.text.to_owned(), column: self.span().begin + 1, message: message.into() }
    }

    /// Parses inside one more bracket, sign or `not`.
    fn deeper<T>(&mut self, parse: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        if self.depth == MAX_DEPTH {
            return Err(self.problem(format!("more than {MAX_DEPTH} nested brackets, signs and 'not'")));
        }
        self.depth += 1;
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }

    fn count_operator(&mut self) -> Result<()> {
        self.operators += 1;
        if self.operators > MAX_OPERATORS {
            return Err(self.problem(format!("more than {MAX_OPERATORS} operators")));
        }
        Ok(())
    }

    fn any(&mut self) -> Result<Predicate> {
        let mut parts = vec![self.all()?];
        while self.take(&Token::Or) {
            self.count_operator()?;
            parts.push(self.all()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Predicate::Any(parts) })
    }

    fn all(&mut self) -> Result<Predicate> {
        let mut parts = vec![self.term()?];
        while self.take(&Token::And) {
            self.count_operator()?;
            parts.push(self.term()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Predicate::All(parts) })
    }

    fn term(&mut self) -> Result<Predicate> {
        if self.take(&Token::Not) {
            return Ok(Predicate::Not(Box::new(self.deeper(Self::term)?)));
        }
        if *self.peek() == Token::Open && self.bracket_is_condition() {
            self.at += 1;
            let inner = self.deeper(Self::any)?;
            return if self.take(&Token::Close) { Ok(inner) } else { Err(self.problem("expected ')'")) };
        }
        if let (Token::Name(name), Some((Token::Open, _))) = (self.peek().clone(), self.tokens.get(self.at + 1))
            && name == "has"
        {
            self.at += 2;
            let (column, _) = self.column()?;
            return if self.take(&Token::Close) {
                Ok(Predicate::Has(column))
            } else {
                Err(self.problem("expected ')'"))
            };
        }
        if let Some((column, kind)) = self.column_here() {
            match kind {
                ColumnType::Text => return self.text_comparison(Text::Column(column), 1),
                ColumnType::Bool => return self.flag(column),
                ColumnType::Number | ColumnType::Integer => {}
            }
        } else if matches!(self.peek(), Token::Quoted(_)) {
            let literal = self.text_literal()?;
            return self.text_comparison(Text::Literal(literal), 0);
        }
        let left = self.sum()?;
        let Token::Compare(comparison) = *self.peek() else {
            return Err(self.problem("expected a comparison, as in 'ate_rmse_m < 0.1'"));
        };
        self.at += 1;
        Ok(Predicate::Numbers(comparison, left, self.sum()?))
    }

    /// True if the bracket at this position contains a condition, false if it begins an arithmetic expression.
    fn bracket_is_condition(&self) -> bool {
        let mut open = 0_usize;
        for (token, _) in &self.tokens[self.at..] {
            match token {
                Token::Open => open += 1,
                Token::Close if open == 1 => return self.is_flag(self.at + 1),
                Token::Close => open -= 1,
                Token::Compare(_) | Token::And | Token::Or | Token::Not => return true,
                Token::Name(name) if name == "contains" || name == "has" => return true,
                _ => {}
            }
        }
        false
    }

    fn is_flag(&self, at: usize) -> bool {
        let Some((Token::Name(name), _)) = self.tokens.get(at) else { return false };
        self.table.column(name).is_some_and(|column| column.values.column_type() == ColumnType::Bool)
    }

    /// The column named by the token at this position.
    fn column_here(&self) -> Option<(String, ColumnType)> {
        let Token::Name(name) = self.peek() else { return None };
        self.table.column(name).map(|column| (name.clone(), column.values.column_type()))
    }

    /// Consumes the name of a column.
    fn column(&mut self) -> Result<(String, ColumnType)> {
        let found = self.column_here().ok_or_else(|| self.no_column())?;
        self.at += 1;
        Ok(found)
    }

    fn no_column(&self) -> ConditionProblem {
        let Token::Name(name) = self.peek() else { return self.problem("expected the name of a column or a number") };
        let names = self.table.columns().iter().map(|column| column.name.as_str());
        let near = nearest_name(name, names).filter(|(distance, _)| 2 * distance <= name.chars().count());
        let near = near.map(|(_, near)| format!("; did you mean '{near}'?")).unwrap_or_default();
        self.problem(format!("there is no column '{name}'{near}"))
    }

    /// A comparison of a Boolean column, or the column alone.
    fn flag(&mut self, column: String) -> Result<Predicate> {
        self.at += 1;
        let Token::Compare(comparison) = *self.peek() else { return Ok(Predicate::Flag(column)) };
        self.at += 1;
        let word = match self.peek() {
            Token::Name(name) => name.to_ascii_lowercase(),
            Token::Number(number) => number.to_string(),
            _ => String::new(),
        };
        let wanted = match word.as_str() {
            "true" | "on" | "yes" | "1" => 1.0,
            "false" | "off" | "no" | "0" => 0.0,
            _ => return Err(self.problem(format!("'{column}' is on or off: expected one of them"))),
        };
        self.at += 1;
        Ok(Predicate::Numbers(comparison, Number::Column(column), Number::Literal(wanted)))
    }

    /// A comparison whose left side is a text; `skip` of its tokens are not yet consumed.
    fn text_comparison(&mut self, left: Text, skip: usize) -> Result<Predicate> {
        self.at += skip;
        if let (Token::Name(word), Text::Column(column)) = (self.peek(), &left)
            && word == "contains"
        {
            let column = column.clone();
            self.at += 1;
            return Ok(Predicate::Contains(column, self.text_literal()?.to_lowercase()));
        }
        let Token::Compare(comparison) = *self.peek() else {
            return Err(self.problem("this is a text; compare it, as in 'run = auto' or 'log contains city'"));
        };
        self.at += 1;
        let right = match self.column_here() {
            Some((column, ColumnType::Text)) => {
                self.at += 1;
                Text::Column(column)
            }
            _ => Text::Literal(self.text_literal()?),
        };
        Ok(Predicate::Texts(comparison, left, right))
    }

    /// A quoted text, or everything up to the next space or bracket: `not-initialized`.
    fn text_literal(&mut self) -> Result<String> {
        if let Token::Quoted(text) = self.peek().clone() {
            self.at += 1;
            return Ok(text);
        }
        let begin = self.span().begin;
        let mut end = begin;
        while !matches!(self.peek(), Token::End | Token::Open | Token::Close) && self.span().begin == end {
            end = self.span().end;
            self.at += 1;
        }
        if end == begin {
            return Err(self.problem("expected a text; put a text with spaces in quotes"));
        }
        Ok(self.text.chars().skip(begin).take(end - begin).collect())
    }

    fn sum(&mut self) -> Result<Number> {
        let mut left = self.product()?;
        loop {
            let sign = match self.peek() {
                Token::Plus => Sign::Plus,
                Token::Minus => Sign::Minus,
                _ => return Ok(left),
            };
            self.at += 1;
            self.count_operator()?;
            left = Number::Combined(sign, Box::new(left), Box::new(self.product()?));
        }
    }

    fn product(&mut self) -> Result<Number> {
        let mut left = self.factor()?;
        loop {
            let sign = match self.peek() {
                Token::Times => Sign::Times,
                Token::Over => Sign::Over,
                _ => return Ok(left),
            };
            self.at += 1;
            self.count_operator()?;
            left = Number::Combined(sign, Box::new(left), Box::new(self.factor()?));
        }
    }

    fn factor(&mut self) -> Result<Number> {
        if self.take(&Token::Minus) {
            return Ok(Number::Negated(Box::new(self.deeper(Self::factor)?)));
        }
        if self.take(&Token::Open) {
            let inner = self.deeper(Self::sum)?;
            return if self.take(&Token::Close) { Ok(inner) } else { Err(self.problem("expected ')'")) };
        }
        if let Token::Number(number) = *self.peek() {
            self.at += 1;
            let unit = if let Token::Name(unit) = self.peek() { factor_of_unit(unit) } else { None };
            self.at += usize::from(unit.is_some());
            return Ok(Number::Literal(number * unit.unwrap_or(1.0)));
        }
        let begin = self.at;
        let (column, kind) = self.column()?;
        if matches!(kind, ColumnType::Text | ColumnType::Bool) {
            self.at = begin;
            return Err(self.problem(format!("'{column}' holds {}, expected a number", kind.name())));
        }
        Ok(Number::Column(column))
    }
}
