//! The command line: arguments and sub-commands.

mod arguments;
mod commands;
mod degeneracy;
mod report;
#[cfg(feature = "gui")]
mod screenshot;

use clap::Parser as _;

use arguments::{Arguments, Command, ViewArguments};

/// Reads the arguments of the process and does what they ask for.
///
/// Wrong arguments end the process with exit code 2; an error of the command is returned.
pub(crate) fn run() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    match arguments.command.unwrap_or_else(|| Command::View(ViewArguments::default())) {
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
    }
}
