//! Fixes of an antenna elsewhere, or of an earlier time, in words.

use glam::DVec3;
use nav_sim_navigation::fusion::Displaced;

/// `the fixes seem to be 0.107 ± 0.002 s late: with --gnss-delay=0.107 the NIS is 1.01 per component, now 1.95`
#[must_use]
pub(crate) fn displaced_words(found: &Displaced) -> String {
    let three = |v: DVec3| format!("{:.2},{:.2},{:.2}", v.x, v.y, v.z);
    let antenna = found.lever_arm_b.map(|[arm, sigma]| {
        let given = three(arm);
        (
            format!("those of an antenna at {given} ± {} m (front, right, down of the IMU)", three(sigma)),
            format!("--lever-arm={given}"),
        )
    });
    let delay = found.delay_s.map(|[delay, sigma]| {
        (format!("{delay:.3} ± {sigma:.3} s late"), format!("--gnss-delay={delay:.3}"))
    });
    let (what, options): (Vec<String>, Vec<String>) = antenna.into_iter().chain(delay).unzip();
    let [now, then] = found.nis;
    format!(
        "the fixes seem to be {}: with {} the NIS is {then:.2} per component, now {now:.2}",
        what.join(" and "),
        options.join(" ")
    )
}
