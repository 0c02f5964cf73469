//! Environments of the experiments, built from textured surfaces.

mod canvas;
mod facade;
mod furniture;
mod house;
mod landscape;
mod mesh;
mod surface;
mod texture;
mod town;

pub(crate) use mesh::{Affine, Bounds, World};
pub(crate) use texture::Footprints;

use super::experiment::Environment;

/// Builds a world; textures depend on the seed, the plan does not.
pub(crate) fn build(environment: Environment, seed: u64) -> World {
    match environment {
        Environment::House => house::build(seed),
        Environment::Town => town::build(seed),
    }
}
