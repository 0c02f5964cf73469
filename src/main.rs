//! The `dcvins` program: runs the command line and prints its error.

mod cli;

use std::io::Write as _;
use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // With standard error closed, nobody can be informed.
            drop(writeln!(std::io::stderr(), "dcvins: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
