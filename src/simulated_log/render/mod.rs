//! Images of an environment, rendered on the CPU: z-buffered faces, eight samples per pixel at edges, filtered
//! textures, shadows.
//!
//! Faces are first rasterized to a buffer of face numbers with eight samples per pixel; then every pixel is shaded
//! once, or once per face if it contains several. Edges are smooth, and only visible textures are sampled.

mod raster;
mod sensor;
mod shade;
mod shadow;
mod view;

pub(crate) use raster::Workspace;
pub(crate) use sensor::{Sensor, SensorOptions};
pub(crate) use shade::SurfaceShader;
pub(crate) use view::RenderedView;
