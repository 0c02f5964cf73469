//! Tables, trajectories and pictures without a window.

mod error;
mod evaluation;
pub mod trajectory;

pub use error::ExportError;
pub use evaluation::{EvaluationOptions, EvaluationReport, evaluate};
