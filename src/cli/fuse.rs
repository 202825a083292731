//! `nav-sim fuse`: the filter on recorded data.

use super::{Failure, Session};
use crate::formats::atomic::{AtomicDir, Found, claim_directory};
use crate::fuse::{Drive, FILES, FuseAnswer, FuseManifest, FuseRequest, directory};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Fuse recorded IMU and GNSS data with the filter of `run` and the noise model MODEL
///
/// IMU: rates (t_s, gyro_x_rad_s … accel_z_m_s2; other units and loggers' names as for `wv`) or increments
/// (dtheta_x_rad … dv_z_m_s, time = end of the interval). GNSS: t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m,
/// sd_d_m, and v_n_m_s … sd_vd_m_s where velocity is measured. Either may be a text file of KF-GINS (7 or 8
/// columns of increments; 7 of position, 13 with velocity). GNSS may also be a solution of RTKLIB (.pos, GPST)
/// or NMEA sentences (GGA; RMC or VTG, GST), in seconds of the day or in Unix time, as the IMU is. A log (MCAP, bag,
/// ULog, UBX) may be either, or both. Gaps of up to 5 s are bridged, with the uncertainty that the recording shows over such times elsewhere. Writes solution.csv,
/// innovations.csv, errors.csv (with a reference), solution.kml, summary.json, report.html, manifest.json; with
/// --smooth also smoothed.csv, errors_smoothed.csv, smoothed.kml. Exit code 3: the solution is overconfident.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory record trajectories/land_vehicle.toml calib_data/tactical.toml -o drive
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --reference drive/reference.csv --outage 300:360 --smooth -o out/fused
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --initial drive/initial.toml -o out/given")]
pub(crate) struct Args {
    #[command(flatten)]
    request: FuseRequest,
    /// Directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/fuse")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let begin = Instant::now();
    let drive = Drive::read(&args.request)?;
    let manifest = FuseManifest {
        command: super::given(),
        ..drive.manifest.clone()
    };
    let recognise = |text: &str| {
        let present = serde_json::from_str(text);
        Ok(present.map_or(Found::Foreign, |present| {
            Found::result(manifest.is_same_fusion(&present))
        }))
    };
    let inputs = manifest.inputs.iter().map(|input| Path::new(&input.path));
    let _own = claim_directory(&args.out, &FILES, inputs, session.existing(), recognise)?;
    let answer = drive.fuse()?;
    write(
        &answer,
        &FuseManifest {
            wall_s: begin.elapsed().as_secs_f64(),
            ..manifest
        },
        &args.out,
    )?;
    session.answer(&answer);
    session.wrote(&args.out);
    answer.unmet().map_or(Ok(()), Err)
}

/// Writes all files, the manifest last.
fn write(answer: &FuseAnswer, manifest: &FuseManifest, out: &Path) -> Result<(), Failure> {
    let mut made = AtomicDir::create(out)?;
    let files = directory(answer, manifest);
    let is_old = |name: &&str| files.iter().all(|file| file.name != *name);
    let old: Vec<&str> = FILES.into_iter().filter(is_old).collect();
    for file in files {
        made.write_parts(file.name, file.parts)?;
    }
    made.commit()?;
    // what an earlier fusion smoothed is not of this one; where there is none, there is nothing to remove
    old.iter()
        .for_each(|name| drop(std::fs::remove_file(out.join(name))));
    Ok(())
}
