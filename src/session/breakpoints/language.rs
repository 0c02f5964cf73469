//! Names of the quantities and properties of a step in the text of a condition.

use super::quantities::{CAUSES, EVENTS, FLAGS, NAMED, NUMBERS, NamedNumber, Quantity, StepFlag};
use crate::estimator::FactorKind;
use crate::text::Named as _;
use crate::text::condition::{Arithmetic, ConditionProblem, Expression, Language, Number, Parser, Predicate, Token};
use crate::text::nearest_name;

const FUNCTIONS: [&str; 5] = ["singular", "rise", "abs", "min", "max"];

/// The language of conditions on a step.
pub(super) struct StepQuantities;

type Result<T> = std::result::Result<T, ConditionProblem>;

impl Language for StepQuantities {
    type Quantity = Quantity;
    type Flag = StepFlag;

    const MAX_BYTES: usize = 1_000_000;
    const MAX_OPERATORS: usize = 500;
    const SINGLE_EQUALS: bool = false;
    const EXAMPLES: [&str; 2] = ["rank < 18", "rank < 18 or features < 40"];

    fn operand(parser: &mut Parser<'_, Self>, _number: bool) -> Result<Expression<Self>> {
        let begin = parser.begin();
        match parser.next_token() {
            Token::Name(name) if parser.take(&Token::Open) => call(parser, &name, begin),
            Token::Name(name) => plain(parser, &name, begin),
            Token::End => {
                Err(parser.problem_at(begin, "the condition ends here: expected a quantity, a number or '('"))
            }
            _ => Err(parser.problem_at(begin, "expected a quantity such as 'rank', a number or '('")),
        }
    }
}

/// A number that is a quantity, written from a position to the previous token.
fn quantity(parser: &Parser<'_, StepQuantities>, quantity: Quantity, begin: usize) -> Expression<StepQuantities> {
    Expression::Number(Number::Quantity(quantity, parser.since(begin)))
}

fn flag(flag: StepFlag) -> Expression<StepQuantities> {
    Expression::Predicate(Predicate::Flag(flag))
}

fn plain(parser: &Parser<'_, StepQuantities>, name: &str, begin: usize) -> Result<Expression<StepQuantities>> {
    if let Some(number) = NUMBERS.iter().find(|known| known.name == name) {
        return Ok(quantity(parser, Quantity::Plain(*number), begin));
    }
    if let Some(known) = FLAGS.iter().find(|known| known.name == name) {
        return Ok(flag(StepFlag::Named(*known)));
    }
    match name {
        "true" => return Ok(flag(StepFlag::Literal(true))),
        "false" => return Ok(flag(StepFlag::Literal(false))),
        _ => {}
    }
    let message = if let Some((name, _, example, _)) = NAMED.iter().find(|(known, ..)| *known == name) {
        format!("'{name}' needs a name in brackets: {name}({example})")
    } else if name == "event" {
        "'event' needs a kind in brackets: event(marginalized)".to_owned()
    } else if FUNCTIONS.contains(&name) {
        format!("'{name}' needs brackets: {name}(…)")
    } else {
        let known = NUMBERS.iter().map(|known| known.name).chain(FLAGS.iter().map(|known| known.name));
        unknown("quantity", name, known.chain(names_with_brackets()))
    };
    Err(parser.problem_at(begin, message))
}

/// A name with an argument list, whose opening bracket has been read.
fn call(parser: &mut Parser<'_, StepQuantities>, name: &str, begin: usize) -> Result<Expression<StepQuantities>> {
    let inside = parser.begin();
    let expression = match name {
        "event" => {
            let kind = parser.name("a kind of event")?;
            let kinds = EVENTS.iter().find(|(known, _)| *known == kind).map(|(_, kinds)| kinds.to_vec());
            let known = EVENTS.iter().map(|(known, _)| *known);
            let kinds = kinds.ok_or_else(|| parser.problem_at(inside, unknown("kind of event", &kind, known)))?;
            parser.close(begin)?;
            flag(StepFlag::Event(kinds))
        }
        "singular" => {
            let Token::Number(number) = parser.next_token() else {
                return Err(parser.problem_at(inside, "expected the number of a singular value, 1 for the largest"));
            };
            if number < 1.0 || number.fract() != 0.0 || number > 1e6 {
                return Err(parser.problem_at(inside, "singular values are counted from 1, the largest first"));
            }
            parser.close(begin)?;
            quantity(parser, Quantity::Singular(number as usize), begin)
        }
        "rise" => {
            let argument = Box::new(parser.argument()?);
            parser.close(begin)?;
            quantity(parser, Quantity::Rise(argument), begin)
        }
        "abs" => {
            let inner = parser.argument()?;
            parser.close(begin)?;
            Expression::Number(Number::Absolute(Box::new(inner)))
        }
        "min" | "max" => {
            let first = parser.argument()?;
            if !parser.take(&Token::Comma) {
                return Err(parser.problem(format!("expected ',' and a second number: {name}(x, y)")));
            }
            let second = parser.argument()?;
            parser.close(begin)?;
            let arithmetic = if name == "min" { Arithmetic::Min } else { Arithmetic::Max };
            Expression::Number(Number::Combined(arithmetic, Box::new(first), Box::new(second)))
        }
        _ => {
            let named = named(parser, name, [begin, inside])?;
            quantity(parser, named, begin)
        }
    };
    Ok(expression)
}

/// A quantity with an argument, by the positions of its name and of its argument.
fn named(parser: &mut Parser<'_, StepQuantities>, function: &str, [begin, inside]: [usize; 2]) -> Result<Quantity> {
    let Some((_, kind, example, _)) = NAMED.iter().find(|(known, ..)| *known == function) else {
        let plain =
            NUMBERS.iter().any(|known| known.name == function) || FLAGS.iter().any(|known| known.name == function);
        if plain {
            return Err(parser.problem_at(inside - 1, format!("'{function}' takes no brackets")));
        }
        return Err(parser.problem_at(begin, unknown("function", function, names_with_brackets())));
    };
    let name = parser.name(&format!("a name, as in {function}({example})"))?;
    let choices: Vec<&str> = match kind {
        NamedNumber::Lost => CAUSES.into(),
        NamedNumber::Chi2 | NamedNumber::Nis => FactorKind::all().map(FactorKind::name).collect(),
        _ => Vec::new(),
    };
    if !choices.is_empty() && !choices.contains(&name.as_str()) {
        let what = if *kind == NamedNumber::Lost { "cause" } else { "factor" };
        return Err(parser.problem_at(inside, unknown(what, &name, choices.iter().copied())));
    }
    parser.close(begin)?;
    Ok(Quantity::Named(*kind, name))
}

fn names_with_brackets() -> impl Iterator<Item = &'static str> {
    NAMED.iter().map(|(name, ..)| *name).chain(FUNCTIONS).chain(["event"])
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
