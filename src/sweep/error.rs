//! Errors of the files of a study.

use std::io;
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use crate::flight_log::LogError;
use crate::study::{PerturbationError, PlanError, TableError};

/// The reason why a file of a study could not be read or written.
#[derive(Debug, Error)]
pub enum StudyFileError {
    /// A file or folder could not be written.
    #[error("cannot write: {source}: {path}")]
    Write {
        /// The error of the operating system.
        source: io::Error,
        /// Path of the file or folder.
        path: PathBuf,
    },
    /// A file could not be read.
    #[error("cannot read: {source}: {path}")]
    Read {
        /// The error of the operating system.
        source: io::Error,
        /// Path of the file.
        path: PathBuf,
    },
    /// A table could not be read or written.
    #[error("the table is damaged, or no table of a study: {source}: {path}")]
    Parquet {
        /// What the reader or writer found.
        source: ParquetError,
        /// Path of the file.
        path: PathBuf,
    },
    /// A plan cannot be used.
    #[error("{source}: {path}")]
    Plan {
        /// The problem with its line.
        source: Box<PlanError>,
        /// Path of the plan.
        path: PathBuf,
    },
    /// A pattern of a plan matches no log, or is no pattern.
    #[error("logs '{pattern}' of the plan: {problem}: {path}")]
    Logs {
        /// The pattern.
        pattern: String,
        /// The problem.
        problem: String,
        /// Path of the plan.
        path: PathBuf,
    },
    /// The rig of a job cannot be perturbed.
    #[error(transparent)]
    Perturbation(Box<PerturbationError>),
    /// A log or a rig cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The description of a job is damaged.
    #[error("the description of the job is damaged: {problem}; remove its folder: {path}")]
    Job {
        /// The problem.
        problem: String,
        /// Path of the description.
        path: PathBuf,
    },
    /// Tables do not fit together.
    #[error("the tables of two jobs differ: {source}: {path}")]
    Table {
        /// The difference.
        source: Box<TableError>,
        /// Path of the second one.
        path: PathBuf,
    },
    /// The folder holds something else than a study.
    #[error("the folder holds '{found}' and no {index}; give another folder, or an empty one: {path}")]
    NoStudy {
        /// What is in it.
        found: String,
        /// Name of the file by which a study is recognized.
        index: &'static str,
        /// The folder.
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

    /// For `map_err` behind [`OutputSet::commit`](crate::flight_log::output::OutputSet::commit).
    pub(super) fn commit((path, source): (PathBuf, io::Error)) -> Self {
        Self::Write { source, path }
    }
}
