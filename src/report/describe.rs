//! Fitted models in words.

use super::fits::CandidateEntry;
use super::practical::{policy, practical_rows};
use nav_sim_calibration::{
    ALIKE_LEVEL, Estimator, Goodness, Inference, LevelSpread, Outcome, Ranking, Settings, Share,
    correlation_time_s, duration, percent, reasons, shares, signals, tau_s, undetermined,
};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::{Composite, Process};
use nav_sim_signal::units::DEG;

/// A fit in words: a head line, a line for each process, how sure the optimum is, the remarks.
pub(crate) fn describe(outcome: &Outcome, settings: &Settings) -> String {
    let mut lines = vec![head(outcome, settings)];
    lines.extend(outcome.ranking.iter().flat_map(|r| ranking_lines(r, settings.rate_hz)));
    lines.extend(process_lines(
        &outcome.fit.composite,
        outcome.scope.sensor,
        &outcome.curve.levels,
        settings.rate_hz,
    ));
    lines.extend(practical_line(outcome, settings.rate_hz));
    lines.push(optimum(outcome));
    lines.extend(outcome.inference.iter().flat_map(|i| inference_lines(i, outcome)));
    lines.extend(outcome.notes.iter().map(|note| format!("  note: {note}")));
    lines.join("\n")
}

fn inference_lines(inference: &Inference, outcome: &Outcome) -> Vec<String> {
    if inference.fitted < 2 {
        return vec![format!(
            "  {} of {} draws of the bootstrap had a fit: no intervals",
            inference.fitted, inference.draws
        )];
    }
    let mut lines: Vec<String> = inference.goodness.iter().map(|g| j_test(g, outcome)).collect();
    let labels = outcome.fit.composite.labels();
    for i in &inference.intervals {
        if let Some(text) = undetermined(i, &labels) {
            lines.push(format!("  95 % {text}"));
            continue;
        }
        let error = match i.standard_error {
            error if error.is_finite() => format!("  (standard error {error:.2e})"),
            _ => String::new(),
        };
        lines.push(format!(
            "  95 % {:<6} {:<7} {:.6e} … {:.6e}{error}",
            labels[i.of.process],
            i.of.parameter.name(),
            i.low,
            i.high
        ));
    }
    if outcome.replicates > 1 {
        lines.extend(spread_line(inference, outcome));
    }
    lines
}

fn j_test(goodness: &Goodness, outcome: &Outcome) -> String {
    let Goodness { statistic, dof, expected, p_value } = goodness;
    let verdict = if goodness.is_rejected() {
        "the model does not describe the curve"
    } else if outcome.departure().missed.is_empty() {
        "no evidence against"
    } else {
        "not rejected, in view of how much the signals differ among themselves; by their noise alone it misses scales (note)"
    };
    format!(
        "  J-test {statistic:.4e} on {dof} degrees of freedom, median {expected:.4e} if the model holds, p = \
         {p_value:.3}: {verdict}"
    )
}

/// Where the signals that are averaged differ most beyond what noise alone makes.
fn spread_line(inference: &Inference, outcome: &Outcome) -> Option<String> {
    let p = inference.alike?;
    let signals = match (outcome.recordings, outcome.replicates) {
        (1, _) => "the axes",
        (recordings, replicates) if recordings == replicates => "the recordings",
        _ => "the signals (recordings and axes)",
    };
    if p > ALIKE_LEVEL {
        return Some(format!("  no evidence that {signals} differ beyond their noise (p = {p:.3})"));
    }
    let most = |s: &&LevelSpread| s.between / s.within;
    let LevelSpread { tau_s, within, between } =
        *inference.spread.iter().max_by(|a, b| most(a).total_cmp(&most(b)))?;
    Some(format!(
        "  {signals} differ beyond their noise (p = {p:.3}), most at {}: by {} of the wavelet variance, noise alone \
         makes {}",
        duration(tau_s),
        percent(between),
        percent(within)
    ))
}

fn head(outcome: &Outcome, settings: &Settings) -> String {
    let (count, signals) = (outcome.replicates, signals(outcome));
    let trimmed = match settings.trim.count(count) {
        a if outcome.estimator == Estimator::DrAwv && count > 0 => {
            format!(", {a} dropped at each end of each scale")
        }
        _ => String::new(),
    };
    let scales = outcome.curve.levels.len();
    format!(
        "{} · {} · {} · {signals}{trimmed}, {scales} scales",
        outcome.scope.name(),
        outcome.estimator.name(),
        outcome.spec
    )
}

fn process_lines(model: &Composite, sensor: Sensor, levels: &[u32], rate_hz: f64) -> Vec<String> {
    let shares = shares(model, levels);
    let line = |((process, label), share): ((&Process, String), &Share)| {
        let parameters: Vec<String> =
            process.parameters().iter().map(|(name, value)| format!("{name} = {value:.6e}")).collect();
        let parameters = parameters.join(", ");
        if share.largest.0 <= 0.0 {
            return format!("  {label:<6} {parameters:<42} zero at the optimum");
        }
        let meaning = meaning(process, sensor, rate_hz);
        let governs = match (share.leads.first(), share.leads.last()) {
            (Some(first), Some(last)) if first == last => {
                format!("dominates at {}", duration(tau_s(*first, rate_hz)))
            }
            (Some(first), Some(last)) => {
                let ends = [first, last].map(|level| duration(tau_s(*level, rate_hz)));
                format!("dominates from {} to {}", ends[0], ends[1])
            }
            _ => format!(
                "dominates at no scale ({} of the variance at most, at {})",
                percent(share.largest.0),
                duration(tau_s(share.largest.1, rate_hz))
            ),
        };
        format!("  {label:<6} {parameters:<42} {meaning}; {governs}")
    };
    model.processes.iter().zip(model.labels()).zip(&shares).map(line).collect()
}

/// N, B and K, which are those of all processes together.
fn practical_line(outcome: &Outcome, rate_hz: f64) -> Option<String> {
    let practical = outcome.practical(rate_hz)?;
    let rows = practical_rows(&practical, outcome.scope.sensor);
    let told =
        rows.iter().map(|row| format!("{} {} {}", row.name, row.shown(), row.unit).trim_end().to_owned());
    Some(format!("  all processes together, N and K {}: {}", policy(), told.collect::<Vec<_>>().join(", ")))
}

/// A process in the terms of data sheets; N and K of the whole model are another matter ([`practical_rows`]).
pub(super) fn meaning(process: &Process, sensor: Sensor, rate_hz: f64) -> String {
    let dt = 1.0 / rate_hz;
    let unit = sensor.unit();
    // Per √h, in degrees for angles.
    let (name, per_root_hour, root_hour_unit) = match sensor {
        Sensor::Accel => ("velocity random walk", 60.0, "m/s/√h"),
        Sensor::Gyro => ("angle random walk", 60.0 / DEG, "°/√h"),
    };
    match process {
        Process::White(p) => {
            format!("{name} of WN alone {:.4e} {root_hour_unit}", (p.sigma2() * dt).sqrt() * per_root_hour)
        }
        Process::Quantization(p) => {
            format!("Q = {:.4e} {unit}, times dt {:.4e} {unit}·s", p.q2().sqrt(), p.q2().sqrt() * dt)
        }
        Process::Ar1(p) => match correlation_time_s(process, rate_hz) {
            Some(t) => {
                format!("correlation time {t:.4} s, standard deviation {:.4e} {unit}", p.variance().sqrt())
            }
            None => format!("alternating, standard deviation {:.4e} {unit}", p.variance().sqrt()),
        },
        Process::GaussMarkov(p) => {
            format!(
                "correlation time {:.4} s, standard deviation {:.4e} {unit}",
                1.0 / p.beta(),
                p.s2().sqrt()
            )
        }
        Process::RandomWalk(p) => {
            let name = match sensor {
                Sensor::Accel => "acceleration random walk",
                Sensor::Gyro => "rate random walk",
            };
            format!("{name} of RW alone {:.4e} {unit}/√s", (p.gamma2() * rate_hz).sqrt())
        }
        Process::Drift(p) => format!("ramp {:.4e} {unit}/s", p.slope() * rate_hz),
        Process::Ma1(p) => {
            format!("standard deviation {:.4e} {unit}", (p.sigma2() * (1.0 + p.theta() * p.theta())).sqrt())
        }
    }
}

fn optimum(outcome: &Outcome) -> String {
    let fit = &outcome.fit;
    let search = match (fit.combinations, fit.starts) {
        _ if outcome.estimator == Estimator::Avlr => "slopes read off, nothing minimised".to_owned(),
        (1, _) => "the only minimum".to_owned(),
        (n, 1) => format!("{n} combinations of correlation times searched, one minimum"),
        (n, starts) => {
            let next =
                fit.runner_up.map_or(String::new(), |f| format!(", the next at an objective of {f:.6e}"));
            format!(
                "{n} combinations of correlation times searched, {starts} local minima, {} of them the best{next}",
                fit.agreeing
            )
        }
    };
    format!("  objective {:.6e}, {}: {search}", fit.objective, fit.termination.name().replace('_', " "))
}

/// Candidates that are shown.
const SHOWN: usize = 8;

/// The ranking as lines.
fn ranking_lines(ranking: &Ranking, rate_hz: f64) -> Vec<String> {
    let line = |c: CandidateEntry| {
        let p = c.p_value.map_or(String::new(), |p| format!("  p ≤ {p:.3}"));
        let j_test = c.j_test_p_value.map_or(String::new(), |p| format!("  J-test p = {p:.3}"));
        let mark = if c.chosen { "*" } else { " " };
        format!(
            "  {mark} {:<18} WVIC {:>10.4} = {:.4} + {:.4}, {} parameters{p}{j_test}",
            c.model, c.wvic, c.objective, c.optimism, c.parameters
        )
    };
    let all = CandidateEntry::all(ranking);
    let left = all.len().saturating_sub(SHOWN.max(ranking.chosen + 1));
    let mut lines: Vec<String> = all.into_iter().take(SHOWN.max(ranking.chosen + 1)).map(line).collect();
    lines.push(format!(
        "    {} more with a larger WVIC, {} not identifiable (a process is zero or at the end of its range)",
        left + ranking.far,
        ranking.not_identifiable
    ));
    lines.extend(reasons(ranking, rate_hz).iter().map(|r| format!("  chosen: {r}")));
    lines
}
