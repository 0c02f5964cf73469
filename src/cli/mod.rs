//! The command line: arguments and sub-commands.

mod arguments;
mod calibrate;
mod check;
mod compute;
mod convert;
mod degeneracy;
mod diagnose;
mod estimation_arguments;
mod evaluate;
mod excerpt;
mod exit;
mod export;
#[cfg(feature = "gui")]
mod figure_arguments;
mod follow_arguments;
mod generate;
mod history;
mod interrupt;
mod log_checking;
mod noise;
#[cfg(feature = "gui")]
mod open_log;
mod plan;
mod prepared_log;
mod report;
#[cfg(feature = "gui")]
mod report_figures;
mod result_cache;
mod rig;
mod run;
mod run_summary;
#[cfg(feature = "gui")]
mod screenshot;
mod shared_arguments;
mod simulate;
mod stills_arguments;
#[cfg(feature = "gui")]
mod study_arguments;
#[cfg(feature = "gui")]
mod study_report;
mod sweep;
mod terminal;
mod view;
#[cfg(test)]
#[cfg(feature = "gui")]
mod view_tests;

use clap::{CommandFactory as _, Parser as _};
use dcvins::export::SourceError;
use dcvins::text::printable_lines;

use arguments::{Arguments, Command};
use exit::ExitOutcome;
use terminal::notify;
use view::ViewArguments;

/// Parses the arguments of the process and runs the sub-command.
///
/// Wrong arguments end the process with exit code 2; an error of the command is returned.
pub(crate) fn run() -> anyhow::Result<ExitOutcome> {
    let arguments = Arguments::parse();
    let done = |result: anyhow::Result<()>| result.map(|()| ExitOutcome::Success);
    let result = match arguments.command.unwrap_or_else(|| Command::View(ViewArguments::default())) {
        Command::View(arguments) => done(view::view(&arguments)),
        Command::Run(arguments) => run::run(&arguments),
        #[cfg(feature = "gui")]
        Command::Screenshot(arguments) => screenshot::screenshot(&arguments),
        Command::Report(arguments) => report::report(&arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(&arguments),
        Command::History(arguments) => history::history(&arguments),
        Command::Check(arguments) => check::check(&arguments),
        Command::Diagnose(arguments) => diagnose::diagnose(&arguments),
        Command::Noise(arguments) => noise::noise(&arguments),
        Command::Rig(arguments) => rig::rig(&arguments),
        Command::Simulate(arguments) => simulate::simulate(&arguments),
        Command::Sweep(arguments) => sweep::sweep(&arguments),
        Command::SweepJob(arguments) => sweep::sweep_job(&arguments),
        Command::Degeneracy(arguments) => done(degeneracy::degeneracy(&arguments)),
        Command::Plan(arguments) => plan::plan(&arguments),
        Command::Excerpt(arguments) => excerpt::excerpt(&arguments),
        Command::Convert(arguments) => convert::convert(&arguments),
        Command::Evaluate(arguments) => done(evaluate::evaluate(&arguments)),
        Command::Export(arguments) => done(export::export(&arguments)),
        Command::Generate(arguments) => done(generate::generate(&arguments, &Arguments::command())),
    };
    match result {
        Err(error) if error.downcast_ref::<SourceError>().is_some_and(SourceError::is_interrupted) => {
            notify(&format!("dcvins: {error}"));
            Ok(ExitOutcome::Interrupted)
        }
        result => result,
    }
}

/// The message of an error followed by the messages of its causes that it does not contain.
pub(crate) fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    printable_lines(&text).into_owned()
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::message;

    #[test]
    fn a_cause_is_printed_once() {
        let error = anyhow!("no such file");
        assert_eq!(message(&error.context("cannot read: no such file: a.mcap")), "cannot read: no such file: a.mcap");
        assert_eq!(message(&anyhow!("no such file").context("cannot read a.mcap")), "cannot read a.mcap: no such file");
    }
}
