//! The rows that pass the filter, sorted and grouped.

use std::cmp::Ordering;

use super::filter::RowFilter;
use super::study::columns;
use crate::study::{Cell, ColumnType, StudyTable};

/// A column by which rows are sorted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SortKey {
    pub column: String,
    /// True for largest first; empty cells are last in both directions.
    pub descending: bool,
}

/// Rows with the same value in the grouping column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowGroup {
    /// The value as text; empty without a grouping column, and for empty cells.
    pub name: String,
    /// Row indices in the order of the sort keys.
    pub rows: Vec<usize>,
}

/// The rows of a table as shown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Arranged {
    /// All rows that pass, in the order of the sort keys.
    pub rows: Vec<usize>,
    /// The same rows by group, groups in the order of their values; one group without a grouping column.
    pub groups: Vec<RowGroup>,
}

/// Maximum number of groups of a column that is offered for grouping.
const MAX_GROUPS: usize = 200;

/// Rank of each row by a column's values: equal values have equal ranks, empty cells the largest.
fn ranks(table: &StudyTable, column: &str, descending: bool) -> Vec<u32> {
    let Some(column) = table.column(column) else { return vec![0; table.rows()] };
    let cells = column.values.cells();
    let compare = |a: &usize, b: &usize| {
        let (a, b) = (&cells[*a], &cells[*b]);
        let by_value = if descending { b.order(a) } else { a.order(b) };
        let is_empty = |cell: &Cell| *cell == Cell::Empty;
        is_empty(a).cmp(&is_empty(b)).then(by_value)
    };
    let mut rows: Vec<usize> = (0..table.rows()).collect();
    rows.sort_by(compare);
    let mut ranks = vec![0; table.rows()];
    let mut rank = 0;
    for place in 0..rows.len() {
        if place > 0 && compare(&rows[place - 1], &rows[place]) != Ordering::Equal {
            rank += 1;
        }
        ranks[rows[place]] = rank;
    }
    ranks
}

/// The rows that pass `filter`, sorted by `sort` and then by index, and grouped by the column `group`.
pub fn arrange(table: &StudyTable, filter: &RowFilter, sort: &[SortKey], group: Option<&str>) -> Arranged {
    let mut rows: Vec<usize> = (0..table.rows()).filter(|row| filter.passes(table, *row)).collect();
    let keys: Vec<Vec<u32>> = sort.iter().map(|key| ranks(table, &key.column, key.descending)).collect();
    rows.sort_by(|a, b| {
        keys.iter().fold(Ordering::Equal, |order, ranks| order.then_with(|| ranks[*a].cmp(&ranks[*b])))
    });
    let Some(group) = group.filter(|group| table.place(group).is_some()) else {
        let all = RowGroup { name: String::new(), rows: rows.clone() };
        return Arranged { groups: if rows.is_empty() { Vec::new() } else { vec![all] }, rows };
    };
    let ranks = ranks(table, group, false);
    let mut by_rank: std::collections::BTreeMap<u32, RowGroup> = std::collections::BTreeMap::new();
    for row in &rows {
        let new = || RowGroup { name: table.cell(*row, group).to_string(), rows: Vec::new() };
        by_rank.entry(ranks[*row]).or_insert_with(new).rows.push(*row);
    }
    Arranged { rows, groups: by_rank.into_values().collect() }
}

/// Columns by which rows can be grouped: texts, integers and Booleans with at least two and not too many values, inputs
/// of the runs first.
pub fn group_columns(table: &StudyTable) -> Vec<String> {
    let few = |name: &str| {
        let Some(column) = table.column(name) else { return false };
        if column.values.column_type() == ColumnType::Number || name == columns::KEY || name == columns::MESSAGE {
            return false;
        }
        let mut seen: Vec<Cell> = Vec::new();
        for row in 0..table.rows() {
            let cell = column.values.cell(row);
            if let Err(place) = seen.binary_search_by(|known| known.order(&cell)) {
                seen.insert(place, cell);
                if seen.len() > MAX_GROUPS {
                    return false;
                }
            }
        }
        seen.len() > 1
    };
    let first =
        [columns::RUN, columns::LOG, columns::DISTURBANCE, columns::PERTURBATION, columns::STATUS, columns::SEED];
    let others = table.columns().iter().map(|column| column.name.as_str()).filter(|name| !first.contains(name));
    first.into_iter().chain(others).filter(|name| few(name)).map(str::to_owned).collect()
}
