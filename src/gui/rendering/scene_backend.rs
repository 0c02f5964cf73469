//! The renderer of the 3D scene in a context.

use egui::{Context, Id};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SceneBackend {
    /// On the CPU into a texture: for screenshots, and for windows on a CPU adapter.
    #[default]
    Cpu,
    /// With wgpu in egui's paint callback, into targets of this format.
    Wgpu(wgpu::TextureFormat),
}

impl SceneBackend {
    fn key() -> Id {
        Id::unique("scene back end")
    }

    /// Sets the backend of a context; the default is the CPU.
    pub fn set(self, context: &Context) {
        context.data_mut(|data| data.insert_temp(Self::key(), self));
    }

    pub fn of(context: &Context) -> Self {
        context.data(|data| data.get_temp(Self::key())).unwrap_or_default()
    }
}
