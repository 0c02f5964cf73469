//! Errors of the files of a study.

use std::io;
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use crate::flight_log::LogError;
use crate::study::{PerturbationError, PlanError, TableError};

/// Reason why a file of a study could not be read or written.
#[derive(Debug, Error)]
pub enum StudyFileError {
    #[error("cannot write: {source}: {path}")]
    Write { source: io::Error, path: PathBuf },
    #[error("cannot read: {source}: {path}")]
    Read { source: io::Error, path: PathBuf },
    #[error("the table is damaged, or not a table of a study: {source}: {path}")]
    Parquet { source: ParquetError, path: PathBuf },
    #[error("{source}: {path}")]
    Plan {
        /// The problem with its line.
        source: Box<PlanError>,
        path: PathBuf,
    },
    #[error("logs '{pattern}' of the plan: {problem}: {path}")]
    Logs { pattern: String, problem: String, path: PathBuf },
    #[error(transparent)]
    Perturbation(Box<PerturbationError>),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("the description of the job is damaged: {problem}; remove its folder: {path}")]
    Job { problem: String, path: PathBuf },
    #[error("the tables of two jobs differ: {source}: {path}")]
    Table {
        source: Box<TableError>,
        /// Path of the second table.
        path: PathBuf,
    },
    #[error("the folder holds '{found}' and no {index}; give another folder, or an empty one: {path}")]
    NoStudy {
        /// Name of an existing entry.
        found: String,
        /// Name of the file by which a study is recognized.
        index: &'static str,
        path: PathBuf,
    },
}

impl From<PerturbationError> for StudyFileError {
    fn from(error: PerturbationError) -> Self {
        Self::Perturbation(Box::new(error))
    }
}

impl StudyFileError {
    /// For `map_err` of a write.
    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Write { source, path: path.to_owned() }
    }

    /// For `map_err` of a read.
    pub(super) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Read { source, path: path.to_owned() }
    }

    /// For `map_err` behind [`OutputSet::commit`](crate::files::output::OutputSet::commit).
    pub(super) fn commit((path, source): (PathBuf, io::Error)) -> Self {
        Self::Write { source, path }
    }
}
