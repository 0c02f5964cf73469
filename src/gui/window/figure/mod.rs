//! Figures of panels for papers: one panel over a time range in a column of a page, as vectors.

mod draw;
mod size;
mod spec;
mod text;

pub(crate) use self::draw::complete;
pub use self::draw::{FigureInput, alone_ui};
pub use self::size::figure_height;
pub use self::spec::{FIGURE_FONT_PT, FIGURE_SIDE_MM, FigureFormat, FigureSpec};
pub use self::text::{FigureContent, FigureText};
