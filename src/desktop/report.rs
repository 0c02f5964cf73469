//! A report on the log of the window, written by another process of this program and opened by the desktop.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;

/// Program that opens a file as a double click does.
const OPENER: &str = if cfg!(target_os = "macos") {
    "open"
} else if cfg!(windows) {
    "explorer"
} else {
    "xdg-open"
};

/// Starts `dcvins report` with arguments and a folder; the receiver gets the path of the page, which is opened too.
pub(super) fn start(folder: &Path, arguments: &[String]) -> Result<Receiver<Result<PathBuf, String>>, String> {
    let program = std::env::current_exe().map_err(|error| format!("cannot find this program: {error}"))?;
    let mut command = Command::new(program);
    command.arg("report").args(arguments).arg("--output").arg(folder);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().map_err(|error| format!("cannot start dcvins report: {error}"))?;
    let (sender, receiver) = channel();
    let page = folder.join("report.html");
    let wait = move || {
        let written = match child.wait_with_output() {
            Ok(output) if output.status.success() || output.status.code() == Some(NEVER_INITIALIZED) => Ok(page),
            Ok(output) => Err(last_line(&output.stderr)),
            Err(error) => Err(error.to_string()),
        };
        if let Ok(page) = &written {
            open(page);
        }
        // The window may be closed.
        drop(sender.send(written.map(|page| std::fs::canonicalize(&page).unwrap_or(page))));
    };
    let thread = thread::Builder::new().name("report".to_owned()).spawn(wait);
    thread.map_err(|error| format!("cannot start a thread: {error}"))?;
    Ok(receiver)
}

/// Exit code of a report on a run that never initialized; its files are written.
const NEVER_INITIALIZED: i32 = 3;

/// Opens a page in the browser; without a desktop nothing happens.
fn open(page: &Path) {
    let mut command = Command::new(OPENER);
    command.arg(page).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    drop(command.spawn());
}

/// The last line that is not empty.
fn last_line(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let line = text.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or("dcvins report failed");
    line.to_owned()
}

#[cfg(test)]
mod tests {
    use super::last_line;

    #[test]
    fn the_reason_is_the_last_line() {
        assert_eq!(last_line(b"progress\ncannot write a: full\n\n"), "cannot write a: full");
        assert_eq!(last_line(b""), "dcvins report failed");
    }
}
