//! From the first images to the first window: frames that wait for the initialization, and the window made from its solution.

mod extrinsics_fit;
mod first_window;
pub(crate) mod initializer;
