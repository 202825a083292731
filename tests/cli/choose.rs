//! Figures of `choose`; its words are in `transcripts/calibrate.md`.

use crate::common::drive::{Place, number, off};

/// A gyroscope whose random walk is most of the error after ten seconds: white noise alone cannot describe it.
const WALK: &str = r#"rate_hz = 100.0
[accel]
processes = [{ type = "WN", sigma2 = 1e-5 }, { type = "RW", gamma2 = 1e-10 }]
[gyro]
processes = [{ type = "WN", sigma2 = 1e-8 }, { type = "RW", gamma2 = 1e-10 }]
"#;

const CHOOSE: &str =
    "choose r --trajectory trajectories/figure_eight.toml --outage 40:60 --seed 1 --estimator";

/// Recordings of [`WALK`] in `r`.
fn recordings(options: &str) -> Place {
    let place = Place::checkout();
    place.write("model.toml", WALK);
    place.done(&format!("synthesize model.toml --seed 1 -o r {options}"));
    place
}

#[test]
fn the_model_that_made_the_recordings_is_chosen_and_written() {
    let place = recordings("--samples 16384 --replicates 4");
    let options = "awv,gmwm --model WN,WN+RW --inflate none,x10 -o out";
    let found = place.answer(&format!("{CHOOSE} {options}"));
    assert_eq!(found["winner"], "awv WN+RW, 15", "{found}");
    let candidates = found["candidates"].as_array().unwrap();
    assert_eq!(candidates.len(), 8);
    let of = |name: &str| candidates.iter().find(|c| c["candidate"] == name).unwrap();
    // without the random walk the filter is lost, ten times the deviations are far too many
    let nees = |name: &str| number(of(name), "/nees/value");
    assert!(
        nees("awv WN, 15") > 90.0 && nees("awv WN+RW, 15, x10") < 3.0,
        "{found}"
    );
    // four recordings hold some nine windows side by side: 9 ± √(18/9), of which three are allowed
    assert!((nees("awv WN+RW, 15") - 9.0).abs() < 4.3, "{found}");
    assert_eq!(of("awv WN+RW, 15, x10")["tied"], false);
    assert_eq!(of("gmwm WN+RW, 15")["eligible"], false);
    let folds = of("awv WN+RW, 15")["folds"].as_array().unwrap();
    assert_eq!(folds.len(), 4, "each recording judges: {found}");
    for fold in folds {
        let ratio = number(fold, "/rmse_m") / number(fold, "/believed_m");
        // two windows of two components: the root of a chi-square of four degrees over four, outside in 1e-3
        assert!(
            fold["windows"] == 16 && (0.15..2.4).contains(&ratio),
            "{fold}"
        );
    }
    assert_eq!(place.json("out/ranking.json"), found);
    let model: toml::Table = place.read("out/model.toml").parse().unwrap();
    // a random walk of 12 signals of 164 s, seen from some 3 s on: 12 × 50 steps, known to √(2/600) = 6 %; six of these
    let walk = model["gyro"]["processes"][1]["gamma2"].as_float().unwrap();
    assert!(off(walk, 1e-10) < 0.4, "{walk}");
    assert_eq!(model["provenance"]["estimator"].as_str(), Some("awv"));
    // other candidates replace the ranking only by force
    place.done(&format!("{CHOOSE} awv --model WN+RW -o out"));
    let replaced = place.json("out/ranking.json");
    assert_eq!(replaced["candidates"].as_array().unwrap().len(), 1);
}

/// The first sixteenth of one recording is its warm-up: left out, it is as if it had never been recorded, for the curves and
/// for the windows that are navigated on.
#[test]
fn a_warm_up_that_is_left_out_counts_for_nothing() {
    const WARM_UP: usize = 1024;
    let place = recordings("--samples 16384 --replicates 3");
    let is_warm_up = |k: usize| (1..=WARM_UP).contains(&k);
    let ranking = |options: &str| {
        place.done(&format!("{CHOOSE} awv --model WN+RW -o out {options}"));
        let fold = place.json("out/ranking.json")["candidates"][0]["folds"][0].clone();
        ["/rmse_m", "/nees", "/believed_m"].map(|key| number(&fold, key))
    };
    let name = |k: usize| format!("r/replicate_{k}.csv");
    let first = place.read(&name(1));
    place.edit(&name(1), &name(1), |k, row| match row.rsplit_once(',') {
        Some((rest, last)) if is_warm_up(k) => {
            format!("{rest},{}", last.parse::<f64>().unwrap() + 0.1)
        }
        _ => row.to_owned(),
    });
    let left_out = ranking("--skip-s 10.24");
    place.write(&name(1), first);
    for k in 1..=3 {
        let text = place.read(&name(k));
        let rows = text.lines().enumerate().filter(|(k, _)| !is_warm_up(*k));
        place.write(
            &name(k),
            rows.map(|(_, row)| format!("{row}\n")).collect::<String>(),
        );
    }
    let never = ranking("");
    // samples are kept from the first one of the file on: the same but for their rounding
    for (left_out, never) in left_out.into_iter().zip(never) {
        assert!(off(left_out, never) < 1e-8, "{left_out:?} {never:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let place = recordings("--samples 8192 --replicates 3");
    let [one, two] = [1, 2].map(|threads| {
        place.done(&format!(
            "{CHOOSE} awv --model WN+RW -j {threads} -o {threads}"
        ));
        place.read(&format!("{threads}/ranking.json"))
    });
    assert_eq!(one, two);
}

/// One of six recordings has noise of 0.2 s beside the model's, which no other has: it is calibrated on, judges nothing, and is
/// named.
#[test]
fn an_abnormal_recording_judges_no_candidate() {
    let place =
        recordings("--replicates 6 --samples 16384 --contaminate examples/one_bad_recording.toml");
    let choose = CHOOSE
        .replace(
            "trajectories/figure_eight.toml",
            "examples/quick_drive.toml",
        )
        .replace("40:60", "40:59");
    let ran = place.done(&format!(
        "{choose} awv,dr-awv --model WN+RW --runs 8 -o of_r"
    ));
    let note = "abnormal, ranks no candidate (nav-sim calibrate says how): r/replicate_4.csv";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let ranking = place.json("of_r/ranking.json");
    let folds = ranking["candidates"][0]["folds"].as_array().unwrap().iter();
    let judges: Vec<&str> = folds
        .map(|fold| fold["recording"].as_str().unwrap())
        .collect();
    let expected = [1, 2, 3, 5, 6].map(|k| format!("r/replicate_{k}.csv"));
    assert_eq!(judges, expected);
}
