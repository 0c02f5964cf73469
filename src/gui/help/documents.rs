//! The documents of `docs/`, built into the program, and the links between them.

use std::sync::OnceLock;

use super::markdown::{MarkdownBlock, parse};

#[derive(Debug)]
struct Document {
    /// Path in the repository.
    path: &'static str,
    text: &'static str,
}

macro_rules! document {
    ($path:literal) => {
        Document { path: $path, text: include_str!(concat!("../../../", $path)) }
    };
}

/// The manual is first.
const DOCUMENTS: [Document; 30] = [
    document!("docs/manual.md"),
    document!("docs/tutorial.md"),
    document!("docs/recordings.md"),
    document!("docs/commands.md"),
    document!("docs/formats.md"),
    document!("docs/coming_from.md"),
    document!("docs/mathematics.md"),
    document!("docs/accuracy.md"),
    document!("docs/real_data.md"),
    document!("docs/packages.md"),
    document!("docs/architecture.md"),
    document!("assets/README.md"),
    document!("docs/libraries.md"),
    document!("docs/thresholds.md"),
    document!("docs/experiments/README.md"),
    document!("docs/experiments/images_and_front_end.md"),
    document!("docs/experiments/encoders_and_joint_angles.md"),
    document!("docs/experiments/gimbal_imu.md"),
    document!("docs/experiments/robustness.md"),
    document!("docs/experiments/uneven_scenes.md"),
    document!("docs/experiments/solver_and_first_window.md"),
    document!("docs/experiments/sensor_calibration.md"),
    document!("docs/experiments/rigs_and_recordings.md"),
    document!("docs/experiments/speed_and_memory.md"),
    document!("docs/experiments/regression_guard.md"),
    document!("docs/experiments/heading_in_an_orbit.md"),
    document!("docs/experiments/planned_motions.md"),
    document!("docs/experiments/sigma_of_the_calibration.md"),
    document!("docs/experiments/a_thousand_faults.md"),
    document!("docs/experiments/archive.md"),
];

/// Index of an embedded document in the list; the default is the manual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct DocumentId(usize);

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum LinkTarget {
    /// A section of an embedded document; without an anchor its start.
    Section(DocumentId, Option<String>),
    Web(String),
}

impl DocumentId {
    pub(super) const TUTORIAL: Self = Self(1);

    pub(super) fn all() -> impl Iterator<Item = Self> {
        (0..DOCUMENTS.len()).map(Self)
    }

    /// Blocks of the document, parsed once.
    pub(super) fn blocks(self) -> &'static [MarkdownBlock] {
        static PARSED: OnceLock<Vec<Vec<MarkdownBlock>>> = OnceLock::new();
        &PARSED.get_or_init(|| DOCUMENTS.iter().map(|document| parse(document.text)).collect())[self.0]
    }

    /// First heading of the document.
    pub(super) fn title(self) -> String {
        let heading = self.blocks().iter().find_map(|block| match block {
            MarkdownBlock::Heading { spans, .. } => Some(spans),
            _ => None,
        });
        heading.map_or_else(String::new, |spans| spans.iter().map(|span| span.text.as_str()).collect())
    }

    /// True if the document has a heading with this anchor.
    #[cfg(test)]
    pub(super) fn has_anchor(self, wanted: &str) -> bool {
        self.blocks().iter().any(|block| matches!(block, MarkdownBlock::Heading { anchor, .. } if anchor == wanted))
    }

    /// Target of a link in this document; `None` if it leads to no embedded document.
    pub(super) fn follow(self, link: &str) -> Option<LinkTarget> {
        if link.starts_with("https://") || link.starts_with("http://") {
            return Some(LinkTarget::Web(link.to_owned()));
        }
        let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
        let anchor = (!anchor.is_empty()).then(|| anchor.to_owned());
        if path.is_empty() {
            return Some(LinkTarget::Section(self, anchor));
        }
        let (folder, _) = DOCUMENTS[self.0].path.rsplit_once('/').unwrap_or_default();
        let mut parts: Vec<&str> = folder.split('/').collect();
        for part in path.split('/') {
            match part {
                "." => {}
                ".." => drop(parts.pop()),
                _ => parts.push(part),
            }
        }
        let wanted = parts.join("/");
        let place = DOCUMENTS.iter().position(|document| document.path == wanted)?;
        Some(LinkTarget::Section(Self(place), anchor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::help::markdown::links_of;

    #[test]
    fn links_are_followed_from_the_folder_of_their_document() {
        let manual = DocumentId::default();
        let section =
            |id: usize, anchor: Option<&str>| Some(LinkTarget::Section(DocumentId(id), anchor.map(str::to_owned)));
        assert_eq!(manual.follow("#rank"), section(0, Some("rank")));
        assert_eq!(manual.follow("commands.md"), section(3, None));
        assert_eq!(manual.follow("../assets/README.md"), section(11, None));
        assert_eq!(manual.follow("https://mcap.dev"), Some(LinkTarget::Web("https://mcap.dev".to_owned())));
        assert_eq!(manual.follow("nowhere.md#rank"), None);
        assert!(manual.has_anchor("rank") && !manual.has_anchor("nowhere"));
        assert_eq!(manual.title(), "Manual of the window");
        assert!(DocumentId::TUTORIAL.title().starts_with("Tutorial"));
    }

    #[test]
    fn every_link_of_every_document_leads_to_a_section() {
        let mut followed = 0;
        for document in DocumentId::all() {
            for link in document.blocks().iter().flat_map(links_of) {
                let found = match document.follow(link) {
                    Some(LinkTarget::Section(target, Some(anchor))) => target.has_anchor(&anchor),
                    Some(LinkTarget::Section(_, None) | LinkTarget::Web(_)) => true,
                    None => false,
                };
                assert!(found, "{}: '{link}' leads nowhere", document.title());
                followed += 1;
            }
        }
        assert!(followed >= 40, "only {followed} links were found");
    }
}
