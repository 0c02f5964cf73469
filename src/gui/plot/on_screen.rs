//! Plots on the screen, so that a pass of egui finds the plot under the pointer before it draws them.

use egui::{Context, Id, Pos2, Rect, Ui};

use super::area::PlotArea;

/// A plot that was drawn.
#[derive(Clone, Debug)]
pub(crate) struct PlotOnScreen {
    /// Key of its value axis; empty without one.
    pub(crate) key: String,
    pub(crate) area: PlotArea,
    /// Visible part of the plot.
    visible: Rect,
}

#[derive(Clone, Debug, Default)]
struct PlotsOnScreen {
    pass: u64,
    drawn: Vec<PlotOnScreen>,
    before: Vec<PlotOnScreen>,
}

impl PlotsOnScreen {
    /// Begins a new list if a new pass has begun.
    fn begin(&mut self, pass: u64) {
        if self.pass != pass {
            self.pass = pass;
            self.before = std::mem::take(&mut self.drawn);
        }
    }
}

fn change<R>(ctx: &Context, act: impl FnOnce(&mut PlotsOnScreen) -> R) -> R {
    let pass = ctx.cumulative_pass_nr();
    ctx.data_mut(|data| {
        let plots = data.get_temp_mut_or_default::<PlotsOnScreen>(Id::unique("plots on the screen"));
        plots.begin(pass);
        act(plots)
    })
}

/// Registers a plot that is drawn in this pass.
pub(crate) fn register(ui: &Ui, area: &PlotArea, key: &str) {
    let visible = area.rect.intersect(ui.clip_rect());
    if visible.is_positive() {
        let plot = PlotOnScreen { key: key.to_owned(), area: *area, visible };
        change(ui.ctx(), |plots| plots.drawn.push(plot));
    }
}

/// The plot of the last pass at a position in the layer of `ui`.
pub(crate) fn plot_at(ui: &Ui, position: Pos2) -> Option<PlotOnScreen> {
    if ui.ctx().layer_id_at(position) != Some(ui.layer_id()) {
        return None;
    }
    change(ui.ctx(), |plots| plots.before.iter().find(|plot| plot.visible.contains(position)).cloned())
}

/// The plot of the last pass under the pointer, with the time there in nanoseconds since the log began.
pub(crate) fn plot_under_pointer(ui: &Ui) -> Option<(PlotOnScreen, i64)> {
    let pointer = ui.input(|input| input.pointer.hover_pos())?;
    let plot = plot_at(ui, pointer)?;
    let stamp_ns = plot.area.stamp_ns_at(pointer.x);
    Some((plot, stamp_ns))
}
