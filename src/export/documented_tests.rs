//! Tables of columns as they are in the documents.

use crate::table::Column;

/// Table of a document; columns without a meaning are left out.
pub(super) fn documented<Row>(columns: &[Column<'_, Row>]) -> String {
    let row = |column: &Column<'_, Row>| {
        let Column { name, unit, meaning, cell_type, .. } = column;
        format!("| `{name}` | {} | {unit} | {meaning} |\n", cell_type.name())
    };
    let rows: String = columns.iter().filter(|column| !column.meaning.is_empty()).map(row).collect();
    format!("| column | type | unit | content |\n| --- | --- | --- | --- |\n{rows}")
}
