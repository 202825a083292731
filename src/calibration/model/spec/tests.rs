//! Sums of processes as they are written.

use super::*;

#[test]
fn sums_are_read_in_any_order() {
    for text in ["2*AR1+RW+WN+QN", " qn + AR1+ rw+wn +ar1", "N2", "n2"] {
        assert_eq!(
            text.parse::<ModelSpec>().unwrap(),
            ModelSpec::n2(),
            "{text}"
        );
    }
    assert_eq!("AR1+RW+WN".parse::<ModelSpec>().unwrap(), ModelSpec::n1());
    let spec: ModelSpec = "MA1+N1+DR+3*GM".parse().unwrap();
    assert_eq!(spec.to_string(), "WN+AR1+3*GM+MA1+RW+DR");
    assert_eq!(spec.to_string().parse::<ModelSpec>().unwrap(), spec);
    assert_eq!((spec.parameters(), ModelSpec::n2().parameters()), (13, 7));
}

#[test]
fn special_cases() {
    let special = |a: &str, b: &str| {
        a.parse::<ModelSpec>()
            .unwrap()
            .is_special_case_of(&b.parse::<ModelSpec>().unwrap())
    };
    for (a, b) in [
        ("WN", "N1"),
        ("N1", "N1"),
        ("WN", "AR1"),
        ("RW", "AR1"),
        ("WN+RW", "2*AR1"),
        ("WN+AR1", "2*AR1"),
    ] {
        assert!(special(a, b), "{a} of {b}");
    }
    for (a, b) in [
        ("WN+RW", "AR1"),
        ("N1", "2*AR1"),
        ("QN", "AR1"),
        ("AR1", "WN+RW"),
        ("DR", "N2"),
    ] {
        assert!(!special(a, b), "{a} of {b}");
    }
}

#[test]
fn what_means_no_model_is_refused() {
    let message = |text: &str| text.parse::<ModelSpec>().unwrap_err().to_string();
    assert_eq!(message("AR1+WM"), "model \"AR1+WM\": \"WM\" is no process");
    assert_eq!(message(""), "model \"\": a process is missing");
    assert_eq!(message("WN++RW"), "model \"WN++RW\": a process is missing");
    assert_eq!(
        message("0*AR1"),
        "model \"0*AR1\": \"0\" is not a number of processes"
    );
    assert_eq!(
        message("-1*AR1"),
        "model \"-1*AR1\": \"-1\" is not a number of processes"
    );
    assert!(message("2*WN").ends_with("2 WN are one WN: their wavelet variances are proportional"));
    assert!(message("4*AR1+2*GM").contains("6 AR1, GM and MA1 processes; at most 5"));
    assert!(message("99*N2").contains("99 WN"));
}

#[test]
fn what_cannot_be_is_refused() {
    let mut spec = ModelSpec::n2();
    let mut message = |p: &str, q: &str, l, h| spec.limit(p, q, l, h).unwrap_err().to_string();
    assert_eq!(
        message("AR1", "phi", None, Some(0.9)),
        "WN+QN+2*AR1+RW has no process AR1"
    );
    assert_eq!(message("WN", "phi", None, None), "WN has no parameter phi");
    assert_eq!(
        message("AR1_1", "phi", Some(0.9), Some(0.8)),
        "AR1_1 phi: nothing lies between 0.9 and 0.8"
    );
    assert_eq!(
        message("AR1_2", "phi", None, Some(1.0)),
        "AR1_2 phi: 1 is not between 0 and 1"
    );
    assert_eq!(
        message("RW", "gamma2", Some(-1.0), None),
        "RW gamma2: -1 is not a number from 0 to 1e100"
    );
    assert!(
        message("WN", "sigma2", Some(1e308), Some(1e308))
            .ends_with("is not a number from 0 to 1e100")
    );
    assert_eq!(spec.parameters(), 7);
    spec.limit("AR1_2", "phi", Some(0.99), Some(0.99)).unwrap();
    assert_eq!(spec.parameters(), 6, "a fixed parameter is not free");
}
