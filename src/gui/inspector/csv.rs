//! State at the cursor; one quantity per row.

use super::InspectorPanel;
use crate::geometry::seconds_from_ns;
use crate::gui::{CsvTable, PanelContext};
use crate::table::{Column, csv};

/// Column of a quantity with its name, unit and value.
type QuantityColumn = Column<'static, (String, &'static str, f64)>;

impl CsvTable for InspectorPanel {
    /// The state of the newest frame at the cursor.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let columns = [
            QuantityColumn::new("quantity", |(name, ..)| name.clone()),
            QuantityColumn::new("unit", |(_, unit, _)| *unit),
            QuantityColumn::new("value", |(.., value)| *value),
        ];
        let mut rows = Vec::new();
        let Some(step) = run.step_at(ctx.cursor_ns) else { return csv(&columns, rows) };
        rows.push(("time".to_owned(), "s", seconds_from_ns(step.report.stamp_ns)));
        rows.push(("frame".to_owned(), "", step.report.frame_index as f64));
        if let Some(newest) = step.report.newest() {
            let vectors = [
                ("position", "m", newest.world_from_imu.translation_m),
                ("velocity", "m/s", newest.velocity_m_per_s),
                ("accelerometer bias", "m/s2", newest.accelerometer_bias_m_per_s2),
                ("gyroscope bias", "rad/s", newest.gyroscope_bias_rad_per_s),
            ];
            for (name, unit, vector) in vectors {
                let axes = ["x", "y", "z"].into_iter().zip(&vector);
                rows.extend(axes.map(|(axis, value)| (format!("{name} {axis}"), unit, *value)));
            }
            let rotation = ["x", "y", "z", "w"].into_iter().zip(&newest.world_from_imu.rotation.coords);
            rows.extend(rotation.map(|(axis, value)| (format!("attitude q{axis}"), "", *value)));
            let joints = newest.joint_angles_rad.iter().enumerate();
            rows.extend(joints.map(|(joint, angle)| (format!("joint {}", joint + 1), "rad", *angle)));
        }
        let (calibration, names) = (&step.report.calibration, ctx.names());
        for parameter in calibration.parameters.iter().copied() {
            let (name, unit) = (names.name(parameter), parameter.dimension().unit());
            rows.push((name.clone(), unit, calibration.value_of(parameter).unwrap_or(f64::NAN)));
            rows.push((format!("{name} sigma"), unit, calibration.sigma_of(parameter).unwrap_or(f64::NAN)));
        }
        csv(&columns, rows)
    }
}
