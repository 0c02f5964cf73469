//! Rig files: this program's schema and Kalibr's, read and written.

pub(crate) mod attitude;
mod document;
mod fields;
mod find;
mod kalibr;
mod keys;
mod mask;
mod read;
mod save;
mod sensor;
pub mod template;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use read::CameraFacts;
