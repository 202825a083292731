use super::*;
use crate::earth::moved;
use crate::tests::*;

/// Figures of eight for 800 s at 12 m/s.
fn drive() -> Trajectory {
    let turn = |deg: f64| {
        format!(
            "{{ kind = 'turn', angle_deg = {deg}, duration_s = 30 }},
            {{ kind = 'straight', duration_s = 10 }},"
        )
    };
    let mut profile = profile(12.0, &[turn(270.0), turn(-270.0)].concat().repeat(10));
    profile.ramp_s = 3.0;
    profile.build().unwrap()
}

/// Standard deviations of position (m), velocity (m/s) and attitude (degrees).
const SIGMA: Nine = [1.0, 1.0, 2.0, 0.05, 0.05, 0.08, 0.1, 0.1, 0.5];

/// A solution at 1 Hz with first-order errors of two seconds, 400 correlation times, `scale` times the stated ones.
fn solution(drive: &Trajectory, seed: u64, scale: f64) -> Vec<StatedRow> {
    let mut normal = normals(seed);
    let phi = (-0.5_f64).exp();
    let mut z: Nine = std::array::from_fn(|_| normal());
    let mut row = |k: u32| {
        z = z.map(|z| phi * z + (1.0 - phi * phi).sqrt() * normal());
        let e: Nine = std::array::from_fn(|i| scale * SIGMA[i] * z[i]);
        let t_s = f64::from(k);
        let truth = drive.state(t_s);
        let [lat, lon, h] = moved(truth.place(), DVec3::new(e[0], e[1], e[2]));
        let rpy = RollPitchYaw::from_quat(truth.q_b_n);
        let turned = RollPitchYaw {
            roll: rpy.roll + e[6] * DEG,
            pitch: rpy.pitch + e[7] * DEG,
            yaw: rpy.yaw + e[8] * DEG,
        };
        StatedRow {
            t_s,
            state: NavState {
                lat,
                lon,
                h,
                v_n: truth.v_n + DVec3::new(e[3], e[4], e[5]),
                q_b_n: turned.to_quat(),
            },
            has: [true; 2],
            covariance: SMatrix::from_fn(|i, j| if i == j { SIGMA[i].powi(2) } else { 0.0 }),
            has_correlations: true,
        }
    };
    (2..798).map(&mut row).collect()
}

fn judged(rows: &[StatedRow], reference: &Reference) -> Judgement {
    judge(rows, reference, ReferenceOffset::default(), &[]).unwrap()
}

/// Errors of 1.0, 1.25 and 0.8 times the stated are told as such, and not by another clock or point: all but one of 12.
#[test]
fn sizes_of_errors_are_told() {
    let drive = drive();
    let reference = Reference::from(drive.clone());
    for (scale, kind) in [
        (1.0, VerdictKind::Consistent),
        (1.25, VerdictKind::Overconfident),
        (0.8, VerdictKind::Underconfident),
    ] {
        let is_right =
            |seed: &u64| judged(&solution(&drive, *seed, scale), &reference).kind == kind;
        let right = (0..12).filter(is_right).count();
        assert!(right >= 11, "{right} of 12 at {scale}");
    }
}

/// A reference whose stamps are 0.2 s late, and one of a point a metre ahead: found within five standard deviations, and what
/// is left is consistent.
#[test]
fn another_clock_and_another_point_are_found() {
    let drive = drive();
    let reference = Reference::from(drive.clone());
    let mut right = [0; 2];
    for seed in 0..12 {
        let rows = solution(&drive, seed, 1.0);
        let (mut early, mut ahead) = (rows.clone(), rows);
        early.iter_mut().for_each(|row| row.t_s -= 0.2);
        for row in &mut ahead {
            let of_point = reference.state_of_point(row.t_s, -DVec3::X).unwrap();
            let truth = drive.state(row.t_s);
            let offset = truth.q_b_n * -DVec3::X;
            let [lat, lon, h] = moved(row.state.place(), offset);
            (row.state.lat, row.state.lon, row.state.h) = (lat, lon, h);
            row.state.v_n += of_point.v_n - truth.v_n;
        }
        for (k, rows) in [early, ahead].iter().enumerate() {
            let judgement = judged(rows, &reference);
            let [SetupFault::Offset(found)] = judgement.doubts[..] else {
                panic!("{:?}", judgement.doubts)
            };
            let (off, sigma) = (found.offset, found.sigma);
            let is_found = match k {
                0 => {
                    found.parts == [true, false] && (off.delay_s - 0.2).abs() < 5.0 * sigma.delay_s
                }
                _ => {
                    let apart = (off.lever_arm_m - DVec3::X).abs();
                    found.parts == [false, true] && apart.cmplt(5.0 * sigma.lever_arm_m).all()
                }
            };
            let without = judgement.without_offset.unwrap().verdict.kind;
            let is_right = is_found && without == VerdictKind::Consistent;
            assert_eq!(judgement.kind, VerdictKind::Doubtful);
            right[k] += usize::from(is_right);
        }
    }
    assert!(right[0] >= 11 && right[1] >= 11, "{right:?}");
}

/// A change of each row.
type Change<'a> = &'a dyn Fn(&mut StatedRow);

/// A solution in other units or axes than its names say is named as that; a filter that is wrong by one factor is not.
#[test]
fn simple_transformations_are_named() {
    let drive = drive();
    let reference = Reference::from(drive.clone());
    let changed = |scale: f64, change: Change<'_>| {
        let mut rows = solution(&drive, 7, scale);
        rows.iter_mut().for_each(change);
        judged(&rows, &reference)
    };
    let angles = |row: &mut StatedRow, map: fn([f64; 3]) -> [f64; 3]| {
        row.state = with_angles(row.state, map);
    };
    let sigmas = |row: &mut StatedRow, block: usize, map: &dyn Fn(f64) -> f64| {
        for i in 3 * block..3 * block + 3 {
            row.covariance[(i, i)] = map(row.covariance[(i, i)].sqrt()).powi(2);
        }
    };
    let cases: [(&str, Change<'_>); 13] = [
        ("deviations of position are variances", &|row| {
            sigmas(row, 0, &|s| s * s);
        }),
        ("deviations of velocity are variances", &|row| {
            sigmas(row, 1, &|s| s * s);
        }),
        ("deviations of attitude are variances", &|row| {
            sigmas(row, 2, &|s| s * s);
        }),
        ("velocities are km/h", &|row| row.state.v_n *= 3.6),
        ("velocities are km/h", &|row| {
            row.state.v_n *= 3.6;
            sigmas(row, 1, &|s| 3.6 * s);
        }),
        ("north and east velocity are exchanged", &|row| {
            let v = row.state.v_n;
            row.state.v_n = DVec3::new(v.y, v.x, -v.z);
        }),
        ("north and east velocity are exchanged", &|row| {
            row.state.v_n = DVec3::new(row.state.v_n.y, row.state.v_n.x, row.state.v_n.z);
        }),
        ("attitude are radians named", &|row| {
            sigmas(row, 2, &|s| s * DEG);
        }),
        ("attitude are degrees named", &|row| {
            sigmas(row, 2, &|s| s / DEG);
        }),
        ("attitudes are radians", &|row| {
            angles(row, |all| all.map(|a| a * DEG));
        }),
        ("attitudes are radians", &|row| {
            angles(row, |all| all.map(|a| a * DEG));
            sigmas(row, 2, &|s| s * DEG);
        }),
        ("yaw is 90° − ψ", &|row| {
            angles(row, |[r, p, y]| [r, -p, QUARTER - y]);
        }),
        ("yaw has the other sign", &|row| {
            angles(row, |[r, p, y]| [r, p, -y]);
        }),
    ];
    for (cause, change) in cases {
        let judgement = changed(1.0, change);
        let [
            SetupFault::Transformed {
                cause: found, left, ..
            },
        ] = judgement.doubts[..]
        else {
            panic!("{cause}: {:?}", judgement.doubts)
        };
        assert!(found.contains(cause), "{cause}: {found}");
        assert!((left - 1.0).abs() < 0.25, "{cause}: {left}");
        assert_eq!(judgement.kind, VerdictKind::Doubtful);
    }
    // errors of one factor on all states, or of one on three of them
    for scale in [0.1, 0.5, 2.0, 3.0, 10.0, 20.0] {
        let judgement = changed(scale, &|_| {});
        assert!(
            judgement.doubts.is_empty(),
            "{scale}: {:?}",
            judgement.doubts
        );
        for block in 0..3 {
            let judgement = changed(1.0, &|row| sigmas(row, block, &|s| s / scale));
            let is_named = |d: &SetupFault| matches!(d, SetupFault::Transformed { .. });
            assert!(
                !judgement.doubts.iter().any(is_named),
                "{scale}, {block}: {:?}",
                judgement.doubts
            );
        }
    }
}

/// A reference at 0.2 Hz under a solution at 1 Hz is judged at its own epochs: in turns of 9°/s the attitude between them is that of
/// an interpolation, off by several standard deviations of the yaw.
#[test]
fn a_coarse_reference_is_judged_at_its_epochs() {
    const STEP_S: u32 = 5;
    let drive = drive();
    let samples = samples(159, f64::from(STEP_S), |t_s| {
        let state = drive.state(t_s);
        (state.lat, state.lon, state.h, state.q_b_n)
    });
    let reference = Reference::from(Trajectory::from_samples(&samples).unwrap());
    let mut rows = solution(&drive, 3, 1.0);
    // the velocities of such a reference are those of a spline
    rows.iter_mut().for_each(|row| row.has[0] = false);
    let judgement = judged(&rows, &reference);
    assert!(
        judgement.is_at_epochs && judgement.rows == 159,
        "{}",
        judgement.rows
    );
    assert!(judgement.kind < VerdictKind::Overconfident);
    rows.retain(|row| row.t_s % f64::from(STEP_S) != 0.0);
    let errors = errors(&rows, &reference, ReferenceOffset::default());
    let stated = Verdict::of_drive(&normalised(&errors), &[]).unwrap();
    assert_eq!(stated.verdict.kind, VerdictKind::Overconfident);
    let yaw = stated.error_over_sigma.0[8];
    assert!(yaw > 3.0, "{yaw}");
}

/// Clocks a leap of 18 s apart, and clocks that have nothing in common.
#[test]
fn clocks_far_apart_are_found() {
    let drive = drive();
    let reference = Reference::from(drive.clone());
    for delay_s in [18.0, 50_400.0] {
        let mut rows = solution(&drive, 1, 1.0);
        rows.iter_mut().for_each(|row| row.t_s -= delay_s);
        let found = rough_delay_s(&rows, &reference, ReferenceOffset::default());
        assert_eq!(found, Some(delay_s));
    }
}

/// Heights above the geoid, a body with other axes, and a solution that states nothing.
#[test]
fn frames_are_named() {
    let drive = drive();
    let reference = Reference::from(drive.clone());
    let changed = |change: &dyn Fn(&mut StatedRow)| {
        let mut rows = solution(&drive, 4, 1.0);
        rows.iter_mut().for_each(change);
        judged(&rows, &reference)
    };
    let doubts = |change: &dyn Fn(&mut StatedRow), is_named: fn(&SetupFault) -> bool| {
        let doubts = changed(change).doubts;
        assert!(doubts.iter().any(is_named), "{doubts:?}");
    };
    doubts(
        &|row| row.state.h += 47.0,
        |d| matches!(d, SetupFault::Height { metres } if (metres - 47.0).abs() < 1.0),
    );
    doubts(
        &|row| row.state.q_b_n *= DQuat::from_rotation_x(180.0 * DEG),
        |d| matches!(d, SetupFault::Axes { .. }),
    );
    let unsaid = changed(&|row| {
        row.covariance = SMatrix::from_diagonal_element(f64::NAN);
        row.has_correlations = false;
    });
    assert_eq!((unsaid.kind, unsaid.stated), (VerdictKind::Undecided, None));
    assert_relative_eq!(unsaid.rmse.0[2], 2.0, max_relative = 0.2);
}
