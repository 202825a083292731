//! A run of the filter through recorded data.

use super::filter::Filter;
use super::gap::{Bridges, Spread};
use super::smoother::Tape;
use super::{
    AidRecord, FusionError, Recorded, RowError, Settings, Solution, Start, Use, VehicleVelocity,
    check_clocks, spans,
};
use crate::earth::{MAX_LATITUDE, geodetic_to_ecef};
use crate::ekf::{Belief, nis_limit};
use crate::gnss::GnssFix;
use crate::imu::ImuIncrement;
use crate::trajectory::reference::Reference;
use crate::units::DEG;

/// Runs the filter through recorded data from `start`. A fix or an aid is applied at its own time: the sample it
/// falls into is split there. A sample much longer than the others bridges a gap ([`super::gap`]). `reference` is only
/// compared with.
///
/// # Errors
/// Clocks that do not overlap, a start outside the data, a pole, divergence.
pub fn fuse(
    recorded: &Recorded<'_>,
    belief: &Belief,
    start: &Start,
    settings: &Settings,
    reference: Option<&Reference>,
) -> Result<Solution, FusionError> {
    check_clocks(recorded)?;
    let imu = spans(recorded).0;
    if !(imu.0 - 1e-6..imu.1).contains(&start.t_s) {
        return Err(FusionError::Start {
            t_s: start.t_s,
            imu,
        });
    }
    check_place(recorded, start, settings)?;
    let mut filter = Filter::new(belief, start, settings);
    let tape = match settings.smooth {
        true => Some(Tape::new(
            &mut filter,
            start.t_s,
            most_marks(recorded, start, settings),
        )?),
        false => None,
    };
    let mut run = Run {
        filter,
        tape,
        settings,
        reference,
        now: start.t_s,
        next_row: start.t_s,
        solution: Solution::default(),
    };
    let mut bridges = Bridges::new(recorded.imu);
    let mut fixes = recorded
        .gnss
        .iter()
        .skip_while(|f| f.t_s <= start.t_s)
        .peekable();
    let mut aids = recorded
        .aids
        .iter()
        .skip_while(|a| a.t_s <= start.t_s)
        .peekable();
    run.row()?;
    for sample in recorded.imu.iter().skip_while(|s| s.t_s <= start.t_s) {
        let spread = bridges.spread(sample);
        // a fix that is a millionth of a sample late belongs to its end
        let slack = 1e-6 * sample.dt_s;
        let end_s = sample.t_s + slack;
        loop {
            let fix_s = fixes.peek().map_or(f64::INFINITY, |f| f.t_s);
            if let Some(aid) = aids.next_if(|a| a.t_s <= end_s && a.t_s < fix_s) {
                run.advance(sample, spread, aid.t_s, slack);
                run.aid(aid)?;
            } else if let Some(fix) = fixes.next_if(|f| f.t_s <= end_s) {
                run.advance(sample, spread, fix.t_s, slack);
                run.fix(fix)?;
            } else {
                break;
            }
        }
        run.advance(sample, spread, sample.t_s, 0.0);
        run.solution.samples += 1;
        if sample.t_s + slack >= run.next_row {
            run.row()?;
        }
    }
    Ok(run.end())
}

/// Rows, fixes and aids that there will be at most.
fn most_marks(recorded: &Recorded<'_>, start: &Start, settings: &Settings) -> f64 {
    let samples = recorded.imu.iter().filter(|s| s.t_s > start.t_s).count() as f64;
    let rows = (spans(recorded).0.1 - start.t_s) * settings.rows_hz;
    1.0 + rows.min(samples).ceil() + (recorded.gnss.len() + recorded.aids.len()) as f64
}

/// Refuses a start that its own and the receiver's deviations cannot explain: 10 km or 50 of both, beside
/// the way to the first fix.
fn check_place(
    recorded: &Recorded<'_>,
    start: &Start,
    settings: &Settings,
) -> Result<(), FusionError> {
    const FAR: (f64, f64) = (10_000.0, 50.0);
    let Some(fix) = recorded.gnss.iter().find(|f| f.t_s >= start.t_s) else {
        return Ok(());
    };
    let seconds = fix.t_s - start.t_s;
    let place = geodetic_to_ecef(start.state.lat, start.state.lon, fix.h);
    let metres = geodetic_to_ecef(fix.lat, fix.lon, fix.h).distance(place);
    let [n, e, _] = start.sigma.pos_sigma_m;
    let sigma_m = n.hypot(e).hypot(fix.pos_sigma_n.truncate().length());
    // at twice the speed, accelerating with a gravity
    let way = 2.0 * start.state.v_n.length() * seconds + 5.0 * seconds * seconds;
    let allowed = FAR.0.min(FAR.1 * sigma_m) + way + settings.lever_arm_b.length();
    if metres > allowed {
        Err(FusionError::Place {
            t_s: fix.t_s,
            metres,
            sigma_m,
        })
    } else {
        Ok(())
    }
}

/// The state of a run through the data.
struct Run<'a> {
    filter: Filter,
    tape: Option<Tape>,
    settings: &'a Settings,
    reference: Option<&'a Reference>,
    now: f64,
    next_row: f64,
    solution: Solution,
}

impl Run<'_> {
    /// Through the sample as far as `to`, which is taken as the sample's end when it is nearly that.
    /// Where it bridges a gap, with the gap's uncertainty.
    fn advance(&mut self, sample: &ImuIncrement, spread: Option<Spread>, to: f64, slack: f64) {
        let to = if to + slack >= sample.t_s {
            sample.t_s
        } else {
            to
        };
        if to > self.now + slack {
            match spread {
                None => self.filter.advance(sample, to - self.now),
                Some(spread) => self.filter.cross(sample, to - self.now, spread),
            }
            self.now = to;
        }
    }

    fn fix(&mut self, fix: &GnssFix) -> Result<(), FusionError> {
        let mut record = self.filter.look_at(fix);
        record.error = self.error().map(|e| e.values);
        let withheld = self.settings.outages.iter().any(|o| o.withholds(fix.t_s));
        let limit = self
            .settings
            .nis_gate
            .map(|p| nis_limit(p, record.innovation.len()));
        record.used = match limit {
            _ if withheld => Use::Withheld,
            Some(limit) if record.nis > limit => Use::Rejected,
            _ => Use::Used,
        };
        match &mut self.tape {
            _ if record.used != Use::Used => {}
            Some(tape) => tape.fix(&mut self.filter, self.now, |filter| filter.update(fix)),
            None => self.filter.update(fix),
        }
        let finite = record.nis.is_finite();
        self.solution.fixes.push(record);
        if finite {
            Ok(())
        } else {
            Err(FusionError::Diverged { t_s: self.now })
        }
    }

    /// Uses what the vehicle knows of its velocity.
    fn aid(&mut self, aid: &VehicleVelocity) -> Result<(), FusionError> {
        self.filter.settle();
        let mut record = AidRecord {
            t_s: aid.t_s,
            aid: aid.aid,
            normalised: Vec::new(),
        };
        let mut update = |filter: &mut Filter| record = filter.aid(aid);
        match &mut self.tape {
            Some(tape) => tape.fix(&mut self.filter, self.now, update),
            None => update(&mut self.filter),
        }
        let finite = record.nis().is_finite();
        self.solution.aids.push(record);
        if finite {
            Ok(())
        } else {
            Err(FusionError::Diverged { t_s: self.now })
        }
    }

    fn row(&mut self) -> Result<(), FusionError> {
        self.next_row = (self.next_row + 1.0 / self.settings.rows_hz).max(self.now);
        let mut row = self.filter.row(self.now);
        if !(row.sigma.iter().all(|s| s.is_finite()) && row.state.q_b_n.is_finite()) {
            return Err(FusionError::Diverged { t_s: self.now });
        }
        if row.state.lat.abs() > MAX_LATITUDE {
            return Err(FusionError::Pole {
                t_s: self.now,
                lat_deg: row.state.lat / DEG,
            });
        }
        row.error = self.error();
        self.solution.rows.push(row);
        if let Some(tape) = &mut self.tape {
            tape.row(&mut self.filter, self.now);
        }
        Ok(())
    }

    /// What came out; smoothed where a tape ran along.
    fn end(self) -> Solution {
        let Self {
            mut filter,
            tape,
            mut solution,
            reference,
            ..
        } = self;
        solution.vehicle = filter.ekf.vehicle_estimates();
        solution.smoothed = tape.map(|tape| tape.smoothed(&mut filter, &solution.rows, reference));
        solution
    }

    /// Difference from the reference now, if it reaches here.
    fn error(&mut self) -> Option<RowError> {
        self.filter.error_from(self.reference?, self.now)
    }
}
