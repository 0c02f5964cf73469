//! Suggested motions for sensors, checked by predicted standard deviations.

use crate::estimator::PoseKnowledge;
use crate::gimbal::Parameterization;
use crate::observability::laboratory::{
    LABORATORY_IMU, LaboratoryForm, LaboratoryMotion, LaboratorySetup, Mechanism, SensorColumns, SensorExcitation,
    sensor_excitation,
};
use crate::text::Named as _;

/// σ of a parameter after a motion, in units of its column scale.
fn sigma(table: &SensorExcitation, parameter: &str, motion: LaboratoryMotion) -> f64 {
    let column = table.motions.iter().position(|name| name == motion.name()).unwrap();
    table.parameters.iter().find(|row| row.name == parameter).unwrap().sigmas[column]
}

#[test]
fn the_motion_suggested_for_a_sensor_determines_it_better_than_others() {
    use LaboratoryMotion::{Hover, PitchOnly, RollOnly, RotationOnly, TranslationOnly, YawOnly};
    // The camera looks along the IMU's x axis: yaw is about the vertical image axis, pitch about the horizontal one.
    let poses = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: false };
    let setup = LaboratorySetup { poses, ..LaboratorySetup::new(Mechanism::named("rigid").unwrap()) };
    let setup = setup.with_columns(SensorColumns::ALL);
    let table = sensor_excitation(&setup, LaboratoryForm::whole(Parameterization::Minimal)).unwrap();
    // Parameter, suggested motion, motion that determines the parameter less.
    let rows = [
        ("readout", RollOnly, TranslationOnly),
        ("timeshift", RollOnly, TranslationOnly),
        ("fx", YawOnly, PitchOnly),
        ("fy", PitchOnly, YawOnly),
        ("cx", YawOnly, RollOnly),
        ("cy", PitchOnly, RollOnly),
        ("k1", RotationOnly, RollOnly),
        ("k2", RotationOnly, RollOnly),
        ("gyroscope.sx", RollOnly, PitchOnly),
        ("gyroscope.sy", PitchOnly, YawOnly),
        ("gyroscope.sz", YawOnly, RollOnly),
        ("gyroscope.mxy", RotationOnly, RollOnly),
        ("gyroscope.mxz", RotationOnly, PitchOnly),
        ("gyroscope.myz", RotationOnly, RollOnly),
        ("accelerometer.sx", PitchOnly, TranslationOnly),
        ("accelerometer.mxz", RollOnly, TranslationOnly),
        ("accelerometer.myz", PitchOnly, TranslationOnly),
    ];
    for (parameter, better, worse) in rows {
        let [better, worse, none] = [better, worse, Hover].map(|motion| sigma(&table, parameter, motion));
        assert!(better < worse && better < 0.999 * none, "{parameter}: {better}, {worse}, hover {none}");
    }
}
