//! Definition of a column.

use std::borrow::Cow;
use std::cmp::Ordering;

use serde::Serialize;

use super::cell::{Cell, CellValue, ColumnType};
use super::number::{Medium, significant};

/// Direction of change of a value that is worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    Larger,
    Smaller,
    /// Any change: a consistent estimator has an expected value, and deviations in both directions are worse.
    Either,
}

/// Layout of the cells of a column on a screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Text in one line.
    Label,
    Number,
    /// Text that may need several lines.
    Wrapped,
    /// Drawing without a text.
    Drawing,
}

/// Emphasis of a shown text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    Strong,
    Plain,
    Weak,
    Accent,
    Good,
    Caution,
    Bad,
}

/// Order of the rows by a column.
enum Order<Row> {
    /// By the values; rows without a value are last in both directions.
    Values,
    /// The order in which the rows come.
    Given,
    By(fn(&Row, &Row) -> Ordering),
}

/// Function of a row.
type OfRow<'a, Row, Value> = Box<dyn Fn(&Row) -> Value + 'a>;
/// Text of a row where the table is read.
type ShownText<'a, Row> = Box<dyn Fn(&Row, Medium) -> String + 'a>;

/// Definition of a column of a table with rows of type `Row`.
pub struct Column<'a, Row> {
    /// Name in files, unique in its table: lower case, with the unit at its end where there is one (`ate_rmse_m`);
    /// empty for a column that is only shown.
    pub name: Cow<'a, str>,
    /// Unit, empty for numbers without one and for text.
    pub unit: &'static str,
    /// Content of a cell in one line.
    pub meaning: Cow<'a, str>,
    pub cell_type: ColumnType,
    value: OfRow<'a, Row, Cell>,
    /// Headings on a screen and on a page; `None` where the column is not shown.
    headings: [Option<Cow<'a, str>>; 2],
    text: Option<ShownText<'a, Row>>,
    tone: Option<OfRow<'a, Row, Tone>>,
    order: Order<Row>,
    pub style: Style,
    /// True if the first click on its heading puts the largest value on top.
    pub largest_first: bool,
    /// True if the column is shown only where at least one row has a value.
    optional: bool,
    /// Change that is worse in a comparison.
    pub worse: Direction,
    /// True if equal results have different values on two machines: paths, the program, times and memory.
    pub local: bool,
    /// True if lengths are shown in millimetres.
    pub fine: bool,
}

impl<'a, Row> Column<'a, Row> {
    /// A column of files; with an empty name it is in none.
    pub fn new<Value: CellValue>(name: impl Into<Cow<'a, str>>, value: impl Fn(&Row) -> Value + 'a) -> Self {
        Self {
            name: name.into(),
            unit: "",
            meaning: Cow::Borrowed(""),
            cell_type: Value::TYPE,
            value: Box::new(move |row| value(row).into()),
            headings: [None, None],
            text: None,
            tone: None,
            order: Order::Values,
            style: if Value::TYPE == ColumnType::Text { Style::Label } else { Style::Number },
            largest_first: false,
            optional: false,
            worse: Direction::Larger,
            local: false,
            fine: false,
        }
    }

    /// A column whose values depend on the machine, such as times; comparisons of results omit it.
    pub fn local<Value: CellValue>(name: impl Into<Cow<'a, str>>, value: impl Fn(&Row) -> Value + 'a) -> Self {
        Self { local: true, ..Self::new(name, value) }
    }

    /// A column that is in no file.
    pub fn shown<Value: CellValue>(value: impl Fn(&Row) -> Value + 'a) -> Self {
        Self::new("", value)
    }

    /// A column that is only on a page, under a heading.
    pub fn page<Value: CellValue>(heading: impl Into<Cow<'a, str>>, value: impl Fn(&Row) -> Value + 'a) -> Self {
        Self::shown(value).on_page(heading)
    }

    /// One column of files for each item.
    pub fn each<Item: 'a, Value: CellValue>(
        items: impl IntoIterator<Item = Item>,
        name: impl Fn(&Item) -> String,
        value: impl Fn(&Row, &Item) -> Value + Copy + 'a,
    ) -> impl Iterator<Item = Self> {
        items.into_iter().map(move |item| Self::new(name(&item), move |row| value(row, &item)))
    }

    /// Sets the unit and the content of a cell in one line.
    pub fn means(mut self, unit: &'static str, meaning: impl Into<Cow<'a, str>>) -> Self {
        self.unit = unit;
        self.meaning = meaning.into();
        self
    }

    /// Shows the column on a screen under a heading.
    pub fn on_screen(mut self, heading: impl Into<Cow<'a, str>>) -> Self {
        self.headings[0] = Some(heading.into());
        self
    }

    /// Shows the column on a page under a heading.
    pub fn on_page(mut self, heading: impl Into<Cow<'a, str>>) -> Self {
        self.headings[1] = Some(heading.into());
        self
    }

    /// Shows the column on a screen and on a page, under different headings.
    pub fn headings(self, screen: impl Into<Cow<'a, str>>, page: impl Into<Cow<'a, str>>) -> Self {
        self.on_screen(screen).on_page(page)
    }

    /// Shows this text instead of the value.
    pub fn text(mut self, text: impl Fn(&Row, Medium) -> String + 'a) -> Self {
        self.text = Some(Box::new(text));
        self
    }

    pub fn style(mut self, style: Style) -> Self {
        self.style = style;
        self
    }

    pub fn tone(mut self, tone: impl Fn(&Row) -> Tone + 'a) -> Self {
        self.tone = Some(Box::new(tone));
        self
    }

    /// Sorts by this order instead of the values.
    pub fn order(mut self, order: fn(&Row, &Row) -> Ordering) -> Self {
        self.order = Order::By(order);
        self
    }

    /// Sorts by the order in which the rows come.
    pub fn natural(mut self) -> Self {
        self.order = Order::Given;
        self
    }

    pub fn largest_first(mut self) -> Self {
        self.largest_first = true;
        self
    }

    pub fn optional(mut self) -> Self {
        self.optional = true;
        self
    }

    pub fn worse(mut self, worse: Direction) -> Self {
        self.worse = worse;
        self
    }

    pub fn fine(mut self) -> Self {
        self.fine = true;
        self
    }

    pub fn cell(&self, row: &Row) -> Cell {
        (self.value)(row)
    }

    /// Heading where the table is read; `None` if the column is not shown there.
    pub fn heading(&self, medium: Medium) -> Option<&str> {
        self.headings[medium as usize].as_deref()
    }

    /// True if the column is shown in a table of these rows.
    pub fn is_shown<'r>(&self, medium: Medium, mut rows: impl Iterator<Item = &'r Row>) -> bool
    where
        Row: 'r,
    {
        self.heading(medium).is_some() && (!self.optional || rows.any(|row| self.cell(row) != Cell::Empty))
    }

    pub fn shown_text(&self, row: &Row, medium: Medium) -> String {
        if let Some(text) = &self.text {
            return text(row, medium);
        }
        match self.cell(row) {
            Cell::Number(number) => significant(number),
            Cell::Bool(on) => if on { "on" } else { "off" }.to_owned(),
            cell => cell.to_string(),
        }
    }

    pub fn shown_tone(&self, row: &Row) -> Tone {
        let usual = if self.style == Style::Wrapped { Tone::Plain } else { Tone::Strong };
        self.tone.as_ref().map_or(usual, |tone| tone(row))
    }

    /// Sorts rows; equal ones keep their order.
    pub fn sort(&self, rows: &mut [Row], descending: bool) {
        let directed = |order: Ordering| if descending { order.reverse() } else { order };
        let is_empty = |cell: &Cell| matches!(cell, Cell::Empty) || *cell == Cell::Text(String::new());
        match self.order {
            Order::Given if descending => rows.reverse(),
            Order::Given => {}
            Order::By(order) => rows.sort_by(|a, b| directed(order(a, b))),
            Order::Values => rows.sort_by(|a, b| {
                let (a, b) = (self.cell(a), self.cell(b));
                is_empty(&a).cmp(&is_empty(&b)).then_with(|| directed(a.order(&b)))
            }),
        }
    }
}

/// Items in the order in which they first appear, as for columns of rows with different items.
pub fn distinct<Item: PartialEq>(items: impl IntoIterator<Item = Item>) -> Vec<Item> {
    let mut known = Vec::new();
    for item in items {
        if !known.contains(&item) {
            known.push(item);
        }
    }
    known
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_a_value_are_last_in_both_directions() {
        let column = Column::new("x", |row: &Option<f64>| *row);
        let sorted = |descending: bool| {
            let mut rows = [None, Some(2.0), None, Some(1.0)];
            column.sort(&mut rows, descending);
            rows
        };
        assert_eq!(sorted(false), [Some(1.0), Some(2.0), None, None]);
        assert_eq!(sorted(true), [Some(2.0), Some(1.0), None, None]);
    }

    #[test]
    fn optional_columns_need_a_value() {
        let column = || Column::shown(|row: &Option<f64>| *row).on_screen("x").optional();
        assert!(column().is_shown(Medium::Screen, [None, Some(1.0)].iter()));
        assert!(!column().is_shown(Medium::Screen, [None].iter()));
        assert!(!column().is_shown(Medium::Page, [Some(1.0)].iter()));
    }
}
