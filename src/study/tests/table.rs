use crate::study::{Cell, ColumnType, StudyColumn, StudyTable, TableError};

fn columns() -> Vec<StudyColumn> {
    vec![
        StudyColumn::new("log", ColumnType::Text, "", "Name of the log."),
        StudyColumn::new("seed", ColumnType::Integer, "", "Seed."),
        StudyColumn::new("ate_rmse_m", ColumnType::Number, "m", "Position error."),
        StudyColumn::new("initialized", ColumnType::Bool, "", "Whether there is a pose."),
    ]
}

fn table() -> StudyTable {
    let mut table = StudyTable::new(columns()).unwrap();
    for (log, seed, ate) in [("b", 2, Some(0.5)), ("a", 1, None), ("a", 2, Some(0.25))] {
        let cells = [("log", log.into()), ("seed", Cell::Integer(seed)), ("ate_rmse_m", ate.into())];
        table.push(cells.into_iter().chain([("initialized", ate.is_some().into())])).unwrap();
    }
    table
}

#[test]
fn cells_are_found_by_row_and_name() {
    let table = table();
    assert_eq!((table.rows(), table.columns().len()), (3, 4));
    assert_eq!(table.text(0, "log"), Some("b"));
    assert_eq!(table.integer(1, "seed"), Some(1));
    assert_eq!(table.number(1, "seed"), Some(1.0));
    assert_eq!(table.number(1, "ate_rmse_m"), None);
    assert_eq!(table.boolean(2, "initialized"), Some(true));
    assert_eq!(table.cell(0, "other"), Cell::Empty);
    assert_eq!(table.cell(9, "log"), Cell::Empty);
    assert_eq!(table.row(2).map(|cell| cell.to_string()).collect::<Vec<_>>(), ["a", "2", "0.25", "true"]);
}

#[test]
fn a_row_that_does_not_fit_changes_nothing() {
    let mut table = table();
    let before = table.clone();
    let unknown = table.push([("log", "c".into()), ("size", Cell::Integer(1))]);
    assert_eq!(unknown.unwrap_err().to_string(), "there is no column 'size'");
    let wrong = table.push([("log", "c".into()), ("seed", Cell::Number(1.5))]);
    assert_eq!(wrong.unwrap_err().to_string(), "column 'seed' holds integer, not number");
    assert_eq!(table, before);
    table.push([("ate_rmse_m", Cell::Integer(3))]).unwrap();
    table.push([("ate_rmse_m", Cell::Number(f64::NAN))]).unwrap();
    assert_eq!((table.number(3, "ate_rmse_m"), table.number(4, "ate_rmse_m")), (Some(3.0), None));
    assert_eq!(table.cell(3, "log"), Cell::Empty);
}

#[test]
fn columns_must_have_one_length_and_different_names() {
    let mut twice = columns();
    twice.push(twice[0].clone());
    assert_eq!(StudyTable::new(twice).unwrap_err(), TableError::TwoColumns { name: "log".to_owned() });
    let mut longer = columns();
    longer[2] = table().columns()[2].clone();
    let unequal = StudyTable::new(longer).unwrap_err();
    assert_eq!(unequal.to_string(), "column 'ate_rmse_m' has 3 rows, the first column 0");
}

#[test]
fn tables_of_other_columns_are_merged_by_name() {
    let mut merged = table();
    let mut other = StudyTable::new(vec![
        StudyColumn::new("seed", ColumnType::Integer, "", "Seed."),
        StudyColumn::new("note", ColumnType::Text, "", "Anything."),
    ])
    .unwrap();
    other.push([("seed", Cell::Integer(7)), ("note", "x".into())]).unwrap();
    merged.append(&other).unwrap();
    assert_eq!((merged.rows(), merged.integer(3, "seed"), merged.text(3, "note")), (4, Some(7), Some("x")));
    assert_eq!((merged.text(0, "note"), merged.text(3, "log")), (None, None));
    let mismatch = StudyTable::new(vec![StudyColumn::new("seed", ColumnType::Text, "", "Seed.")]).unwrap();
    assert_eq!(merged.clone().append(&mismatch).unwrap_err().to_string(), "column 'seed' holds integer, not text");
}

#[test]
fn rows_are_grouped_by_the_text_of_a_cell() {
    let table = table();
    let groups = table.groups("log");
    assert_eq!(groups.into_iter().collect::<Vec<_>>(), [("a".to_owned(), vec![1, 2]), ("b".to_owned(), vec![0])]);
    let varying: Vec<&str> = table.varying_columns().map(|column| column.name.as_str()).collect();
    assert_eq!(varying, ["log", "seed", "ate_rmse_m", "initialized"]);
    assert_eq!(table.select(&[2]).varying_columns().count(), 0);
}

#[test]
fn the_documents_list_exactly_the_columns() {
    let document = include_str!("../../../docs/formats.md");
    for table in [crate::study::runs_table(), crate::study::parameters_table(), crate::study::frames_table()] {
        let row = |StudyColumn { name, unit, description, values }: &StudyColumn| {
            format!("| `{name}` | {} | {unit} | {description} |\n", values.column_type().name())
        };
        let rows: String = table.columns().iter().map(row).collect();
        let expected = format!("| column | type | unit | content |\n| --- | --- | --- | --- |\n{rows}\n");
        assert!(document.contains(&expected), "docs/formats.md lacks the table:\n{expected}");
    }
}

#[test]
fn every_path_length_of_relative_errors_has_its_columns() {
    let runs = crate::study::runs_table();
    for length_m in crate::session::RELATIVE_LENGTHS_M {
        for name in [format!("rpe_{length_m}m_translation_m"), format!("rpe_{length_m}m_rotation_rad")] {
            assert!(runs.place(&name).is_some(), "no column {name}");
        }
    }
}
