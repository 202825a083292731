//! Limits that errors must keep, in words.

use super::number::{readable, window};
use nav_sim_navigation::metrics::{Met, Summary};

/// `required p95_m<=5: NOT MET, 7.41 m at the end of the outage 300–390 s`
pub(crate) fn requirement_line(met: &Met, summary: &Summary) -> String {
    if met.name == "consistent" {
        let word = if met.met { "met" } else { "NOT MET" };
        return format!(
            "required consistent: {word}, the filter is {}",
            summary.verdict.kind
        );
    }
    let outage = |k: usize| {
        format!(
            "outage {}",
            window(summary.outages[k].start_s, summary.outages[k].end_s)
        )
    };
    let place = met.outage.map_or_else(
        || "over the run".to_owned(),
        |k| format!("at the end of the {}", outage(k)),
    );
    let is_shown = met.met || met.value > met.limit;
    let word = match met.met {
        true => "met",
        // within the limit, by a figure that proves nothing
        false if !is_shown => "NOT SHOWN",
        false => "NOT MET",
    };
    let by = match met.beyond_linear.map(outage) {
        None => String::new(),
        Some(outage) if is_shown => {
            format!(" by the runs, beyond linear theory from the {outage} on")
        }
        Some(outage) => {
            format!(" beyond linear theory from the {outage} on: confirm with --method both")
        }
    };
    let (name, limit, value, unit) = (&met.name, met.limit, readable(met.value), unit(&met.name));
    format!("required {name}<={limit}: {word}, {value} {unit} {place}{by}")
}

/// The unit that the name of a figure ends with.
fn unit(name: &str) -> &'static str {
    let units = [("_m_s", "m/s"), ("_deg", "°"), ("_m", "m")];
    units
        .iter()
        .find(|(end, _)| name.ends_with(end))
        .map_or("", |(_, unit)| unit)
}
