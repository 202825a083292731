//! Writing recordings.

use super::column_name;
use crate::io::table::write_npy_header;
use flate2::{Compression, write::GzEncoder};
use nav_sim_signal::imu::Channel;
use std::io::{self, BufWriter, Write};

/// A format of recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FileFormat {
    /// Text, ten significant digits.
    #[default]
    Csv,
    /// The same, compressed.
    CsvGz,
    /// Samples × channels, all digits; without time.
    Npy,
}

nav_sim_signal::named!(FileFormat { Csv = "csv", CsvGz = "csv.gz", Npy = "npy" });

impl FileFormat {
    /// Writes signals of the same length (m/s² or rad/s), sampled at `rate_hz` from time 0 on.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(
        self,
        to: impl Write,
        rate_hz: f64,
        signals: &[(Channel, Vec<f64>)],
    ) -> io::Result<()> {
        let mut to = BufWriter::with_capacity(1 << 17, to);
        match self {
            Self::Csv => write_csv(&mut to, rate_hz, signals)?,
            Self::CsvGz => {
                let mut encoder = GzEncoder::new(&mut to, Compression::fast());
                write_csv(&mut encoder, rate_hz, signals)?;
                encoder.finish()?;
            }
            Self::Npy => write_npy(&mut to, signals)?,
        }
        to.flush()
    }
}

fn rows(signals: &[(Channel, Vec<f64>)]) -> usize {
    signals.first().map_or(0, |(_, x)| x.len())
}

fn write_csv(to: &mut impl Write, rate_hz: f64, signals: &[(Channel, Vec<f64>)]) -> io::Result<()> {
    let names: Vec<&str> = signals.iter().map(|(c, _)| column_name(*c)).collect();
    writeln!(to, "t_s,{}", names.join(","))?;
    let mut line = Vec::new();
    for k in 0..rows(signals) {
        line.clear();
        write!(line, "{}", k as f64 / rate_hz)?;
        for (_, x) in signals {
            write!(line, ",{:.9e}", x[k])?;
        }
        line.push(b'\n');
        to.write_all(&line)?;
    }
    Ok(())
}

fn write_npy(to: &mut impl Write, signals: &[(Channel, Vec<f64>)]) -> io::Result<()> {
    write_npy_header(to, rows(signals), signals.len())?;
    for k in 0..rows(signals) {
        for (_, x) in signals {
            to.write_all(&x[k].to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::recordings::{ReadOptions, read};

    #[test]
    fn every_format_reads_back() {
        let signals = Channel::ALL.map(|c| {
            let x = |k: usize| (k as f64 + 1.0).sqrt() * 1e-3 - 1e-7 * c.index() as f64;
            (c, (0..100).map(x).collect::<Vec<f64>>())
        });
        let directory = tempfile::tempdir().unwrap();
        for (format, digits) in [
            (FileFormat::Csv, 1e-11),
            (FileFormat::CsvGz, 1e-11),
            (FileFormat::Npy, 1e-17),
        ] {
            let path = directory.path().join(format!("a.{}", format));
            format
                .write(std::fs::File::create(&path).unwrap(), 128.0, &signals)
                .unwrap();
            let options = ReadOptions {
                rate_hz: Some(128.0),
                ..ReadOptions::default()
            };
            let (recordings, _) = read(&[path], &options).unwrap();
            for (read, (channel, x)) in recordings[0].signals.iter().zip(&signals) {
                assert_eq!(read.channel, *channel);
                for (a, b) in read.samples.iter().zip(x) {
                    assert!((a + read.mean - b).abs() <= digits + 1e-16, "{format:?}");
                }
            }
        }
    }
}
