//! The images of one or all cameras of a run with their tracks and residuals.

mod csv;
mod model;
mod paint;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{
    Align2, ColorImage, PopupCloseBehavior, Rect, Sense, TextureHandle, TextureOptions, Ui, UiBuilder, Vec2, pos2, vec2,
};

use self::model::ImageModel;
pub use self::model::SolveSide;
use self::paint::{ImagePlacement, MarkOptions};
use super::cells::{above_line, cells, columns_of_images};
use super::help::terms::window;
use super::plot::pan_zoom::PanZoom;
use super::under_pointer::{Item, offer, offer_item};
use super::units::significant;
use super::widgets::{describe, empty_ui};
use super::{Panel, PanelContext, ShownCameras};
use crate::sensors::{GrayImage, ImageMask};
use crate::session::{FrameImage, RunRecord};

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
/// Largest number of cameras with a button each; with more they are in a list.
const CAMERA_BUTTONS: usize = 4;
/// Height of legend and caption in points.
const LINE_HEIGHT: f32 = 18.0;

/// State of the image panel: options of the overlay, and the visible regions of the images.
#[derive(Default)]
pub struct ImagePanel {
    pub(in crate::gui) options: MarkOptions,
    /// By camera of the run.
    views: Vec<PanZoom>,
    /// By camera of the run.
    textures: Vec<Option<CachedTexture>>,
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
        let keys = run.last_camera_keys();
        self.controls_ui(ui, context, run, &keys);
        let shown = context.selection.cameras.indices(&keys);
        let line = LINE_HEIGHT + ui.spacing().item_spacing.y;
        let (images, legend) = above_line(ui, line);
        let columns = columns_of_images(images.size(), shown.len(), line);
        let mut moved = false;
        for (camera, cell) in shown.clone().zip(cells(images, columns, shown.len())) {
            ui.push_id(camera, |ui| {
                ui.scope_builder(UiBuilder::new().max_rect(cell), |ui| {
                    ui.set_clip_rect(ui.clip_rect().intersect(cell));
                    let Some(model) = ImageModel::at(&context.recording.rig, run, camera, context.cursor_ns) else {
                        let of_camera = if keys.len() > 1 { format!(" of {}", keys[camera]) } else { String::new() };
                        empty_ui(ui, &format!("No image{of_camera} at or before the cursor"));
                        return;
                    };
                    let size = ui.available_size() - vec2(0.0, line);
                    self.content_ui(ui, context, (&run.spec.label, camera), &model, size);
                    moved |= camera == 0 && context.moved_chain(model.stamp_ns).is_some();
                    caption_ui(ui, context, &model);
                });
            });
        }
        ui.scope_builder(UiBuilder::new().max_rect(legend), |ui| self.legend_ui(ui, context, moved));
    }

    fn view_copy(&self) -> Self {
        Self { options: self.options, views: self.views.clone(), textures: Vec::new() }
    }
}

impl ImagePanel {
    /// Draws the options that the images of all runs have in common.
    pub(in crate::gui) fn common_controls_ui(&mut self, ui: &mut Ui, context: &PanelContext<'_>) {
        ui.horizontal(|ui| {
            if context.presentation.is_figure() {
                self.side_ui(ui);
            } else {
                self.choices_ui(ui, has_mask(context));
            }
        });
    }

    /// Draws the image of a run between the images of other runs: label and caption in one line, and the image.
    pub(in crate::gui) fn cell_ui(&mut self, ui: &mut Ui, context: &mut PanelContext<'_>) {
        let Some(run) = context.selected_run() else { return };
        // Runs are compared by one camera each.
        let camera = match &context.selection.cameras {
            ShownCameras::All => 0,
            shown => shown.indices(&run.last_camera_keys()).start,
        };
        let model = ImageModel::at(&context.recording.rig, run, camera, context.cursor_ns);
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
        self.content_ui(ui, context, (&run.spec.label, camera), &model, size);
    }

    /// Draws the legend of the marks in one line.
    pub(in crate::gui) fn legend_ui(&self, ui: &mut Ui, context: &PanelContext<'_>, moved: bool) {
        let (legend, line) = ui.allocate_exact_size(vec2(ui.available_width(), LINE_HEIGHT), Sense::hover());
        line.on_hover_text(LEGEND);
        paint::legend(ui.painter(), legend, context.theme, &self.options, moved);
    }

    /// Draws the image with its marks in a size in points.
    fn content_ui(
        &mut self,
        ui: &mut Ui,
        context: &mut PanelContext<'_>,
        (label, camera): (&str, usize),
        model: &ImageModel,
        size: Vec2,
    ) {
        let (area, response) = ui.allocate_exact_size(size.max(Vec2::splat(16.0)), Sense::click_and_drag());
        let name = if model.is_only_camera {
            format!("Image of {label}")
        } else {
            format!("Image of {} of {label}", model.camera_key)
        };
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, &name));
        describe(&response, &model.caption());
        let image = context.images.image(&model.camera_key, model.image_index);
        let cameras = self.views.len().max(camera + 1);
        self.views.resize_with(cameras, PanZoom::default);
        self.textures.resize_with(cameras, || None);
        self.image_ui(ui, (area, camera), &response, context, model, image);
    }

    /// Copies the view of another panel.
    pub(in crate::gui) fn follow(&mut self, other: &Self) {
        (self.options, self.views) = (other.options, other.views.clone());
    }

    /// True if it has the view of another panel.
    pub(in crate::gui) fn looks_like(&self, other: &Self) -> bool {
        (self.options, &self.views) == (other.options, &other.views)
    }

    fn controls_ui(&mut self, ui: &mut Ui, context: &mut PanelContext<'_>, run: &RunRecord, keys: &[&str]) {
        ui.horizontal(|ui| {
            ui.colored_label(context.theme.run(context.selection.run).color, &run.spec.label);
            if context.presentation.is_figure() {
                self.side_ui(ui);
                return;
            }
            ui.separator();
            if keys.len() > 1 {
                cameras_ui(ui, &mut context.selection.cameras, keys);
                ui.separator();
            }
            self.choices_ui(ui, has_mask(context));
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
        (area, camera): (Rect, usize),
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
            let of_rig = context.recording.rig.camera(&model.camera_key);
            of_rig.map_or([640, 480], |of_rig| of_rig.model.resolution_px)
        });
        let fitted = fitted_size(area, size_px);
        let view = &mut self.views[camera];
        view.navigate(ui, context.theme, area, fitted, response, MAX_ZOOM);
        let place = ImagePlacement { rect: view.place(area, fitted), size_px };
        if let Some(image) = image {
            let of_rig = context.recording.rig.camera(&model.camera_key).ok();
            let mask = of_rig.and_then(|of_rig| Some(&of_rig.mask.as_ref()?.image)).filter(|_| self.options.mask);
            let texture = cached_texture(ui, &mut self.textures[camera], image, mask);
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
        if let Some(slide) = context.moved_chain(model.stamp_ns).filter(|_| camera == 0) {
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
}

/// Draws the choice of the cameras whose images are shown.
fn cameras_ui(ui: &mut Ui, shown: &mut ShownCameras, keys: &[&str]) {
    let indices = shown.indices(keys);
    let of_key = |index: usize| if index == 0 { ShownCameras::Main } else { ShownCameras::Key(keys[index].to_owned()) };
    let mut choices = |ui: &mut Ui| {
        for (index, key) in keys.iter().enumerate() {
            if ui.selectable_label(indices == (index..index + 1), *key).clicked() {
                *shown = of_key(index);
            }
        }
        let all = ui.selectable_label(indices.len() > 1, "All");
        if all.on_hover_text("Images of all cameras of the run, side by side").clicked() {
            *shown = ShownCameras::All;
        }
    };
    if keys.len() <= CAMERA_BUTTONS {
        choices(ui);
    } else {
        let selected = if indices.len() > 1 { "All" } else { keys[indices.start] };
        egui::ComboBox::from_id_salt("cameras").selected_text(selected).show_ui(ui, choices);
    }
}

/// Texture of an image with its mask; made only where it is not the cached one.
fn cached_texture(
    ui: &Ui,
    cache: &mut Option<CachedTexture>,
    image: Arc<GrayImage>,
    mask: Option<&ImageMask>,
) -> egui::TextureId {
    let masked = mask.is_some();
    if let Some(cached) = cache
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
    let mut cached = cache.take().unwrap_or_else(|| CachedTexture {
        image: Arc::clone(&image),
        masked,
        handle: ui.ctx().load_texture("camera image", color_image.clone(), TextureOptions::LINEAR),
    });
    cached.handle.set(color_image, TextureOptions::LINEAR);
    cached.image = image;
    cached.masked = masked;
    cache.insert(cached).handle.id()
}

/// Draws the parts of the caption that fit into the room.
fn caption_ui(ui: &mut Ui, context: &PanelContext<'_>, model: &ImageModel) {
    let (room, font) = (ui.available_width(), egui::TextStyle::Body.resolve(ui.style()));
    let width = |text: &str| ui.painter().layout_no_wrap(text.to_owned(), font.clone(), context.theme.text).size().x;
    let line = ui.add(egui::Label::new(model.fitting_caption(|text| width(text) <= room)).truncate());
    line.on_hover_text(format!("{}\n{}", model.caption(), window::CAPTION.meaning));
}

/// True if a shown camera of the selected run has a mask.
fn has_mask(context: &PanelContext<'_>) -> bool {
    let Some(run) = context.selected_run() else { return false };
    let keys = run.last_camera_keys();
    let shown = context.selection.cameras.indices(&keys);
    let is_masked = |key: &&str| context.recording.rig.camera(key).is_ok_and(|camera| camera.mask.is_some());
    keys.get(shown).is_some_and(|shown| shown.iter().any(is_masked))
}

/// Size in points of an image that fills the area in one direction.
fn fitted_size(area: Rect, size_px: [usize; 2]) -> Vec2 {
    let image = vec2(size_px[0].max(1) as f32, size_px[1].max(1) as f32);
    image * (area.width() / image.x).min(area.height() / image.y)
}
