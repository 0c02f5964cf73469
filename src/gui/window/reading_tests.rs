//! Tests of reading values in plots: the pointer's time, reading cursors, value axes, lines of events.

use egui::{Event, Key, Modifiers, MouseWheelSource, MouseWheelUnit, PointerButton, Pos2, Role, TouchPhase, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::tests::{Bench, SECOND_NS, bench_of, bench_with, sample};
use super::{MainWindow, Preset, window_ui};
use crate::gui::painted_texts::{PaintedText, painted_texts};
use crate::gui::rendering::headless::{Headless, HeadlessOptions};
use crate::gui::samples::sample_images;
use crate::gui::tests::keep_screenshot;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{PanelContext, PanelName, Playback, Presentation, ReadingCursor, Selection};
use crate::painting::painter::Painter;

/// The plot of the first parameter.
const PLOT: &str = "I.rx";

/// Position in the plot of the first parameter by fractions of its size.
fn place(harness: &Harness<'static, Bench>, x: f32, y: f32) -> Pos2 {
    let plots = harness.query_all_by_label_contains(PLOT);
    let rect = plots.map(|node| node.rect()).find(|rect| rect.height() > 20.0 && rect.width() > 60.0).unwrap();
    rect.min + vec2(x, y) * rect.size()
}

fn point_at(harness: &mut Harness<'static, Bench>, at: Pos2) {
    harness.event(Event::PointerMoved(at));
    harness.run_steps(2);
}

fn scroll(harness: &mut Harness<'static, Bench>, modifiers: Modifiers) {
    harness.event(Event::ModifiersChanged(modifiers));
    let (unit, phase, source) = (MouseWheelUnit::Point, TouchPhase::Move, MouseWheelSource::Unknown);
    harness.event(Event::MouseWheel { unit, delta: vec2(0.0, 120.0), phase, source, modifiers });
    harness.run_steps(20);
    harness.event(Event::ModifiersChanged(Modifiers::NONE));
    harness.run_steps(2);
}

#[test]
fn the_pointer_reads_all_plots_and_keys_set_both_cursors() {
    let mut harness = bench_with(PanelName::Convergence);
    assert_eq!(harness.state().selection.reading.pointer_ns, None);
    for (x, key, cursor) in [(0.25, Key::C, ReadingCursor::A), (0.75, Key::V, ReadingCursor::B)] {
        let at = place(&harness, x, 0.5);
        point_at(&mut harness, at);
        // The log lasts four seconds.
        let pointed_ns = harness.state().selection.reading.pointer_ns.unwrap();
        let expected_ns = (f64::from(x) * 4e9) as i64;
        assert!((pointed_ns - expected_ns).abs() < SECOND_NS / 20, "{pointed_ns}");
        harness.key_press(key);
        harness.run_steps(2);
        assert_eq!(harness.state().selection.reading.cursor_ns(cursor), Some(pointed_ns));
    }
    let interval_ns = harness.state().selection.reading.interval_ns().unwrap();
    assert!((interval_ns - 2 * SECOND_NS).abs() < SECOND_NS / 20);
    assert!(harness.query_by_label("Δt").is_some(), "the status bar shows the interval");
    harness.key_press(Key::X);
    harness.run_steps(2);
    assert_eq!(harness.state().selection.reading.interval_ns(), None);
    // Without a plot under the pointer a cursor is set at the playback cursor.
    point_at(&mut harness, Pos2::new(2.0, 2.0));
    assert_eq!(harness.state().selection.reading.pointer_ns, None);
    harness.key_press(Key::C);
    harness.run_steps(2);
    let playback_ns = harness.state().cursor_ns;
    assert_eq!(harness.state().selection.reading.cursor_ns(ReadingCursor::A), Some(playback_ns));
}

#[test]
fn a_value_axis_is_zoomed_fixed_and_freed() {
    let mut harness = bench_with(PanelName::Convergence);
    let fixed = |harness: &Harness<'static, Bench>| {
        harness.state().selection.reading.fixed_values.get("convergence I.rx").copied()
    };
    // The key fixes the range as it is.
    let at = place(&harness, 0.5, 0.5);
    point_at(&mut harness, at);
    harness.key_press(Key::Y);
    harness.run_steps(2);
    let [low, high] = fixed(&harness).unwrap();
    assert!(low < high);
    // Alt and the wheel over the plot zoom the values about the pointer, and not the time.
    scroll(&mut harness, Modifiers::ALT);
    let [zoomed_low, zoomed_high] = fixed(&harness).unwrap();
    assert!(zoomed_high - zoomed_low < 0.8 * (high - low), "{zoomed_low} to {zoomed_high}");
    assert!(low < zoomed_low && zoomed_high < high);
    assert_eq!(harness.state().selection.visible_ns, None);
    harness.key_press(Key::Y);
    harness.run_steps(2);
    assert_eq!(fixed(&harness), None);

    // The wheel over the axis does the same without Alt.
    let beside = place(&harness, 0.0, 0.5) - vec2(10.0, 0.0);
    let axes = harness.query_all_by_label("Value axis").map(|node| node.rect());
    let axis = axes.into_iter().find(|rect| rect.contains(beside)).unwrap().center();
    point_at(&mut harness, axis);
    scroll(&mut harness, Modifiers::NONE);
    let [low, high] = fixed(&harness).unwrap();
    assert_eq!(harness.state().selection.visible_ns, None);
    // A drag of the axis moves the range without changing its length.
    for pressed in [true, false] {
        let button = PointerButton::Primary;
        let modifiers = Modifiers::NONE;
        let pos = if pressed { axis } else { axis + vec2(0.0, 12.0) };
        harness.event(Event::PointerMoved(pos));
        harness.run_steps(1);
        harness.event(Event::PointerButton { pos, button, pressed, modifiers });
        harness.run_steps(1);
    }
    harness.run_steps(3);
    let [moved_low, moved_high] = fixed(&harness).unwrap();
    assert!(moved_low > low && (moved_high - moved_low - (high - low)).abs() < 1e-9 * high.abs().max(1.0));
    harness.key_press_modifiers(Modifiers::SHIFT, Key::Y);
    harness.run_steps(2);
    assert_eq!(fixed(&harness), None);
}

#[test]
fn the_menu_of_a_plot_offers_reading() {
    let mut harness = bench_with(PanelName::Convergence);
    let at = place(&harness, 0.5, 0.5);
    let open = |harness: &mut Harness<'static, Bench>| {
        point_at(harness, at);
        for pressed in [true, false] {
            let button = PointerButton::Secondary;
            harness.event(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
            harness.run_steps(1);
        }
        harness.run_steps(2);
    };
    let mut choose = |label: &str| {
        open(&mut harness);
        let item = harness.query_all_by_label_contains(label).find(|node| node.accesskit_node().role() == Role::Button);
        item.unwrap_or_else(|| panic!("no '{label}'")).click();
        harness.run_steps(3);
        let state = harness.state();
        let reading = &state.selection.reading;
        let set = ReadingCursor::ALL.map(|cursor| reading.cursor_ns(cursor).is_some());
        (set, reading.fixed_values.len(), state.window.settings.event_lines, !reading.events.is_empty())
    };
    assert_eq!(choose("Set reading cursor A here"), ([true, false], 0, false, false));
    assert_eq!(choose("Set reading cursor B here"), ([true, true], 0, false, false));
    assert_eq!(choose("Fix the value axis"), ([true, true], 1, false, false));
    assert_eq!(choose("Free the value axis"), ([true, true], 0, false, false));
    assert_eq!(choose("Clear the reading cursors"), ([false, false], 0, false, false));
    assert_eq!(choose("Events and rank losses in all plots"), ([false, false], 0, true, true));
}

#[test]
fn the_name_of_a_reading_cursor_does_not_cover_a_verdict() {
    let mut harness = bench_with(PanelName::Convergence);
    let verdicts = |harness: &Harness<'static, Bench>| -> Vec<egui::Rect> {
        let marked = ["weakly determined", "not determined", "⚠", "✖"];
        let panel =
            harness.state().window.tiles.places.iter().find(|(panel, _)| *panel == PanelName::Convergence).unwrap().1;
        let of = |painted: PaintedText<'_>| {
            (marked.contains(&painted.text()) && panel.contains(painted.rect().center())).then_some(painted.rect())
        };
        painted_texts(harness).into_iter().filter_map(of).collect()
    };
    let free = verdicts(&harness);
    assert!(!free.is_empty());
    for tenths in 0..40 {
        harness.state_mut().selection.reading.set_cursor(ReadingCursor::B, tenths * SECOND_NS / 10);
        harness.run_steps(2);
        let shown = verdicts(&harness);
        assert_eq!(shown, free, "verdicts are beside the plots and do not move");
        for painted in painted_texts(&harness).iter().filter(|painted| painted.text() == "B") {
            let name = painted.rect();
            assert!(shown.iter().all(|verdict| !verdict.intersects(name.shrink(1.0))), "{tenths}: {name:?} {shown:?}");
        }
    }
}

#[test]
fn a_low_residuals_panel_shows_the_values_over_time_without_scrolling() {
    for (size, preset) in [([1366.0, 768.0], Preset::Overview), ([1920.0, 1080.0], Preset::Overview)] {
        let mut harness = bench_of(sample(), size);
        harness.state_mut().window.tiles.layout.arrange(preset);
        harness.state_mut().window.tiles.layout.set_visible(PanelName::Residuals, true);
        harness.run_steps(4);
        let places = &harness.state().window.tiles.places;
        let panel = places.iter().find(|(panel, _)| *panel == PanelName::Residuals).unwrap().1;
        let plot = harness.get_by_label("Reprojection RMS over time").rect();
        assert!(panel.contains_rect(plot) && plot.height() > 30.0, "{size:?}: {plot:?} in {panel:?}");
    }
}

/// A window with the pointer at a position in points, painted.
fn painted(
    theme: ThemeName,
    size_px: [u32; 2],
    preset: Preset,
    pointer: Pos2,
    selection: &mut Selection,
) -> image::RgbaImage {
    let options = HeadlessOptions { size_px, pixels_per_point: 1.0, theme };
    let recording = sample();
    let mut state = MainWindow::default();
    state.settings.event_lines = true;
    state.tiles.arrange(preset);
    if preset == Preset::Overview {
        state.tiles.layout.set_visible(PanelName::Convergence, true);
    }
    let mut ui = |ui: &mut egui::Ui| {
        let mut context = PanelContext {
            recording: &recording,
            cursor_ns: 3 * SECOND_NS,
            playback: &Playback::default(),
            images: &mut sample_images(),
            selection,
            theme: &Theme::of(theme),
            presentation: Presentation::Interactive,
            commands: &mut Vec::new(),
        };
        window_ui(ui, &mut state, &mut context);
    };
    let (mut headless, mut painter) = (Headless::new(options), Painter::new());
    headless.set_frame_time_s(0.02);
    let mut frame = headless.frame(vec![Event::PointerMoved(pointer)], &mut ui);
    for _ in 0..4 {
        painter.set_textures(&frame.textures);
        painter.free_textures(&frame.textures);
        frame.textures.clear();
        frame = headless.frame(Vec::new(), &mut ui);
    }
    painter.set_textures(&frame.textures);
    frame.textures.clear();
    painter.paint(&frame.chunks, size_px, 1.0, Theme::of(theme).background)
}

#[test]
fn values_are_painted_in_all_plots() {
    for (theme, size_px, preset) in [
        (ThemeName::Dark, [1920, 1080], Preset::Overview),
        (ThemeName::Light, [1366, 768], Preset::Overview),
        (ThemeName::Light, [1366, 768], Preset::Comparison),
        (ThemeName::Dark, [1366, 768], Preset::Calibration),
    ] {
        let mut selection = Selection::default();
        selection.reading.set_cursor(ReadingCursor::A, 27 * SECOND_NS / 10);
        selection.reading.set_cursor(ReadingCursor::B, 34 * SECOND_NS / 10);
        // In the timeline at the bottom.
        let pointer = Pos2::new(0.82 * size_px[0] as f32, size_px[1] as f32 - 60.0);
        let with_pointer = painted(theme, size_px, preset, pointer, &mut selection);
        assert!(selection.reading.pointer_ns.is_some());
        let name = format!("reading-{}-{}-{}", theme_name(theme), size_px[0], preset as u8);
        keep_screenshot(&name, &with_pointer);
        let without = painted(theme, size_px, preset, Pos2::new(3.0, 3.0), &mut selection);
        // The line and the values are in the panels above too, far from the pointer.
        let above = size_px[1] - 320;
        let differs = |x: u32, y: u32| with_pointer.get_pixel(x, y) != without.get_pixel(x, y);
        let changed = (0..size_px[0]).flat_map(|x| (40..above).map(move |y| (x, y))).filter(|(x, y)| differs(*x, *y));
        assert!(changed.count() > 200, "{name}");
    }
}

fn theme_name(theme: ThemeName) -> &'static str {
    if theme == ThemeName::Dark { "dark" } else { "light" }
}
