//! Files of one result in a folder, written all or none.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::ExportError;
use crate::files::output::OutputSet;

/// Writes files with their names into a folder, which is made if it is missing; returns their paths in the same order.
pub(super) fn write_files<N: AsRef<Path>, C: AsRef<[u8]>>(
    files: impl IntoIterator<Item = (N, C)>,
    folder: &Path,
) -> Result<Vec<PathBuf>, ExportError> {
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let mut outputs = OutputSet::default();
    let mut paths = Vec::new();
    for (name, content) in files {
        let path = folder.join(name);
        outputs.write(&path, content.as_ref()).map_err(ExportError::write(&path))?;
        paths.push(path);
    }
    outputs.commit().map_err(ExportError::commit)?;
    Ok(paths)
}

/// Text of a JSON file.
pub(crate) fn json_text(value: &impl Serialize, path: &Path) -> Result<String, ExportError> {
    let json = serde_json::to_string_pretty(value);
    let json = json.map_err(|source| ExportError::Write { source: source.into(), path: path.to_owned() })?;
    Ok(format!("{json}\n"))
}

/// Removes the files with these names in a folder that are not among `written`: they belong to an earlier result.
pub(super) fn remove_others(names: &[&str], written: &[PathBuf], folder: &Path) -> Result<(), ExportError> {
    let paths = names.iter().map(|name| folder.join(name));
    for path in paths.filter(|path| !written.contains(path) && path.is_file()) {
        fs::remove_file(&path).map_err(ExportError::write(&path))?;
    }
    Ok(())
}

/// A figure for print as pixels of the CPU painter and as a drawing, with the names of both files; `texts` are the prefix of
/// ids and the title of the drawing.
#[cfg(feature = "gui")]
pub(super) fn figure_files(
    [png, svg]: [&'static str; 2],
    size_px: [u32; 2],
    [prefix, title]: [&str; 2],
    figure_ui: impl Fn(&mut egui::Ui, &crate::gui::theme::Theme),
) -> Vec<(&'static str, Vec<u8>)> {
    use crate::gui::rendering::headless::{self, HeadlessOptions};
    use crate::gui::theme::{Theme, ThemeName};

    let options = HeadlessOptions { size_px, pixels_per_point: 1.5, theme: ThemeName::Print };
    let theme = Theme::of(options.theme);
    let image = headless::draw(options, |ui| figure_ui(ui, &theme));
    let drawing = headless::svg_of(options, prefix, title, |ui| figure_ui(ui, &theme));
    let mut files = vec![(svg, drawing.into_bytes())];
    // Encoding an image of this size cannot fail.
    files.extend(super::png_bytes(&image).ok().map(|content| (png, content)));
    files
}
