//! The `dcvins` program: runs the command line and prints its error.

mod cli;

use std::io::Write as _;
use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::run() {
        Ok(outcome) => outcome.into(),
        Err(error) => {
            // A closed standard error loses the message; the exit code remains.
            drop(writeln!(std::io::stderr(), "dcvins: {}", cli::message(&error)));
            ExitCode::FAILURE
        }
    }
}
