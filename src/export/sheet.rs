//! Quantities in the units of data sheets, in ASCII as `nav-sim datasheet` reads them.

use nav_sim_signal::imu::Sensor;
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};

/// A quantity of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// White noise density N: velocity or angle random walk.
    Density,
    /// Random-walk density K: acceleration or rate random walk.
    Walk,
    /// A bias: its instability, its standard deviation.
    Bias,
}

impl Quantity {
    /// Its SI unit.
    pub(crate) const fn si_unit(self, sensor: Sensor) -> &'static str {
        match (self, sensor) {
            (Self::Density, Sensor::Accel) => "m/s^2/sqrt(Hz)",
            (Self::Density, Sensor::Gyro) => "rad/s/sqrt(Hz)",
            (Self::Walk, Sensor::Accel) => "m/s^3/sqrt(Hz)",
            (Self::Walk, Sensor::Gyro) => "rad/s^2/sqrt(Hz)",
            (Self::Bias, sensor) => sensor.unit(),
        }
    }

    /// Its unit on data sheets, and how many of them one SI unit is.
    pub(crate) const fn sheet(self, sensor: Sensor) -> (&'static str, f64) {
        const ROOT_HOUR: f64 = 60.0;
        match (self, sensor) {
            (Self::Density, Sensor::Accel) => ("m/s/sqrt(h)", ROOT_HOUR),
            (Self::Density, Sensor::Gyro) => ("deg/sqrt(h)", ROOT_HOUR / DEG),
            (Self::Walk, Sensor::Accel) => ("m/s^2/sqrt(h)", ROOT_HOUR),
            (Self::Walk, Sensor::Gyro) => ("deg/h/sqrt(h)", ROOT_HOUR / DEG_PER_HOUR),
            (Self::Bias, Sensor::Accel) => ("ug", 1e6 / STANDARD_GRAVITY),
            (Self::Bias, Sensor::Gyro) => ("deg/h", 1.0 / DEG_PER_HOUR),
        }
    }
}
