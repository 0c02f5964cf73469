//! Page that is shown for a log without a measured rig: rigs that were found, and a form for a new one.

mod draft;
mod form;
mod page;
mod topic_fields;

pub(super) use self::page::RigPage;
