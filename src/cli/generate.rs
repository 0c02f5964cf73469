//! `dcvins generate`: shell completions and manual pages from the arguments, for packages.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use clap::{Args, Command, Subcommand};
use clap_complete::Shell;
use clap_mangen::Man;
use dcvins::files::output;

use crate::cli::terminal::print;

/// Date of the release in the headers of manual pages, as in the changelog.
const RELEASED: &str = "2026-11-27";

/// Name and version in the footers of manual pages.
const SOURCE: &str = concat!("dcvins ", env!("CARGO_PKG_VERSION"));

#[derive(Args, Clone, Debug)]
pub(crate) struct GenerateArguments {
    /// Kind of the files.
    #[command(subcommand)]
    pub kind: GenerateKind,
}

#[derive(Clone, Debug, Subcommand)]
pub(crate) enum GenerateKind {
    /// Print the completions of a shell.
    Completions {
        /// Shell that reads the completions.
        shell: Shell,
    },
    /// Write a manual page for each sub-command, `dcvins-COMMAND.1`.
    Man {
        /// Folder for the pages.
        #[arg(short, long, visible_alias = "out", value_name = "DIR")]
        output: PathBuf,
    },
}

/// Prints or writes the files for `command`, the program with all its arguments.
pub(crate) fn generate(arguments: &GenerateArguments, command: &Command) -> Result<()> {
    match &arguments.kind {
        GenerateKind::Completions { shell } => print(&completions(*shell, command)?),
        GenerateKind::Man { output: folder } => {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
            for (name, page) in manual_pages(command)? {
                let path = folder.join(name);
                output::write_file(&path, &page).with_context(|| format!("cannot write {}", path.display()))?;
                print(&format!("{}\n", path.display()))?;
            }
            Ok(())
        }
    }
}

fn completions(shell: Shell, command: &Command) -> Result<String> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut visible(command), "dcvins", &mut text);
    String::from_utf8(text).context("completions are text")
}

/// The arguments without hidden sub-commands, which completions would offer.
fn visible(command: &Command) -> Command {
    let hidden = ["generate", "sweep-job"];
    let shown: Vec<Command> =
        command.get_subcommands().filter(|it| !hidden.contains(&it.get_name())).cloned().collect();
    Command::new("dcvins")
        .version(command.get_version().unwrap_or_default().to_owned())
        .about(command.get_about().cloned().unwrap_or_default())
        .propagate_version(true)
        .subcommands(shown)
}

/// Names and contents of the pages of all sub-commands; the page of the program itself is written by hand.
fn manual_pages(command: &Command) -> Result<Vec<(String, Vec<u8>)>> {
    let mut command = visible(command).disable_help_subcommand(true);
    command.build();
    let mut pages = Vec::new();
    let mut waiting: Vec<Command> = command.get_subcommands().cloned().collect();
    while let Some(command) = waiting.pop() {
        waiting.extend(command.get_subcommands().filter(|it| it.get_name() != "help").cloned());
        let man = Man::new(command).section("1").date(RELEASED).source(SOURCE).manual("User commands");
        let mut page = Vec::new();
        man.render(&mut page).context("cannot write a manual page")?;
        pages.push((man.get_filename(), page));
    }
    pages.sort();
    Ok(pages)
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, ValueEnum as _};

    use super::*;
    use crate::cli::arguments::Arguments;

    #[test]
    fn completions_of_every_shell_have_the_commands_and_options() {
        for shell in Shell::value_variants() {
            let text = completions(*shell, &Arguments::command()).unwrap();
            for word in ["screenshot", "convert", "video-offset", "camera-link"] {
                assert!(text.contains(word), "{shell}: {word}");
            }
            assert!(!text.contains("sweep-job"), "{shell}");
        }
    }

    #[test]
    fn every_command_has_a_page_with_its_options() {
        let pages = manual_pages(&Arguments::command()).unwrap();
        let page = |name: &str| {
            let found = pages.iter().find(|(known, _)| known == name).map(|(_, page)| page.clone());
            String::from_utf8(found.unwrap_or_else(|| panic!("no page {name}"))).unwrap()
        };
        assert!(page("dcvins-run.1").contains("no\\-timing") && page("dcvins-rig-new.1").contains("mechanism"));
        let count = Arguments::command().get_subcommands().filter(|it| !it.is_hide_set()).count();
        assert!(pages.len() > count, "{} pages of {count} commands and their own commands", pages.len());
        assert!(page("dcvins-view.1").starts_with(".ie"), "{}", page("dcvins-view.1"));
    }
}
