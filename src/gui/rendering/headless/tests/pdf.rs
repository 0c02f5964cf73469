use std::io::Read as _;

use egui::{Color32, RichText, Stroke, Ui, pos2};
use flate2::read::ZlibDecoder;

use super::super::{HeadlessOptions, pdf_of};
use crate::gui::theme::ThemeName;

const OPTIONS: HeadlessOptions =
    HeadlessOptions { size_px: [400, 200], pixels_per_point: 2.0, theme: ThemeName::Print };

fn draw(ui: impl FnMut(&mut Ui)) -> Vec<u8> {
    pdf_of(OPTIONS, [85.0, 42.5], ["title", "command"], ui).expect("the fonts can be embedded")
}

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Unpacked streams of a file, as text.
fn streams(file: &[u8]) -> Vec<String> {
    let mut streams = Vec::new();
    let mut rest = file;
    let find = |bytes: &[u8], word: &[u8]| bytes.windows(word.len()).position(|it| it == word);
    while let Some(begin) = find(rest, b"\nstream\n") {
        rest = &rest[begin + 8..];
        let end = find(rest, b"\nendstream").expect("a stream ends");
        let mut unpacked = Vec::new();
        // The map of letters is not packed.
        if ZlibDecoder::new(&rest[..end]).read_to_end(&mut unpacked).is_err() {
            unpacked = rest[..end].to_vec();
        }
        streams.push(text_of(&unpacked));
        rest = &rest[end..];
    }
    streams
}

#[test]
fn a_page_has_its_size_its_title_and_letters_of_embedded_fonts() {
    let ui = |ui: &mut Ui| {
        ui.label("ρ = 0.25 px");
        ui.label(RichText::new("1.5").monospace());
        ui.label("✔");
    };
    let file = draw(ui);
    assert!(file == draw(ui), "two files differ");
    let text = text_of(&file);
    assert!(text.starts_with("%PDF-1.7") && text.trim_end().ends_with("%%EOF"));
    assert!(text.contains("/MediaBox [0 0 240.94") && text.contains(" 120.47"), "85 mm are 240.9 points: {text}");
    assert!(text.contains("/Title (title)") && text.contains("/Subject (command)"), "{text}");
    assert!(!text.contains("Date"), "files of equal drawings are equal");
    // Text, numbers and the symbol are of three fonts.
    assert_eq!(text.matches("/FontFile2").count(), 3);
    let streams = streams(&file);
    let maps: Vec<&String> = streams.iter().filter(|stream| stream.contains("begincmap")).collect();
    let mapped = |letter: char| maps.iter().any(|map| map.contains(&format!("<{:04X}>", u32::from(letter))));
    for letter in ['ρ', '=', '5', '✔'] {
        assert!(mapped(letter), "{letter} can be searched");
    }
    assert!(!mapped('Z'), "letters that are not used are not embedded");
}

#[test]
fn lines_stay_lines_and_opacities_are_kept() {
    let file = draw(|ui| {
        let painter = ui.painter();
        painter.line_segment([pos2(1.0, 2.0), pos2(30.0, 40.0)], Stroke::new(1.5, Color32::RED));
        painter.circle_filled(pos2(50.0, 50.0), 4.0, Color32::from_black_alpha(51));
    });
    let page = streams(&file).into_iter().find(|stream| stream.contains(" l\n")).expect("a page");
    assert!(page.contains("1 0 0 RG\n1.5 w\n1 2 m\n30 40 l\nS"), "{page}");
    assert!(page.contains("/A0 gs\n0 0 0 rg"), "{page}");
    assert!(text_of(&file).contains("/ca 0.2"));
}
