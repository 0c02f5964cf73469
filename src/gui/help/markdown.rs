//! Markdown documents as a list of blocks.

use pulldown_cmark::{Event, HeadingLevel, Options, Parser, Tag, TagEnd};

/// A piece of text with one style.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct StyledText {
    pub(super) text: String,
    pub(super) strong: bool,
    pub(super) emphasis: bool,
    pub(super) code: bool,
    pub(super) link: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum MarkdownBlock {
    Heading {
        /// 1 for the title of the document.
        level: u8,
        /// The anchor without `#`.
        anchor: String,
        spans: Vec<StyledText>,
    },
    /// A paragraph, or an item of a list.
    Paragraph {
        /// Number of enclosing lists.
        depth: usize,
        /// Marker of the item: a bullet or a number with a period.
        marker: Option<String>,
        spans: Vec<StyledText>,
    },
    Code(String),
    /// Rows of cells; the first row is the header.
    Table(Vec<Vec<Vec<StyledText>>>),
}

#[cfg(test)]
pub(super) fn links_of(block: &MarkdownBlock) -> impl Iterator<Item = &str> {
    let spans: Vec<&StyledText> = match block {
        MarkdownBlock::Heading { spans, .. } | MarkdownBlock::Paragraph { spans, .. } => spans.iter().collect(),
        MarkdownBlock::Code(_) => Vec::new(),
        MarkdownBlock::Table(rows) => rows.iter().flatten().flatten().collect(),
    };
    spans.into_iter().filter_map(|span| span.link.as_deref())
}

pub(super) fn parse(text: &str) -> Vec<MarkdownBlock> {
    let mut reader = Reader::default();
    for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
        reader.read(event);
    }
    reader.blocks
}

/// State between two events of the parser.
#[derive(Debug, Default)]
struct Reader {
    blocks: Vec<MarkdownBlock>,
    /// Anchors without the number of a repetition.
    anchors: Vec<String>,
    /// Text that is being read, and its style.
    spans: Vec<StyledText>,
    look: StyledText,
    /// Per enclosing list the number of the next item; `None` for bullets.
    lists: Vec<Option<u64>>,
    /// Marker of an item whose text has not started.
    marker: Option<String>,
    code: Option<String>,
    /// True inside a figure. Figures are omitted: they show the window in which the document is read.
    figure: bool,
    rows: Vec<Vec<Vec<StyledText>>>,
}

impl Reader {
    fn read(&mut self, event: Event<'_>) {
        match event {
            Event::Start(tag) => self.begin(tag),
            Event::End(tag) => self.end(tag),
            Event::Text(text) => self.push(&text, false),
            Event::Code(text) => self.push(&text, true),
            Event::SoftBreak | Event::HardBreak => self.push(" ", false),
            Event::InlineMath(_)
            | Event::DisplayMath(_)
            | Event::Html(_)
            | Event::InlineHtml(_)
            | Event::FootnoteReference(_)
            | Event::Rule
            | Event::TaskListMarker(_) => {}
        }
    }

    fn push(&mut self, text: &str, code: bool) {
        if self.figure {
            return;
        }
        if let Some(block) = &mut self.code {
            block.push_str(text);
            return;
        }
        let span = StyledText { text: text.to_owned(), code, ..self.look.clone() };
        match self.spans.last_mut() {
            Some(last)
                if (StyledText { text: String::new(), ..last.clone() })
                    == (StyledText { text: String::new(), ..span.clone() }) =>
            {
                last.text.push_str(text);
            }
            _ => self.spans.push(span),
        }
    }

    fn begin(&mut self, tag: Tag<'_>) {
        match tag {
            Tag::Strong => self.look.strong = true,
            Tag::Emphasis => self.look.emphasis = true,
            Tag::Link { dest_url, .. } => self.look.link = Some(dest_url.into_string()),
            Tag::Image { .. } => self.figure = true,
            Tag::List(first) => {
                self.paragraph();
                self.lists.push(first);
            }
            Tag::Item => {
                self.marker = Some(match self.lists.last_mut() {
                    Some(Some(number)) => {
                        *number += 1;
                        format!("{}.", *number - 1)
                    }
                    _ => "•".to_owned(),
                });
            }
            Tag::CodeBlock(_) => self.code = Some(String::new()),
            Tag::Table(_) => self.rows.clear(),
            Tag::TableHead | Tag::TableRow => self.rows.push(Vec::new()),
            _ => {}
        }
    }

    fn end(&mut self, tag: TagEnd) {
        match tag {
            TagEnd::Strong => self.look.strong = false,
            TagEnd::Emphasis => self.look.emphasis = false,
            TagEnd::Image => self.figure = false,
            TagEnd::Link => self.look.link = None,
            TagEnd::Heading(level) => self.heading(level),
            TagEnd::Paragraph | TagEnd::Item => self.paragraph(),
            TagEnd::List(_) => drop(self.lists.pop()),
            TagEnd::CodeBlock => {
                let text = self.code.take().unwrap_or_default();
                self.blocks.push(MarkdownBlock::Code(text.trim_end().to_owned()));
            }
            TagEnd::TableCell => {
                let cell = std::mem::take(&mut self.spans);
                if let Some(row) = self.rows.last_mut() {
                    row.push(cell);
                }
            }
            TagEnd::Table => self.blocks.push(MarkdownBlock::Table(std::mem::take(&mut self.rows))),
            _ => {}
        }
    }

    fn heading(&mut self, level: HeadingLevel) {
        let spans = std::mem::take(&mut self.spans);
        let text: String = spans.iter().map(|span| span.text.as_str()).collect();
        let plain = anchor_of(&text);
        let earlier = self.anchors.iter().filter(|known| **known == plain).count();
        let anchor = if earlier == 0 { plain.clone() } else { format!("{plain}-{earlier}") };
        self.anchors.push(plain);
        self.blocks.push(MarkdownBlock::Heading { level: level as u8, anchor, spans });
    }

    /// Ends a paragraph or the text of an item.
    fn paragraph(&mut self) {
        let spans = std::mem::take(&mut self.spans);
        if !spans.is_empty() {
            let (depth, marker) = (self.lists.len(), self.marker.take());
            self.blocks.push(MarkdownBlock::Paragraph { depth, marker, spans });
        }
    }
}

/// Anchor of a heading, as generated by GitHub.
fn anchor_of(heading: &str) -> String {
    let letters = heading.trim().to_lowercase().replace(' ', "-");
    letters.chars().filter(|letter| letter.is_alphanumeric() || "-_".contains(*letter)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(text: &str) -> StyledText {
        StyledText { text: text.to_owned(), ..StyledText::default() }
    }

    #[test]
    fn blocks_keep_their_text_and_their_look() {
        let text = "# A `b` title\n\nOne\nline, **bold** and [a link](x.md#y).\n\n```sh\nrun it\n```\n\n\
                    | a | b |\n| --- | --- |\n| 1 | `2` |\n";
        let blocks = parse(text);
        let [
            MarkdownBlock::Heading { level: 1, anchor, .. },
            MarkdownBlock::Paragraph { depth: 0, marker: None, spans },
            rest @ ..,
        ] = blocks.as_slice()
        else {
            panic!("{blocks:?}")
        };
        assert_eq!(anchor, "a-b-title");
        let bold = StyledText { strong: true, ..plain("bold") };
        let link = StyledText { link: Some("x.md#y".to_owned()), ..plain("a link") };
        assert_eq!(spans[..], [plain("One line, "), bold, plain(" and "), link, plain(".")]);
        let code = StyledText { code: true, ..plain("2") };
        let rows = vec![vec![vec![plain("a")], vec![plain("b")]], vec![vec![plain("1")], vec![code]]];
        assert_eq!(rest[..], [MarkdownBlock::Code("run it".to_owned()), MarkdownBlock::Table(rows)]);
        assert_eq!(links_of(&blocks[1]).collect::<Vec<_>>(), ["x.md#y"]);
    }

    #[test]
    fn figures_are_omitted() {
        let [MarkdownBlock::Paragraph { spans, .. }] = &parse("![a figure](a.png)\n\nText ![with](b.png)one.\n")[..]
        else {
            panic!("one paragraph")
        };
        assert_eq!(spans[..], [plain("Text one.")]);
    }

    #[test]
    fn items_have_marks_and_depths() {
        let blocks = parse("1. one\n   - inner\n2. two\n\nafter\n");
        let item = |depth: usize, marker: Option<&str>, text: &str| MarkdownBlock::Paragraph {
            depth,
            marker: marker.map(str::to_owned),
            spans: vec![plain(text)],
        };
        let expected = [
            item(1, Some("1."), "one"),
            item(2, Some("•"), "inner"),
            item(1, Some("2."), "two"),
            item(0, None, "after"),
        ];
        assert_eq!(blocks[..], expected);
    }

    #[test]
    fn a_repeated_heading_has_a_numbered_anchor() {
        let blocks = parse("## Ranks\n\n## Ranks\n\n## 10. Strength (χ²)\n");
        let anchors: Vec<&str> = blocks
            .iter()
            .filter_map(|block| match block {
                MarkdownBlock::Heading { anchor, .. } => Some(anchor.as_str()),
                _ => None,
            })
            .collect();
        assert_eq!(anchors, ["ranks", "ranks-1", "10-strength-χ²"]);
    }
}
