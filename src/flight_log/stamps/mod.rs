//! Stamps of messages: the clock of a topic, the spacing of its stamps, and stamps as text.

pub(crate) mod clock;
pub(crate) mod spacing;
pub(super) mod text;
