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
    let rest = [
        "[[segment]]\nkind = \"straight\"\nduration_s = -3",
        "[[segment]]\nkind = \"strait\"",
        "[[segment]]\nkind = \"turn\"\nangle_deg = 90\nradius = 3",
        "[[segment]]\nkind = \"turn\"\nangle_deg = 90\nradius_m = 30",
        "[[segment]]\nkind = \"straight\"\nduration_s = 3\ndistance_m = 4",
        "[[segment]]\nkind = \"straight\"",
        "speed_m_s = 10\n[[segment]]\nkind = \"climb\"\nheight_m = 90\ndistance_m = 100",
        "",
    ]
    .map(|rest| format!("{START}{rest}"));
    let beyond = rest[0].replace("46.5", "95");
    let none = "[[segment]]\nkind = \"stop\"\nduration_s = 1".to_owned();
    let all = rest.into_iter().chain([beyond, none]);
    insta::assert_snapshot!(answers(all.map(|text| {
        let built = profile(&text).map_err(|e| told(&e));
        (text, built)
    })));
}
