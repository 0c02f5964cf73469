//! Cells of a grid of images.

use egui::{Rect, Ui, Vec2, pos2, vec2};

/// Distance of two cells in points.
const GAP: f32 = 6.0;

/// The free room without a line of a height at its lower edge, and this line.
pub(super) fn above_line(ui: &Ui, height: f32) -> (Rect, Rect) {
    let room = ui.available_rect_before_wrap();
    room.split_top_bottom_at_y((room.bottom() - height).max(room.top()))
}

/// Number of columns with which images are largest in an area; every cell has lines of this height beside its image.
pub(super) fn columns_of_images(area: Vec2, count: usize, lines_height: f32) -> usize {
    /// Width over height of most images.
    const ASPECT: f32 = 4.0 / 3.0;
    let height = |columns: usize| {
        let rows = count.div_ceil(columns);
        let cell = cell_size(area, columns, rows);
        (cell.y - lines_height).min(cell.x / ASPECT)
    };
    (1..=count.max(1)).max_by(|a, b| height(*a).total_cmp(&height(*b))).unwrap_or(1)
}

fn cell_size(area: Vec2, columns: usize, rows: usize) -> Vec2 {
    let side = |whole: f32, parts: usize| (whole - GAP * (parts.max(1) - 1) as f32) / parts.max(1) as f32;
    vec2(side(area.x, columns), side(area.y, rows))
}

/// Rectangles of the cells, row by row.
pub(super) fn cells(all: Rect, columns: usize, count: usize) -> Vec<Rect> {
    let columns = columns.max(1);
    let rows = count.div_ceil(columns);
    let size = cell_size(all.size(), columns, rows);
    let place = |run: usize| {
        let (column, row) = ((run % columns) as f32, (run / columns) as f32);
        Rect::from_min_size(pos2(all.left() + column * (size.x + GAP), all.top() + row * (size.y + GAP)), size)
    };
    (0..count).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_do_not_overlap_and_stay_inside() {
        for width in [300.0, 700.0, 1600.0] {
            let all = Rect::from_min_size(pos2(10.0, 20.0), vec2(width, 400.0));
            for count in 1..=4 {
                for columns in 1..=count {
                    let cells = cells(all, columns, count);
                    assert_eq!(cells.len(), count);
                    for (number, cell) in cells.iter().enumerate() {
                        assert!(all.expand(0.1).contains_rect(*cell) && cell.is_positive());
                        assert!(cells[..number].iter().all(|other| !other.intersects(cell.shrink(1.0))));
                    }
                }
            }
        }
    }

    #[test]
    fn images_are_as_large_as_possible() {
        assert_eq!(columns_of_images(vec2(600.0, 200.0), 4, 22.0), 4, "a low area has one row");
        assert_eq!(columns_of_images(vec2(600.0, 500.0), 4, 22.0), 2);
        assert_eq!(columns_of_images(vec2(200.0, 900.0), 4, 22.0), 1, "a narrow one has one column");
        assert_eq!(columns_of_images(vec2(600.0, 200.0), 0, 22.0), 1);
    }
}
