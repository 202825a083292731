//! Sentences of the manuals, and damaged ones.

use super::*;
use crate::io::tests::{answers, told};
use nav_sim_document::{Importance, Note};
use nav_sim_navigation::gnss::{GnssFix, GnssVelocity};
use nav_sim_signal::units::DEG;

const SIGMA: FixSigma = FixSigma {
    pos_m: [2.0, 2.0, 4.0],
    vel_m_s: Some([0.1, 0.1, 0.2]),
};

/// A sentence with its checksum.
fn sentence(body: &str) -> String {
    format!(
        "${body}*{:02X}\n",
        body.bytes().fold(0, |all, byte| all ^ byte)
    )
}

fn fixes(
    path: &str,
    text: &str,
    unsaid: Option<&FixSigma>,
    imu_s: Option<(f64, f64)>,
) -> Result<(Vec<GnssFix>, Vec<Note>), Error> {
    let (stated, remarks) = super::fixes(path, text, unsaid, imu_s)?;
    let fix = |stated| crate::io::fusion_files::fix(path, stated, unsaid);
    Ok((stated.iter().map(fix).collect::<Result<_, _>>()?, remarks))
}

fn read(text: &str) -> Vec<GnssFix> {
    fixes("a.nmea", text, Some(&SIGMA), None).unwrap().0
}

/// The fixes of a log, and what is said of it.
fn said(text: &str, imu_s: Option<(f64, f64)>) -> (Vec<GnssFix>, Vec<String>) {
    let (all, remarks) = fixes("a.nmea", text, Some(&SIGMA), imu_s).unwrap();
    let words = |note: Note| match note.importance {
        Importance::Warning => format!("doubt: {}", note.text),
        _ => format!("note: {}", note.text),
    };
    (all, remarks.into_iter().map(words).collect())
}

/// A second of a receiver that knows date, position and its deviations.
fn second(time: &str, date: &str) -> String {
    [
        format!("GPRMC,{time},A,4807.038,N,01131.000,E,022.4,084.4,{date},003.1,W"),
        format!("GPGGA,{time},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"),
        format!("GPGST,{time},1.8,,,,1.7,1.3,2.2"),
    ]
    .map(|body| sentence(&body))
    .concat()
}

/// The sentences that the manuals print, with their own checksums: 48° 07.038' N, 11° 31.000' E, 545.4 m above the
/// geoid, which is 46.9 m above the ellipsoid; 22.4 knots towards 84.4°; 1994-03-23 12:35:19 UTC.
#[test]
fn sentences_of_the_manuals() {
    let text = "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n\
                $GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n";
    let [fix] = read(text)[..] else { panic!() };
    assert!(
        (fix.lat / DEG - 48.1173).abs() < 1e-9 && (fix.lon / DEG - 11.0 - 31.0 / 60.0).abs() < 1e-9
    );
    assert!(
        (fix.h - 592.3).abs() < 1e-9 && fix.t_s == 45_319.0,
        "{fix:?}"
    );
    let GnssVelocity {
        horizontal: v,
        horizontal_sigma: sigma,
        down,
    } = fix.velocity.unwrap();
    assert!(
        (v.length() - 22.4 * 0.514_444_444).abs() < 1e-6
            && (v.y.atan2(v.x) / DEG - 84.4).abs() < 1e-9
    );
    assert_eq!(
        (sigma, down, fix.pos_sigma_n),
        (DVec2::splat(0.1), None, DVec3::new(2.0, 2.0, 4.0))
    );
    // Trimble's, and u-blox's
    for text in [
        "$GPGST,172814.0,0.006,0.023,0.020,273.6,0.023,0.020,0.031*6A",
        "$GPGST,082356.00,1.8,,,,1.7,1.3,2.2*7E",
        "$GPVTG,,T,,M,0.00,N,0.00,K*4E",
    ] {
        assert!(fields(text, true).is_ok(), "{text}");
    }
}

#[test]
fn what_has_one_time_is_one_fix_from_any_talker() {
    let gst = sentence("GNGST,235959.50,1.8,,,,1.7,1.3,2.2");
    let gga = "GGA,235959.50,4630.0,S,00630.0,W,4,12,0.7,400.0,M,-30.5,M,,";
    let text = [
        gst,
        sentence(&format!("GN{gga}")),
        sentence(&format!("GP{}", gga.replace("400.0", "444.4"))),
        sentence("GNRMC,235959.50,A,4630.0,S,00630.0,W,19.438444924,90.0,310124,,,A"),
        sentence("GAGGA,000000.00,4630.0,S,00630.0,W,1,12,1.4,400.0,M,-30.5,M,,"),
        sentence("GNRMC,000000.00,A,4630.0,S,00630.0,W,0.02,,010224,,,A"),
        sentence("GLGGA,000000.50,,,,,0,00,99.9,,,,,,"),
    ]
    .concat();
    let all = read(&text);
    assert_eq!(
        all.iter().map(|f| f.t_s).collect::<Vec<_>>(),
        [86_399.5, 86_400.0]
    );
    assert_eq!(
        (all[0].pos_sigma_n, all[0].h),
        (DVec3::new(1.7, 1.3, 2.2), 369.5)
    );
    assert!((all[0].lat / DEG + 46.5).abs() < 1e-9 && (all[0].lon / DEG + 6.5).abs() < 1e-9);
    assert!(
        all[0]
            .velocity
            .unwrap()
            .horizontal
            .distance(DVec2::new(0.0, 10.0))
            < 1e-9
    );
    // at rest there is no course
    let GnssVelocity {
        horizontal: v,
        horizontal_sigma: sigma,
        ..
    } = all[1].velocity.unwrap();
    assert!(
        v == DVec2::ZERO && (sigma.x - 0.1_f64.hypot(0.02 * KNOT)).abs() < 1e-12,
        "{sigma}"
    );
    assert_eq!(all[1].pos_sigma_n, DVec3::new(2.0, 2.0, 4.0));
    // 2024-02-01 00:00 UTC is 1 706 745 600 s: the IMU's clock tells which of the two is meant
    let unix = (1_706_745_599.0, 1_706_745_700.0);
    let (unix, said) = said(&text, Some(unix));
    assert!(
        unix[1].t_s == 1_706_745_600.0 && said[0].ends_with("Unix time"),
        "{said:?}"
    );
    assert!(said[0].contains(": 2 fixes"), "{said:?}");
}

#[test]
fn damaged_sentences_are_refused_with_their_line() {
    let gga = |time: &str, lat: &str| {
        sentence(&format!(
            "GPGGA,{time},{lat},N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
        ))
    };
    let [first, later] = ["123519", "123520"].map(|time| gga(time, "4807.038"));
    // cut at its ends by whatever logged it
    let cut = format!("07.038,N,01131.000,E*1\n{first}{}", &later[..30]);
    assert_eq!(read(&cut).len(), 1);
    let damaged = [
        first.trim().replace("48", "49"),
        first[..40].to_owned(),
        "hello".to_owned(),
        gga("123519.5", "9107.038").trim().to_owned(),
        gga("253519", "4807.038").trim().to_owned(),
    ];
    let within = damaged.map(|bad| (format!("{first}{bad}\n{later}"), Some(&SIGMA)));
    let whole = [
        (first, None),
        (sentence("GPRMC,1,V,,,,,,,,,"), Some(&SIGMA)),
    ];
    insta::assert_snapshot!(answers(within.iter().chain(&whole).map(|(text, sigma)| {
        let read = fixes("a.nmea", text, *sigma, None);
        (text, read.map_err(|e| told(&e)))
    })));
}

/// Whatever a logger writes before the sentence of a line, a text of its own or a column.
#[test]
fn what_a_logger_writes_before_a_sentence_is_ignored() {
    let log = second("123519", "230394") + &second("123520", "230394");
    let plain = said(&log, None);
    for stamp in [
        "2026-11-23T10:00:00.123 ",
        "1699999999.123,",
        "[  12.5] RX: ",
    ] {
        let stamped: String = log.lines().map(|line| format!("{stamp}{line}\n")).collect();
        assert!(is_nmea(&stamped), "{stamp}");
        assert_eq!(said(&stamped, None), plain, "{stamp}");
    }
    assert!(!is_nmea("t_s,price\n0,$12\n") && !is_nmea("t_s,lat_deg\n0,46\n"));
}

/// An IMU that runs in Unix time is on the day that most sentences state; another counts the seconds of the day.
#[test]
fn the_day_is_that_of_most_sentences() {
    let log = second("100000", "231126") + &second("100001", "231126");
    let day_s = 1_795_392_000.0;
    let imu = Some((day_s + 35_990.0, day_s + 36_100.0));
    let (fixes, words) = said(&log, imu);
    assert_eq!(fixes[0].t_s, day_s + 36_000.0);
    assert!(words[0].ends_with("times are Unix time"), "{words:?}");
    // another day than the IMU's, or an IMU that counts from its start: seconds of the day
    let other = second("100000", "080407") + &second("100001", "080407");
    assert_eq!(said(&other, imu).0[0].t_s, 36_000.0);
    assert_eq!(said(&log, Some((0.0, 100.0))).1.len(), 1);
    // before it has found the time, a receiver states any date
    let (found, _) = said(&(second("095959", "060180") + &log), imu);
    assert_eq!(found[1].t_s, day_s + 36_000.0);
}

/// The checksum of NMEA 0183 may be left out of all sentences; where some have it, the others are damaged.
#[test]
fn logs_without_any_checksum_are_read() {
    let whole: String = (0..4)
        .map(|k| second(&format!("12351{k}"), "230394"))
        .collect();
    let bare: String = whole
        .lines()
        .map(|line| line.split('*').next().unwrap().to_owned() + "\n")
        .collect();
    let (fixes, words) = said(&bare, None);
    assert_eq!(fixes, read(&whole));
    assert!(
        words.contains(
            &"doubt: no sentence has a checksum: damaged digits are undetected".to_owned()
        ),
        "{words:?}"
    );
    let (_, words) = said(&whole, None);
    assert!(!words.iter().any(|text| text.contains("checksum")));
    let first = whole.lines().nth(4).unwrap();
    let some = whole.replacen(first, first.split('*').next().unwrap(), 1);
    let e = super::fixes("a.nmea", &some, Some(&SIGMA), None).unwrap_err();
    assert!(e.to_string().contains("no checksum"), "{e}");
}
