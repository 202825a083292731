//! Motion profiles.

use super::*;

const START: &str = "[start]\nlat_deg = 46.5\nlon_deg = 6.6\nh_m = 400\nheading_deg = 90\n";

fn profile(text: &str) -> Result<Trajectory, Failure> {
    profile::build(&TomlSource::new("p.toml", text))
}

#[test]
fn a_profile_of_every_kind_of_segment() {
    let t = profile(&format!(
        "{START}[vehicle]\nbank = \"coordinated\"\nramp_s = 1.0\n\
         [[segment]]\nkind = \"accelerate\"\nto_speed_m_s = 15\naccel_m_s2 = 1.5\n\
         [[segment]]\nkind = \"straight\"\ndistance_m = 150\nclimb_m = 2\n\
         [[segment]]\nkind = \"turn\"\nangle_deg = -90\nradius_m = 60\n\
         [[segment]]\nkind = \"climb\"\nheight_m = -4\nduration_s = 20\nramp_s = 3\n\
         [[segment]]\nkind = \"waypoints\"\nlateral_accel_m_s2 = 2\n\
         points = [{{ n_m = 900, e_m = 500 }}, {{ lat_deg = 46.512, lon_deg = 6.6, h_m = 410 }}]\n\
         [[segment]]\nkind = \"stop\"\nduration_s = 5\n"
    ))
    .unwrap();
    let end = t.state(t.end_s());
    // Braking from 15 m/s at 1.5 m/s² takes 11 s and 82.5 m past the last point, 410 m high.
    let (lat, lon) = (46.512 * DEG, 6.6 * DEG);
    let last = nav_sim_navigation::frames::NavState {
        lat,
        lon,
        h: 410.0,
        ..end
    };
    let past = nav_sim_navigation::earth::ned_difference(last.place(), end.place());
    assert!(
        (past.length() - 82.5).abs() < 0.01 && past.z.abs() < 1e-6,
        "{past}"
    );
    assert!(end.v_n.length() < 1e-6);
}

#[test]
fn profiles_are_refused_with_line_key_and_hint() {
    let refused = |text: &str| {
        let e = profile(&format!("{START}{text}")).unwrap_err();
        (e.to_string(), e.advice().unwrap_or_default())
    };
    let segment = |keys: &str| refused(&format!("[[segment]]\n{keys}\n"));
    assert_eq!(
        segment("kind = \"straight\"\nduration_s = -3"),
        (
            "p.toml, line 8: \"segment[1].duration_s\" = -3 is refused: it must be a finite number > 0".into(),
            String::new()
        )
    );
    assert_eq!(segment("kind = \"strait\"").1, "did you mean \"straight\"?");
    assert_eq!(
        segment("kind = \"turn\"\nangle_deg = 90\nradius = 3"),
        (
            "p.toml, line 9: unknown key \"segment[1].radius\"".into(),
            "did you mean \"radius_m\"?".into()
        )
    );
    assert_eq!(
        segment("kind = \"turn\"\nangle_deg = 90\nradius_m = 30").1,
        "put an accelerate segment before it, or give the start a speed_m_s"
    );
    assert_eq!(
        segment("kind = \"straight\"\nduration_s = 3\ndistance_m = 4").0,
        "p.toml, line 9: \"segment[1].distance_m\" = 4 beside duration_s"
    );
    assert_eq!(
        segment("kind = \"straight\"").0,
        "p.toml, line 6: \"segment[1].duration_s\" or \"segment[1].distance_m\" is missing"
    );
    assert_eq!(
        refused("speed_m_s = 10\n[[segment]]\nkind = \"climb\"\nheight_m = 90\ndistance_m = 100").0,
        "p.toml, line 9: \"segment[1].height_m\" = 90 is too steep: 90 m over 100.0 m of path climbs more than 60°"
    );
    assert_eq!(refused("").0, "p.toml, line 1: \"segment\" is missing");
    let e = profile(
        "[start]\nlat_deg = 95\nlon_deg = 0\nh_m = 0\nheading_deg = 0\n[[segment]]\nkind = \"stop\"\nduration_s = 1\n",
    );
    assert_eq!(
        e.unwrap_err().to_string(),
        "p.toml, line 2: \"start.lat_deg\" = 95 is refused: it must be a finite number ≥ -89.9 and ≤ 89.9"
    );
    let e = profile("[[segment]]\nkind = \"stop\"\nduration_s = 1\n").unwrap_err();
    assert_eq!(e.to_string(), "p.toml, line 1: \"start\" is missing");
}
