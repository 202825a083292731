//! Wavelet variances of one signal in memory.

use crate::error;
use crate::work::work;
use nav_sim::io::recordings::facts::doubts;
use nav_sim::signal::wavelet::{
    RobustVariance, Tuning, WaveletError, classical_and_robust, default_levels, gappy, haar,
    interval,
};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Confidence of the intervals.
const CONFIDENCE: f64 = 0.95;

/// The wavelet variance of `x`: dict of `wv`, `edof`, `ci_low`, `ci_high`, scale by scale from 2 samples on.
#[pyfunction]
#[pyo3(signature = (x, scales, efficiency))]
pub(crate) fn wavelet<'py>(
    py: Python<'py>,
    x: PyReadonlyArray1<'py, f64>,
    scales: Option<u32>,
    efficiency: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    // a copy, so that Ctrl-C need not wait and nobody changes what is being read
    let signal = without_mean(x.as_array().to_vec());
    let largest = signal.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if largest.is_finite() && largest > 0.0 && !(1e-100..=1e100).contains(&largest) {
        let message = format!("x: {largest:e} is out of range: 1e-100 to 1e100");
        return Err(error::refused(py, &message));
    }
    let doubts = doubts("x", x.as_array().to_vec().as_slice());
    py.import("nav_sim._errors")?
        .getattr("warn")?
        .call1((doubts,))?;
    let found = work(py, None, None, move |_| {
        variances(&signal, scales, efficiency)
    })?;
    let found = found.map_err(|e| error::refused(py, &format!("x: {e}")))?;
    let columns = PyDict::new(py);
    for (name, values) in found {
        columns.set_item(name, PyArray1::from_vec(py, values))?;
    }
    Ok(columns)
}

/// The samples less the mean of those that are there, summed about the first of them, as the readers of recordings do it: a large offset costs no
/// digits.
fn without_mean(mut samples: Vec<f64>) -> Vec<f64> {
    let present = || samples.iter().filter(|v| !v.is_nan());
    let Some(first) = present().next().copied() else {
        return samples;
    };
    let mean = first + present().map(|v| v - first).sum::<f64>() / present().count() as f64;
    // An infinite one would make all of them so, and the first would be blamed.
    let mean = if mean.is_finite() { mean } else { 0.0 };
    samples.iter_mut().for_each(|v| *v -= mean);
    samples
}

/// Scale by scale.
type Columns = [(&'static str, Vec<f64>); 4];

fn variances(
    signal: &[f64],
    scales: Option<u32>,
    efficiency: Option<f64>,
) -> Result<Columns, WaveletError> {
    let levels = scales.unwrap_or_else(|| default_levels(signal.len()));
    let tuning = efficiency.map(Tuning::new).transpose()?;
    let values = |robust: Vec<RobustVariance>| robust.iter().map(|r| r.value).collect();
    let mut coverage = vec![1.0; levels as usize];
    let wv: Vec<f64> = if signal.iter().any(|x| x.is_nan()) {
        let found = gappy(signal, levels, &tuning.unwrap_or_default())?;
        coverage = found.coverage;
        match efficiency {
            Some(_) => values(found.robust),
            None => found.classical,
        }
    } else {
        match &tuning {
            Some(tuning) => values(classical_and_robust(signal, levels, tuning)?.1),
            None => haar::classical(signal, levels)?,
        }
    };
    // As the command has them: of the samples that are there, and no fewer than one.
    let edof = |(level, covered): (u32, &f64)| {
        let eta3 = (interval::edof_eta3(signal.len(), level) * covered).max(1.0);
        efficiency.map_or(eta3, |efficiency| interval::edof_robust(eta3, efficiency))
    };
    let edof: Vec<f64> = (1..).zip(&coverage).map(edof).collect();
    let ends = wv.iter().zip(&edof);
    let (low, high) = ends
        .map(|(wv, edof)| interval::interval(*wv, *edof, CONFIDENCE))
        .unzip();
    Ok([
        ("wv", wv),
        ("edof", edof),
        ("ci_low", low),
        ("ci_high", high),
    ])
}
