//! State at the cursor; one quantity per row.

use super::InspectorPanel;
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::geometry::seconds_from_ns;
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for InspectorPanel {
    /// The state of the newest frame at the cursor.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let mut table = CsvWriter::new(["quantity", "unit", "value"]);
        let Some(step) = run.step_at(ctx.cursor_ns) else { return table.into_text() };
        let mut push_row = |quantity: &str, unit: &str, value: f64| {
            table.row([quantity.to_owned(), unit.to_owned(), number_cell(value)]);
        };
        push_row("time", "s", seconds_from_ns(step.report.stamp_ns));
        push_row("frame", "", step.report.frame_index as f64);
        if let Some(newest) = step.report.newest() {
            let rotation = newest.world_from_imu.rotation;
            let vectors = [
                ("position", "m", newest.world_from_imu.translation_m),
                ("velocity", "m/s", newest.velocity_m_per_s),
                ("accelerometer bias", "m/s2", newest.accelerometer_bias_m_per_s2),
                ("gyroscope bias", "rad/s", newest.gyroscope_bias_rad_per_s),
            ];
            for (name, unit, vector) in vectors {
                for (axis, value) in ["x", "y", "z"].into_iter().zip(vector.iter()) {
                    push_row(&format!("{name} {axis}"), unit, *value);
                }
            }
            for (name, value) in ["x", "y", "z", "w"].into_iter().zip(rotation.coords.iter()) {
                push_row(&format!("attitude q{name}"), "", *value);
            }
            for (joint, angle) in newest.joint_angles_rad.iter().enumerate() {
                push_row(&format!("joint {}", joint + 1), "rad", *angle);
            }
        }
        let calibration = &step.report.calibration;
        let names = ctx.names();
        for (index, parameter) in calibration.parameters.iter().enumerate() {
            let (name, unit) = (names.name(*parameter), parameter.dimension().unit());
            push_row(&name, unit, calibration.values.get(index).copied().unwrap_or(f64::NAN));
            push_row(&format!("{name} sigma"), unit, calibration.sigmas.get(index).copied().unwrap_or(f64::NAN));
        }
        table.into_text()
    }
}
