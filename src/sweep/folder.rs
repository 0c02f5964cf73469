//! The folder of a study: its plan, flights, jobs and tables.
//!
//! ```text
//! DIR/study.json            marks the folder as a study
//! DIR/plan.toml             copy of the plan
//! DIR/results.parquet, results.csv, parameters.parquet, parameters.csv, frames.parquet, tables.md
//! DIR/flights/ID/           a simulated flight with its rig and ground truth
//! DIR/jobs/KEY/job.json     inputs of a job
//! DIR/jobs/KEY/stderr.txt   standard error of its last attempt
//! DIR/jobs/KEY/*.parquet    its rows; results.parquet is written last, and marks the job as done
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::StudyFileError;
use super::parquet_table::{read_parquet, stage_parquet};
use crate::files::output;
use crate::files::output::OutputSet;
use crate::study::{KeyedJob, SimulatedFlight, StudyJob, StudyOutput, StudyPlan, StudyTable, StudyTables};

/// File that identifies the folder of a study.
pub(super) const INDEX: &str = "study.json";
/// The table of runs; the rows of a job have the same name in its folder.
const RUNS: &str = "results";
const PARAMETERS: &str = "parameters";
const FRAMES: &str = "frames";
/// The Markdown tables of the plan.
const SUMMARY: &str = "tables.md";

#[derive(Debug, Serialize, Deserialize)]
struct StudyIndex {
    /// Version of the folder's layout.
    dcvins_study: u32,
    name: String,
    /// Absolute path of the plan.
    plan: PathBuf,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StudyFolder {
    root: PathBuf,
}

impl StudyFolder {
    /// A new folder for the study of a plan, or the folder of an earlier sweep, which is resumed.
    ///
    /// # Errors
    /// If the folder contains something else, or cannot be written.
    pub fn create(root: &Path, plan: &StudyPlan, plan_path: &Path) -> Result<Self, StudyFileError> {
        output::check_folder(root).map_err(StudyFileError::write(root))?;
        let mut names = fs::read_dir(root).into_iter().flatten().filter_map(Result::ok).map(|entry| entry.file_name());
        let foreign = names.find(|name| !output::is_temporary(name));
        if let Some(found) = foreign.filter(|_| !root.join(INDEX).is_file()) {
            let found = found.to_string_lossy().into_owned();
            return Err(StudyFileError::NoStudy { found, index: INDEX, path: root.to_owned() });
        }
        for folder in [root.to_owned(), root.join("jobs"), root.join("flights")] {
            fs::create_dir_all(&folder).map_err(StudyFileError::write(&folder))?;
        }
        let root = fs::canonicalize(root).map_err(StudyFileError::read(root))?;
        let plan_path = fs::canonicalize(plan_path).map_err(StudyFileError::read(plan_path))?;
        let text = fs::read(&plan_path).map_err(StudyFileError::read(&plan_path))?;
        let index = StudyIndex { dcvins_study: 1, name: plan.name.clone(), plan: plan_path };
        let index = serde_json::to_vec_pretty(&index).unwrap_or_default();
        let mut outputs = OutputSet::default();
        for (name, content) in [("plan.toml", &text), (INDEX, &index)] {
            let path = root.join(name);
            outputs.write(&path, content).map_err(StudyFileError::write(&path))?;
        }
        outputs.commit().map_err(StudyFileError::commit)?;
        Ok(Self { root })
    }

    /// An existing folder of a study.
    ///
    /// # Errors
    /// If there is no study in the folder.
    pub fn open(root: &Path) -> Result<Self, StudyFileError> {
        let index = root.join(INDEX);
        fs::metadata(&index).map_err(StudyFileError::read(&index))?;
        Ok(Self { root: fs::canonicalize(root).map_err(StudyFileError::read(root))? })
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    /// File with the hashes of logs.
    pub fn hash_cache(&self) -> PathBuf {
        self.root.join("hashes.json")
    }

    pub fn job(&self, key: &str) -> PathBuf {
        self.root.join("jobs").join(key)
    }

    /// File with the standard error of the last attempt of a job.
    pub fn job_stderr(&self, key: &str) -> PathBuf {
        self.job(key).join("stderr.txt")
    }

    pub(super) fn flight_folder(&self, flight: &SimulatedFlight) -> PathBuf {
        self.root.join("flights").join(flight.id())
    }

    /// File with the standard error of the rendering of a flight.
    pub fn flight_stderr(&self, flight: &SimulatedFlight) -> PathBuf {
        self.root.join("flights").join(format!("{}.stderr.txt", flight.id()))
    }

    /// Folder of the batch script and the logs of Slurm.
    pub fn slurm(&self) -> PathBuf {
        self.root.join("slurm")
    }

    /// Path of a file for the tables: relative to the folder of the study if the file is in it.
    pub(super) fn relative(&self, path: &Path) -> String {
        path.strip_prefix(&self.root).unwrap_or(path).display().to_string()
    }

    /// Writes the inputs of a job for its process.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write_job(&self, job: &KeyedJob) -> Result<(), StudyFileError> {
        let folder = self.job(&job.key);
        fs::create_dir_all(&folder).map_err(StudyFileError::write(&folder))?;
        let path = folder.join("job.json");
        let text = serde_json::to_vec_pretty(&job.job).unwrap_or_default();
        output::write_file(&path, &text).map_err(StudyFileError::write(&path))
    }

    /// Reads the inputs of a job.
    ///
    /// # Errors
    /// If there is no such job, or its description is damaged.
    pub fn read_job(&self, key: &str) -> Result<StudyJob, StudyFileError> {
        let path = self.job(key).join("job.json");
        let text = fs::read(&path).map_err(StudyFileError::read(&path))?;
        serde_json::from_slice(&text)
            .map_err(|error| StudyFileError::Job { problem: error.to_string(), path: path.clone() })
    }

    /// True if the rows of a job exist.
    pub fn is_done(&self, key: &str, plan: &StudyPlan) -> bool {
        let folder = self.job(key);
        let table = |name: &str| folder.join(format!("{name}.parquet")).is_file();
        table(RUNS) && (!plan.output.frames || table(FRAMES))
    }

    /// Row of a job in the table of runs, `None` if the job is not done.
    ///
    /// # Errors
    /// If the row cannot be read.
    pub fn run_of(&self, key: &str) -> Result<Option<StudyTable>, StudyFileError> {
        let path = self.job(key).join(format!("{RUNS}.parquet"));
        path.is_file().then(|| read_parquet(&path)).transpose()
    }

    /// Writes the rows of a job; the row of the run comes last.
    pub(super) fn write_rows(
        &self,
        key: &str,
        tables: &StudyTables,
        output: StudyOutput,
    ) -> Result<(), StudyFileError> {
        let folder = self.job(key);
        fs::create_dir_all(&folder).map_err(StudyFileError::write(&folder))?;
        let mut outputs = OutputSet::default();
        let frames = output.frames.then_some((FRAMES, &tables.frames));
        let written = [(PARAMETERS, &tables.parameters)].into_iter().chain(frames).chain([(RUNS, &tables.runs)]);
        for (name, table) in written {
            outputs.add(stage_parquet(table, &folder.join(format!("{name}.parquet")))?);
        }
        outputs.commit().map_err(StudyFileError::commit)
    }

    /// Removes the rows of a job, so that it runs again.
    ///
    /// # Errors
    /// If the rows cannot be removed.
    pub fn forget(&self, key: &str) -> Result<(), StudyFileError> {
        let path = self.job(key).join(format!("{RUNS}.parquet"));
        if path.is_file() { fs::remove_file(&path).map_err(StudyFileError::write(&path)) } else { Ok(()) }
    }

    /// Rows of all jobs that are done, in the order of the jobs, and the number of the other jobs.
    ///
    /// # Errors
    /// If rows cannot be read.
    pub fn collect(&self, jobs: &[KeyedJob], plan: &StudyPlan) -> Result<(StudyTables, usize), StudyFileError> {
        let (mut tables, mut missing) = (StudyTables::default(), 0);
        for job in jobs {
            if !self.is_done(&job.key, plan) {
                missing += 1;
                continue;
            }
            let folder = self.job(&job.key);
            let wanted = [
                (RUNS, &mut tables.runs, true),
                (PARAMETERS, &mut tables.parameters, true),
                (FRAMES, &mut tables.frames, plan.output.frames),
            ];
            for (name, all, _) in wanted.into_iter().filter(|(_, _, wanted)| *wanted) {
                let path = folder.join(format!("{name}.parquet"));
                let rows = read_parquet(&path)?;
                all.append(&rows).map_err(|source| StudyFileError::Table { source: Box::new(source), path })?;
            }
        }
        Ok((tables, missing))
    }

    /// Writes the tables of the study and returns their paths.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write_tables(&self, tables: &StudyTables, plan: &StudyPlan) -> Result<Vec<PathBuf>, StudyFileError> {
        let mut outputs = OutputSet::default();
        let mut paths = Vec::new();
        for (name, table) in [(RUNS, &tables.runs), (PARAMETERS, &tables.parameters)] {
            let [parquet, csv] = ["parquet", "csv"].map(|kind| self.root.join(format!("{name}.{kind}")));
            outputs.add(stage_parquet(table, &parquet)?);
            outputs.write(&csv, table.csv(0..table.rows()).as_bytes()).map_err(StudyFileError::write(&csv))?;
            paths.extend([parquet, csv]);
        }
        if plan.output.frames {
            let path = self.root.join(format!("{FRAMES}.parquet"));
            outputs.add(stage_parquet(&tables.frames, &path)?);
            paths.push(path);
        }
        if !plan.tables.is_empty() {
            let path = self.root.join(SUMMARY);
            outputs.write(&path, plan.tables_text(&tables.runs).as_bytes()).map_err(StudyFileError::write(&path))?;
            paths.push(path);
        }
        outputs.commit().map_err(StudyFileError::commit)?;
        Ok(paths)
    }
}
