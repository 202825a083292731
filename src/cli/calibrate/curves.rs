//! Fitting curves that come from elsewhere.

use super::output::{self, outputs};
use super::{Args, bootstrap, of_calibration};
use crate::cli::{Failure, Session, read};
use nav_sim::calibration::{Estimator, Group, Outcome, Scope, Settings, fit_curve};
use nav_sim::formats::curve_file::{self, NamedCurve};
use nav_sim::imu::Sensor;
use std::path::{Path, PathBuf};

pub(super) fn run(
    args: &Args,
    path: &Path,
    settings: &mut Settings,
    session: &Session,
) -> Result<(), Failure> {
    let curves = curve_file::read(path).map_err(|e| {
        let failure = if e.is_content() { Failure::input(&e) } else { Failure::could_not(&e) };
        failure.maybe_hint(e.hint())
    })?;
    if let (Some(own), Some(given)) = (curves[0].rate_hz, args.recordings.rate_hz()) {
        let message =
            format!("{}: the curve says its rate, {own} Hz; --rate-hz {given} is another", path.display());
        return Err(Failure::input(message).hint("leave --rate-hz out: it is for a CSV curve"));
    }
    let Some(rate_hz) = curves[0].rate_hz.or(args.recordings.rate_hz()) else {
        let failure = Failure::input(format!("{}: the curve does not say its sample rate", path.display()));
        return Err(
            failure.hint("give the rate with --rate-hz: correlation times and the model file need it")
        );
    };
    settings.rate_hz = rate_hz;
    let estimator = |named: &NamedCurve| {
        let named_so = |e: &Estimator| named.estimator.as_deref() == Some(e.name());
        Estimator::ALL.into_iter().find(named_so).unwrap_or(Estimator::Given)
    };
    let found: Vec<Estimator> = curves.iter().map(estimator).collect();
    settings.estimators = Estimator::ALL.into_iter().filter(|e| found.contains(e)).collect();
    let outputs = match &args.out {
        Some(out) => {
            let inputs: Vec<PathBuf> =
                [path].into_iter().map(Path::to_owned).chain(args.parameters.clone()).collect();
            outputs(out, &settings.estimators, &inputs)?
        }
        None => Vec::new(),
    };
    let mut groups: Vec<Group> = Vec::new();
    let mut outcomes: Vec<Outcome> = Vec::new();
    for (named, estimator) in curves.into_iter().zip(found) {
        let Some(sensor) = named.sensor.or(args.sensor).or(args.out.is_none().then_some(Sensor::Accel))
        else {
            let failure =
                Failure::input(format!("{}: the curve does not say of which sensor it is", path.display()));
            return Err(failure.hint("--sensor accel or --sensor gyro"));
        };
        let group = Group { scope: Scope { sensor, axis: named.axis }, replicates: Vec::new() };
        let same = |o: &Outcome| o.estimator == estimator && o.scope == group.scope;
        if outcomes.iter().any(same) {
            let (name, estimator) = (group.scope.name(), estimator.name());
            let message = format!("{}: there are two curves of {name} for {estimator}", path.display());
            return Err(Failure::input(message).hint("calibrate the recordings themselves: it averages them"));
        }
        let outcome = fit_curve(&group, estimator, named.curve, settings);
        outcomes.push(outcome.map_err(|e| of_calibration(&e))?);
        groups.push(group);
    }
    bootstrap(args, &groups, &mut outcomes, settings, session);
    let input = read::input("curve", path)?;
    let note = output::note(args, settings, vec![input], session)?;
    output::finish(&outputs, &groups, &outcomes, settings, &note, session)
}
