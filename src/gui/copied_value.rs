//! The value under the pointer, for copying it.

use egui::{Context, Id, Ui};

/// The value that a panel offers in one pass of egui.
#[derive(Clone)]
struct Offered {
    pass: u64,
    text: String,
}

fn id() -> Id {
    Id::unique("offered value")
}

/// Offers the value under the pointer for copying, in this pass only.
pub(crate) fn offer(ui: &Ui, text: String) {
    let pass = ui.ctx().cumulative_pass_nr();
    ui.data_mut(|data| data.insert_temp(id(), Offered { pass, text }));
}

/// The value that was offered in this pass.
pub(crate) fn offered(ctx: &Context) -> Option<String> {
    let pass = ctx.cumulative_pass_nr();
    ctx.data(|data| data.get_temp::<Offered>(id())).filter(|offered| offered.pass == pass).map(|offered| offered.text)
}
