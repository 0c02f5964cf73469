//! The objects of a PDF file with one page.

use egui::FontDefinitions;
use pdf_writer::{Finish as _, Name, Rect, Ref, TextStr};

use super::content::PageWriter;
use super::file::File;
use super::fonts::Fonts;
use crate::vector::Drawing;

/// PDF of a drawing on a page of `size_pt` (width and height in points of 1/72 inch), over an opaque background.
///
/// `definitions` are the fonts that the drawing was laid out with. `None` if a font cannot be embedded.
pub fn document(drawing: &Drawing, size_pt: [f32; 2], definitions: &FontDefinitions) -> Option<Vec<u8>> {
    let mut fonts = Fonts::of(definitions);
    let mut writer = PageWriter::new(drawing, size_pt, &mut fonts);
    drawing.elements.iter().for_each(|element| writer.element(element));
    let (content, images, opacities) = writer.finish();

    let mut file = File::new();
    let [catalog, pages, page, contents, info] = [(); 5].map(|()| file.reference());
    file.pdf.catalog(catalog).pages(pages);
    file.pdf.pages(pages).kids([page]).count(1);
    let font_ids = fonts.used().map(|(name, font)| Some((name, font.write(&mut file)?))).collect::<Option<Vec<_>>>()?;
    let image_ids: Vec<Ref> =
        images.iter().filter_map(|texture| drawing.textures.image(*texture)).map(|image| file.image(image)).collect();
    let opacity_ids = opacities.iter().map(|[fill, stroke]| {
        let id = file.reference();
        let [fill, stroke] = [fill, stroke].map(|opacity| f32::from(*opacity) / 255.0);
        file.pdf.ext_graphics(id).non_stroking_alpha(fill).stroking_alpha(stroke);
        id
    });
    let opacity_ids: Vec<Ref> = opacity_ids.collect();
    let mut described = file.pdf.page(page);
    described.parent(pages).media_box(Rect::new(0.0, 0.0, size_pt[0], size_pt[1])).contents(contents);
    let mut resources = described.resources();
    let mut named = resources.fonts();
    for (name, id) in &font_ids {
        named.pair(Name(name.as_bytes()), *id);
    }
    named.finish();
    let mut named = resources.x_objects();
    for (number, id) in image_ids.iter().enumerate() {
        named.pair(Name(format!("I{number}").as_bytes()), *id);
    }
    named.finish();
    let mut named = resources.ext_g_states();
    for (number, id) in opacity_ids.iter().enumerate() {
        named.pair(Name(format!("A{number}").as_bytes()), *id);
    }
    named.finish();
    resources.finish();
    described.finish();
    file.stream(contents, &content);
    let mut described = file.pdf.document_info(info);
    described.title(TextStr(&drawing.title)).creator(TextStr(concat!("dcvins ", env!("CARGO_PKG_VERSION"))));
    if !drawing.description.is_empty() {
        described.subject(TextStr(&drawing.description));
    }
    described.finish();
    Some(file.pdf.finish())
}
