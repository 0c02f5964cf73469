use std::fs;

use super::*;
use crate::study::{Cell, ColumnType, StudyColumn, StudyTable, runs_table};

fn table(rows: usize) -> StudyTable {
    let mut table = StudyTable::new(vec![
        StudyColumn::new("log", ColumnType::Text, "", "Name of the log."),
        StudyColumn::new("seed", ColumnType::Integer, "", "Seed."),
        StudyColumn::new("ate_rmse_m", ColumnType::Number, "m", "Position error."),
        StudyColumn::new("ok", ColumnType::Bool, "", "Whether it ran."),
    ])
    .unwrap();
    for row in 0..rows {
        let number = 0.1 + row as f64 / 3.0;
        let empty = row % 3 == 1;
        table
            .push([
                ("log", if row % 5 == 4 { Cell::Empty } else { format!("flight «{}», \"a\"\n", row % 7).into() }),
                ("seed", if empty { Cell::Empty } else { Cell::Integer(row as i64 - 2) }),
                ("ate_rmse_m", if empty { Cell::Empty } else { number.into() }),
                ("ok", if row == 0 { Cell::Empty } else { empty.into() }),
            ])
            .unwrap();
    }
    table
}

#[test]
fn a_table_comes_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    for rows in [0, 1, 2, 200, 70_000] {
        let (path, table) = (folder.path().join("results.parquet"), table(rows));
        write_parquet(&table, &path).unwrap();
        assert_eq!(read_parquet(&path).unwrap(), table, "{rows} rows");
        let first = fs::read(&path).unwrap();
        write_parquet(&table, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), first, "the same table gives the same bytes");
    }
    let path = folder.path().join("empty.parquet");
    write_parquet(&runs_table(), &path).unwrap();
    assert_eq!(read_parquet(&path).unwrap(), runs_table());
}

#[test]
fn a_damaged_table_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("results.parquet");
    write_parquet(&table(100), &path).unwrap();
    let whole = fs::read(&path).unwrap();
    for length in [0, 3, 4, whole.len() / 2, whole.len() - 1] {
        fs::write(&path, &whole[..length]).unwrap();
        let error = read_parquet(&path).unwrap_err().to_string();
        assert!(error.starts_with("the table is damaged, or not a table of a study"), "{error}");
    }
    assert!(read_parquet(&folder.path().join("none.parquet")).unwrap_err().to_string().starts_with("cannot read"));
}

#[test]
fn csv_has_all_digits_and_quotes() {
    let text = table(2).csv(0..2);
    assert_eq!(
        text,
        "log,seed,ate_rmse_m,ok\n\"flight «0», \"\"a\"\"\n\",-2,0.1,\n\"flight «1», \"\"a\"\"\n\",,,true\n"
    );
}
