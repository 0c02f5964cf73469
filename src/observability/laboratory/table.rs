//! All scenarios of the degeneracy table, measured, each beside the expected result (docs/mathematics.md, section 7).

use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::spurious::{self, SpuriousRow};
use super::truth::{Column, Joints, LEAST_FRAMES, LeastFrames, Poses, SECTIONS, Truth};
use super::{Deficit, LABORATORY_IMU, LaboratoryForm, LaboratoryResult, LaboratorySetup, Mechanism};
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::{ParameterNames, Parameterization};

/// The least numbers of frames are looked for up to here.
const MOST_FRAMES: usize = 16;
/// Landmarks of the windows with unknown joint angles; the others have a hundred.
const LANDMARKS_WITHOUT_ENCODER: usize = 130;

/// The table, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TruthTable {
    /// Its parts.
    pub sections: Vec<TableSection>,
    /// What two windows claim together that are linearized at different values of the calibration.
    pub spurious: Vec<SpuriousRow>,
    /// How many ranks, causes, sets of null directions and claims were compared.
    pub compared: usize,
    /// How many of them agree with the expected ones.
    pub agreeing: usize,
}

/// A part of the table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TableSection {
    /// What it is about.
    pub title: String,
    /// Its experiments.
    pub rows: Vec<TableRow>,
}

/// One experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TableRow {
    /// What is flown.
    pub scenario: String,
    /// Name of the mechanism.
    pub mechanism: String,
    /// Name of the motion.
    pub motion: String,
    /// Ranks in the parameterizations that the table compares.
    pub entries: Vec<TableEntry>,
    /// What the first form lacks, by cause.
    pub deficit: Option<Deficit>,
    /// The expected deficit.
    pub deficit_expected: Option<Deficit>,
    /// Parameters of the null directions of the minimal form.
    pub null_of_minimal: Vec<String>,
    /// The expected parameters, where the table names them all.
    pub null_of_minimal_expected: Option<Vec<String>>,
    /// Whether every expected result was measured.
    pub agrees: bool,
}

/// The rank of an experiment in one form.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TableEntry {
    /// Name of the form.
    pub form: String,
    /// Its letter (docs/mathematics.md, section 3).
    pub column: String,
    /// Number of columns.
    pub columns: usize,
    /// The structural rank measured here.
    pub measured: usize,
    /// The expected rank.
    pub expected: usize,
}

/// Runs every scenario of docs/mathematics.md, section 7, and every case of docs/mathematics.md, section 9.
pub fn truth_table() -> TruthTable {
    let mut sections: Vec<TableSection> = SECTIONS
        .par_iter()
        .map(|section| TableSection {
            title: section.title.to_owned(),
            rows: section.rows.par_iter().filter_map(measure).collect(),
        })
        .collect();
    sections.push(TableSection {
        title: "Least number of frames for the full rank of the minimal form (three joints, generic)".to_owned(),
        rows: LEAST_FRAMES.par_iter().filter_map(least_frames).collect(),
    });
    let rows = || sections.iter().flat_map(|section| &section.rows);
    let spurious = spurious::measure();
    let compared = rows().map(TableRow::compared).sum::<usize>() + spurious.len();
    let agreeing = rows().map(TableRow::agreeing).sum::<usize>() + spurious.iter().filter(|row| row.agrees).count();
    TruthTable { sections, spurious, compared, agreeing }
}

pub(super) fn setup(mechanism: &str, joints: Joints, poses: Poses, frames: usize) -> Option<LaboratorySetup> {
    let mut setup = LaboratorySetup::new(Mechanism::named(mechanism).ok()?);
    setup.joints = match joints {
        Joints::Known => JointKnowledge::Known,
        Joints::Prior(degrees) => JointKnowledge::Encoder(degrees.to_radians()),
        Joints::Free => JointKnowledge::Unknown,
    };
    setup.poses = match poses {
        Poses::Known => PoseKnowledge::Known,
        Poses::BiasKnown | Poses::BiasFree => {
            PoseKnowledge::Inertial { noise: LABORATORY_IMU, biases_known: poses == Poses::BiasKnown }
        }
    };
    setup.frames = frames;
    if joints == Joints::Free {
        setup.landmarks = LANDMARKS_WITHOUT_ENCODER;
    }
    Some(setup)
}

fn measure(truth: &Truth) -> Option<TableRow> {
    let mut setup = setup(truth.mechanism, truth.joints, truth.poses, truth.frames)?;
    setup.motion = truth.motion;
    setup.frozen = truth.frozen.iter().map(|joint| joint - 1).collect();
    let forms: Vec<LaboratoryForm> = truth.ranks.iter().map(|(column, _)| column.form()).collect();
    let results = setup.run_all(&forms);
    if results.len() != forms.len() {
        return None;
    }
    let entries = truth
        .ranks
        .iter()
        .zip(&results)
        .map(|((column, expected), result)| TableEntry {
            form: result.form.name(),
            column: column.name().to_owned(),
            columns: result.rank.parameters.len(),
            measured: result.rank.rank_structural,
            expected: *expected,
        })
        .collect();
    let minimal = LaboratoryForm::whole(Parameterization::Minimal);
    let null_of_minimal = results
        .iter()
        .find(|result| result.form == minimal)
        .map_or_else(Vec::new, |result| result.null_parameters())
        .into_iter()
        .map(|parameter| ParameterNames::default().name(parameter))
        .collect::<Vec<_>>();
    let expected = truth.causes.map(|[parameterization, joints, absorbed, motion]| Deficit {
        parameterization,
        joints,
        absorbed,
        motion,
    });
    Some(
        TableRow {
            scenario: truth.scenario.to_owned(),
            mechanism: truth.mechanism.to_owned(),
            motion: truth.motion.name().to_owned(),
            entries,
            deficit: results.first().map(LaboratoryResult::deficit),
            deficit_expected: expected,
            null_of_minimal,
            null_of_minimal_expected: truth
                .null_of_minimal
                .map(|names| names.iter().map(|name| (*name).to_owned()).collect()),
            agrees: false,
        }
        .judged(),
    )
}

/// Fewer frames than needed for the rank, then as many; the entry's numbers are frames.
fn least_frames(truth: &LeastFrames) -> Option<TableRow> {
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let mut found = None;
    for frames in 2..=MOST_FRAMES {
        let result = setup("generic", truth.joints, truth.poses, frames)?.run(form)?;
        if result.rank.rank_structural >= truth.rank {
            found = Some((frames, result));
            break;
        }
    }
    let (frames, result) = found?;
    let (least, most) = truth.frames;
    Some(
        TableRow {
            scenario: truth.scenario.to_owned(),
            mechanism: "generic".to_owned(),
            motion: super::LaboratoryMotion::Aggressive.name().to_owned(),
            entries: vec![TableEntry {
                form: form.name(),
                column: "frames".to_owned(),
                columns: result.rank.parameters.len(),
                measured: frames,
                expected: frames.clamp(least, most),
            }],
            deficit: None,
            deficit_expected: None,
            null_of_minimal: Vec::new(),
            null_of_minimal_expected: None,
            agrees: false,
        }
        .judged(),
    )
}

impl TableRow {
    fn judged(mut self) -> Self {
        self.agrees = self.agreeing() == self.compared();
        self
    }

    fn compared(&self) -> usize {
        self.entries.len()
            + usize::from(self.deficit_expected.is_some())
            + usize::from(self.null_of_minimal_expected.is_some())
    }

    fn agreeing(&self) -> usize {
        let ranks = self.entries.iter().filter(|entry| entry.measured == entry.expected).count();
        let causes = self.deficit_expected.is_some() && self.deficit == self.deficit_expected;
        let names = self.null_of_minimal_expected.as_ref().is_some_and(|names| {
            let sorted = |names: &[String]| {
                let mut names = names.to_vec();
                names.sort_unstable();
                names
            };
            sorted(names) == sorted(&self.null_of_minimal)
        });
        ranks + usize::from(causes) + usize::from(names)
    }
}

impl Column {
    fn form(self) -> LaboratoryForm {
        let parameterization = match self {
            Self::C | Self::CWithout => Parameterization::Classical,
            Self::M | Self::MWithout => Parameterization::Minimal,
            Self::B => Parameterization::MinimalSwapped,
            Self::Mb => Parameterization::MinimalYx,
            Self::P => Parameterization::Poe,
        };
        LaboratoryForm { parameterization, joint_offsets: !matches!(self, Self::CWithout | Self::MWithout) }
    }

    fn name(self) -> &'static str {
        match self {
            Self::C => "C",
            Self::CWithout => "C-",
            Self::M => "M",
            Self::MWithout => "M-",
            Self::B => "B",
            Self::Mb => "Mb",
            Self::P => "P",
        }
    }
}

impl fmt::Display for TruthTable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            out,
            "Structural ranks, measured/expected by docs/mathematics.md, section 7 (! where they differ).\n\
             C classical, M minimal, B minimal-swapped, Mb minimal-yx, P poe, - without joint offsets; lost to the\n\
             parameterization (G), joints that do not move (F), free joint angles (E), motion (M), of the first form."
        )?;
        for section in &self.sections {
            writeln!(out, "\n{}", section.title)?;
            for row in &section.rows {
                row.write(out)?;
            }
        }
        writeln!(out, "\n{}", spurious::title())?;
        for row in &self.spurious {
            writeln!(out, "{row}")?;
        }
        writeln!(
            out,
            "\n{} of {} results agree with docs/mathematics.md, sections 7 and 9",
            self.agreeing, self.compared
        )
    }
}

impl TableRow {
    fn write(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.agrees { ' ' } else { '!' };
        let ranks: Vec<String> = self
            .entries
            .iter()
            .map(|entry| format!("{} {}/{}", entry.column, entry.measured, entry.expected))
            .collect();
        write!(out, "{mark} {:<42}{:<47}", self.scenario, ranks.join("  "))?;
        if let Some(deficit) = &self.deficit {
            write!(out, "{:<12}", deficit.short())?;
        }
        let wanted = self.null_of_minimal_expected.as_ref();
        if !self.null_of_minimal.is_empty() || wanted.is_some_and(|names| !names.is_empty()) {
            write!(out, " null of M: {}", short_list(&self.null_of_minimal))?;
        }
        writeln!(out)
    }
}

/// The names, or the first few and how many more.
fn short_list(names: &[String]) -> String {
    const SHOWN: usize = 6;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(" ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

impl Deficit {
    /// `G6 F4`, or `-` when nothing is lost.
    pub(super) fn short(&self) -> String {
        let parts = [("G", self.parameterization), ("F", self.joints), ("E", self.absorbed), ("M", self.motion)];
        let lost: Vec<String> =
            parts.iter().filter(|(_, count)| *count > 0).map(|(name, count)| format!("{name}{count}")).collect();
        if lost.is_empty() { "-".to_owned() } else { lost.join(" ") }
    }
}
