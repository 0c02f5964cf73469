//! Tests: panels as figures contain nothing that a user can operate.

use std::sync::Arc;

use egui::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use super::{MainWindow, Panels, alone_ui};
use crate::gui::desktop::PanelExport;
use crate::gui::samples::{sample_images, sample_recording_of};
use crate::gui::tests::parameter;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{PanelContext, PanelName, Playback, Presentation, Selection};
use crate::observability::{SlideDirection, SlidePosition};
use crate::session::Recording;
use crate::session::breakpoints::Breakpoints;
use crate::text::Named as _;

/// Accessibility roles of widgets that a click, a drag or a key changes.
const OPERABLE: [Role; 12] = [
    Role::Button,
    Role::CheckBox,
    Role::ComboBox,
    Role::DisclosureTriangle,
    Role::Link,
    Role::MenuItem,
    Role::RadioButton,
    Role::Slider,
    Role::SpinButton,
    Role::Switch,
    Role::Tab,
    Role::TextInput,
];

/// Panels with a toolbar.
const WITH_CONTROLS: [PanelName; 6] = [
    PanelName::Image,
    PanelName::Scene,
    PanelName::Laboratory,
    PanelName::Comparison,
    PanelName::Breakpoints,
    PanelName::Timeline,
];

/// Labels of the operable widgets of a panel that shows a selection, a moved chain and a breakpoint.
fn operable(recording: &Recording, panel: PanelName, presentation: Presentation, size: [f32; 2]) -> Vec<String> {
    let cursor_ns = recording.last_stamp_ns();
    let mut breakpoints = Breakpoints::default();
    breakpoints.add("features < 40".parse().unwrap());
    breakpoints.read(recording);
    let playback = Playback { breakpoints: Arc::new(breakpoints), ..Playback::default() };
    let step = recording.runs[0].step_at(cursor_ns).unwrap();
    let selection = Selection {
        feature: step.report.features.first().map(|feature| feature.id),
        parameter: Some(parameter("L2.alpha")),
        slide: Some(SlidePosition { direction: SlideDirection::Measured(0), amount: 0.5 }),
        ..Selection::default()
    };
    let ui = |ui: &mut egui::Ui, (window, selection): &mut (MainWindow, Selection)| {
        let theme = Theme::of(ThemeName::Print);
        let mut context = PanelContext {
            recording,
            cursor_ns,
            playback: &playback,
            images: &mut sample_images(),
            selection,
            theme: &theme,
            presentation,
            commands: &mut Vec::new(),
        };
        alone_ui(panel, ui, &mut window.panels, &mut context);
    };
    let mut harness = Harness::builder()
        .with_size(size)
        .with_max_steps(20)
        .with_context_setup(|ctx| Theme::of(ThemeName::Print).apply(ctx))
        .build_ui_state(ui, (MainWindow::default(), selection));
    harness.run_steps(3);
    let nodes = harness.query_all(By::new().predicate(|node| OPERABLE.contains(&node.role())));
    nodes
        .map(|node| format!("{:?} {}", node.accesskit_node().role(), node.accesskit_node().label().unwrap_or_default()))
        .collect()
}

#[test]
fn figures_have_no_buttons_sliders_or_selectors() {
    for runs in [&["auto"][..], &["auto", "classical"]] {
        let recording = sample_recording_of(80, runs);
        for panel in PanelName::all() {
            for size in [[1400.0, 900.0], [640.0, 480.0]] {
                let found = operable(&recording, panel, Presentation::Figure, size);
                assert!(found.is_empty(), "{} with {} runs at {size:?}: {found:?}", panel.name(), runs.len());
            }
            // The same panels in the window, to verify that the list of roles finds controls.
            if WITH_CONTROLS.contains(&panel) {
                let found = operable(&recording, panel, Presentation::Interactive, [1400.0, 900.0]);
                assert!(!found.is_empty(), "{} has no controls", panel.name());
            }
        }
    }
}

#[test]
fn an_exported_comparison_shows_its_tables_and_plots_completely() {
    let export = exported(PanelName::Comparison);
    let height = export.screenshot.height() as f32 / 2.0;
    assert!(height > 550.0, "{height}");
    crate::gui::tests::keep_screenshot("exported-comparison", &export.screenshot);
}

#[test]
fn the_drawing_of_an_exported_image_has_the_image() {
    let export = exported(PanelName::Image);
    assert!(export.drawing.contains("<image "), "no image in {} bytes", export.drawing.len());
}

/// Export of a panel that is too low for its tables, with two runs.
fn exported(panel: PanelName) -> PanelExport {
    let recording = sample_recording_of(80, &["auto", "classical"]);
    let theme = Theme::of(ThemeName::Light);
    let (playback, mut commands, mut selection) = (Playback::default(), Vec::new(), Selection::default());
    let mut context = PanelContext {
        recording: &recording,
        cursor_ns: recording.last_stamp_ns(),
        playback: &playback,
        images: &mut sample_images(),
        selection: &mut selection,
        theme: &theme,
        presentation: Presentation::Interactive,
        commands: &mut commands,
    };
    super::panel_export::export(&Panels::default(), (panel, egui::vec2(700.0, 400.0)), &mut context)
}
