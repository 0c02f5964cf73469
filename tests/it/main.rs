//! Integration tests, one module per feature.

mod cameras;
mod changed_inputs;
mod check;
mod command_line;
mod convert;
mod degeneracy;
mod dependencies;
mod documentation;
mod evaluate;
mod flights;
mod follow;
mod hostile_logs;
mod imports;
mod layering;
#[cfg(feature = "gui")]
mod manual_screenshots;
mod masks;
mod open_sources;
mod other_estimators;
mod outputs;
mod plan;
mod python;
mod release;
#[cfg(feature = "gui")]
mod renderers;
mod report;
mod result_cache;
mod results;
mod rig_template;
mod sample_folder;
mod sample_log;
#[cfg(feature = "gui")]
mod screenshots;
#[cfg(unix)]
mod slurm;
mod stills;
#[cfg(feature = "gui")]
mod studies;
#[cfg(feature = "gui")]
mod study_sample;
mod sweep;
mod thresholds;
mod time_travel;
mod trajectories;
#[cfg(feature = "gui")]
mod tutorial;
