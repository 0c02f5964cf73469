//! The window's fonts: glyphs of letters, and embedding of those that a page uses.

use std::collections::BTreeMap;
use std::sync::Arc;

use egui::{FontData, FontDefinitions, FontFamily};
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Finish as _, Name, Rect, Ref, Str};
use skrifa::prelude::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider as _};
use subsetter::GlyphRemapper;

use super::file::File;

/// Units per em of widths and metrics in a PDF.
const PER_EM: f32 = 1000.0;

/// Fonts of the two families in the order of their use for a letter.
pub(super) struct Fonts {
    proportional: Vec<usize>,
    monospace: Vec<usize>,
    fonts: Vec<Font>,
}

/// One font with the glyphs that are used so far.
pub(super) struct Font {
    data: Arc<FontData>,
    glyphs: GlyphRemapper,
    /// Letter and width (1/1000 em) by number of the embedded glyph.
    letters: BTreeMap<u16, (char, f32)>,
}

/// Glyph of a letter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FontGlyph {
    /// Index of its font.
    pub(super) font: usize,
    /// Number of the embedded glyph.
    pub(super) glyph: u16,
    /// Width of the glyph in em.
    pub(super) width: f32,
    /// Size of the font relative to the size of the text.
    pub(super) scale: f32,
}

impl Fonts {
    pub(super) fn of(definitions: &FontDefinitions) -> Self {
        let names: Vec<&String> = definitions.font_data.keys().collect();
        let family = |family: FontFamily| -> Vec<usize> {
            let of = definitions.families.get(&family).into_iter().flatten();
            of.filter_map(|name| names.iter().position(|known| *known == name)).collect()
        };
        let (proportional, monospace) = (family(FontFamily::Proportional), family(FontFamily::Monospace));
        let font = |data: &Arc<FontData>| Font {
            data: Arc::clone(data),
            glyphs: GlyphRemapper::new(),
            letters: BTreeMap::new(),
        };
        Self { proportional, monospace, fonts: definitions.font_data.values().map(font).collect() }
    }

    /// Glyph of a letter in the first font that has one; `None` if none has.
    pub(super) fn glyph(&mut self, monospace: bool, letter: char) -> Option<FontGlyph> {
        let family = if monospace { &self.monospace } else { &self.proportional };
        family.iter().find_map(|index| {
            let font = &mut self.fonts[*index];
            let (glyph, width) = font.glyph(letter)?;
            Some(FontGlyph { font: *index, glyph, width: width / PER_EM, scale: font.data.tweak.scale })
        })
    }

    /// Name in the file and font of every font with glyphs.
    pub(super) fn used(&self) -> impl Iterator<Item = (String, &Font)> {
        self.fonts
            .iter()
            .enumerate()
            .filter(|(_, font)| !font.letters.is_empty())
            .map(|(index, font)| (format!("F{index}"), font))
    }
}

impl Font {
    fn face(&self) -> Option<FontRef<'_>> {
        FontRef::from_index((*self.data.font).as_ref(), self.data.index).ok()
    }

    /// Number of the embedded glyph of a letter, and its width in 1/1000 em.
    fn glyph(&mut self, letter: char) -> Option<(u16, f32)> {
        let face = self.face()?;
        let glyph = face.charmap().map(letter).filter(|glyph| glyph.to_u32() > 0)?;
        let units_per_em = f32::from(face.metrics(Size::unscaled(), LocationRef::default()).units_per_em);
        let width = face.glyph_metrics(Size::unscaled(), LocationRef::default()).advance_width(glyph)?;
        let width = width * PER_EM / units_per_em;
        let number = self.glyphs.remap(u16::try_from(glyph.to_u32()).ok()?);
        self.letters.entry(number).or_insert((letter, width));
        Some((number, width))
    }

    /// Embeds the used glyphs; returns the object of the font, `None` if the font cannot be reduced to them.
    pub(super) fn write(&self, file: &mut File) -> Option<Ref> {
        let program = subsetter::subset((*self.data.font).as_ref(), self.data.index, &self.glyphs).ok()?;
        let metrics = self.face()?.metrics(Size::unscaled(), LocationRef::default());
        let scaled = |value: f32| value * PER_EM / f32::from(metrics.units_per_em);
        let [font, cid, descriptor, data, unicode] = [(); 5].map(|()| file.reference());
        let name = format!("{}+{}", tag(&program), if metrics.is_monospace { "Monospace" } else { "Text" });
        let name = Name(name.as_bytes());
        let system = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
        file.pdf
            .type0_font(font)
            .base_font(name)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(cid)
            .to_unicode(unicode);
        let mut described = file.pdf.cid_font(cid);
        described.subtype(CidFontType::Type2).base_font(name).system_info(system).font_descriptor(descriptor);
        described.default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = described.widths();
        for (glyph, (_, width)) in &self.letters {
            widths.consecutive(*glyph, [*width]);
        }
        widths.finish();
        described.finish();
        let bounds = metrics.bounds.unwrap_or_default();
        file.pdf
            .font_descriptor(descriptor)
            .name(name)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Rect::new(scaled(bounds.x_min), scaled(bounds.y_min), scaled(bounds.x_max), scaled(bounds.y_max)))
            .italic_angle(metrics.italic_angle)
            .ascent(scaled(metrics.ascent))
            .descent(scaled(metrics.descent))
            .cap_height(scaled(metrics.cap_height.unwrap_or(metrics.ascent)))
            .stem_v(80.0)
            .font_file2(data);
        file.stream(data, &program);
        let mut letters = UnicodeCmap::<u16>::new(Name(b"Letters"), system);
        for (glyph, (letter, _)) in &self.letters {
            letters.pair(*glyph, *letter);
        }
        let letters = letters.finish().into_vec();
        file.pdf.cmap(unicode, &letters);
        Some(font)
    }
}

/// Six capital letters that distinguish this part of a font from others, as PDF demands.
fn tag(program: &[u8]) -> String {
    let mut sum = crc32fast::hash(program);
    let letter = |_: usize| {
        let letter = char::from(b'A' + (sum % 26) as u8);
        sum /= 26;
        letter
    };
    (0..6).map(letter).collect()
}
