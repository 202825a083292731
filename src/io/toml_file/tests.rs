//! What is refused, and where it is said to stand.

use super::*;
use crate::io::tests::{answers, told};
use nav_sim_signal::units::{Positive, Share};
use serde::Deserialize;
use serde::de::DeserializeOwned;

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only whether it reads matters")]
struct File {
    count: u64,
    part: Option<Part>,
    parts: Option<Vec<Part>>,
    words: Option<Vec<Word>>,
    kinds: Option<Vec<Operation>>,
    place: Option<std::path::PathBuf>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only whether it reads matters")]
struct Part {
    x: f64,
    xyz: Option<[f64; 3]>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Word {
    North,
    South,
}

#[test]
fn refusals_name_file_line_key_and_value() {
    insta::assert_snapshot!(refusals::<File>(&[
        "count = -1",
        "count = \"many\"",
        "\n[part]\nx = 1",
        "count = 1\n[part]",
        "count = 1\npart = {}",
        "count = 1\n[part]\nx = \"a\"",
        "count = 1\n[parts]\nx = 1",
        "count = 1\npart = 3",
        "count = 1\nkinds = [3]",
        "count = 1\nplace = 3",
        "count = 1\n[part]\nx = 1\nxyz = [1, 2]",
        "count = 1\n[part]\nx = 1\nxyz = {}",
        "count = 1\nwords = \"north\"",
        "count = 1\nwords = [\"south\", \"nroth\"]",
        "count = 1\n[part]\nx = 1\nxyz = [\n  1, # = 2\n  \"a\",\n  3]",
        "count = 1\n[[parts]]\nx = 1\n[[parts]]\nx = \"b\"",
        "count = 1\nparts = [{ x = 1 }, { xzy = 1 }]",
        "count = 1\n[[parts]]",
        "count = 1\nwords = [2026-11-27]",
        "count = 1\nplace = 2026-11-27",
        "count = 99999999999999999999",
        "count = 170141183460469231731687303715884105728",
        "count = 1\nconut = 1",
        "count = 1\nb = = 2",
    ]));
}

fn refusals<T: DeserializeOwned + JsonSchema>(texts: &[&str]) -> String {
    answers(texts.iter().map(|text| {
        let source = TomlSource::new("f.toml", text);
        (text, source.get::<T>().map_err(|e| told(&e)))
    }))
}

const TEXT: &str = "runs = 3\n[gnss]\nsigma = [1,\n 2]\n[[outage]]\nend_s = 1\n[[outage]]\nend_s = 2\n\
                    [[scenario]]\nsettings.gnss.rate_hz = -1\n[[scenario]]\nsettings = { gnss = { rate_hz = -2 } }\n";

#[test]
fn paths_lead_to_where_values_are_written() {
    let table = DeTable::parse(TEXT).unwrap();
    for (path, written) in [
        ("runs", "3"),
        ("gnss", "[gnss]"),
        ("gnss.sigma", "[1,\n 2]"),
        ("outage[1].end_s", "1"),
        ("outage[2].end_s", "2"),
        ("outage[2]", "[[outage]]"),
        ("scenario[1].settings.gnss.rate_hz", "-1"),
        ("scenario[2].settings.gnss.rate_hz", "-2"),
        ("scenario[2].settings.gnss", "{ rate_hz = -2 }"),
    ] {
        let (span, is_set) = span_of(table.get_ref(), path);
        assert_eq!((&TEXT[span], is_set), (written, true), "{path}");
    }
    // what is not set lies in the innermost table that is
    for (path, written) in [
        ("imu.rate_hz", ""),
        ("gnss.rate_hz", "[gnss]"),
        ("outage[2].start_s", "[[outage]]"),
    ] {
        let (span, is_set) = span_of(table.get_ref(), path);
        assert_eq!((&TEXT[span], is_set), (written, false), "{path}");
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only whether it reads matters")]
struct Rules {
    #[serde(default)]
    rule: Vec<Rule>,
    axis: Option<Axis>,
    other: Option<OneOrEach<f64>>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only whether it reads matters")]
struct Axis {
    rules: Vec<Rule>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
#[expect(dead_code, reason = "only whether it reads matters")]
struct Rule {
    replicates: Option<Vec<u64>>,
    #[serde(flatten)]
    operation: Operation,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(tag = "operation", rename_all = "lowercase")]
#[expect(dead_code, reason = "only whether it reads matters")]
enum Operation {
    Step(Step),
    Drift(Part),
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only whether it reads matters")]
struct Step {
    height: OneOrEach<Share>,
    at: Option<Positive>,
}

#[test]
fn keys_of_tagged_tables_are_found() {
    insta::assert_snapshot!(refusals::<Rules>(&[
        "[[rule]]\noperation = \"step\"\nheight = 0.5\n[[rule]]\noperation = \"step\"\nheight = 2",
        "[[rule]]\noperation = \"step\"\nheight = [0, \"a\"]",
        "[[rule]]\noperation = \"step\"\nheight = 1\nat = 0",
        "[[rule]]\noperation = \"step\"\nat = 1",
        "[[rule]]\noperation = \"step\"\nheight = 1\nhieght = 1",
        "[[rule]]\noperation = \"stpe\"",
        "[[rule]]\nheight = 1",
        "[[rule]]\noperation = \"drift\"\nx = 1\nreplicates = [1, -2]",
        "[axis]\nrules = [\n{ operation = \"drift\", x = 1 },\n{ operation = \"drift\", x = \"nan\" },\n]",
        "other = [1, nan]",
    ]));
}
