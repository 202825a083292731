//! What is calibrated: the paper's replicates, or noise of one's own.

use crate::Failure;
use crate::paper_section4::study::Design;
use nav_sim::calibration::Estimator;
use nav_sim::signal::noise::{Composite, Model, Process, ProcessKind, Spread};

/// A case by its name.
pub(crate) fn case(name: &str, paper: Design) -> Result<Design, Failure> {
    let of_parts = |parts: &[(&str, &[f64])], replicates: u64| -> Result<Design, Failure> {
        let mut processes = Vec::new();
        for (code, values) in parts {
            let kind = ProcessKind::named(code).ok_or("no such process")?;
            processes.push(Process::of_values(kind, values, paper.model.rate_hz)?);
        }
        let noise = Composite::new(processes);
        let model = Model::pooled(paper.model.rate_hz, &noise, &noise);
        let spec = parts
            .iter()
            .map(|(code, _)| *code)
            .collect::<Vec<_>>()
            .join("+")
            .parse()?;
        let estimators = match replicates {
            1 => vec![Estimator::Gmwm, Estimator::Rgmwm],
            _ => vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
        };
        Ok(Design {
            model,
            spread: Spread::default(),
            replicates,
            spec,
            estimators,
            ..paper.clone()
        })
    };
    // Of the first scale QN is 1.5 q2, WN sigma2/2.
    let q2 = |share: f64, sigma2: f64| sigma2 * share / (1.0 - share) / 3.0;
    let three = |share: f64| {
        of_parts(
            &[("WN", &[1.0]), ("QN", &[q2(share, 1.0)]), ("RW", &[1e-6])],
            6,
        )
    };
    match name {
        "paper" => Ok(paper),
        "qn32" => three(0.32),
        "qn50" => three(0.5),
        "qn66" => three(0.66),
        "qn86" => three(0.86),
        "n2" => {
            let slow: [(&str, &[f64]); 3] = [
                ("AR1", &[0.98, 2e-7]),
                ("AR1", &[0.9995, 1e-9]),
                ("RW", &[1e-10]),
            ];
            of_parts(
                &[&[("WN", &[5e-5][..]), ("QN", &[q2(0.64, 5e-5)])], &slow[..]].concat(),
                6,
            )
        }
        "single" => of_parts(&[("WN", &[1.0]), ("RW", &[1e-6])], 1),
        other => Err(format!("no case \"{other}\"").into()),
    }
}
