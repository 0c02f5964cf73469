//! Value and item under the pointer, for copying and for the context menu.

use egui::{Context, Id, Ui};

use crate::frontend::FeatureId;
use crate::gimbal::ParameterId;

/// Item of a panel that a context menu acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Item {
    Parameter(ParameterId),
    Feature(FeatureId),
    /// Index of a run.
    Run(usize),
    /// Stamp of a marker, in nanoseconds since the log began.
    Marker(i64),
}

/// Offer of a panel in one pass of egui.
#[derive(Clone)]
struct Offered<T> {
    pass: u64,
    content: T,
}

fn insert<T: Clone + Send + Sync + 'static>(ui: &Ui, name: &'static str, content: T) {
    let pass = ui.ctx().cumulative_pass_nr();
    ui.data_mut(|data| data.insert_temp(Id::unique(name), Offered { pass, content }));
}

fn get<T: Clone + Send + Sync + 'static>(ctx: &Context, name: &'static str) -> Option<T> {
    let pass = ctx.cumulative_pass_nr();
    let offered = ctx.data(|data| data.get_temp::<Offered<T>>(Id::unique(name)));
    offered.filter(|offered| offered.pass == pass).map(|offered| offered.content)
}

const VALUE: &str = "offered value";
const ITEM: &str = "offered item";

/// Offers the value under the pointer for copying, in this pass only.
pub(crate) fn offer(ui: &Ui, text: String) {
    insert(ui, VALUE, text);
}

/// The value that was offered in this pass.
pub(crate) fn offered(ctx: &Context) -> Option<String> {
    get(ctx, VALUE)
}

/// Offers the item under the pointer to the context menu, in this pass only.
pub(crate) fn offer_item(ui: &Ui, item: Item) {
    insert(ui, ITEM, item);
}

/// The item that was offered in this pass.
pub(crate) fn offered_item(ctx: &Context) -> Option<Item> {
    get(ctx, ITEM)
}
