//! Alarms: the recordings that are further from the others than chance explains.
//!
//! The largest F over all windows and files is compared with what it is in sets of alike recordings, drawn by
//! the sampling law, that differ as much as these do (their excess variance at each scale, of which the axes share as
//! much as they do among the others of the furthest; independent from scale to scale: more chances of a large F than
//! real differences, which hang together, have). Then the furthest is taken out and the others are looked at again.

use super::contrasts::{Distance, FEWEST, Furthest, Table, furthest};
use super::noise::{Noise, Window};
use crate::rng::StreamKey;
use rayon::prelude::*;

/// Probability of an alarm in a set of alike recordings, for one sensor and one question.
pub(super) const FALSE_ALARM: f64 = 0.025;
/// Sets drawn.
const DRAWS: usize = 799;
/// Fewest recordings that can say what axes share of their differences. Of fewer all is taken as shared: three that share
/// all seem to share less so often that alike sets of four were alarmed in 14 %.
const FEWEST_TO_SHARE: usize = 4;
/// Seed of the draws: a diagnosis is an answer, the same each time.
const SEED: u64 = 1;

/// An abnormal file, and where it is so.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub(super) file: usize,
    /// Probability that the most unusual of alike files is as unusual.
    pub(super) p_value: f64,
    pub(super) window: Window,
    pub(super) distance: Distance,
}

/// The abnormal files, the most abnormal first. `source` and `process` name the streams.
pub(super) fn alarms(table: &Table, noise: &[Noise], source: &str, process: &str) -> Vec<Found> {
    let files = table.logs.first().map_or(0, Vec::len);
    let mut active = vec![true; files];
    let mut found = Vec::new();
    while active.iter().filter(|on| **on).count() >= FEWEST {
        let Some(next) = most_abnormal(table, noise, &active, source, process) else {
            break;
        };
        if next.p_value > FALSE_ALARM {
            break;
        }
        // An abnormal file widens the spread that the others are measured by: without it a second one may
        // show.
        active[next.file] = false;
        found.push(next);
    }
    found
}

fn most_abnormal(
    table: &Table,
    noise: &[Noise],
    active: &[bool],
    source: &str,
    process: &str,
) -> Option<Found> {
    let mut own = furthest(table, noise, active);
    // With the furthest in it: F itself compares each with the others alone, and sets of alike recordings have a furthest one too.
    // Drawn with the spread of the others, which the furthest leaves too small, alike sets of four were alarmed in 17 %.
    let between = table.between(noise, active);
    // One file that is far off on all axes must not pass for files that share their differences.
    let mut others = active.to_vec();
    if let Some(first) = (0..own.len()).max_by(|a, b| own[*a].f[0].total_cmp(&own[*b].f[0])) {
        others[first] = false;
    }
    let shared = if others.iter().filter(|on| **on).count() < FEWEST_TO_SHARE {
        1.0
    } else {
        table.shared(noise, &table.between(noise, &others), &others)
    };
    let draw = |run: usize| {
        let key = StreamKey {
            seed: SEED,
            scenario: "diagnosis",
            run: run as u64,
            source,
            process,
        };
        let drawn = table.drawn(noise, &between, shared, &mut key.generator());
        // The whole search is repeated for each draw, so that looking at many windows and files is paid for.
        let all = furthest(&drawn, noise, active);
        [0, 1].map(|kind| all.iter().map(|f| f.f[kind]).fold(0.0, f64::max))
    };
    let draws: Vec<[f64; 2]> = (0..DRAWS).into_par_iter().map(draw).collect();
    // Both kinds of F in units of what each exceeds with the probability of a false alarm.
    let limits = [0, 1].map(|kind| limit(draws.iter().map(|d| d[kind]).collect()));
    let joint = |f: &[f64; 2]| {
        f.iter()
            .zip(&limits)
            .map(|(f, limit)| f / limit)
            .fold(0.0, f64::max)
    };
    let file = (0..own.len()).max_by(|a, b| joint(&own[*a].f).total_cmp(&joint(&own[*b].f)))?;
    let Furthest { f, at } = own.swap_remove(file);
    let kind = usize::from(f[1] / limits[1] > f[0] / limits[0]);
    let larger = draws.iter().filter(|d| joint(d) >= joint(&f)).count();
    let [plain, passed] = at;
    let (window, distance) = if kind == 0 { plain } else { passed }?;
    Some(Found {
        file,
        p_value: (1 + larger) as f64 / (1 + DRAWS) as f64,
        window,
        distance,
    })
}

/// Value that a share [`FALSE_ALARM`] of the values exceeds; 1 where all are 0.
fn limit(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    // Of 799 values 19 lie above this one: 20/800 = 2.5 % with the observed one counted among them.
    let index = ((1.0 - FALSE_ALARM) * values.len() as f64) as usize;
    values
        .get(index)
        .copied()
        .filter(|v| *v > 0.0)
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::sampling::SamplingLaw;
    use crate::noise::{Composite, Process, White};
    use crate::rng::Generator;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// Four recordings of 2^16 samples whose three axes are louder or quieter together, at all scales, by 35 %: nothing is
    /// unusual in any. 100 sets know a rate of 2.5 % to 1.6 %, of which four are allowed.
    #[test]
    fn four_recordings_that_share_their_differences_are_alarmed_as_said() {
        let white = Composite::new(vec![Process::White(White::new(1.0).unwrap())]);
        let law = SamplingLaw::new(&white, 13);
        let edof = law.edof(1 << 16);
        let noise: Vec<Noise> = (0..3)
            .map(|_| Noise::new(law.first(13), vec![edof.clone(); 4]))
            .collect();
        let mut generator = Generator::seed_from_u64(1);
        let mut file = || -> [Vec<f64>; 3] {
            let common = 0.3 * generator.sample::<f64, _>(StandardNormal);
            std::array::from_fn(|_| {
                law.draw(&edof, &mut generator)
                    .into_iter()
                    .map(|ratio| ratio.ln() + common)
                    .collect()
            })
        };
        let alarmed = |set: usize| {
            let files: Vec<[Vec<f64>; 3]> = (0..4).map(|_| file()).collect();
            let axis = |a: usize| files.iter().map(|file| Some(file[a].clone())).collect();
            let table = Table {
                logs: (0..3).map(axis).collect(),
                above_only: false,
            };
            usize::from(!alarms(&table, &noise, &set.to_string(), "noise").is_empty())
        };
        let alarms: usize = (0..100).map(alarmed).sum();
        assert!(alarms as f64 <= 2.5 + 4.0 * 1.6, "{alarms} of 100");
    }
}
