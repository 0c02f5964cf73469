//! Opened studies: their tables, and their runs as sessions.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::StudyFileError;
use super::parquet_table::read_parquet;
use crate::study::view::{Study, columns};
use crate::study::{Cell, ColumnType, ColumnValues, StudyColumn, StudyTable, parameters_table, runs_table};

/// Name of the table of runs without its extension.
const RUNS: &str = "results";
/// Name of the table of parameters without its extension.
const PARAMETERS: &str = "parameters";

/// Reason why a study cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum StudySourceError {
    #[error("no table of runs in the folder: expected results.parquet or results.csv, as 'dcvins sweep' writes them: {}", .0.display())]
    NoTable(PathBuf),
    /// A table cannot be read.
    #[error(transparent)]
    File(#[from] StudyFileError),
    #[error("cannot read the table: {problem}: {}", path.display())]
    Csv {
        /// The problem, with its line.
        problem: String,
        path: PathBuf,
    },
    #[error("the table has no column 'run': not a table of runs of a study: {}", .0.display())]
    NoRuns(PathBuf),
}

#[derive(Clone, Debug)]
pub struct OpenedStudy {
    root: PathBuf,
    study: Arc<Study>,
}

/// True if a path is a study: a folder with a table of runs, or such a table.
pub fn is_study(path: &Path) -> bool {
    if path.is_dir() {
        return ["parquet", "csv"].iter().any(|kind| path.join(format!("{RUNS}.{kind}")).is_file())
            || path.join("study.json").is_file();
    }
    path.extension().is_some_and(|extension| extension == "parquet") && path.is_file()
}

impl OpenedStudy {
    /// Reads the tables of a study: results.parquet and parameters.parquet, or CSV files with the same names. The table
    /// of parameters may be missing.
    ///
    /// # Errors
    /// If there is no table of runs, or a table cannot be read.
    pub fn read(path: &Path) -> Result<Self, StudySourceError> {
        let (folder, runs_path) = if path.is_dir() {
            let found = ["parquet", "csv"].map(|kind| path.join(format!("{RUNS}.{kind}")));
            let table = found.into_iter().find(|table| table.is_file());
            (path.to_owned(), table.ok_or_else(|| StudySourceError::NoTable(path.to_owned()))?)
        } else {
            (path.parent().map(Path::to_owned).unwrap_or_default(), path.to_owned())
        };
        let runs = read_table(&runs_path, &runs_table())?;
        if runs.place(columns::RUN).is_none() {
            return Err(StudySourceError::NoRuns(runs_path));
        }
        let kind = runs_path.extension().unwrap_or_default();
        let parameters_path = runs_path.with_file_name(PARAMETERS).with_extension(kind);
        let parameters = if parameters_path.is_file() {
            read_table(&parameters_path, &parameters_table())?
        } else {
            parameters_table()
        };
        let root = std::path::absolute(&folder).unwrap_or(folder);
        let of_folder = || root.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let name = runs.text(0, "study").filter(|name| !name.is_empty()).map_or_else(of_folder, str::to_owned);
        Ok(Self { study: Arc::new(Study { name, runs, parameters }), root })
    }

    pub fn study(&self) -> &Arc<Study> {
        &self.study
    }

    pub fn folder(&self) -> &Path {
        &self.root
    }
}

#[cfg(feature = "gui")]
mod sessions {
    use super::{Arc, OpenedStudy, Study, columns};
    use crate::geometry::ns_from_seconds;
    use crate::gui::app::{PlayingLog, StudySource};
    use crate::session::{MAX_TRAJECTORIES, RunSpec, Session, SessionRequest, TrajectorySource, TrajectorySpec};

    /// Column with the path of the log, relative to the folder of the study if the log is in it.
    const LOG_PATH: &str = "log_path";
    /// Column with the file of a trajectory, likewise, or its topic.
    const TRAJECTORY_PATH: &str = "trajectory_path";
    /// Column with the name of a run or of a trajectory.
    const LABEL: &str = "label";
    /// Folder of the simulated flights of a study, which are processed in full.
    const FLIGHTS: &str = "flights";

    impl OpenedStudy {
        /// Session request for the log of the first row with the rig of its job, and the runs and trajectories of all
        /// rows.
        fn request(&self, rows: &[usize]) -> Result<SessionRequest, String> {
            let table = &self.study.runs;
            let first = rows.first().copied().unwrap_or_default();
            let path = |column: &str| {
                let text = table.text(first, column).filter(|text| !text.is_empty())?;
                Some(self.root.join(text))
            };
            let log_path = path(LOG_PATH).ok_or("the row has no path of a log (column 'log_path')")?;
            let spec = |row: &usize| -> Result<RunSpec, String> {
                let text = table.text(*row, columns::RUN).unwrap_or_default();
                text.parse().map_err(|problem| format!("run '{text}' of the study: {problem}"))
            };
            let trajectory = |row: &usize| -> Option<TrajectorySpec> {
                let source: TrajectorySource = table.text(*row, TRAJECTORY_PATH)?.parse().ok()?;
                let source = match source {
                    TrajectorySource::File(path) => TrajectorySource::File(self.root.join(path)),
                    topic @ TrajectorySource::Topic(_) => topic,
                };
                Some(TrajectorySpec { source, label: table.text(*row, LABEL)?.to_owned() })
            };
            let mut trajectories: Vec<TrajectorySpec> = rows.iter().filter_map(trajectory).collect();
            trajectories.truncate(MAX_TRAJECTORIES);
            let mut specs = if trajectory(&first).is_some() { Vec::new() } else { vec![spec(&first)?] };
            // Further runs with a specification unknown to this version are omitted.
            specs.extend(rows.iter().skip(1).filter_map(|row| spec(row).ok()));
            let whole = log_path.starts_with(self.root.join(FLIGHTS));
            Ok(SessionRequest {
                rig_path: path("rig_path"),
                ground_truth_path: path("truth_path"),
                specs,
                trajectories,
                start_s: table.number(first, "start_s").filter(|_| !whole).unwrap_or(0.0),
                duration_s: table.number(first, "duration_s").filter(|_| !whole),
                log_path,
                ..SessionRequest::default()
            })
        }
    }

    impl StudySource for OpenedStudy {
        fn study(&self) -> Arc<Study> {
            Arc::clone(&self.study)
        }

        fn open_runs(&self, rows: &[usize]) -> Result<Box<dyn PlayingLog>, String> {
            let mut session = Session::open(&self.request(rows)?).map_err(|error| error.to_string())?;
            let worst_s = rows.first().and_then(|row| self.study.runs.number(*row, columns::WORST_FRAME_S));
            if let Some(worst_s) = worst_s {
                session.seek_when_computed(ns_from_seconds(worst_s));
            }
            Ok(Box::new(session))
        }
    }
}

fn read_table(path: &Path, known: &StudyTable) -> Result<StudyTable, StudySourceError> {
    let is_csv = path.extension().is_some_and(|extension| extension == "csv");
    if is_csv { read_csv(path, known) } else { Ok(with_meanings(read_parquet(path)?, known)) }
}

/// Adds units and descriptions of known columns if the file has none.
fn with_meanings(table: StudyTable, known: &StudyTable) -> StudyTable {
    let complete = |column: &StudyColumn| {
        let mut column = column.clone();
        if let Some(meaning) = known.column(&column.name).filter(|_| column.description.is_empty()) {
            (column.unit, column.description) = (meaning.unit.clone(), meaning.description.clone());
        }
        column
    };
    let columns = table.columns().iter().map(complete).collect();
    StudyTable::new(columns).unwrap_or(table)
}

/// Reads comma-separated values. Columns of `known` have the types given there; the type of another column is the
/// narrowest that fits all its values.
fn read_csv(path: &Path, known: &StudyTable) -> Result<StudyTable, StudySourceError> {
    let failed = |problem: String| StudySourceError::Csv { problem, path: path.to_owned() };
    let text = fs::read(path).map_err(|error| failed(error.to_string()))?;
    let mut reader = csv::Reader::from_reader(text.as_slice());
    let heads = reader.headers().map_err(|error| failed(error.to_string()))?.clone();
    let mut cells: Vec<Vec<String>> = vec![Vec::new(); heads.len()];
    for record in reader.records() {
        let record = record.map_err(|error| failed(error.to_string()))?;
        for (column, cell) in cells.iter_mut().zip(&record) {
            column.push(cell.to_owned());
        }
    }
    let mut columns = Vec::new();
    for (head, texts) in heads.iter().zip(&cells) {
        let meaning = known.column(head);
        let kind = meaning.map(|column| column.values.column_type()).filter(|kind| fits(*kind, texts));
        let kind = kind.unwrap_or_else(|| narrowest(texts));
        let (unit, description) = meaning.map_or(("", ""), |column| (&column.unit, &column.description));
        let values = values_of(kind, texts);
        columns.push(StudyColumn { values, ..StudyColumn::new(head, kind, unit, description) });
    }
    StudyTable::new(columns).map_err(|error| failed(error.to_string()))
}

/// True if every text is empty or a value of the type.
fn fits(kind: ColumnType, texts: &[String]) -> bool {
    texts.iter().all(|text| text.is_empty() || cell_of(kind, text) != Cell::Empty)
}

fn narrowest(texts: &[String]) -> ColumnType {
    let kinds = [ColumnType::Bool, ColumnType::Integer, ColumnType::Number];
    kinds.into_iter().find(|kind| fits(*kind, texts)).unwrap_or(ColumnType::Text)
}

/// The value of a text; empty if it does not have the type.
fn cell_of(kind: ColumnType, text: &str) -> Cell {
    match kind {
        ColumnType::Number => text.parse::<f64>().ok().into(),
        ColumnType::Integer => text.parse::<i64>().ok().into(),
        ColumnType::Bool => match text {
            "true" | "True" => true.into(),
            "false" | "False" => false.into(),
            _ => Cell::Empty,
        },
        ColumnType::Text => {
            if text.is_empty() {
                Cell::Empty
            } else {
                text.into()
            }
        }
    }
}

fn values_of(kind: ColumnType, texts: &[String]) -> ColumnValues {
    let mut values = ColumnValues::new(kind);
    for text in texts {
        values.push(cell_of(kind, text));
    }
    values
}
