//! An SVG document from the elements of a drawing.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use egui::{Rect, TextureId};

use super::attributes::{attribute, escape, lines_through, number, paint, put, stroke};
use super::text;
use crate::vector::{Drawing, Element, FilledArea, Textures};

/// SVG file of a drawing, over an opaque background.
///
/// `size` are its width and height in a viewer with their units, pixels without one; `prefix` is the prefix of the ids
/// of its elements, so that one page can hold several drawings.
pub fn document(drawing: &Drawing, size: &[String; 2], prefix: &str) -> String {
    let mut writer =
        Writer { textures: &drawing.textures, prefix, body: String::new(), clips: Vec::new(), clip: false };
    for element in &drawing.elements {
        writer.element(element);
    }
    let [width, height] = [drawing.size.x, drawing.size.y].map(number);
    let ground = paint("fill", drawing.background);
    let description = match drawing.description.as_str() {
        "" => String::new(),
        text => format!("<desc>{}</desc>\n", escape(text)),
    };
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {width} {height}\" \
         role=\"img\">\n<title>{}</title>\n{description}{}<rect width=\"{width}\" height=\"{height}\"{ground}/>\n{}</svg>\n",
        size[0],
        size[1],
        escape(&drawing.title),
        writer.definitions(),
        writer.body
    )
}

struct Writer<'a> {
    textures: &'a Textures,
    prefix: &'a str,
    body: String,
    clips: Vec<Rect>,
    /// True inside a group with a clip rectangle.
    clip: bool,
}

impl Writer<'_> {
    fn definitions(&self) -> String {
        if self.clips.is_empty() {
            return String::new();
        }
        let mut text = "<defs>\n".to_owned();
        for (index, rect) in self.clips.iter().enumerate() {
            let [x, y, width, height] = [rect.left(), rect.top(), rect.width(), rect.height()].map(number);
            put(
                &mut text,
                format_args!(
                    "<clipPath id=\"{}{index}\"><rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/></clipPath>\n",
                    self.prefix
                ),
            );
        }
        text.push_str("</defs>\n");
        text
    }

    fn clip(&mut self, rect: Option<Rect>) {
        if self.clip {
            self.body.push_str("</g>\n");
        }
        self.clip = rect.is_some();
        let Some(rect) = rect else { return };
        let known = self.clips.iter().position(|clip| *clip == rect);
        let index = known.unwrap_or(self.clips.len());
        if known.is_none() {
            self.clips.push(rect);
        }
        put(&mut self.body, format_args!("<g clip-path=\"url(#{}{index})\">\n", self.prefix));
    }

    fn element(&mut self, element: &Element) {
        match element {
            Element::Clip(rect) => self.clip(*rect),
            Element::Rotation(Some((angle_rad, about))) => {
                let [x, y] = [number(about.x), number(about.y)];
                let angle_deg = number(angle_rad.to_degrees());
                put(&mut self.body, format_args!("<g transform=\"rotate({angle_deg} {x} {y})\">\n"));
            }
            Element::Rotation(None) => self.body.push_str("</g>\n"),
            Element::Lines { lines, stroke: line } => {
                let mut path = String::new();
                for points in lines {
                    lines_through(&mut path, points, false);
                }
                put(&mut self.body, format_args!("<path d=\"{path}\" fill=\"none\"{}/>\n", stroke(*line)));
            }
            Element::Outline { points, closed, fill, stroke: line } => {
                let mut path = String::new();
                lines_through(&mut path, points, *closed);
                let look = [paint("fill", *fill), stroke(*line)].concat();
                self.write("path", &format!(" d=\"{path}\"{look} stroke-linejoin=\"round\""));
            }
            Element::Circle { center, radius, fill, stroke: line } => {
                let place = [attribute("cx", center.x), attribute("cy", center.y), attribute("r", *radius)].concat();
                self.write("circle", &[place, paint("fill", *fill), stroke(*line)].concat());
            }
            Element::Ellipse { center, radius, angle_rad, fill, stroke: line } => {
                let [x, y] = [number(center.x), number(center.y)];
                let radii = [attribute("rx", radius.x), attribute("ry", radius.y)].concat();
                let angle_deg = number(angle_rad.to_degrees());
                let look = [paint("fill", *fill), stroke(*line)].concat();
                let rest = format!(" cx=\"{x}\" cy=\"{y}\"{radii} transform=\"rotate({angle_deg} {x} {y})\"{look}");
                self.write("ellipse", &rest);
            }
            Element::Rect { rect, corner_radius, angle_rad, fill, stroke: line } => {
                let look = [paint("fill", *fill), stroke(*line)].concat();
                self.rect(*rect, [*corner_radius, *angle_rad], &look);
            }
            Element::Areas { areas, fill } => {
                let mut path = String::new();
                for area in areas {
                    add_area(&mut path, area);
                }
                put(&mut self.body, format_args!("<path d=\"{path}\"{}/>\n", paint("fill", *fill)));
            }
            Element::Image { texture, rect, uv } => self.image(*texture, *rect, *uv),
            Element::Text(run) => text::text(&mut self.body, run),
        }
    }

    fn write(&mut self, name: &str, attributes: &str) {
        put(&mut self.body, format_args!("<{name}{attributes}/>\n"));
    }

    fn rect(&mut self, rect: Rect, [corner_radius, angle_rad]: [f32; 2], look: &str) {
        let [x, y, width, height] = [rect.left(), rect.top(), rect.width(), rect.height()].map(number);
        let mut attributes = format!(" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"");
        if corner_radius > 0.0 {
            attributes.push_str(&attribute("rx", corner_radius));
        }
        attributes.push_str(look);
        if angle_rad != 0.0 {
            let [x, y] = [number(rect.center().x), number(rect.center().y)];
            put(&mut attributes, format_args!(" transform=\"rotate({} {x} {y})\"", number(angle_rad.to_degrees())));
        }
        self.write("rect", &attributes);
    }

    /// Writes a region of a texture; nothing for an unknown texture.
    fn image(&mut self, texture: TextureId, rect: Rect, uv: Rect) {
        let Some((texture, png)) = self.textures.image(texture).and_then(|texture| Some((texture, texture.png()?)))
        else {
            return;
        };
        let [width, height] = texture.size.map(|side| side as f32);
        let view = [uv.left() * width, uv.top() * height, uv.width() * width, uv.height() * height].map(number);
        let [x, y, shown_width, shown_height] = [rect.left(), rect.top(), rect.width(), rect.height()].map(number);
        put(
            &mut self.body,
            format_args!(
                "<svg x=\"{x}\" y=\"{y}\" width=\"{shown_width}\" height=\"{shown_height}\" viewBox=\"{}\" \
                 preserveAspectRatio=\"none\"><image width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
                 href=\"data:image/png;base64,{}\"/></svg>\n",
                view.join(" "),
                STANDARD.encode(png)
            ),
        );
    }
}

fn add_area(path: &mut String, area: &FilledArea) {
    match area {
        FilledArea::Rect(rect) => {
            let [left, top, right, bottom] = [rect.left(), rect.top(), rect.right(), rect.bottom()].map(number);
            put(path, format_args!("M{left} {top}H{right}V{bottom}H{left}Z"));
        }
        FilledArea::Triangle(corners) => lines_through(path, corners, true),
    }
}
