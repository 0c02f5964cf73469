//! Tests of a small screen: it shows whole texts of a legible size, and the summary of the rank panel without
//! scrolling.

use egui::{Key, Rect};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::Preset;
use super::tests::{Bench, bench_of, sample};
use crate::gui::PanelName;
use crate::gui::painted_texts::painted_texts;
use crate::gui::theme::SMALLEST_TEXT;
use crate::session::Recording;
use crate::text::Named as _;

/// Screen of a small laptop in points.
const SMALL: [f32; 2] = [1366.0, 768.0];

/// Asserts that texts are whole and legible. Names of positions in the scene move with the view and are exempt.
fn check_texts(harness: &Harness<'static, Bench>, what: &str) {
    let scene = harness.state().window.tiles.places.iter().find(|(panel, _)| *panel == PanelName::Scene);
    let scene = scene.map_or(Rect::NOTHING, |(_, rect)| *rect);
    let mut texts = painted_texts(harness);
    texts.retain(|painted| {
        !painted.text().trim().is_empty() && painted.clip.y_range().contains(painted.rect().center().y)
    });
    assert!(texts.len() > 50, "{what}: {} texts", texts.len());
    for painted in texts {
        let (text, galley) = (painted.text(), &painted.shape.galley);
        let sizes = galley.job.sections.iter().map(|section| section.format.font_id.size);
        let smallest = sizes.fold(f32::INFINITY, f32::min);
        let (rect, clip) = (painted.rect(), painted.clip.expand(1.0));
        let place = format!("{text:?} at {rect:?} in {clip:?}");
        assert!(smallest >= SMALLEST_TEXT, "{what}: small text {place}, {smallest} points");
        let cut = rect.left() < clip.left() || rect.right() > clip.right();
        // The selector of the direction has a tooltip with the whole text.
        let choice = text.starts_with("uninformed ") || text.starts_with("null ");
        assert!(choice || !galley.elided, "{what}: shortened text {place}");
        assert!(!cut || scene.contains(rect.center()), "{what}: text that is cut off {place}");
    }
}

fn runs(count: usize) -> Recording {
    let mut recording = sample();
    recording.runs.truncate(count);
    recording
}

/// Height of the timeline.
fn timeline_height(harness: &Harness<'static, Bench>) -> f32 {
    let places = &harness.state().window.tiles.places;
    places.iter().find(|(panel, _)| *panel == PanelName::Timeline).map_or(0.0, |(_, rect)| rect.height())
}

#[test]
fn timeline_and_panels_follow_the_size_of_the_window() {
    let sizes = [[800.0, 600.0], SMALL, [1920.0, 1080.0], [3840.0, 2160.0]];
    let settled = |size: [f32; 2]| {
        let mut harness = bench_of(runs(2), size);
        harness.run_steps(4);
        harness
    };
    let heights = sizes.map(|size| timeline_height(&settled(size)));
    assert!(heights[0] > 140.0 && heights[2] > 190.0, "{heights:?}");
    for [from, to] in [[0, 2], [2, 0], [3, 1], [1, 3]] {
        let mut harness = settled(sizes[from]);
        harness.set_size(sizes[to].into());
        harness.run_steps(4);
        assert_eq!(timeline_height(&harness), heights[to], "from {:?} to {:?}", sizes[from], sizes[to]);
        let fresh = settled(sizes[to]);
        assert_eq!(harness.state().window.tiles.places, fresh.state().window.tiles.places);
    }
}

#[test]
fn a_timeline_that_was_dragged_keeps_its_part_of_the_window_until_a_layout_is_chosen() {
    let mut harness = bench_of(runs(2), SMALL);
    harness.run_steps(4);
    let before = timeline_height(&harness);
    let edge = egui::pos2(500.0, SMALL[1] - 22.0 - before);
    harness.drag_at(edge);
    harness.run_steps(2);
    harness.hover_at(edge - egui::vec2(0.0, 100.0));
    harness.run_steps(2);
    harness.drop_at(edge - egui::vec2(0.0, 100.0));
    harness.run_steps(3);
    let dragged = timeline_height(&harness);
    assert!((dragged - before - 100.0).abs() < 12.0, "{before} {dragged}");
    harness.set_size(egui::vec2(2732.0, 1536.0));
    harness.run_steps(4);
    assert!(timeline_height(&harness) > 1.9 * dragged, "{dragged} {}", timeline_height(&harness));
    harness.set_size(SMALL.into());
    harness.key_press(Key::Num1);
    harness.run_steps(4);
    assert_eq!(timeline_height(&harness), before);
}

#[test]
fn a_small_screen_shows_whole_texts_in_every_layout() {
    for count in [1, 2] {
        for preset in Preset::all() {
            let mut harness = bench_of(runs(count), SMALL);
            harness.state_mut().window.tiles.arrange(preset);
            harness.run_steps(4);
            check_texts(&harness, &format!("{} with {count} runs", preset.name()));
        }
    }
}

#[test]
fn a_small_screen_shows_whole_texts_in_every_panel() {
    for panel in PanelName::movable() {
        let mut harness = bench_of(runs(2), SMALL);
        harness.state_mut().window.tiles.layout.set_visible(panel, true);
        harness.run_steps(4);
        check_texts(&harness, panel.title());
    }
}

#[test]
fn the_heat_map_is_above_the_fold_in_every_layout() {
    for (count, run) in [(1, 0), (2, 0), (2, 1)] {
        for preset in Preset::all() {
            let mut harness = bench_of(runs(count), SMALL);
            harness.state_mut().window.tiles.arrange(preset);
            harness.state_mut().selection.run = run;
            harness.run_steps(4);
            let what = format!("{}, run {run} of {count}", preset.name());
            let panel =
                harness.state().window.tiles.places.iter().find(|(panel, _)| *panel == PanelName::Rank).unwrap().1;
            for answers in [
                ["Whole flight: ", "Flight to "],
                ["Structural rank 18 of", "Full rank"],
                ["Least observable: ", "Unobservable: "],
                ["Suggested excitation", "No candidate motion"],
            ] {
                let shown = answers.into_iter().flat_map(|answer| harness.query_all_by_label_contains(answer));
                let rects: Vec<Rect> = shown.map(|node| node.rect()).collect();
                assert!(!rects.is_empty(), "{what}: {answers:?}");
                assert!(rects.iter().all(|rect| panel.contains_rect(*rect)), "{what}: {answers:?} at {rects:?}");
            }
            let rows: Vec<Rect> = harness.query_all_by_label_contains(" weights").map(|row| row.rect()).collect();
            assert!(rows.len() >= 3, "{what}: {} rows", rows.len());
            for row in rows {
                assert!(panel.contains_rect(row), "{what}: row {row:?} of {panel:?}");
            }
        }
    }
}

#[test]
fn the_list_of_shortcuts_fits_and_is_complete() {
    for size in [[1600.0, 900.0], SMALL, [800.0, 500.0]] {
        let mut harness = bench_of(runs(1), size);
        harness.key_press(Key::Questionmark);
        harness.run_steps(4);
        let screen = Rect::from_min_size(egui::Pos2::ZERO, size.into());
        for heading in ["File", "Playback", "Everywhere"] {
            // The menu has the same name.
            let inside =
                harness.query_all_by_label(heading).all(|node| screen.x_range().contains(node.rect().center().x));
            assert!(inside, "{heading} at {size:?}");
        }
        // The list has an entry with the same name.
        let mut titles = harness.query_all_by_label("Shortcuts").map(|node| node.rect());
        assert!(titles.any(|title| screen.contains_rect(title)), "title at {size:?}");
        let whole = size != [800.0, 500.0];
        for entry in super::actions::TABLE {
            let mut rects = harness.query_all_by_label(entry.name).map(|node| node.rect());
            assert!(rects.any(|rect| !whole || screen.contains_rect(rect)), "{} at {size:?}", entry.name);
        }
    }
}

#[test]
fn a_large_window_shows_the_convergence_plots_beside_the_calibration_table() {
    let both = |size: [f32; 2]| {
        let harness = bench_of(sample(), size);
        let place = |panel: PanelName| {
            harness.state().window.tiles.places.iter().find(|(known, _)| *known == panel).map(|(_, rect)| *rect)
        };
        Some((place(PanelName::Calibration)?, place(PanelName::Convergence)?))
    };
    assert!(both([1920.0, 1080.0]).is_none());
    let (table, plots) = both([2560.0, 1440.0]).expect("both are on the screen");
    assert!(table.right() < plots.left() && table.top() == plots.top());
}
