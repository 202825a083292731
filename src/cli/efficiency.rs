//! `nav-sim efficiency`: Monte-Carlo study of the estimators themselves.

use super::{Failure, Session};
use nav_sim::efficiency::{
    Accuracy, Design, Estimate, Movement, StudyError, Target, abnormal_curve, accuracy, outlier_curve, target,
};
use nav_sim::formats::efficiency_directory::{Layout, StudyDirectory};
use nav_sim::formats::{atomic, efficiency_file};
use nav_sim::noise::{Process, contamination::Contamination};
use nav_sim::report::{self, EfficiencyFile, EfficiencyRow};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Study the estimators themselves by Monte Carlo
///
/// Draws H sets of K replicates from a model with [spread], contaminates each set in several ways, estimates
/// from it, and says how far from theta_0 the estimates are: robust RMSE (eq. 15 of the paper), its
/// Monte-Carlo error, and the median relative error. What is finished is kept in the output directory
/// (sets.csv): a study that was stopped goes on where it was, to the same results; more --sets extend it.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim efficiency examples/paper_fig2.toml --sets 4 --samples 8192 -o quick
  nav-sim efficiency examples/paper_fig2.toml --sets 2 --samples 8192 --sensitivity -o curves
  nav-sim efficiency examples/paper_fig2.toml --sets 6 --samples 8192 -o quick --format json")]
pub(crate) struct Args {
    /// The study (TOML)
    #[arg(value_name = "STUDY")]
    study: PathBuf,
    /// Directory of the results, finished and unfinished
    #[arg(long, short, value_name = "DIR", default_value = "efficiency")]
    out: PathBuf,
    /// Sets of replicates, instead of the study's
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u64).range(1..=1 << 40))]
    sets: Option<u64>,
    /// Samples of a replicate, instead of the study's
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u64).range(4..=1 << 40))]
    samples: Option<u64>,
    /// Also write sensitivity.csv: how far one outlier, or one replicate with an abnormal random walk, moves
    /// each estimate of the first set, against its size
    #[arg(long)]
    sensitivity: bool,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let file = efficiency_file::read(&args.study)?;
    let mut design = file.design;
    if let Some(samples) = args.samples {
        design = design.with_samples(samples as usize);
    }
    let of = |e: &StudyError| Failure::input(format!("{}: {e}", args.study.display()));
    design.check().map_err(|e| of(&e))?;
    let aim = target(&design).map_err(|e| of(&e))?;
    design.seed = session.seed(file.seed);
    let sets = args.sets.unwrap_or(file.sets);
    let identity = identity(&design);
    let layout = layout(&design, &aim);
    let mut directory = StudyDirectory::open(&args.out, &identity, layout)?;
    estimate(&design, sets, &mut directory, session)?;
    let results = results(&design, &aim, &directory.done[..sets as usize]);
    let results = EfficiencyFile { schema_version: 1, sets, study: identity, results };
    write(&args.out, &results, session)?;
    if args.sensitivity {
        let text = sensitivity(&design, &aim).map_err(|e| of(&e))?;
        atomic::write(&args.out.join("sensitivity.csv"), text)?;
    }
    session.printer.say(&format!("wrote {}", args.out.display()));
    Ok(())
}

/// What makes a study this one and no other. The number of sets does not: a study can be extended.
fn identity(design: &Design) -> Value {
    let hash = |what: Value| blake3::hash(what.to_string().as_bytes()).to_hex()[..16].to_owned();
    let scenario = |s: &Contamination| json!({ "name": s.name, "hash": hash(json!(s.rules)) });
    let axis = design.channel.index();
    json!({
        "schema_version": 1,
        "nav_sim": env!("CARGO_PKG_VERSION"),
        "seed": design.seed,
        "axis": design.channel.to_string(),
        "model": hash(json!([design.model.axes[axis], design.spread.axes[axis]])),
        "rate_hz": design.model.rate_hz,
        "replicates": design.replicates,
        "samples": design.samples,
        "levels": design.levels,
        "scenarios": design.scenarios.iter().map(scenario).collect::<Vec<_>>(),
        "estimators": design.estimators.iter().map(|e| e.name()).collect::<Vec<_>>(),
        "fit": design.spec.to_string(),
        "trim": design.trim.count(design.replicates as usize),
        "efficiency": design.tuning.efficiency(),
    })
}

fn layout(design: &Design, aim: &Target) -> Layout {
    let row = |(s, e): (&Contamination, &str)| (s.name.clone(), e.to_owned());
    let of = |s| design.estimators.iter().map(move |e| row((s, e.name())));
    let rows = design.scenarios.iter().flat_map(of).collect();
    Layout { rows, parameters: Design::parameters(&aim.fit.composite) }
}

/// Estimates from the sets that are not done yet, block by block: a block is kept as soon as it is done.
fn estimate(
    design: &Design,
    sets: u64,
    directory: &mut StudyDirectory,
    session: &Session,
) -> Result<(), Failure> {
    let done = directory.done.len() as u64;
    if done > 0 {
        session.printer.say(&format!("{done} sets are there already"));
    }
    let progress = session.progress("sets", sets.saturating_sub(done));
    // Long enough that no thread waits for the last set of a block for a large part of it.
    let block = 8 * session.threads() as u64;
    let mut next = done;
    while next < sets {
        let end = sets.min(next + block);
        let one = |set: u64| {
            let estimates = design.set(set);
            progress.add(1);
            estimates
        };
        let estimates: Vec<Result<Vec<Estimate>, StudyError>> =
            (next..end).into_par_iter().map(one).collect();
        let estimates = estimates.into_iter().collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
        directory.append(estimates)?;
        next = end;
    }
    Ok(())
}

fn results(design: &Design, aim: &Target, sets: &[Vec<Estimate>]) -> Vec<EfficiencyRow> {
    let names = Design::parameters(&aim.fit.composite);
    let targets = Design::values(&aim.fit.composite);
    let width = design.estimators.len();
    let mut rows = Vec::new();
    for (s, scenario) in design.scenarios.iter().enumerate() {
        let of = |e: usize, p: usize| sets.iter().map(|set| set[s * width + e].theta[p]).collect::<Vec<_>>();
        let judge = |e: usize, p: usize| accuracy(&of(e, p), targets[p], design.seed);
        let cells: Vec<(usize, usize)> =
            (0..width).flat_map(|e| (0..names.len()).map(move |p| (e, p))).collect();
        let judged: Vec<Accuracy> = cells.par_iter().map(|(e, p)| judge(*e, *p)).collect();
        for ((e, p), own) in cells.into_iter().zip(&judged) {
            let roots: usize = sets.iter().map(|set| set[s * width + e].without_root).sum();
            let variances = sets.len() as f64 * design.replicates as f64 * f64::from(design.levels);
            rows.push(EfficiencyRow {
                scenario: scenario.name.clone(),
                estimator: design.estimators[e].name().to_owned(),
                parameter: names[p].clone(),
                target: targets[p],
                zeros: of(e, p).iter().filter(|v| **v <= 0.0).count(),
                without_root: roots as f64 / variances,
                ..EfficiencyRow::new(own, &judged[p])
            });
        }
    }
    rows
}

fn write(out: &Path, results: &EfficiencyFile, session: &Session) -> Result<(), Failure> {
    let (json, table) = (report::json(results), report::efficiency_table(results));
    atomic::write(&out.join("results.csv"), report::efficiency_csv(results))?;
    atomic::write(&out.join("results.txt"), format!("{table}\n"))?;
    atomic::write(&out.join("results.json"), &json)?;
    atomic::write(&out.join("rmse.svg"), report::efficiency_svg(results))?;
    atomic::write(&out.join("report.html"), report::efficiency_page(results))?;
    session.printer.result(if session.json() { json.trim_end() } else { &table });
    Ok(())
}

/// The curves of `--sensitivity` as CSV: disturbance, size, estimator, parameter, relative change.
fn sensitivity(design: &Design, aim: &Target) -> Result<String, StudyError> {
    let names = Design::parameters(&aim.fit.composite);
    let noise = design.model.axis(design.channel);
    let white = noise.processes.iter().find_map(|p| match p {
        Process::White(white) => Some(white.sigma2()),
        _ => None,
    });
    // An outlier's unit: the standard deviation of the white noise, or of what the first scale sees.
    let unit = white.unwrap_or_else(|| 2.0 * noise.haar_wv(1)).sqrt();
    let outliers: Vec<f64> = (0..=9).map(|k| 10_f64.powi(k)).collect();
    let factors: Vec<f64> = (0..=10).map(|k| 4_f64.powi(k)).collect();
    let mut curves = vec![("outlier_in_sigmas".to_owned(), outlier_curve(design, unit, &outliers)?)];
    let walks = noise.processes.iter().any(|p| matches!(p, Process::RandomWalk(_)));
    let most = design.trim.count(design.replicates as usize) as u64 + 1;
    for count in (1..=most).filter(|_| walks) {
        let name = format!("random_walk_variance_factor_of_{count}");
        curves.push((name, abnormal_curve(design, count, &factors)?));
    }
    let mut text = "disturbance,size,estimator,parameter,relative_change\n".to_owned();
    for (disturbance, curve) in &curves {
        for Movement { size, changes } in curve {
            for (estimator, changes) in design.estimators.iter().zip(changes) {
                for (name, change) in names.iter().zip(changes) {
                    text += &format!("{disturbance},{size},{},{name},{change:e}\n", estimator.name());
                }
            }
        }
    }
    Ok(text)
}
