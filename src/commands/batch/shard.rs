//! Which part of a plan a process does: by flag, or by what the scheduler says.

use crate::app::Failure;

/// `i/n`, i from 0.
pub(crate) fn parse(text: &str) -> Result<(u64, u64), String> {
    let numbers = text
        .split_once('/')
        .and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    let shard = numbers.filter(|(index, count): &(u64, u64)| index < count);
    shard.ok_or_else(|| "expected i/n with i from 0 to n − 1, such as 0/4".to_owned())
}

/// Variables that give an index, and those that give the first one, the step and how many there are.
const SCHEDULERS: [(&str, Option<[&str; 3]>); 4] = [
    ("HQ_TASK_ID", None),
    (
        "SLURM_ARRAY_TASK_ID",
        Some([
            "SLURM_ARRAY_TASK_MIN",
            "SLURM_ARRAY_TASK_STEP",
            "SLURM_ARRAY_TASK_COUNT",
        ]),
    ),
    ("PBS_ARRAY_INDEX", None),
    ("JOB_COMPLETION_INDEX", None),
];

/// The shard of this process and where it comes from; none without a flag and a scheduler. `shards` is how many there are,
/// where the scheduler does not say.
pub(crate) fn find(
    flag: Option<(u64, u64)>,
    shards: Option<u64>,
    variable: &dyn Fn(&str) -> Option<String>,
) -> Result<(Option<(u64, u64)>, String), Failure> {
    if flag.is_some() {
        return Ok((flag, "--shard".to_owned()));
    }
    let set = SCHEDULERS
        .iter()
        .find_map(|(name, more)| Some((*name, *more, variable(name)?)));
    let Some((name, more, text)) = set else {
        return match shards {
            None | Some(1) => Ok((None, "no scheduler".to_owned())),
            Some(n) => {
                let failure = Failure::input(format!(
                    "--shards {n}: no scheduler says which of them this is"
                ));
                Err(failure.hint("give --shard i/n"))
            }
        };
    };
    let number = |name: &str, text: &str| {
        text.trim()
            .parse::<u64>()
            .map_err(|_| Failure::input(format!("{name}={text} is not a number")))
    };
    let number_of = |name: &str| variable(name).map(|text| number(name, &text)).transpose();
    // With --shards, tasks count from 0 whatever part of an array was submitted; without, the array says.
    let [first, step, count] = match more.filter(|_| shards.is_none()) {
        Some([min, step, count]) => [number_of(min)?, number_of(step)?, number_of(count)?],
        None => [None; 3],
    };
    let id = number(name, &text)?;
    let index = id
        .checked_sub(first.unwrap_or(0))
        .map(|i| i / step.unwrap_or(1).max(1));
    let Some(count) = shards.or(count) else {
        let failure = Failure::input(format!(
            "{name}={id} says which shard this is, but not of how many"
        ));
        return Err(failure.hint("add --shards n (indices from 0 to n − 1)"));
    };
    match index.filter(|index| *index < count) {
        Some(index) => Ok((Some((index, count)), format!("{name}={id}"))),
        None => {
            let failure = Failure::input(format!("{name}={id} is not one of {count} shards"));
            Err(failure.hint(format!(
                "number the tasks from 0 to {}",
                count.saturating_sub(1)
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn found(
        flag: Option<&str>,
        shards: Option<u64>,
        set: &[(&str, &str)],
    ) -> Result<(u64, u64, String), String> {
        let set: HashMap<&str, &str> = set.iter().copied().collect();
        let variable = |name: &str| set.get(name).map(|v| (*v).to_owned());
        let flag = flag.map(|f| parse(f).unwrap());
        find(flag, shards, &variable)
            .map(|(s, from)| (s.map_or((0, 1), |s| s), from))
            .map(|((index, count), from)| (index, count, from))
            .map_err(|e| e.to_string())
    }

    #[test]
    fn schedulers_are_understood() {
        let ok = |r: Result<(u64, u64, String), String>| r.unwrap();
        assert_eq!(ok(found(None, None, &[])), (0, 1, "no scheduler".into()));
        assert_eq!(
            ok(found(Some("2/3"), None, &[("HQ_TASK_ID", "7")])),
            (2, 3, "--shard".into())
        );
        assert_eq!(
            ok(found(None, Some(8), &[("HQ_TASK_ID", "7")])),
            (7, 8, "HQ_TASK_ID=7".into())
        );
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "14"),
            ("SLURM_ARRAY_TASK_MIN", "10"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
        ];
        assert_eq!(
            ok(found(None, None, &slurm)),
            (2, 4, "SLURM_ARRAY_TASK_ID=14".into())
        );
        assert_eq!(
            ok(found(None, Some(20), &slurm)),
            (14, 20, "SLURM_ARRAY_TASK_ID=14".into())
        );
        assert_eq!(ok(found(None, Some(5), &[("PBS_ARRAY_INDEX", "0")])).0, 0);
        assert_eq!(
            ok(found(None, Some(5), &[("JOB_COMPLETION_INDEX", "4")])).0,
            4
        );
    }

    #[test]
    fn what_cannot_be_a_shard_is_refused() {
        assert!(parse("3/3").is_err() && parse("1").is_err() && parse("-1/2").is_err());
        let error = |r: Result<(u64, u64, String), String>| r.unwrap_err();
        assert!(error(found(None, None, &[("HQ_TASK_ID", "7")])).contains("not of how many"));
        assert!(
            error(found(None, Some(7), &[("HQ_TASK_ID", "7")])).contains("is not one of 7 shards")
        );
        assert!(
            error(found(None, Some(7), &[("PBS_ARRAY_INDEX", "x")]))
                .contains("PBS_ARRAY_INDEX=x is not a number")
        );
        assert!(error(found(None, Some(7), &[])).contains("no scheduler"));
    }
}
