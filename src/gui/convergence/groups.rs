//! Selector of the group that the convergence panel shows, and the headings of groups.

use egui::{Align2, Rect, Role, Ui, WidgetInfo, pos2};

use crate::gimbal::{ParameterGroup, ParameterId};
use crate::gui::PanelContext;
use crate::gui::theme;
use crate::gui::units::capitalized;
use crate::text::Named as _;

/// Content of the panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ConvergenceView {
    /// All groups below each other.
    #[default]
    All,
    /// One group fills the panel.
    Group(ParameterGroup),
}

/// The groups of sorted parameters with their sizes.
pub(super) fn groups_of(parameters: &[ParameterId]) -> Vec<(ParameterGroup, usize)> {
    let chunks = parameters.chunk_by(|a, b| a.group() == b.group());
    chunks.filter_map(|chunk| Some((chunk.first()?.group(), chunk.len()))).collect()
}

/// Draws a row of labels, one of which is selected.
pub(super) fn choice_ui(ui: &mut Ui, view: &mut ConvergenceView, groups: &[(ParameterGroup, usize)]) {
    ui.horizontal(|ui| {
        let all: usize = groups.iter().map(|(_, count)| count).sum();
        ui.selectable_value(view, ConvergenceView::All, format!("All ({all})"))
            .on_hover_text("All groups below each other");
        for (group, count) in groups {
            let label = format!("{} ({count})", capitalized(group.name()));
            ui.selectable_value(view, ConvergenceView::Group(*group), label)
                .on_hover_text("This group fills the panel");
        }
    });
}

/// Draws the heading of a group; a click folds the group.
pub(super) fn heading_ui(
    ui: &Ui,
    ctx: &PanelContext<'_>,
    folded: &mut Vec<ParameterGroup>,
    (group, count): (ParameterGroup, usize),
    rect: Rect,
) {
    let theme = ctx.theme;
    let open = !folded.contains(&group);
    let figure = ctx.presentation.is_figure();
    let mark = match (figure, open) {
        (true, _) => "",
        (false, true) => "⏷ ",
        (false, false) => "⏵ ",
    };
    let text = format!("{mark}{} ({count})", group.name());
    let place = pos2(rect.left(), rect.center().y);
    let end = ui.painter().text(place, Align2::LEFT_CENTER, text, theme::label_font(), theme.text_strong).right();
    let line = egui::Rangef::new((end + 6.0).min(rect.right()), rect.right());
    ui.painter().hline(line, rect.center().y, egui::Stroke::new(1.0, theme.outline));
    if figure {
        return;
    }
    let (sense, role) = ctx.presentation.clickable(Role::Button);
    let response = ui.interact(rect, ui.unique_id().with(("group", group.name())), sense);
    response.widget_info(|| WidgetInfo::selected(role, true, open, format!("Group {}", group.name())));
    if response.clicked() {
        if open {
            folded.push(group);
        } else {
            folded.retain(|known| *known != group);
        }
    }
    response.on_hover_text(if open { "Fold" } else { "Unfold" });
}
