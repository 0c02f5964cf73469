//! Results of checked cases: which row of the table each planted row was named.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use dcvins::faults::{Fault, FaultKind};
use dcvins::log_check::{CheckReport, Trust, problems};
use dcvins::text::Named as _;

use crate::cases::{Case, text_of};
use crate::shared::markdown::write_table;

/// Columns of the CSV file; the last one may have commas.
pub(crate) const HEADER: &str = "planted,named,right,flight,fault,since_s,sentence";
const CONTROL: &str = "control";
const SILENT: &str = "silent";
/// A problem without a kind of fault.
const OTHER: &str = "other";

/// Line of the CSV file of a case.
pub(crate) fn line(case: &Case, report: &CheckReport) -> String {
    let first = problems(&report.findings).into_iter().find(|finding| Trust::after(finding) != Trust::Trusted);
    let named = first.and_then(|finding| finding.faults.first());
    let named_key = match (first, named) {
        (None, _) => SILENT,
        (_, Some(fault)) => fault.kind.name(),
        _ => OTHER,
    };
    let planted = case.fault.as_ref();
    let is_right = match (planted, named) {
        (Some(planted), Some(named)) => is_named(planted, named),
        (Some(_), None) => false,
        (None, _) => first.is_none(),
    };
    let since = planted.and_then(|fault| fault.since_s).map_or_else(String::new, |since_s| since_s.to_string());
    let fields = [
        planted.map_or(CONTROL, |fault| fault.kind.name()).to_owned(),
        named_key.to_owned(),
        is_right.to_string(),
        case.flight.name().to_owned(),
        planted.map_or_else(String::new, text_of),
        since,
        report.verdict().sentence.replace('\n', " "),
    ];
    fields.join(",")
}

/// True if the named fault is the planted one or a kind that contains it. A zoom is a focal length in pieces too, one from the
/// start on is another focal length, and a mount that is wrong from the start is the rig's extrinsics.
fn is_named(planted: &Fault, named: &Fault) -> bool {
    let pair = (planted.kind, named.kind);
    planted.kind == named.kind
        || named.kind.contains(planted.kind)
        || matches!(pair, (FaultKind::Zoom, FaultKind::FocalPieces) | (FaultKind::Mount, FaultKind::Chain))
        || (planted.since_s.is_none() && pair == (FaultKind::Zoom, FaultKind::Focal))
}

/// Confusion matrix of the lines of a CSV file.
pub(crate) struct Matrix {
    /// Number of cases by planted and named row.
    cells: BTreeMap<(String, String), usize>,
    right: usize,
    wrong_cause: usize,
    other: usize,
    silent: usize,
    /// Controls, and those that are not silent.
    controls: [usize; 2],
}

impl Matrix {
    pub(crate) fn of(csv: &str) -> Self {
        let mut matrix =
            Self { cells: BTreeMap::new(), right: 0, wrong_cause: 0, other: 0, silent: 0, controls: [0; 2] };
        for line in csv.lines().filter(|line| *line != HEADER) {
            let mut fields = line.splitn(4, ',');
            let [planted, named, right] = [(); 3].map(|()| fields.next().unwrap_or_default());
            match (planted, named) {
                (CONTROL, _) => {
                    matrix.controls[0] += 1;
                    matrix.controls[1] += usize::from(named != SILENT);
                }
                _ if right == "true" => matrix.right += 1,
                (_, SILENT) => matrix.silent += 1,
                (_, OTHER) => matrix.other += 1,
                _ => matrix.wrong_cause += 1,
            }
            *matrix.cells.entry((planted.to_owned(), named.to_owned())).or_default() += 1;
        }
        matrix
    }
}

impl fmt::Display for Matrix {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let planted: BTreeSet<&str> = self.cells.keys().map(|(planted, _)| planted.as_str()).collect();
        let named: BTreeSet<&str> = self.cells.keys().map(|(_, named)| named.as_str()).collect();
        let rows: Vec<Vec<String>> = planted
            .iter()
            .map(|planted| {
                let count = |named: &&str| self.cells.get(&((*planted).to_owned(), (*named).to_owned()));
                let counts = named.iter().map(|named| count(named).map_or_else(String::new, usize::to_string));
                std::iter::once((*planted).to_owned()).chain(counts).collect()
            })
            .collect();
        let header: Vec<&str> = std::iter::once("planted \\ named").chain(named).collect();
        write_table(formatter, "Cases by planted and named row", &header, &rows)?;
        let Self { right, wrong_cause, other, silent, controls: [controls, loud], .. } = self;
        writeln!(
            formatter,
            "\nright {right}, wrong cause {wrong_cause}, another finding {other}, silent {silent}; \
             {loud} of {controls} controls not silent"
        )
    }
}
