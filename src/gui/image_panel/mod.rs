//! The camera image with its tracks and residuals.

mod csv;
mod model;
mod paint;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Align2, ColorImage, PopupCloseBehavior, Rect, Sense, TextureHandle, TextureOptions, Ui, Vec2, pos2, vec2};

use self::model::ImageModel;
pub use self::model::SolveSide;
use self::paint::{ImagePlacement, MarkOptions};
use super::help::terms::window;
use super::plot::pan_zoom::PanZoom;
use super::under_pointer::{Item, offer, offer_item};
use super::units::significant;
use super::widgets::{describe, empty_ui};
use super::{Panel, PanelContext};
use crate::sensors::{GrayImage, ImageMask};
use crate::session::FrameImage;

/// Maximum magnification relative to the fitted size.
const MAX_ZOOM: f32 = 16.0;
/// Width in points of the row with all options.
const OPTIONS_WIDTH: f32 = 395.0;
/// Width in points of the mask option.
const MASK_WIDTH: f32 = 60.0;
/// The legend as text, for images that are too narrow for the painted one.
const LEGEND: &str = "Colour: age of the track in frames\nRing: used in the solve\nDot: tracked only\nCross: rejected\n\
    Slash: little weight, its observations do not fit one point of the scene\n\
    Line: residual (prediction − measurement), magnified";
/// Period at which an image that is being decoded is requested again.
const DECODING_PERIOD: Duration = Duration::from_millis(15);
/// Height of legend and caption in points.
const LINE_HEIGHT: f32 = 18.0;

/// State of the image panel: options of the overlay, and the visible region of the image.
#[derive(Default)]
pub struct ImagePanel {
    pub(in crate::gui) options: MarkOptions,
    view: PanZoom,
    texture: Option<CachedTexture>,
}

struct CachedTexture {
    image: Arc<GrayImage>,
    /// True if the mask is tinted in the texture.
    masked: bool,
    handle: TextureHandle,
}

impl Panel for ImagePanel {
    fn ui(&mut self, ui: &mut Ui, context: &mut PanelContext<'_>) {
        let Some(run) = context.selected_run() else {
            empty_ui(ui, "No runs");
            return;
        };
        self.controls_ui(ui, context, &run.spec.label);
        let Some(model) = ImageModel::at(run, context.cursor_ns) else {
            empty_ui(ui, "No image at or before the cursor");
            return;
        };
        let size = ui.available_size() - vec2(0.0, 2.0 * LINE_HEIGHT + 2.0 * ui.spacing().item_spacing.y);
        self.content_ui(ui, context, &run.spec.label, &model, size);
        let moved = context.moved_chain(model.stamp_ns).is_some();
        self.legend_ui(ui, context, moved);
        caption_ui(ui, context, &model);
    }

    fn view_copy(&self) -> Self {
        Self { options: self.options, view: self.view, texture: None }
    }
}

impl ImagePanel {
    /// Draws the options that the images of all runs have in common.
    pub(in crate::gui) fn common_controls_ui(&mut self, ui: &mut Ui, context: &PanelContext<'_>) {
        ui.horizontal(|ui| {
            if context.presentation.is_figure() {
                self.side_ui(ui);
            } else {
                self.choices_ui(ui, mask_of(context).is_some());
            }
        });
    }

    /// Draws the image of a run between the images of other runs: label and caption in one line, and the image.
    pub(in crate::gui) fn cell_ui(&mut self, ui: &mut Ui, context: &mut PanelContext<'_>) {
        let Some(run) = context.selected_run() else { return };
        let model = ImageModel::at(run, context.cursor_ns);
        ui.horizontal(|ui| {
            ui.set_height(LINE_HEIGHT);
            ui.colored_label(context.theme.run(context.selection.run).color, &run.spec.label);
            if let Some(model) = &model {
                caption_ui(ui, context, model);
            }
        });
        let Some(model) = model else {
            empty_ui(ui, "No image at or before the cursor");
            return;
        };
        let size = ui.available_size();
        self.content_ui(ui, context, &run.spec.label, &model, size);
    }

    /// Draws the legend of the marks in one line.
    pub(in crate::gui) fn legend_ui(&self, ui: &mut Ui, context: &PanelContext<'_>, moved: bool) {
        let (legend, line) = ui.allocate_exact_size(vec2(ui.available_width(), LINE_HEIGHT), Sense::hover());
        line.on_hover_text(LEGEND);
        paint::legend(ui.painter(), legend, context.theme, &self.options, moved);
    }

    /// Draws the image with its marks in a size in points.
    fn content_ui(&mut self, ui: &mut Ui, context: &mut PanelContext<'_>, label: &str, model: &ImageModel, size: Vec2) {
        let (area, response) = ui.allocate_exact_size(size.max(Vec2::splat(16.0)), Sense::click_and_drag());
        let name = format!("Image of {label}");
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, &name));
        describe(&response, &model.caption());
        let camera_key = context.selected_run().map_or("", |run| run.camera_key.as_str());
        let image = context.images.image(camera_key, model.frame_index);
        self.image_ui(ui, area, &response, context, model, image);
    }

    /// Copies the view of another panel.
    pub(in crate::gui) fn follow(&mut self, other: &Self) {
        (self.options, self.view) = (other.options, other.view);
    }

    /// True if it has the view of another panel.
    pub(in crate::gui) fn looks_like(&self, other: &Self) -> bool {
        (self.options, self.view) == (other.options, other.view)
    }

    fn controls_ui(&mut self, ui: &mut Ui, context: &PanelContext<'_>, run_label: &str) {
        ui.horizontal(|ui| {
            ui.colored_label(context.theme.run(context.selection.run).color, run_label);
            if context.presentation.is_figure() {
                self.side_ui(ui);
                return;
            }
            ui.separator();
            self.choices_ui(ui, mask_of(context).is_some());
        });
    }

    /// Names the side of the solve in a figure.
    fn side_ui(&self, ui: &mut Ui) {
        let side = if self.options.side == SolveSide::Before { "before" } else { "after" };
        ui.weak(format!("residuals {side} the solve"));
    }

    /// Draws the side of the solve and the options of the overlay.
    fn choices_ui(&mut self, ui: &mut Ui, has_mask: bool) {
        ui.selectable_value(&mut self.options.side, SolveSide::Before, "Before")
            .on_hover_text("Reprojection residuals before the solve of this step");
        ui.selectable_value(&mut self.options.side, SolveSide::After, "After")
            .on_hover_text("Reprojection residuals after the solve of this step");
        let wanted = OPTIONS_WIDTH + if has_mask { MASK_WIDTH } else { 0.0 };
        if ui.available_width() >= wanted {
            self.options_ui(ui, has_mask);
        } else {
            let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            MenuButton::new("Show").config(config).ui(ui, |ui| self.options_ui(ui, has_mask));
        }
    }

    /// Draws the options of the overlay: in a row where they fit, else in a menu.
    fn options_ui(&mut self, ui: &mut Ui, has_mask: bool) {
        ui.checkbox(&mut self.options.residuals, "Residuals")
            .on_hover_text("Reprojection residuals, prediction − measurement, px, magnified");
        ui.spacing_mut().slider_width = 70.0;
        ui.add_enabled(
            self.options.residuals,
            egui::Slider::new(&mut self.options.magnification, 1.0..=200.0)
                .logarithmic(true)
                .fixed_decimals(0)
                .prefix("×")
                .text("magnification"),
        );
        ui.checkbox(&mut self.options.trails, "Trails").on_hover_text("Track trails: earlier pixels of each feature");
        ui.checkbox(&mut self.options.ids, "Ids").on_hover_text("Feature ids");
        if has_mask {
            ui.checkbox(&mut self.options.mask, "Mask").on_hover_text("Pixels that the camera's mask covers, tinted");
        }
    }

    fn image_ui(
        &mut self,
        ui: &Ui,
        area: Rect,
        response: &egui::Response,
        context: &mut PanelContext<'_>,
        model: &ImageModel,
        image: FrameImage,
    ) {
        let absence = if image == FrameImage::Decoding { "decoding the video" } else { "image missing" };
        if image == FrameImage::Decoding {
            ui.ctx().request_repaint_after(DECODING_PERIOD);
        }
        let image = image.ready();
        let painter = ui.painter_at(area);
        painter.rect_filled(area, 0.0, context.theme.plot_background);
        let size_px = image.as_ref().map(|image| [image.width, image.height]).unwrap_or_else(|| {
            let camera_key = context.selected_run().map(|run| run.camera_key.as_str());
            let cameras = &context.recording.rig.cameras;
            let camera = cameras.iter().find(|camera| Some(camera.key.as_str()) == camera_key);
            camera.map_or([640, 480], |camera| camera.model.resolution_px)
        });
        let fitted = fitted_size(area, size_px);
        self.view.navigate(ui, context.theme, area, fitted, response, MAX_ZOOM);
        let place = ImagePlacement { rect: self.view.place(area, fitted), size_px };
        if let Some(image) = image {
            let mask = mask_of(context).filter(|_| self.options.mask);
            let texture = self.texture(ui, image, mask);
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            painter.image(texture, place.rect, uv, egui::Color32::WHITE);
        } else {
            let outline = egui::Stroke::new(1.0, context.theme.outline);
            painter.rect_stroke(place.rect, 0.0, outline, egui::StrokeKind::Inside);
            paint::label(&painter, area.center_top() + vec2(0.0, 8.0), Align2::CENTER_TOP, absence);
        }
        for mark in &model.marks {
            paint::feature(&painter, &place, mark, &self.options);
        }
        if let Some(slide) = context.moved_chain(model.stamp_ns) {
            for (_, [now, moved]) in &slide.predictions_px {
                paint::moved_prediction(&painter, &place, now, moved);
            }
            let text = format!("Chain moved: predicted features shift by up to {} px", significant(slide.largest_px));
            paint::label(&painter, area.left_top() + vec2(8.0, 8.0), Align2::LEFT_TOP, &text);
        }
        self.pick_ui(ui, &painter, &place, response, context, model);
    }

    /// Handles tooltip, click, and the selected feature.
    fn pick_ui(
        &self,
        ui: &Ui,
        painter: &egui::Painter,
        place: &ImagePlacement,
        response: &egui::Response,
        context: &mut PanelContext<'_>,
        model: &ImageModel,
    ) {
        /// Maximum distance of the pointer from a feature in points.
        const REACH: f32 = 10.0;
        let nearest = response.hover_pos().and_then(|pointer| {
            model
                .marks
                .iter()
                .map(|mark| (mark, place.position(&mark.measured_px).distance(pointer)))
                .filter(|(_, distance)| *distance <= REACH)
                .min_by(|(_, a), (_, b)| a.total_cmp(b))
                .map(|(mark, _)| mark)
        });
        if response.clicked() {
            context.selection.feature = nearest.map(|mark| mark.id);
        }
        if let Some(mark) = model.marks.iter().find(|mark| Some(mark.id) == context.selection.feature) {
            let at = place.position(&mark.measured_px);
            paint::selection(painter, place, at);
            if !self.options.ids {
                let beside = at + vec2(place.marker_radius() + 8.0, 0.0);
                paint::label(painter, beside, Align2::LEFT_CENTER, &mark.id.0.to_string());
            }
        }
        if let Some(mark) = nearest {
            paint::selection(painter, place, place.position(&mark.measured_px));
            ui.ctx().set_cursor_icon(egui::CursorIcon::PointingHand);
            let text = model::description(mark);
            offer(ui, text.clone());
            offer_item(ui, Item::Feature(mark.id));
            describe(response, &text);
            response.clone().on_hover_text_at_pointer(text);
        }
    }

    fn texture(&mut self, ui: &Ui, image: Arc<GrayImage>, mask: Option<&ImageMask>) -> egui::TextureId {
        let masked = mask.is_some();
        if let Some(cached) = &self.texture
            && Arc::ptr_eq(&cached.image, &image)
            && cached.masked == masked
        {
            return cached.handle.id();
        }
        let wanted = image.width * image.height;
        let mut pixels = image.pixels.clone();
        pixels.resize(wanted, 0);
        let mut color_image = ColorImage::from_gray([image.width, image.height], &pixels);
        if let Some(mask) = mask {
            paint::tint(&mut color_image, mask);
        }
        let mut cached = self.texture.take().unwrap_or_else(|| CachedTexture {
            image: Arc::clone(&image),
            masked,
            handle: ui.ctx().load_texture("camera image", color_image.clone(), TextureOptions::LINEAR),
        });
        cached.handle.set(color_image, TextureOptions::LINEAR);
        cached.image = image;
        cached.masked = masked;
        self.texture.insert(cached).handle.id()
    }
}

/// Draws the parts of the caption that fit into the room.
fn caption_ui(ui: &mut Ui, context: &PanelContext<'_>, model: &ImageModel) {
    let (room, font) = (ui.available_width(), egui::TextStyle::Body.resolve(ui.style()));
    let width = |text: &str| ui.painter().layout_no_wrap(text.to_owned(), font.clone(), context.theme.text).size().x;
    let line = ui.add(egui::Label::new(model.fitting_caption(|text| width(text) <= room)).truncate());
    line.on_hover_text(format!("{}\n{}", model.caption(), window::CAPTION.meaning));
}

/// The mask of the camera of the selected run.
fn mask_of<'a>(context: &PanelContext<'a>) -> Option<&'a ImageMask> {
    let key = &context.selected_run()?.camera_key;
    let camera = context.recording.rig.cameras.iter().find(|camera| camera.key == *key)?;
    camera.mask.as_ref().map(|mask| &mask.image)
}

/// Size in points of an image that fills the area in one direction.
fn fitted_size(area: Rect, size_px: [usize; 2]) -> Vec2 {
    let image = vec2(size_px[0].max(1) as f32, size_px[1].max(1) as f32);
    image * (area.width() / image.x).min(area.height() / image.y)
}
