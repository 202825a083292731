//! Which recordings are abnormal, as words.

use nav_sim_calibration::{Diagnosis, advice, effects};
use nav_sim_signal::imu::Sensor;

/// What the recordings of each sensor say of one another, in words; nothing of a single one.
pub(crate) fn describe_replicates(diagnoses: &[Diagnosis]) -> Vec<String> {
    let of_sensor = |sensor: Sensor| {
        let mut lines = advice(diagnoses, sensor);
        lines.extend(effects(diagnoses, sensor));
        let head = format!("{}: do the recordings agree?", sensor.name());
        let text = std::iter::once(head).chain(lines.iter().map(|l| format!("  {l}")));
        (!lines.is_empty()).then(|| text.collect::<Vec<_>>().join("\n"))
    };
    Sensor::ALL.into_iter().filter_map(of_sensor).collect()
}
