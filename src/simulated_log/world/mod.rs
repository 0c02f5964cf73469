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
pub(crate) use texture::{Footprints, axes, lanes};

use crate::simulation::experiment::{Environment, WorldKind};

/// Builds a world; textures depend on the seed, the plan does not. Of a kind that the environment does not have, it is
/// textured.
pub(crate) fn build(environment: Environment, kind: WorldKind, seed: u64) -> World {
    match environment {
        Environment::House => house::build(kind == WorldKind::Plain, seed),
        Environment::Town => town::build(kind == WorldKind::Facades, seed),
    }
}
