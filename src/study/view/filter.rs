//! Conditions on the rows of a table, in the language of the breakpoints: `ate_rmse_m < 0.1 and run = auto`.
//!
//! Numbers are compared with columns of numbers and may have a unit (`chain_error_m < 5 mm`) and arithmetic; texts are
//! compared with columns of texts, with or without quotes. A comparison with an empty cell is false.

use crate::study::{ColumnType, StudyTable};
use crate::text::condition::{
    ComparisonOperator, ConditionProblem, Expression, Language, Number, Parser, Predicate, Token, Values, parse,
};
use crate::text::nearest_name;

/// A condition on rows; an empty one lets every row pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowFilter {
    /// Over columns of numbers by name.
    predicate: Option<Predicate<String, CellTest>>,
}

/// A property of a row other than a comparison of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CellTest {
    /// Name of a Boolean column.
    Flag(String),
    /// True if a cell is not empty.
    Has(String),
    /// True if a text column contains a text, case-insensitive.
    Contains(String, String),
    Texts(ComparisonOperator, Text, Text),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Text {
    Literal(String),
    Column(String),
}

impl RowFilter {
    /// Parses a condition for the columns of a table; an empty text lets every row pass.
    ///
    /// # Errors
    /// For a syntax error, an unknown column, or a comparison of a text with a number; the error has its column in the
    /// text.
    pub fn parse(text: &str, table: &StudyTable) -> Result<Self, ConditionProblem> {
        let predicate = if text.trim().is_empty() { None } else { Some(parse(text, table)?) };
        Ok(Self { predicate })
    }

    pub fn passes(&self, table: &StudyTable, row: usize) -> bool {
        self.predicate.as_ref().is_none_or(|predicate| predicate.holds(&Row { table, row }) == Some(true))
    }

    /// True if the filter has no condition.
    pub fn is_empty(&self) -> bool {
        self.predicate.is_none()
    }
}

/// A row of a table.
struct Row<'a> {
    table: &'a StudyTable,
    row: usize,
}

impl Values<String, CellTest> for Row<'_> {
    const MISSING: Option<bool> = Some(false);

    fn number(&self, column: &String) -> Option<f64> {
        self.table.number(self.row, column)
    }

    fn flag(&self, test: &CellTest) -> Option<bool> {
        let Row { table, row } = *self;
        Some(match test {
            CellTest::Flag(column) => table.boolean(row, column) == Some(true),
            CellTest::Has(column) => table.cell(row, column).column_type().is_some(),
            CellTest::Contains(column, part) => {
                table.text(row, column).is_some_and(|text| text.to_lowercase().contains(part.as_str()))
            }
            CellTest::Texts(comparison, left, right) => {
                let texts = left.value(table, row).zip(right.value(table, row));
                texts.is_some_and(|(left, right)| comparison.holds_for(left.cmp(right)))
            }
        })
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

type Result<T, E = ConditionProblem> = std::result::Result<T, E>;

impl Language for StudyTable {
    type Quantity = String;
    type Flag = CellTest;

    const MAX_BYTES: usize = 10_000;
    const MAX_OPERATORS: usize = 300;
    const SINGLE_EQUALS: bool = true;
    const EXAMPLES: [&str; 2] = ["ate_rmse_m < 0.1", "ate_rmse_m < 0.1 and run = auto"];

    fn operand(parser: &mut Parser<'_, Self>, number: bool) -> Result<Expression<Self>> {
        let begin = parser.begin();
        if !number && matches!(parser.peek(), Token::Quoted(_)) {
            let literal = text_literal(parser)?;
            return text_comparison(parser, Text::Literal(literal));
        }
        if !number && parser.take_call("has") {
            let (column, _) = column(parser)?;
            parser.close(begin)?;
            return Ok(Expression::Predicate(Predicate::Flag(CellTest::Has(column))));
        }
        let (column, kind) = column(parser)?;
        match kind {
            ColumnType::Number | ColumnType::Integer => {
                Ok(Expression::Number(Number::Quantity(column, parser.since(begin))))
            }
            _ if number => {
                Err(parser.problem_at(begin, format!("'{column}' holds {}, expected a number", kind.name())))
            }
            ColumnType::Text => text_comparison(parser, Text::Column(column)),
            ColumnType::Bool => flag(parser, column),
        }
    }
}

/// The column named by the next token.
fn column_here(parser: &Parser<'_, StudyTable>) -> Option<(String, ColumnType)> {
    let Token::Name(name) = parser.peek() else { return None };
    parser.language.column(name).map(|column| (name.clone(), column.values.column_type()))
}

/// Parses the name of a column.
fn column(parser: &mut Parser<'_, StudyTable>) -> Result<(String, ColumnType)> {
    if let Some(found) = column_here(parser) {
        parser.next_token();
        return Ok(found);
    }
    let Token::Name(name) = parser.peek() else {
        return Err(parser.problem("expected the name of a column or a number"));
    };
    let names = parser.language.columns().iter().map(|column| column.name.as_str());
    let near = nearest_name(name, names).filter(|(distance, _)| 2 * distance <= name.chars().count());
    let near = near.map(|(_, near)| format!("; did you mean '{near}'?")).unwrap_or_default();
    Err(parser.problem(format!("there is no column '{name}'{near}")))
}

/// Parses the rest of a comparison of a Boolean column; without one the column alone is the condition.
fn flag(parser: &mut Parser<'_, StudyTable>, column: String) -> Result<Expression<StudyTable>> {
    let span = parser.since(parser.begin());
    let Token::Compare(comparison) = *parser.peek() else {
        return Ok(Expression::Predicate(Predicate::Flag(CellTest::Flag(column))));
    };
    parser.next_token();
    let word = match parser.peek() {
        Token::Name(name) => name.to_ascii_lowercase(),
        Token::Number(number) => number.to_string(),
        _ => String::new(),
    };
    let wanted = match word.as_str() {
        "true" | "on" | "yes" | "1" => 1.0,
        "false" | "off" | "no" | "0" => 0.0,
        _ => return Err(parser.problem(format!("'{column}' is on or off: expected one of them"))),
    };
    parser.next_token();
    let (left, right) = (Number::Quantity(column, span), Number::Literal(wanted));
    Ok(Expression::Predicate(Predicate::Compared(comparison, left, right)))
}

/// Parses the rest of a comparison whose left side is a text.
fn text_comparison(parser: &mut Parser<'_, StudyTable>, left: Text) -> Result<Expression<StudyTable>> {
    let begin = parser.begin();
    let test = match (parser.next_token(), left) {
        (Token::Name(word), Text::Column(column)) if word == "contains" => {
            CellTest::Contains(column, text_literal(parser)?.to_lowercase())
        }
        (Token::Compare(comparison), left) => {
            let right = match column_here(parser) {
                Some((column, ColumnType::Text)) => {
                    parser.next_token();
                    Text::Column(column)
                }
                _ => Text::Literal(text_literal(parser)?),
            };
            CellTest::Texts(comparison, left, right)
        }
        _ => {
            let message = "this is a text; compare it, as in 'run = auto' or 'log contains city'";
            return Err(parser.problem_at(begin, message));
        }
    };
    Ok(Expression::Predicate(Predicate::Flag(test)))
}

fn text_literal(parser: &mut Parser<'_, StudyTable>) -> Result<String> {
    parser.word().ok_or_else(|| parser.problem("expected a text; put a text with spaces in quotes"))
}
