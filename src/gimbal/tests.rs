mod conversions;
mod derivatives;
pub(crate) mod golden;
pub(crate) mod named;
mod priors;
pub(crate) mod random;

pub(crate) use self::named::parameter;

#[test]
fn intrinsics_of_the_imu_are_shown_in_percent() {
    let value = |name: &str| parameter(name).shown().value(0.0125, 0.001);
    assert_eq!(["gyroscope.sx", "k1", "fx"].map(value), ["1.25 %", "0.0125", "0.0125 px"]);
}
