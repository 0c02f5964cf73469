use std::path::{Path, PathBuf};

use thiserror::Error;

/// Failure to read or write a file that is no log; the message names the problem, its place and the path.
#[derive(Debug, Error)]
pub enum FileError {
    #[error("cannot {action}: {source}: {}", path.display())]
    Io {
        /// Attempted operation: `read the rig`, `open the stills`, ….
        action: &'static str,
        source: std::io::Error,
        path: PathBuf,
    },
    #[error("{field}: {problem}: {}", path.display())]
    Rig {
        /// Path of the field, such as `cam0.intrinsics`.
        field: String,
        problem: String,
        path: PathBuf,
    },
    #[error("the rig is not valid YAML: {problem}: {}", path.display())]
    RigSyntax {
        /// The parser's error with line and column.
        problem: String,
        path: PathBuf,
    },
    #[error("cannot use the stills: {problem}: {}", path.display())]
    Stills {
        /// Place in the file, what is wrong and what is expected there.
        problem: String,
        /// Stills file, or file of a chain.
        path: PathBuf,
    },
}

impl FileError {
    /// Problem of a field of a rig with its line, if it is known (0 if not).
    pub(super) fn of_field(field: &str, problem: impl Into<String>, line: usize, file: &Path) -> Self {
        let mut problem = problem.into();
        if line > 0 {
            problem = format!("{problem}, line {line}");
        }
        Self::Rig { field: field.to_owned(), problem, path: file.to_owned() }
    }
}
