//! What is refused, and where it is said to stand.

use super::*;
use nav_sim_signal::units::{Positive, Share};
use serde::Deserialize;

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
    for (text, expected) in [
        (
            "count = -1",
            "line 1: \"count\" = -1 is refused: it must be a finite number ≥ 0 | ",
        ),
        (
            "count = \"many\"",
            "line 1: \"count\" = \"many\" is not a whole number | ",
        ),
        (
            "\n[part]\nx = 1\n",
            "line 1: \"count\" is missing | add count",
        ),
        (
            "count = 1\n[part]\n",
            "line 2: \"part.x\" is missing | add x to part",
        ),
        (
            "count = 1\npart = {}\n",
            "line 2: \"part.x\" is missing | add x to part",
        ),
        (
            "count = 1\n[part]\nx = \"a\"\n",
            "line 3: \"part.x\" = \"a\" is not a number | ",
        ),
        (
            "count = 1\n[parts]\nx = 1\n",
            "line 2: \"parts\" = [parts] is not a list | write [[parts]], in double brackets",
        ),
        (
            "count = 1\npart = 3\n",
            "line 2: \"part\" = 3 is not a table | ",
        ),
        (
            "count = 1\nkinds = [3]\n",
            "line 2: \"kinds\" = 3 is not a table | ",
        ),
        (
            "count = 1\nplace = 3\n",
            "line 2: \"place\" = 3 is not a text in quotes | ",
        ),
        (
            "count = 1\n[part]\nx = 1\nxyz = [1, 2]\n",
            "line 4: \"part.xyz\" = [1, 2] is not a list of 3 | ",
        ),
        (
            "count = 1\n[part]\nx = 1\nxyz = {}\n",
            "line 4: \"part.xyz\" = {} is not a list | ",
        ),
        (
            "count = 1\nwords = \"north\"",
            "line 2: \"words\" = \"north\" is not a list | ",
        ),
        (
            "count = 1\nwords = [\"south\", \"nroth\"]",
            "line 2: \"words\" = \"nroth\" is not one of \"north\", \"south\" | did you mean \"north\"?",
        ),
        (
            "count = 1\n[part]\nx = 1\nxyz = [\n  1, # = 2\n  \"a\",\n  3]\n",
            "line 6: \"part.xyz\" = \"a\" is not a number | ",
        ),
        (
            "count = 1\n[[parts]]\nx = 1\n[[parts]]\nx = \"b\"\n",
            "line 5: \"parts[2].x\" = \"b\" is not a number | ",
        ),
        (
            "count = 1\nparts = [{ x = 1 }, { xzy = 1 }]\n",
            "line 2: unknown key \"parts[2].xzy\" | did you mean \"xyz\"?",
        ),
        (
            "count = 1\n[[parts]]\n",
            "line 2: \"parts[1].x\" is missing | add x to parts[1]",
        ),
        (
            "count = 1\nwords = [2026-11-27]",
            "line 2: \"words\" = 2026-11-27 is not a text in quotes | ",
        ),
        (
            "count = 1\nplace = 2026-11-27",
            "line 2: \"place\" = 2026-11-27 is not a text in quotes | ",
        ),
        (
            "count = 99999999999999999999",
            "line 1: beyond 9223372036854775807, the largest whole number: \"99999999999999999999\" | ",
        ),
        (
            "count = 170141183460469231731687303715884105728",
            "line 1: beyond 9223372036854775807, the largest whole number: \"170141183460469231731687303715884105728\" | ",
        ),
        (
            "count = 1\nconut = 1",
            "line 2: unknown key \"conut\" | did you mean \"count\"?",
        ),
    ] {
        let source = TomlSource::new("f.toml", text);
        let e = source.get::<File>().unwrap_err();
        assert_eq!(
            format!("{e} | {}", e.advice().unwrap_or_default()),
            format!("f.toml, {expected}")
        );
    }
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
}

#[test]
fn what_is_not_set_lies_in_the_innermost_table_that_is() {
    let table = DeTable::parse(TEXT).unwrap();
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
    let two = |second: &str| {
        format!("[[rule]]\noperation = \"step\"\nheight = 0.5\n[[rule]]\n{second}\n")
    };
    for (text, expected) in [
        (two("operation = \"step\"\nheight = 2"), "line 6: \"rule[2].height\" = 2 is refused: it must be a finite number ≥ 0 and ≤ 1 | "),
        (
            two("operation = \"step\"\nheight = [0, \"a\"]"),
            "line 6: \"rule[2].height\" = \"a\" is not a number | ",
        ),
        (
            two("operation = \"step\"\nheight = 1\nat = 0"),
            "line 7: \"rule[2].at\" = 0 is refused: it must be a finite number > 0 | ",
        ),
        (
            two("operation = \"step\"\nat = 1"),
            "line 4: \"rule[2].height\" is missing | add height to rule[2]",
        ),
        (
            two("operation = \"step\"\nheight = 1\nhieght = 1"),
            "line 7: unknown key \"rule[2].hieght\" | did you mean \"height\"?",
        ),
        (
            two("operation = \"stpe\""),
            "line 5: \"rule[2].operation\" = \"stpe\" is not one of \"step\", \"drift\" | did you mean \"step\"?",
        ),
        (two("height = 1"), "line 4: \"rule[2].operation\" is missing | add operation to rule[2]"),
        (
            two("operation = \"drift\"\nx = 1\nreplicates = [1, -2]"),
            "line 7: \"rule[2].replicates\" = -2 is refused: it must be a finite number ≥ 0 | ",
        ),
        (
            "[axis]\nrules = [\n{ operation = \"drift\", x = 1 },\n{ operation = \"drift\", x = nam },\n]"
                .replace("nam", "\"nan\""),
            "line 4: \"axis.rules[2].x\" = \"nan\" is not a number | ",
        ),
        (
            "other = [1, nan]".to_owned(),
            "line 1: \"other\" = nan is refused: it must be a finite number | ",
        ),
    ] {
        let e = TomlSource::new("f.toml", &text).get::<Rules>().unwrap_err();
        assert_eq!(format!("{e} | {}", e.advice().unwrap_or_default()), format!("f.toml, {expected}"));
    }
}

#[test]
fn syntax_errors_have_their_line() {
    let e = TomlSource::new("f.toml", "a = 1\nb = = 2\n")
        .table()
        .unwrap_err();
    assert!(e.to_string().starts_with("f.toml, line 2: "), "{e}");
}

#[test]
fn a_missing_file_is_named() {
    let e = TomlSource::read(Path::new("/no/such.toml")).unwrap_err();
    assert_eq!(e.to_string(), "/no/such.toml: No such file or directory");
    assert!(e.code() == 2);
}
