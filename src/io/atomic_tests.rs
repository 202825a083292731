//! Outputs appear whole or not at all, whoever is killed.

use super::*;

fn listing(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_file_appears_at_commit_only() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("deep/er/model.toml");
    let file = filled(&path, b"whole").unwrap();
    assert!(!path.exists());
    commit([file]).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"whole");
    assert_eq!(listing(path.parent().unwrap()), ["model.toml"]);
}

/// What a killed writer left is removed by the next one that claims the same output; what only looks like it stays.
#[test]
fn what_killed_writers_left_goes_with_the_next_claim() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    fs::write(dir.path().join(".a.csv.12345-0.partial"), "half").unwrap();
    fs::create_dir(dir.path().join(".run.12345-7.partial")).unwrap();
    fs::write(dir.path().join(".a.csv.mine.partial"), "other").unwrap();
    let claims = (
        claim_file(&path, ".csv", []).unwrap(),
        claim_directory(
            &dir.path().join("run"),
            &["b.csv"],
            std::iter::empty(),
            false,
            |_| DirectoryState::Same,
        ),
    );
    write(&path, "whole").unwrap();
    let mut run = AtomicDir::create(&dir.path().join("run")).unwrap();
    run.write("b.csv", ["b"]).unwrap();
    run.commit().unwrap();
    drop(claims);
    assert_eq!(listing(dir.path()), [".a.csv.mine.partial", "a.csv", "run"]);
}

#[test]
fn a_dropped_file_leaves_nothing_and_the_old_one_stays() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    write(&path, "old").unwrap();
    drop(filled(&path, b"half").unwrap());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(listing(dir.path()), ["a.csv"]);
}

#[test]
fn what_a_killed_process_left_is_not_in_the_way() {
    let dir = tempfile::tempdir().unwrap();
    let pid = std::process::id();
    for count in 0..200 {
        fs::write(
            dir.path().join(format!(".a.csv.{pid}-{count}.partial")),
            "left",
        )
        .unwrap();
    }
    write(&dir.path().join("a.csv"), "new").unwrap();
    assert_eq!(fs::read(dir.path().join("a.csv")).unwrap(), b"new");
}

#[test]
fn links_are_followed_and_devices_written_directly() {
    let dir = tempfile::tempdir().unwrap();
    let (real, link) = (dir.path().join("real"), dir.path().join("link"));
    write(&real, "old").unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    write(&link, "new").unwrap();
    assert!(link.is_symlink());
    assert_eq!(fs::read(&real).unwrap(), b"new");
    write(Path::new("/dev/null"), "gone").unwrap();
}

#[test]
fn a_full_disk_is_an_error_that_names_the_output() {
    let e = write(Path::new("/dev/full"), vec![0; 1 << 20]).unwrap_err();
    assert!(
        e.to_string().starts_with("/dev/full: the disk is full"),
        "{e}"
    );
    assert!(e.code() == 1);
}

#[test]
fn a_directory_is_no_file_and_a_file_no_directory() {
    let dir = tempfile::tempdir().unwrap();
    assert!(filled(dir.path(), b"").is_err());
    let file = dir.path().join("f");
    write(&file, "x").unwrap();
    assert!(AtomicDir::create(&file).is_err());
    assert_eq!(listing(dir.path()), ["f"]);
}

#[test]
fn inputs_are_not_overwritten_under_any_name() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in.csv");
    write(&input, "data").unwrap();
    let alias = dir
        .path()
        .join("../")
        .join(dir.path().file_name().unwrap())
        .join("in.csv");
    let e = guard_inputs(&alias, [input.as_path()]).unwrap_err();
    assert!(
        e.to_string()
            .ends_with("is an input and would be overwritten")
    );
    assert!(e.code() == 2 && e.advice().is_some());
    guard_inputs(&dir.path().join("out.csv"), [input.as_path()]).unwrap();
}

#[test]
fn a_directory_appears_at_commit_only() {
    let dir = tempfile::tempdir().unwrap();
    let run = dir.path().join("run");
    let mut out = AtomicDir::create(&run).unwrap();
    out.write("a.csv", ["a"]).unwrap();
    out.write("manifest.json", ["{}"]).unwrap();
    assert!(!run.exists());
    out.commit().unwrap();
    assert_eq!(listing(&run), ["a.csv", "manifest.json"]);
    assert_eq!(listing(dir.path()), ["run"]);
}

#[test]
fn an_existing_directory_keeps_what_is_not_replaced() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("notes.txt"), "mine").unwrap();
    fs::write(dir.path().join("a.csv"), "old").unwrap();
    let mut out = AtomicDir::create(dir.path()).unwrap();
    out.write("a.csv", ["new"]).unwrap();
    assert_eq!(fs::read(dir.path().join("a.csv")).unwrap(), b"old");
    out.commit().unwrap();
    assert_eq!(listing(dir.path()), ["a.csv", "notes.txt"]);
    assert_eq!(fs::read(dir.path().join("a.csv")).unwrap(), b"new");
}

/// Writers of one output take each other for dead at no instant: each gets its name, and nothing is left. (Of
/// outputs made first and locked afterwards, some were removed between the two.)
#[test]
fn writers_of_one_output_do_not_remove_what_the_others_write() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.unit");
    std::thread::scope(|scope| {
        for writer in 0..8 {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..100 {
                    write(path, format!("{writer}")).unwrap();
                    drop(AtomicDir::create(&path.with_file_name("run")).unwrap());
                }
            });
        }
    });
    assert_eq!(listing(dir.path()), ["a.unit"]);
}

/// No instant of a replacement shows a manifest beside files that are not its own: one that fails, or is killed, on the
/// way leaves none, and the next claim of a killed one's directory takes it.
#[test]
fn a_manifest_stands_beside_its_own_files_only() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir_all(dir.path().join("b.csv/in the way")).unwrap();
    fs::write(dir.path().join("manifest.json"), "old").unwrap();
    let mut out = AtomicDir::create(dir.path()).unwrap();
    for name in ["a.csv", "b.csv", "manifest.json"] {
        out.write(name, ["new"]).unwrap();
    }
    assert!(out.commit().is_err());
    assert_eq!(listing(dir.path()), ["a.csv", "b.csv"]);
    let claim = || {
        let (inputs, force) = (std::iter::empty(), false);
        claim_directory(dir.path(), &["manifest.json"], inputs, force, |_| {
            DirectoryState::Same
        })
    };
    assert!(claim().is_err());
    fs::write(dir.path().join(MARKER), "").unwrap();
    drop(claim().unwrap());
    assert_eq!(listing(dir.path()), ["a.csv", "b.csv"]);
}

/// A process that ended without a word left its marker: the next one takes it, and it goes with that one's claim.
#[test]
fn a_claim_ends_with_its_holder() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.toml");
    fs::write(dir.path().join(".model.toml.claim"), "").unwrap();
    let claim = claim_file(&path, ".csv", []).unwrap();
    let again = claim_file(&path, ".csv", []).unwrap_err();
    assert!(
        again
            .to_string()
            .ends_with("model.toml is another output of this command"),
        "{again}"
    );
    drop(claim);
    assert!(listing(dir.path()).is_empty());
    drop(claim_file(&path, ".csv", []).unwrap());
}

/// Where the system makes no file (of its own file systems, /proc): told so, with a remedy.
#[cfg(target_os = "linux")]
#[test]
fn where_nothing_can_be_made_another_path_is_the_remedy() {
    for path in ["/proc/no_such_place", "/proc/no_such_place/inside"].map(Path::new) {
        for e in [
            filled(path, b"").unwrap_err(),
            AtomicDir::create(path).unwrap_err(),
        ] {
            let shown = path.display();
            assert_eq!(
                e.to_string(),
                format!("{shown}: no file or directory can be made there")
            );
            assert_eq!(e.advice().unwrap(), "name another path");
            assert!(e.code() == 1);
        }
    }
}

/// Where the system has no locks, the marker of a claim holds none, and another command may write there.
#[test]
fn a_claim_without_a_lock_is_shared() {
    let dir = tempfile::tempdir().unwrap();
    let whole = claim_file(&dir.path().join("a.csv"), ".csv", []).unwrap();
    assert!(!whole.is_shared());
    let unlocked = OutputClaim {
        outputs: Vec::new(),
        marker: Some(Temporary::new(dir.path().join("b.claim"), None)),
        is_left: false,
    };
    assert!(unlocked.is_shared());
}
