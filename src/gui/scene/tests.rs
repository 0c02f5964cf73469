use std::sync::Arc;

use egui::Color32;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use nalgebra::{UnitQuaternion, Vector3};

use super::camera::{Orbit, OrbitCamera, SceneView, Viewport, frame, round_length};
use super::chain::{ChainModel, ChainPose};
use super::layout::{SceneDrawing, lay_out};
use super::model::{Dot, Face, ImageQuad, Line, SceneModel};
use super::{Follow, ScenePanel, cpu};
use crate::gui::rendering::headless::{HeadlessOptions, draw};
use crate::gui::samples::{sample_images, sample_recording, sample_recording_of};
use crate::gui::tests::{keep_screenshot, with_context};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{Panel as _, Selection};
use crate::sensors::GrayImage;
use crate::session::Recording;
use crate::text::Named as _;

const GROUND: Color32 = Color32::from_rgb(1, 2, 3);

/// A view from ten metres in front of the origin, along the world's y axis: x to the right, z up, focal length 250 px.
fn front_view() -> SceneView {
    let camera = OrbitCamera { target_m: Vector3::zeros(), towards: -Vector3::y(), distance_m: 10.0 };
    SceneView::new(camera, Viewport::world([400, 200], [0.0, 0.0, 400.0, 200.0]))
}

fn draw_front(model: &SceneModel) -> (SceneDrawing, egui::ColorImage) {
    let drawing = lay_out(model, &front_view(), 1.0, GROUND);
    let image = cpu::draw(&drawing);
    (drawing, image)
}

fn show(ui: &mut egui::Ui, panel: &mut ScenePanel, recording: &Recording, cursor_ns: i64, theme: ThemeName) {
    let theme = Theme::of(theme);
    theme.apply(ui.ctx());
    let mut selection = Selection::default();
    with_context(recording, cursor_ns, &mut sample_images(), &mut selection, &theme, |context| panel.ui(ui, context));
}

#[test]
fn points_are_projected_as_by_a_pinhole_camera() {
    let view = front_view();
    let check = |point: [f64; 3], expected: Option<[f64; 3]>| {
        let seen = view.project(&Vector3::from(point)).map(|at| [at.x_px, at.y_px, at.depth]);
        match (seen, expected) {
            (Some(seen), Some(expected)) => {
                for (value, wanted) in seen.iter().zip(expected) {
                    assert!((value - wanted).abs() < 1e-9, "{point:?}: {seen:?}, expected {expected:?}");
                }
            }
            (seen, expected) => assert_eq!(seen, expected, "{point:?}"),
        }
    };
    check([0.0, 0.0, 0.0], Some([200.0, 100.0, 0.02]));
    check([1.0, 0.0, 0.0], Some([225.0, 100.0, 0.02]));
    check([0.0, 0.0, 1.0], Some([200.0, 75.0, 0.02]));
    // Twice the distance, half the size.
    check([1.0, 10.0, 1.0], Some([212.5, 87.5, 0.01]));
    // At the near plane, and in front of it.
    check([0.0, -9.6, 0.0], Some([200.0, 100.0, 0.5]));
    check([0.0, -9.81, 0.0], None);
}

#[test]
fn framing_contains_every_point_and_fills_the_view() {
    let directions = [[-0.45, -0.75, 0.55], [0.3, 0.9, 0.1], [0.0, -0.01, 1.0], [1.0, 0.0, 0.0]];
    let points: Vec<Vector3<f64>> = (0..50)
        .map(|index| {
            let t = f64::from(index) * 0.3;
            Vector3::new(9.0 * t.sin() + 40.0, 3.0 * (2.0 * t).cos() - 7.0, 0.2 * t)
        })
        .collect();
    let viewport = Viewport::world([800, 450], [0.0, 20.0, 500.0, 450.0]);
    for direction in directions {
        let towards = Vector3::from(direction).normalize();
        let view = SceneView::new(frame(&points, towards, &viewport), viewport);
        let seen: Vec<_> = points.iter().map(|point| view.project(point).expect("in front")).collect();
        let bound = |value: fn(&super::camera::ScreenPoint) -> f64| {
            seen.iter().map(value).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ((left, right), (top, bottom)) = (bound(|at| at.x_px), bound(|at| at.y_px));
        assert!(left > 0.0 && right < 500.0 && top > 20.0 && bottom < 450.0, "{left} {right} {top} {bottom}");
        let filled = ((right - left) / 500.0).max((bottom - top) / 430.0);
        assert!(filled > 0.75, "only {filled} of the view is used from {direction:?}");
    }
    for points in [vec![], vec![Vector3::zeros(); 3], vec![Vector3::new(f64::NAN, 0.0, 0.0)]] {
        let camera = frame(&points, Vector3::z(), &viewport);
        assert!(camera.distance_m > 0.0 && camera.distance_m.is_finite());
    }
}

#[test]
fn rotation_stops_before_the_pole_and_keeps_unit_length() {
    let mut orbit = Orbit::from_direction(Vector3::new(-0.45, -0.75, 0.55));
    for step in 0..200 {
        orbit.rotate(0.1, if step < 100 { 0.3 } else { -0.3 });
        assert!((orbit.towards.norm() - 1.0).abs() < 1e-12);
        assert!(orbit.towards.xy().norm() > 0.01, "{:?}", orbit.towards);
        if step == 99 {
            assert!(orbit.towards.z > 0.99, "looks down: {:?}", orbit.towards);
        }
    }
    assert!(orbit.towards.z < -0.99, "looks up: {:?}", orbit.towards);
}

#[test]
fn round_lengths() {
    for (at_most, expected) in [(1.0, 1.0), (0.99, 0.5), (4.9, 2.0), (730.0, 500.0), (0.031, 0.02), (f64::NAN, 1.0)] {
        assert!((round_length(at_most) - expected).abs() < 1e-12, "{at_most}");
    }
}

#[test]
fn dashes_keep_their_lengths_across_corners() {
    // 8 m along x at 25 px/m, with a point in the middle of a dash: 200 px of dashes 30, 10.
    let points_m = [-4.0, -3.3, 0.1, 4.0].map(|x| Vector3::new(x, 0.0, 0.0)).to_vec();
    let line = Line { points_m, color: Color32::WHITE, width: 2.0, dashes: &[30.0, 10.0] };
    let (drawing, _) = draw_front(&SceneModel { lines: vec![line], ..SceneModel::default() });
    let painted = |x: f32| drawing.segments.iter().any(|segment| segment.from[0] <= x && x <= segment.to[0]);
    for pixel in 0..200 {
        let is_dash = pixel % 40 < 30;
        assert_eq!(painted(100.5 + pixel as f32), is_dash, "pixel {pixel}");
    }
}

#[test]
fn lines_are_cut_at_the_near_plane_and_the_viewport() {
    // A line from behind the camera into the distance, and one outside the viewport.
    let through = vec![Vector3::new(0.5, -30.0, 0.0), Vector3::new(0.5, 90.0, 0.0)];
    let beside = vec![Vector3::new(50.0, 0.0, -5.0), Vector3::new(50.0, 0.0, 5.0)];
    let lines = [through, beside].map(|points_m| Line { points_m, color: Color32::WHITE, width: 2.0, dashes: &[] });
    let (drawing, _) = draw_front(&SceneModel { lines: lines.to_vec(), ..SceneModel::default() });
    assert_eq!(drawing.segments.len(), 1);
    let segment = drawing.segments[0];
    for [x, y, depth] in [segment.from, segment.to] {
        assert!((-65.0..465.0).contains(&x) && (-65.0..265.0).contains(&y), "{segment:?}");
        assert!(depth > 0.0 && depth <= 1.0);
    }
}

#[test]
fn the_nearest_wins_whatever_the_order() {
    let square = |y: f64, color: Color32| {
        let corner = |x: f64, z: f64| Vector3::new(x, y, z);
        let lower = Face { corners_m: [corner(-2.0, -2.0), corner(2.0, -2.0), corner(2.0, 2.0)], color };
        [lower, Face { corners_m: [corner(-2.0, -2.0), corner(2.0, 2.0), corner(-2.0, 2.0)], color }]
    };
    let (red, blue) = (Color32::RED, Color32::BLUE);
    for faces in [[square(0.0, red), square(3.0, blue)].concat(), [square(3.0, blue), square(0.0, red)].concat()] {
        let (_, image) = draw_front(&SceneModel { faces, ..SceneModel::default() });
        let at = |x: usize, y: usize| image.pixels[y * 400 + x];
        assert_eq!(at(200, 100), red);
        // 2 m at 10 m are 50 px.
        assert_eq!((at(150, 100), at(149, 100), at(249, 100), at(250, 100)), (red, GROUND, red, GROUND));
    }
    // A line in the plane of a face is visible, a line behind it is not.
    let line = |y: f64, z: f64| Line {
        points_m: vec![Vector3::new(-1.0, y, z), Vector3::new(1.0, y, z)],
        color: Color32::WHITE,
        width: 3.0,
        dashes: &[],
    };
    let model = SceneModel {
        faces: square(0.0, red).to_vec(),
        lines: vec![line(0.0, 1.0), line(1.0, -1.0)],
        dots: vec![Dot { position_m: Vector3::new(0.0, -1.0, 0.0), color: blue, radius: 4.0 }],
        ..SceneModel::default()
    };
    let (_, image) = draw_front(&model);
    let at = |x: usize, y: usize| image.pixels[y * 400 + x];
    assert_eq!((at(200, 75), at(200, 122), at(200, 100)), (Color32::WHITE, red, blue));
}

#[test]
fn lines_and_dots_have_their_size() {
    let line = Line {
        points_m: vec![Vector3::new(-4.0, 0.0, -2.0), Vector3::new(4.0, 0.0, 1.3)],
        color: Color32::WHITE,
        width: 3.0,
        dashes: &[],
    };
    let ink = |model: &SceneModel| {
        let (_, image) = draw_front(model);
        image.pixels.iter().map(|pixel| (f64::from(pixel.g()) - 2.0) / 253.0).sum::<f64>()
    };
    let lines = ink(&SceneModel { lines: vec![line], ..SceneModel::default() });
    // Longer by half a width at both ends.
    let exact = 3.0 * (200.0_f64.hypot(82.5) + 1.5);
    assert!((lines / exact - 1.0).abs() < 0.02, "{lines}, expected {exact}");
    let dot = Dot { position_m: Vector3::new(0.33, 0.0, 0.21), color: Color32::WHITE, radius: 9.0 };
    let dots = ink(&SceneModel { dots: vec![dot], ..SceneModel::default() });
    let exact = std::f64::consts::PI * 81.0;
    assert!((dots / exact - 1.0).abs() < 0.02, "{dots}, expected {exact}");
}

#[test]
fn images_are_drawn_in_perspective() {
    // A checkerboard of 8 by 8 fields on the ground; the centre of each field has its colour.
    let pixels = (0..64 * 64).map(|index| if (index / 8 + index / 512) % 2 == 0 { 40 } else { 220 }).collect();
    let image = Arc::new(GrayImage { width: 64, height: 64, pixels });
    let floor = |x: f64, y: f64| Vector3::new(x, y, -1.5);
    let corners_m = [floor(-4.0, 4.0), floor(4.0, 4.0), floor(4.0, -4.0), floor(-4.0, -4.0)];
    let model = SceneModel { images: vec![ImageQuad { corners_m, image }], ..SceneModel::default() };
    let (_, drawn) = draw_front(&model);
    let view = front_view();
    for row in 0..8 {
        for column in 0..8 {
            let at = view.project(&floor(-3.5 + f64::from(column), 3.5 - f64::from(row))).unwrap();
            let pixel = drawn.pixels[at.y_px as usize * 400 + at.x_px as usize];
            let expected = if (row + column) % 2 == 0 { 40 } else { 220 };
            assert_eq!(pixel.r(), expected, "field {column} {row}");
        }
    }
}

#[test]
fn the_chain_is_the_product_of_its_links() {
    let recording = sample_recording();
    let [chain, true_chain] = [Some(&recording.rig), recording.ground_truth_rig.as_ref()]
        .map(|rig| rig.unwrap().chain_of_camera("cam0").unwrap());
    let angles_rad = [0.3, -0.2, 0.7];
    let pose = ChainPose::at(&chain, &angles_rad);
    assert_eq!(pose.names, ["I", "B", "J2", "J3", "E", "C"]);
    let exact = chain.imu_from_camera(&angles_rad);
    assert!(pose.imu_from_camera().minus(&exact).norm() < 1e-12);
    let names: Vec<String> = ["yaw", "roll", "pitch"].map(str::to_owned).into();
    let model = ChainModel::at(&angles_rad, &chain, Some(&true_chain), &names);
    let error = true_chain.imu_from_camera(&angles_rad).inverse() * exact;
    let (distance_m, angle_rad) = model.camera_error.unwrap();
    assert!((distance_m - error.translation_m.norm()).abs() < 1e-12);
    assert!((angle_rad - error.rotation.angle()).abs() < 1e-9);
    assert!(model.has_joints(), "its title is that of a gimbal");
    // A rigid camera has the frames I and C.
    let rigid = crate::gimbal::ClassicalChain { imu_from_base: exact, ..Default::default() };
    let pose = ChainPose::at(&rigid, &[]);
    assert_eq!(pose.names, ["I", "C"]);
    assert!(!ChainModel::at(&[], &rigid, None, &[]).has_joints(), "its title is that of extrinsics");
    assert_eq!(pose.skeleton_m().len(), 2);
    let rotated = UnitQuaternion::identity();
    assert!(pose.imu_from_frame[0].rotation.angle_to(&rotated) < 1e-12);
}

#[test]
fn controls_are_found_by_label_and_work() {
    let recording = sample_recording_of(80, &["auto"]);
    let mut harness = Harness::builder().with_size([900.0, 600.0]).build_ui_state(
        move |ui, panel| show(ui, panel, &recording, 3_900_000_000, ThemeName::Dark),
        ScenePanel::default(),
    );
    harness.run();
    for label in ["Vehicle", "Landmarks", "Chain", "Top"] {
        harness.get_by_label(label).click();
    }
    harness.run();
    let panel = harness.state();
    assert_eq!((panel.look.follow, panel.look.options.landmarks, panel.look.chain), (Follow::Vehicle, false, false));
    assert!(panel.look.world.towards.z > 0.99);
    harness.get_by_label("Fit").click();
    harness.run();
    assert_eq!(harness.state().look.world, super::default_world_orbit());
}

#[test]
fn dragging_rotates_the_view_and_a_double_click_resets_it() {
    let recording = sample_recording_of(80, &["auto"]);
    let mut harness = Harness::builder().with_size([900.0, 600.0]).build_ui_state(
        move |ui, panel| show(ui, panel, &recording, 3_900_000_000, ThemeName::Dark),
        ScenePanel::default(),
    );
    harness.run();
    let home = harness.state().look.world;
    harness.drag_at(egui::pos2(200.0, 300.0));
    harness.run();
    harness.hover_at(egui::pos2(260.0, 330.0));
    harness.run();
    harness.drop_at(egui::pos2(260.0, 330.0));
    harness.run();
    let rotated = harness.state().look.world;
    assert!(rotated.towards.dot(&home.towards) < 0.95, "{rotated:?}");
    assert!(rotated.towards.z > home.towards.z, "dragging down looks from higher up");
    assert_eq!(rotated.shift_m, home.shift_m);
}

#[test]
fn screenshots_repeat_and_every_stamp_can_be_drawn() {
    let recording = sample_recording();
    let options = |theme| HeadlessOptions { size_px: [780, 480], pixels_per_point: 1.0, theme };
    let screenshot = |cursor_ns, theme, follow| {
        let mut panel = ScenePanel::default();
        panel.look.follow = follow;
        draw(options(theme), |ui| show(ui, &mut panel, &recording, cursor_ns, theme))
    };
    for theme in [ThemeName::Dark, ThemeName::Light, ThemeName::Print] {
        let late = screenshot(5_500_000_000, theme, Follow::Trajectory);
        keep_screenshot(&format!("scene-{}", theme.name()), &late);
        assert!(late == screenshot(5_500_000_000, theme, Follow::Trajectory));
    }
    let vehicle = screenshot(4_000_000_000, ThemeName::Dark, Follow::Vehicle);
    keep_screenshot("scene-vehicle", &vehicle);
    for cursor_ns in [-1, 0, 2_000_000_000] {
        keep_screenshot(&format!("scene-{cursor_ns}"), &screenshot(cursor_ns, ThemeName::Dark, Follow::Vehicle));
    }
}

#[test]
fn the_close_up_covers_at_most_a_fifth_wherever_it_is() {
    use egui::{Rect, pos2, vec2};

    for size in [vec2(300.0, 180.0), vec2(800.0, 500.0), vec2(1900.0, 900.0)] {
        let area = Rect::from_min_size(pos2(10.0, 20.0), size);
        for place in [vec2(0.0, 0.0), vec2(1.0, 1.0), vec2(0.3, 0.8)] {
            let rect = super::close_up_rect(area, place, 1.0);
            assert!(area.contains_rect(rect), "{rect:?} in {area:?}");
            assert!(rect.area() <= 0.205 * area.area(), "{rect:?} of {area:?}");
        }
    }
}
