//! The command line of `dcvins`: parse the arguments, pick a mode, print errors.

mod arguments;
mod commands;
mod degeneracy;
mod report;
#[cfg(feature = "gui")]
mod screenshot;

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;

use arguments::{Arguments, Command, ViewArguments};

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match arguments.command.unwrap_or_else(|| Command::View(ViewArguments::default())) {
        Command::View(view) => commands::view(&view),
        Command::Run(run) => commands::run(&run),
        #[cfg(feature = "gui")]
        Command::Screenshot(screenshot) => screenshot::screenshot(&screenshot),
        Command::Report(arguments) => report::report(&arguments),
        Command::Calibrate(calibrate) => commands::calibrate(&calibrate),
        Command::Check(check) => commands::check(&check),
        Command::Simulate(simulate) => commands::simulate(&simulate),
        Command::Degeneracy(arguments) => degeneracy::degeneracy(&arguments),
        Command::Convert(convert) => commands::convert(&convert),
        Command::Evaluate(evaluate) => commands::evaluate(&evaluate),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // With standard error gone there is nobody left to tell.
            drop(writeln!(std::io::stderr(), "dcvins: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
