//! The page: elements of a drawing as operators of PDF.

use egui::{Color32, Pos2, Rect, Stroke, TextureId, Vec2};
use pdf_writer::types::LineJoinStyle;
use pdf_writer::{Content, Finish as _, Name, Str};

use super::fonts::{FontGlyph, Fonts};
use crate::vector::{Drawing, Element, FilledArea, Letter, TextRun};

/// Distance of the control points of a quarter of a circle of radius 1 from its ends.
const QUARTER: f32 = 0.552_284_8;
/// Slope of italic letters.
const SLANT: f32 = 0.2;
/// Smallest shift of a letter that is written, in 1/1000 em.
const MIN_SHIFT: f32 = 0.5;

pub(super) struct PageWriter<'a> {
    drawing: &'a Drawing,
    fonts: &'a mut Fonts,
    content: Content,
    /// True inside a clip rectangle.
    clip: bool,
    /// Textures in the order of the numbers in their names.
    images: Vec<TextureId>,
    /// Opacities of areas and of lines that are used together.
    opacities: Vec<[u8; 2]>,
}

impl<'a> PageWriter<'a> {
    /// Starts a page of `size_pt` with the coordinates of the drawing, y down.
    pub(super) fn new(drawing: &'a Drawing, size_pt: [f32; 2], fonts: &'a mut Fonts) -> Self {
        let mut content = Content::new();
        let scale = [size_pt[0] / drawing.size.x, size_pt[1] / drawing.size.y];
        content.transform([scale[0], 0.0, 0.0, -scale[1], 0.0, size_pt[1]]);
        let mut writer = Self { drawing, fonts, content, clip: false, images: Vec::new(), opacities: Vec::new() };
        writer.painted(drawing.background, Stroke::NONE, |content| {
            content.rect(0.0, 0.0, drawing.size.x, drawing.size.y);
        });
        writer
    }

    /// The content, the textures `I0`, `I1`, … and the opacities of areas and lines `A0`, `A1`, ….
    pub(super) fn finish(self) -> (Vec<u8>, Vec<TextureId>, Vec<[u8; 2]>) {
        (self.content.finish().into_vec(), self.images, self.opacities)
    }

    pub(super) fn element(&mut self, element: &Element) {
        match element {
            Element::Clip(rect) => self.clip(*rect),
            Element::Rotation(Some((angle_rad, about))) => {
                self.content.save_state().transform(rotation(*angle_rad, *about));
            }
            Element::Rotation(None) => {
                self.content.restore_state();
            }
            Element::Lines { lines, stroke } => self.painted(Color32::TRANSPARENT, *stroke, |content| {
                for [from, to] in lines {
                    content.move_to(from.x, from.y).line_to(to.x, to.y);
                }
            }),
            Element::Outline { points, closed, fill, stroke } => self.painted(*fill, *stroke, |content| {
                content.set_line_join(LineJoinStyle::RoundJoin);
                polygon(content, points, *closed);
            }),
            Element::Circle { center, radius, fill, stroke } => {
                let radius = Vec2::splat(*radius);
                self.painted(*fill, *stroke, |content| ellipse(content, *center, radius));
            }
            Element::Ellipse { center, radius, angle_rad, fill, stroke } => {
                self.painted(*fill, *stroke, |content| {
                    content.transform(rotation(*angle_rad, *center));
                    ellipse(content, *center, *radius);
                });
            }
            Element::Rect { rect, corner_radius, angle_rad, fill, stroke } => {
                self.painted(*fill, *stroke, |content| {
                    if *angle_rad != 0.0 {
                        content.transform(rotation(*angle_rad, rect.center()));
                    }
                    rounded(content, *rect, *corner_radius);
                });
            }
            Element::Areas { areas, fill } => self.painted(*fill, Stroke::NONE, |content| {
                for area in areas {
                    match area {
                        FilledArea::Rect(rect) => rounded(content, *rect, 0.0),
                        FilledArea::Triangle(corners) => polygon(content, corners, true),
                    }
                }
            }),
            Element::Image { texture, rect, uv } => self.image(*texture, *rect, *uv),
            Element::Text(run) => self.text(run),
        }
    }

    fn clip(&mut self, rect: Option<Rect>) {
        if self.clip {
            self.content.restore_state();
        }
        self.clip = rect.is_some();
        if let Some(rect) = rect {
            self.content.save_state().rect(rect.left(), rect.top(), rect.width(), rect.height());
            self.content.clip_nonzero().end_path();
        }
    }

    /// Fills and strokes a path.
    fn painted(&mut self, fill: Color32, stroke: Stroke, path: impl Fn(&mut Content)) {
        let (fills, strokes) = (fill.a() > 0, !stroke.is_empty() && stroke.color.a() > 0);
        if !fills && !strokes {
            return;
        }
        self.content.save_state();
        self.set_opacity(if fills { fill.a() } else { u8::MAX }, if strokes { stroke.color.a() } else { u8::MAX });
        if fills {
            let [red, green, blue] = rgb(fill);
            self.content.set_fill_rgb(red, green, blue);
        }
        if strokes {
            let [red, green, blue] = rgb(stroke.color);
            self.content.set_stroke_rgb(red, green, blue).set_line_width(stroke.width);
        }
        path(&mut self.content);
        match (fills, strokes) {
            (true, true) => self.content.fill_nonzero_and_stroke(),
            (true, false) => self.content.fill_nonzero(),
            (false, _) => self.content.stroke(),
        };
        self.content.restore_state();
    }

    /// Sets the opacities of areas and lines.
    fn set_opacity(&mut self, fill: u8, stroke: u8) {
        if (fill, stroke) == (u8::MAX, u8::MAX) {
            return;
        }
        let known = self.opacities.iter().position(|opacities| *opacities == [fill, stroke]);
        let number = known.unwrap_or(self.opacities.len());
        if known.is_none() {
            self.opacities.push([fill, stroke]);
        }
        self.content.set_parameters(Name(format!("A{number}").as_bytes()));
    }

    /// Paints a region of a texture; nothing for an unknown texture.
    fn image(&mut self, texture: TextureId, rect: Rect, uv: Rect) {
        if self.drawing.textures.image(texture).is_none() || !uv.is_positive() {
            return;
        }
        let known = self.images.iter().position(|known| *known == texture);
        let number = known.unwrap_or(self.images.len());
        if known.is_none() {
            self.images.push(texture);
        }
        // The whole texture, of which the clip rectangle shows the region.
        let size = rect.size() / uv.size();
        let corner = rect.min - uv.min.to_vec2() * size;
        self.content.save_state().rect(rect.left(), rect.top(), rect.width(), rect.height());
        self.content.clip_nonzero().end_path();
        self.content.transform([size.x, 0.0, 0.0, -size.y, corner.x, corner.y + size.y]);
        self.content.x_object(Name(format!("I{number}").as_bytes())).restore_state();
    }

    /// Writes letters at their laid-out places; letters that no font has are left out.
    fn text(&mut self, run: &TextRun) {
        if run.color.a() == 0 {
            return;
        }
        let fonts = &mut *self.fonts;
        let glyph = |letter: &Letter| Some((fonts.glyph(run.monospace, letter.letter)?, letter.x));
        let glyphs: Vec<(FontGlyph, f32)> = run.letters.iter().filter_map(glyph).collect();
        self.content.save_state();
        self.set_opacity(run.color.a(), u8::MAX);
        let [red, green, blue] = rgb(run.color);
        self.content.set_fill_rgb(red, green, blue).begin_text();
        for part in glyphs.chunk_by(|(a, _), (b, _)| a.font == b.font) {
            let Some((first, x)) = part.first() else { continue };
            let size = run.size * first.scale;
            let slant = if run.italics { SLANT } else { 0.0 };
            self.content.set_font(Name(format!("F{}", first.font).as_bytes()), size);
            self.content.set_text_matrix([1.0, 0.0, slant, -1.0, *x, run.y]);
            let mut shown = self.content.show_positioned();
            let mut items = shown.items();
            let mut text: Vec<u8> = Vec::new();
            // Position that follows from the widths of the glyphs.
            let mut pen = *x;
            for (glyph, x) in part {
                let shift = (pen - x) / size * 1000.0;
                if shift.abs() > MIN_SHIFT {
                    if !text.is_empty() {
                        items.show(Str(&text));
                        text.clear();
                    }
                    items.adjust((shift * 10.0).round() / 10.0);
                    pen = *x;
                }
                text.extend(glyph.glyph.to_be_bytes());
                pen += glyph.width * size;
            }
            items.show(Str(&text));
            items.finish();
            shown.finish();
        }
        self.content.end_text().restore_state();
    }
}

/// Red, green and blue from 0 to 1.
fn rgb(color: Color32) -> [f32; 3] {
    let [red, green, blue, _] = color.to_srgba_unmultiplied();
    [red, green, blue].map(|channel| (f32::from(channel) / 255.0 * 1e3).round() / 1e3)
}

/// Matrix of a rotation (rad, clockwise on the screen) about a point.
fn rotation(angle_rad: f32, about: Pos2) -> [f32; 6] {
    let (sin, cos) = angle_rad.sin_cos();
    let shift = about - egui::emath::Rot2::from_angle(angle_rad) * about.to_vec2();
    [cos, sin, -sin, cos, shift.x, shift.y]
}

fn polygon(content: &mut Content, points: &[Pos2], closed: bool) {
    for (number, point) in points.iter().enumerate() {
        if number == 0 {
            content.move_to(point.x, point.y);
        } else {
            content.line_to(point.x, point.y);
        }
    }
    if closed && !points.is_empty() {
        content.close_path();
    }
}

fn ellipse(content: &mut Content, center: Pos2, radius: Vec2) {
    rounded_by(content, Rect::from_center_size(center, 2.0 * radius), radius);
}

fn rounded(content: &mut Content, rect: Rect, corner_radius: f32) {
    if corner_radius > 0.0 {
        rounded_by(content, rect, Vec2::splat(corner_radius.min(0.5 * rect.width()).min(0.5 * rect.height())));
    } else {
        content.rect(rect.left(), rect.top(), rect.width(), rect.height());
    }
}

/// A rectangle whose corners are quarters of an ellipse.
fn rounded_by(content: &mut Content, rect: Rect, radius: Vec2) {
    let control = radius * (1.0 - QUARTER);
    let Rect { min, max } = rect;
    content.move_to(min.x + radius.x, min.y).line_to(max.x - radius.x, min.y);
    content.cubic_to(max.x - control.x, min.y, max.x, min.y + control.y, max.x, min.y + radius.y);
    content.line_to(max.x, max.y - radius.y);
    content.cubic_to(max.x, max.y - control.y, max.x - control.x, max.y, max.x - radius.x, max.y);
    content.line_to(min.x + radius.x, max.y);
    content.cubic_to(min.x + control.x, max.y, min.x, max.y - control.y, min.x, max.y - radius.y);
    content.line_to(min.x, min.y + radius.y);
    content.cubic_to(min.x, min.y + control.y, min.x + control.x, min.y, min.x + radius.x, min.y);
    content.close_path();
}
