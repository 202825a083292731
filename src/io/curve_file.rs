//! Wavelet-variance curves to fit: CSV with columns `tau_samples,wv,edof`, or the JSON that `calibrate` or `wv`
//! writes (the classical curve of a signal is GMWM's, the robust one RGMWM's).

use super::file_kind::{self, FileKind};
use super::table::{Dictionary, Quantity, parse as parse_table};
use super::{Failure, Place, source};
use crate::report::{CurvesFile, FittedCurve, SignalsFile};
use nav_sim_calibration::{log_bias, robust_bias};
use nav_sim_signal::imu::{Axis, Sensor};
use nav_sim_signal::wavelet::{Curve, Tuning};
use std::path::Path;

/// A curve and what it is of.
#[derive(Debug)]
pub(crate) struct NamedCurve {
    /// The sensor, if the file says it.
    pub sensor: Option<Sensor>,
    /// The axis, if it is of one.
    pub axis: Option<Axis>,
    /// Sample rate (Hz), if the file says it.
    pub rate_hz: Option<f64>,
    /// Estimator, if the file says it.
    pub estimator: Option<String>,
    /// The curve.
    pub curve: Curve,
}

/// Layouts of a curve file, in words.
const LAYOUT: &str = "a curve is a CSV with the columns tau_samples,wv,edof (tau_samples = 2, 4, 8, …), or a .wv.json of calibrate or wv";

/// Reads the curves of a file.
///
/// # Errors
/// When it cannot be read, or is no curve file.
pub(crate) fn read(path: &Path) -> Result<Vec<NamedCurve>, Failure> {
    let text = source::text(path).map_err(|e| Failure::io(path, e))?;
    parse(&path.display().to_string(), &text)
        .map_err(|e| file_kind::or_wrong_kind(&[FileKind::Curve], path, e.or_hint(LAYOUT)))
}

fn parse(path: &str, text: &str) -> Result<Vec<NamedCurve>, Failure> {
    let curves = if text.trim_start().starts_with('{') {
        json(path, text)?
    } else {
        vec![csv(path, text)?]
    };
    if curves.iter().any(|c| c.curve.levels.is_empty()) || curves.is_empty() {
        return Err(Failure::contents(path, Place::Within, "no curve in it"));
    }
    Ok(curves)
}

/// Columns of a curve.
static QUANTITIES: [Quantity; 3] = [
    Quantity::number("tau_samples", "tau_samples"),
    Quantity::number("wv", "wv"),
    Quantity::number("edof", "edof"),
];
pub(crate) const DICTIONARY: Dictionary<'_> =
    Dictionary::new(&QUANTITIES, "the first line names them");

fn csv(path: &str, text: &str) -> Result<NamedCurve, Failure> {
    let table = parse_table(path, text, &DICTIONARY)?;
    let names = QUANTITIES.each_ref().map(|quantity| quantity.name);
    let columns = table.columns(names)?;
    let mut curve = Curve::default();
    for row in 0..table.rows() {
        push(&mut curve, columns.map(|column| column.si(row)))
            .map_err(|message| Failure::contents(path, table.line(row), message))?;
    }
    Ok(NamedCurve {
        sensor: None,
        axis: None,
        rate_hz: None,
        estimator: None,
        curve,
    })
}

/// Key that distinguishes a file of `wv` from one of `calibrate`.
#[derive(serde::Deserialize)]
struct Signals {
    signals: Option<serde::de::IgnoredAny>,
}

fn json(path: &str, text: &str) -> Result<Vec<NamedCurve>, Failure> {
    let syntax = |e: serde_json::Error| Failure::contents(path, e.line(), e.to_string());
    let is_of_wv = serde_json::from_str::<Signals>(text)
        .map_err(syntax)?
        .signals
        .is_some();
    let refused =
        |part: String, message: String| Failure::contents(path, Place::Part(part), message);
    let of_head = |message| refused("head".to_owned(), message);
    let file = if is_of_wv {
        let file: SignalsFile = serde_json::from_str(text).map_err(syntax)?;
        tuning(file.efficiency).map_err(of_head)?;
        CurvesFile::from(file)
    } else {
        serde_json::from_str(text).map_err(syntax)?
    };
    let (version, rate_hz) = (file.schema_version, file.rate_hz);
    if version != 1 {
        let message = format!("schema_version = {version} is not 1");
        return Err(of_head(message));
    }
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(of_head(format!(
            "rate_hz = {rate_hz} is not a finite number > 0"
        )));
    }
    let named = |(number, entry): (usize, &FittedCurve)| {
        let name = format!("curve {number}");
        let of_curve = |message| refused(name.clone(), message);
        let (tau, wv, edof) = (entry.tau_s.len(), entry.wv.len(), entry.edof.len());
        let has_bias = [0, tau].contains(&entry.log_bias.len());
        if tau != wv || tau != edof || !has_bias {
            return Err(of_curve(format!(
                "{tau} scales, {wv} wavelet variances and {edof} degrees of freedom"
            )));
        }
        let axis = Axis::ALL.into_iter().find(|a| a.name() == entry.axis);
        if axis.is_none() && entry.axis != "all" {
            return Err(of_curve(format!(
                "axis = {} is not x, y, z or all",
                entry.axis
            )));
        }
        let robust = entry.efficiency.map(tuning).transpose().map_err(of_curve)?;
        let level = |tau_s: &f64| (tau_s * rate_hz).log2().round() as u32;
        let mut curve = Curve {
            quantization: robust.as_ref().map(|tuning| *tuning.quantization()),
            classical: entry.classical_tau_s.iter().map(level).collect(),
            differing: entry.differing.clamp(0.0, 100.0),
            ..Curve::default()
        };
        for i in 0..tau {
            let point = [entry.tau_s[i] * rate_hz, entry.wv[i], entry.edof[i]];
            push(&mut curve, point)
                .map_err(|message| refused(format!("{name}, scale {}", i + 1), message))?;
        }
        // The variances of `wv` are measured; those of a table may be exact.
        let measured = curve.levels.iter().zip(&curve.edof).map(|(level, edof)| {
            let robust = robust.as_ref().filter(|_| !curve.classical.contains(level));
            log_bias(
                *edof,
                robust.map_or(0.0, |tuning| robust_bias(*edof, tuning)),
            )
        });
        curve.log_bias = match entry.log_bias.is_empty() {
            true => measured.collect(),
            false => entry.log_bias.clone(),
        };
        Ok(NamedCurve {
            sensor: Some(entry.sensor),
            axis,
            rate_hz: Some(rate_hz),
            estimator: Some(entry.estimator.clone()).filter(|name| !name.is_empty()),
            curve,
        })
    };
    (1..).zip(&file.curves).map(named).collect()
}

/// The tuning of robust variances of an efficiency.
fn tuning(efficiency: f64) -> Result<Tuning, String> {
    // The efficiency in a file is the true one, which the other convention puts a little beyond the range.
    match Tuning::new(efficiency.clamp(0.3, 0.99)) {
        Ok(tuning) if efficiency > 0.0 && efficiency <= 1.0 => Ok(tuning),
        _ => Err(format!("efficiency = {efficiency} is not above 0, up to 1")),
    }
}

/// Appends a point (scale in samples, wavelet variance, degrees of freedom); scales are powers of two, ascending.
fn push(curve: &mut Curve, [tau, wv, edof]: [f64; 3]) -> Result<(), String> {
    let level = tau.log2().round();
    // Scales in seconds come back from a division by the rate.
    let is_power = (1.0..=62.0).contains(&level) && (tau / level.exp2() - 1.0).abs() < 1e-6;
    let is_later = curve.levels.last().is_none_or(|last| *last < level as u32);
    let is_in = |(low, high): (f64, f64), value: f64| value >= low && value <= high;
    let checks = [
        (is_power, "tau_samples", tau, "a power of two ≥ 2"),
        (is_later, "tau_samples", tau, "greater than the one before"),
        (
            is_in(Curve::WV_RANGE, wv),
            "wv",
            wv,
            "a number from 1e-100 to 1e100",
        ),
        (
            is_in(Curve::EDOF_RANGE, edof),
            "edof",
            edof,
            "a number from 1e-15 to 1e15",
        ),
    ];
    if let Some((_, name, value, expected)) = checks.into_iter().find(|(holds, ..)| !holds) {
        return Err(format!("{name} = {value} is not {expected}"));
    }
    curve.levels.push(level as u32);
    curve.wv.push(wv);
    curve.edof.push(edof);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tests::{answers, told};
    use crate::report::json as to_json;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_table_of_scales() {
        let text = "# mine\nwv, edof ,tau_samples\n1e-5,100,2\n5e-6,50,4\n1e-6,12.5,16\n";
        let read = csv("c.csv", text).unwrap();
        assert_eq!(
            read.curve,
            Curve {
                levels: vec![1, 2, 4],
                wv: vec![1e-5, 5e-6, 1e-6],
                edof: vec![100.0, 50.0, 12.5],
                ..Curve::default()
            }
        );
    }

    #[test]
    fn what_calibrate_writes() {
        let entry = FittedCurve {
            sensor: Sensor::Gyro,
            axis: "all".into(),
            tau_s: vec![2.0 / 30.0, 4.0 / 30.0],
            wv: vec![2e-7, 1e-7],
            edof: vec![10.0, 5.0],
            ..FittedCurve::default()
        };
        let file = CurvesFile {
            schema_version: 1,
            rate_hz: 30.0,
            curves: vec![entry],
        };
        let read = json("m.wv.json", &to_json(&file)).unwrap();
        assert_eq!(
            (read[0].sensor, read[0].axis, read[0].rate_hz),
            (Some(Sensor::Gyro), None, Some(30.0))
        );
        assert_eq!(
            read[0].curve,
            Curve {
                levels: vec![1, 2],
                wv: vec![2e-7, 1e-7],
                edof: vec![10.0, 5.0],
                log_bias: read[0].curve.log_bias.clone(),
                ..Curve::default()
            }
        );
        // Medians of chi²/n for n = 20 and 10, 19.3374/20 and 9.3418/10 (tables), within the error of the cube root.
        for (found, exact) in read[0].curve.log_bias.iter().zip([-0.033693, -0.068086]) {
            assert_abs_diff_eq!(*found, exact, epsilon = 1e-3);
        }
    }

    /// Beyond the bounds of edof the time of intervals grows without bound, and squares of large variances are no numbers.
    #[test]
    fn refusals_name_the_line_and_the_value() {
        let rows = [
            "2,x,1",
            "3,1,1",
            "4,1,1\n2,1,1",
            "2,NaN,1",
            "2,1,0",
            "2,1,1e16",
            "2,1e170,1",
        ];
        let mut tables = rows
            .map(|rows| format!("tau_samples,wv,edof\n{rows}\n"))
            .to_vec();
        tables.push("tau,wv,edof\n2,1,1\n".to_owned());
        let later = "{\"schema_version\": 9, \"rate_hz\": 30.0, \"curves\": []}";
        let of_csv = tables
            .iter()
            .map(|text| (text.as_str(), csv("c.csv", text).map(|_| ())));
        let of_json =
            [later, "{\"rate_hz\": 1}"].map(|text| (text, json("c.json", text).map(|_| ())));
        insta::assert_snapshot!(answers(
            of_csv
                .chain(of_json)
                .map(|(text, read)| (text, read.map_err(|e| told(&e))))
        ));
    }
}
