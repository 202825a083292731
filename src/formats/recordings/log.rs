//! Recordings in logs: the samples of one IMU.

use super::error::sample;
use super::header::{Role, Unit, column_name};
use super::options::ReadOptions;
use super::table::{BETWEEN, BEYOND, Column, LARGEST, Lines, Notes, Raw, fits};
use crate::formats::{FileError, logs};
use nav_sim_logs::{Clock, ImuSample};
use nav_sim_signal::imu::Channel;
use std::path::Path;

/// Reads the samples of the IMU of a log.
pub(super) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let name = path.display().to_string();
    let refused = |e| logs::refused(path, e);
    let log = logs::open(path)?;
    let mut samples = log
        .imu(options.log.topic.as_deref(), options.log.stamp)
        .map_err(refused)?;
    let wanted = |channel: &Channel| {
        options
            .channels
            .as_ref()
            .is_none_or(|all| all.contains(channel))
    };
    let signals: Vec<Channel> = Channel::ALL.into_iter().filter(wanted).collect();
    let mut columns = vec![column("t_s".to_owned(), Role::Time { unit_s: Some(1.0) })];
    columns.extend(signals.iter().map(|channel| {
        column(
            column_name(*channel),
            Role::Signal {
                channel: *channel,
                unit: Unit::Si(1.0),
            },
        )
    }));
    for (row, read) in samples.by_ref().enumerate() {
        let read: ImuSample = read.map_err(refused)?;
        if row % BETWEEN == 0 {
            fits(&name, &columns, (row + BETWEEN) as u64)?;
        }
        columns[0].values.push(read.t_s());
        let (accel, gyro) = read.motion.rates();
        let six = [accel, gyro].concat();
        for (column, channel) in columns[1..].iter_mut().zip(&signals) {
            let value = six[channel.index()];
            if !value.is_finite() || value.abs() > LARGEST {
                let reason = if value.is_finite() {
                    BEYOND
                } else {
                    "is not finite"
                };
                return Err(sample(
                    &name,
                    row as u64 + 1,
                    &column.name,
                    &value.to_string(),
                    reason,
                ));
            }
            column.values.push(value);
        }
    }
    let mut notes = Notes::default();
    notes.assumptions.push(format!("topic {}", samples.topic()));
    let damage = log.damage().or(samples.damage());
    notes.warnings.extend(damage.map(logs::cut_off));
    let other = |c: &&nav_sim_logs::Channel| c.topic != samples.topic() && c.clock == Clock::Unix;
    let ignored = log
        .channels()
        .iter()
        .filter(other)
        .map(|c| c.topic.clone())
        .collect();
    Ok(Raw {
        path: name.clone(),
        columns,
        ignored,
        head_rate: None,
        lines: Lines::default(),
        notes,
    })
}

pub(super) fn column(name: String, role: Role) -> Column {
    Column {
        name,
        role,
        values: Vec::new(),
    }
}
