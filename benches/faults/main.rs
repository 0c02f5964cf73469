//! Every kind of fault of the table, planted with three sizes and two times in two flights, and the row that `check`
//! names first.
//!
//! `cargo bench --bench faults -- --part 3/20` checks the third of twenty parts, every twentieth case, and adds its lines to
//! `target/faults.csv` (`--csv FILE`); the printed matrix is of all lines of that file. Without `--part`, the file is new and
//! has all cases. `--kind KEY` checks one row of the table alone, and `--logs FOLDER` keeps the log and the rig of each case.

mod cases;
mod flights;
mod matrix;
#[path = "../shared/mod.rs"]
mod shared;

use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};

use cases::{Case, cases, left_out};
use dcvins::faults::{FaultKind, TABLE};
use flights::{Flight, FlightLogs};
use matrix::{HEADER, Matrix};

struct Arguments {
    /// Number of the part from 1 on, and of parts.
    part: Option<(usize, usize)>,
    /// The only row that is checked.
    kind: Option<FaultKind>,
    /// Folder in which the logs are kept.
    logs: Option<PathBuf>,
    csv: PathBuf,
}

impl Arguments {
    fn read(mut words: impl Iterator<Item = String>) -> Result<Self> {
        let csv = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/faults.csv");
        let mut arguments = Self { part: None, kind: None, logs: None, csv };
        while let Some(word) = words.next() {
            let mut value = || words.next().with_context(|| format!("{word} needs a value"));
            match word.as_str() {
                // Cargo adds it for a bench of its own.
                "--bench" => {}
                "--csv" => arguments.csv = value()?.into(),
                "--logs" => arguments.logs = Some(value()?.into()),
                "--kind" => {
                    let key = value()?;
                    let row = TABLE.iter().find(|row| row.key == key);
                    arguments.kind = Some(row.with_context(|| format!("'{key}' is no row of the table"))?.kind);
                }
                "--part" => {
                    let text = value()?;
                    let part = text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
                    let part = part.filter(|(part, of)| (1..=*of).contains(part));
                    arguments.part = Some(part.with_context(|| format!("'{text}' is no part, as in 3/20"))?);
                }
                _ => bail!("unknown argument {word}"),
            }
        }
        Ok(arguments)
    }
}

#[expect(clippy::print_stdout, reason = "a bench prints what it measured")]
fn main() -> Result<()> {
    let arguments = Arguments::read(std::env::args().skip(1))?;
    let folder = tempfile::tempdir()?;
    let mut logs = FlightLogs::new(folder.path());
    if arguments.part.is_none() || !arguments.csv.exists() {
        fs::write(&arguments.csv, format!("{HEADER}\n"))?;
    }
    let mut csv = OpenOptions::new().append(true).open(&arguments.csv)?;
    let (part, of) = arguments.part.unwrap_or((1, 1));
    let is_chosen = |case: &&Case| arguments.kind.is_none() || arguments.kind == case.fault.as_ref().map(|it| it.kind);
    let all = cases(&Flight::ALL)?;
    for (number, case) in all.iter().skip(part - 1).step_by(of).filter(is_chosen).enumerate() {
        let planted = logs.planted_log(case)?;
        if let Some(folder) = &arguments.logs {
            planted.keep(folder, &format!("{number:03}"))?;
        }
        writeln!(csv, "{}", matrix::line(case, &planted.check()?))?;
    }
    println!("{}", Matrix::of(&fs::read_to_string(&arguments.csv)?));
    for (key, reason) in left_out() {
        println!("not planted: {key} ({reason})");
    }
    if let Some(cpu_s) = shared::process::cpu_s() {
        println!("processor time: {cpu_s:.0} s");
    }
    Ok(())
}
