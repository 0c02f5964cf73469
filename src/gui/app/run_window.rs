//! Opening the window on a display.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use egui::{IconData, ViewportBuilder};
use thiserror::Error;

use super::kept_window::{KeptWindow, place_on_screen};
use super::software_window::SoftwareWindow;
use crate::gui::app::{App, OpenLog, OpenRequest, OpenStudy, PlayingLog};
use crate::gui::desktop::Desktop;
use crate::gui::rendering::scene_backend::SceneBackend;
use crate::gui::theme::ThemeName;

/// Packages for the window on a server without a desktop (Debian and Ubuntu).
pub const WINDOW_PACKAGES: &str = "mesa-vulkan-drivers libx11-6 libxcursor1 libxi6 libxkbcommon-x11-0";

/// Icon of the window in its title bar and in the task bar.
const ICON_PNG: &[u8] = include_bytes!("../../../assets/icon/dcvins-128.png");

/// Reason why the window cannot be opened.
#[derive(Debug, Error)]
pub enum WindowError {
    #[error(
        "no display: neither WAYLAND_DISPLAY nor DISPLAY is set\n\
         start it in a desktop session or through 'ssh -X'; 'dcvins screenshot' renders panels without a display"
    )]
    NoDisplay,
    /// A library or a graphics driver is missing, or the display refused the connection.
    #[error("the window cannot be opened: {problem}\n{remedy}")]
    Refused { problem: String, remedy: String },
}

pub struct WindowOptions {
    /// A session that is already open.
    pub log: Option<Box<dyn PlayingLog>>,
    /// Files to open when the window is shown.
    pub request: Option<OpenRequest>,
    /// Opens the logs that the user selects.
    pub open_log: OpenLog,
    pub open_study: OpenStudy,
    pub desktop: Arc<dyn Desktop>,
    pub theme: ThemeName,
    /// True if the tour starts immediately.
    pub tour: bool,
}

/// Opens the window and returns when it is closed.
pub fn run_window(options: WindowOptions) -> Result<(), WindowError> {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if cfg!(target_os = "linux") && !["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"].into_iter().any(set) {
        return Err(WindowError::NoDisplay);
    }
    let kept = options.desktop.kept_window();
    let is_first = kept.is_none();
    let kept = KeptWindow::from_text(&kept.unwrap_or_default());
    let viewport = ViewportBuilder::default()
        .with_title("dcvins")
        // Name of the desktop entry, `assets/linux/dcvins.desktop`.
        .with_app_id("dcvins")
        .with_icon(icon())
        .with_drag_and_drop(true);
    let viewport = kept.place.of(viewport);
    // Colours have eight bits already, and a CPU adapter would compute the noise of every pixel.
    let native = eframe::NativeOptions {
        viewport,
        system_font_fallback: false,
        dithering: false,
        ..eframe::NativeOptions::default()
    };
    let start = move || {
        eframe::run_native(
            "dcvins",
            native,
            Box::new(move |creation| {
                arrange_drawing(creation.wgpu_render_state.as_ref(), &creation.egui_ctx);
                if let Some(window) = creation.winit_window() {
                    place_on_screen(window, is_first);
                }
                let mut app =
                    App::new(options.open_log, options.desktop, options.theme).with_studies(options.open_study);
                if let Some(log) = options.log {
                    app.show(log, None);
                }
                if let Some(request) = options.request {
                    app.open(request);
                }
                if options.tour {
                    app.start_tour();
                }
                Ok(Box::new(app))
            }),
        )
    };
    // The loader of the keyboard library panics if the library is missing; the panic is reported as an error.
    match without_loader_panics(start) {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(display_error(error.to_string())),
        Err(problem) => Err(display_error(problem)),
    }
}

fn icon() -> IconData {
    eframe::icon_data::from_png_bytes(ICON_PNG).expect("the icon is a PNG, as a test checks")
}

/// Selects the renderer: the graphics card, or with a CPU adapter this program's own painter, which is several times
/// faster there.
fn arrange_drawing(state: Option<&eframe::egui_wgpu::RenderState>, context: &egui::Context) {
    match state {
        Some(state) if state.adapter.get_info().device_type != wgpu::DeviceType::Cpu => {
            SceneBackend::Wgpu(state.target_format).set(context);
        }
        Some(state) => {
            SceneBackend::Cpu.set(context);
            context.add_plugin(SoftwareWindow::new(state.target_format));
        }
        None => SceneBackend::Cpu.set(context),
    }
}

fn display_error(problem: String) -> WindowError {
    let remedy = if cfg!(target_os = "linux") {
        format!(
            "on a machine without a desktop install the packages of the window: apt-get install {WINDOW_PACKAGES}\n\
             'dcvins screenshot' renders panels without a display"
        )
    } else {
        "check that the graphics driver supports Vulkan, Metal, Direct3D 12 or OpenGL".to_owned()
    };
    WindowError::Refused { problem, remedy }
}

/// Runs a function and returns a panic about a library that cannot be loaded as an error; other panics propagate.
fn without_loader_panics<T>(run: impl FnOnce() -> T) -> Result<T, String> {
    const SIGN: &str = "could not be loaded";
    let text = |payload: &(dyn std::any::Any + Send)| {
        let text =
            payload.downcast_ref::<String>().map(String::as_str).or_else(|| payload.downcast_ref::<&str>().copied());
        text.unwrap_or_default().to_owned()
    };
    let before = Arc::new(std::panic::take_hook());
    let forward = Arc::clone(&before);
    std::panic::set_hook(Box::new(move |info| {
        if !text(info.payload()).contains(SIGN) {
            forward(info);
        }
    }));
    let result = catch_unwind(AssertUnwindSafe(run));
    drop(std::panic::take_hook());
    std::panic::set_hook(Box::new(move |info| before(info)));
    result.or_else(|payload| {
        let message = text(payload.as_ref());
        if message.contains(SIGN) { Err(message) } else { std::panic::resume_unwind(payload) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_icon_is_a_square() {
        let icon = icon();
        assert_eq!((icon.width, icon.height), (128, 128));
    }

    #[test]
    fn missing_libraries_become_errors_and_other_panics_go_on() {
        assert_eq!(without_loader_panics(|| 7), Ok(7));
        let missing = without_loader_panics::<()>(|| panic!("Library {} could not be loaded.", "libx.so"));
        assert_eq!(missing, Err("Library libx.so could not be loaded.".to_owned()));
        let other = catch_unwind(|| without_loader_panics::<()>(|| std::panic::panic_any("something else")));
        assert!(other.is_err());
    }

    #[test]
    fn a_display_error_names_the_missing_packages() {
        let text = display_error("no adapter".to_owned()).to_string();
        assert!(text.starts_with("the window cannot be opened: no adapter"));
        assert!(!cfg!(target_os = "linux") || text.contains(WINDOW_PACKAGES));
    }
}
