//! Backup and restore in bad conditions: an older schema, a read-only file system, damaged results, and failures.

use std::fs::{self, Permissions};
use std::os::unix::fs::{FileExt as _, MetadataExt as _, PermissionsExt as _, chown};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Output};

use fretwork_job::Cost;
use fretwork_store::{Moving, Piece, backup, restore};
use sqlx::{Connection as _, Executor as _};
use tempfile::TempDir;

use crate::chunks::study;
use crate::faults::mounting;
use crate::keeping::{compute, write_first_version};
use crate::program::{fails, run};
use crate::store::{accepted, body, claim, crash, fresh, key, open, raw};
use crate::upgrade;

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// What a command wrote to standard output and to standard error.
fn said(output: &Output) -> String {
    String::from_utf8([&*output.stdout, &*output.stderr].concat()).unwrap()
}

async fn version(path: &Path) -> i64 {
    let query = sqlx::query_scalar("SELECT max(version) FROM _sqlx_migrations");
    query.fetch_one(&mut raw(path).await).await.unwrap()
}

/// The names of the files in a directory.
fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(dir)
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[tokio::test]
async fn databases_of_earlier_versions_are_backed_up_as_they_are_and_restored_with_the_new_tables()
{
    let target = TempDir::new().unwrap();
    for (number, results) in [(0, 1), (1, 2)] {
        let old = TempDir::new().unwrap();
        if number == 0 {
            write_first_version(old.path()).await;
        } else {
            upgrade::write_database(old.path());
        }
        let before = version(old.path()).await;
        let dir = target.path().join(number.to_string());
        fs::create_dir(&dir).unwrap();
        let file = dir.join("fretwork.db");
        let saved = backup(old.path(), &file).await.unwrap();
        assert_eq!((saved.results, saved.damaged.len()), (results, 0));
        assert_eq!(version(&dir).await, before, "an earlier program can use the backup");
        let new = target.path().join(format!("new-{number}"));
        let (restored, _) = restore(&new, &file, false).await.unwrap();
        assert_eq!(restored, saved);
        assert!(version(&new).await > before);
        open(&new).await.close().await;
    }
}

#[test]
fn a_backup_of_a_read_only_file_system_is_possible() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    // A database that was closed, and one with the log that a crash has left.
    let (closed, store) = runtime.block_on(fresh());
    runtime.block_on(async {
        compute(&store, 1, 1000).await;
        compute(&store, 2, 1000).await;
    });
    let crashed = crash(closed.path());
    runtime.block_on(store.close());
    assert!(fs::metadata(crashed.path().join("fretwork.db-wal")).unwrap().len() > 0);
    assert!(!closed.path().join("fretwork.db-wal").exists());
    for dir in [closed, crashed] {
        let mount = "mount --bind \"$0\" \"$0\" && mount -o remount,bind,ro \"$0\"";
        let Some(mut command) = mounting(mount, dir.path()) else { return };
        let target = TempDir::new().unwrap();
        let file = target.path().join("backup.db");
        let words = ["backup", text(&file), "--data-dir", text(dir.path())];
        let output = command.args(words).output().unwrap();
        assert!(said(&output).contains("2 results ("), "{output:?}");
        assert_eq!(names(target.path()), ["backup.db"]);
        // A copy of the files on a read-only disk can be restored, too.
        let mut command = mounting(mount, dir.path()).unwrap();
        let (from, to) = (dir.path().join("fretwork.db"), target.path().join("data"));
        let words = ["restore", text(&from), "--data-dir", text(&to)];
        let output = command.args(words).output().unwrap();
        assert!(said(&output).contains("2 results ("), "{output:?}");
        assert_eq!(names(&to), ["fretwork.db", "fretwork.lock"]);
    }
}

#[tokio::test]
async fn a_directory_keeps_the_newest_backups_and_what_is_none() {
    let (data, store) = fresh().await;
    compute(&store, 1, 1000).await;
    store.close().await;
    let target = TempDir::new().unwrap();
    let dir = target.path().join("new/backups");
    let words = ["backup", text(&dir), "--keep", "14", "--data-dir", text(data.path())];
    assert!(run(&words, "").status.success());
    let mut made = names(&dir);
    let others = ["fretwork-mine.db", "fretwork-mineZ.db", "notes.txt"];
    // Compressed by somebody.
    let compressed = "fretwork-2020-01-01T000000.000Z.db.gz";
    for name in others.iter().chain(&["fretwork-2020-01-01T000000.000Z.db.part", compressed]) {
        fs::write(dir.join(name), "").unwrap();
    }
    for _ in 1..20 {
        let output = run(&words, "");
        assert!(output.status.success(), "{}", said(&output));
        let file = said(&output).split(": ").next().unwrap().to_owned();
        made.push(Path::new(&file).file_name().unwrap().to_str().unwrap().to_owned());
    }
    assert!(made.is_sorted(), "{made:?}");
    let kept = made[6..].iter().map(String::as_str).chain(others);
    let kept: Vec<_> = std::iter::once(compressed).chain(kept).collect();
    assert_eq!(names(&dir), kept);
    for (number, name) in made[6..].iter().enumerate() {
        let to = target.path().join(number.to_string());
        assert_eq!(restore(&to, &dir.join(name), false).await.unwrap().0.results, 1);
    }
    // A database with damage replaces no sound backup.
    damage(data.path(), None).await;
    let output = run(&["backup", text(&dir), "--keep", "1", "--data-dir", text(data.path())], "");
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert_eq!(names(&dir).len(), kept.len() + 1);
    fails(
        &run(&["backup", &format!("{}/", text(&dir)), "--data-dir", text(&dir)], ""),
        "contains no database",
    );
}

/// The owner of a directory and of all files in it; `None` if they differ.
fn owner(dir: &Path) -> Option<u32> {
    let own = fs::metadata(dir).unwrap().uid();
    let files = fs::read_dir(dir).unwrap().map(|file| file.unwrap().metadata().unwrap().uid());
    files.chain([own]).all(|uid| uid == own).then_some(own)
}

#[tokio::test]
async fn what_root_puts_into_a_directory_belongs_to_the_owner_of_the_directory() {
    if !rustix::process::geteuid().is_root() {
        return;
    }
    let dir = TempDir::new().unwrap();
    let (data, file) = (dir.path().join("data"), dir.path().join("backup.db"));
    fs::create_dir(&data).unwrap();
    chown(&data, Some(4711), Some(4711)).unwrap();
    let at = ["--data-dir", text(&data)];
    assert!(
        run(&[&["keys", "add", "anna", "--role", "read"], &at[..]].concat(), "").status.success()
    );
    assert_eq!(owner(&data), Some(4711));
    backup(&data, &file).await.unwrap();
    fs::remove_dir_all(&data).unwrap();
    fs::create_dir(&data).unwrap();
    chown(&data, Some(4711), Some(4711)).unwrap();
    restore(&data, &file, false).await.unwrap();
    assert_eq!((owner(&data), names(&data).len()), (Some(4711), 2));

    // Root gives nothing away that it has not created.
    chown(data.join("fretwork.lock"), Some(0), Some(0)).unwrap();
    assert!(run(&[&["keys", "list"], &at[..]].concat(), "").status.success());
    assert_eq!(owner(&data), None);
    chown(data.join("fretwork.lock"), Some(4711), Some(4711)).unwrap();

    // Another user gets the reason, and what to do.
    fs::set_permissions(dir.path(), Permissions::from_mode(0o755)).unwrap();
    fs::set_permissions(&data, Permissions::from_mode(0o700)).unwrap();
    let program = dir.path().join("fretwork");
    fs::copy(env!("CARGO_BIN_EXE_fretwork"), &program).unwrap();
    let as_other = |words: &[&str]| {
        Command::new(&program).args(words).args(at).uid(4712).gid(4712).output().unwrap()
    };
    for words in [&["keys", "list"][..], &["audit"], &["serve"], &["export", "out.zst"]] {
        fails(&as_other(words), "run this command as the user of the server (`sudo -u USER");
    }
    for words in [&["check"][..], &["check", "--repair"]] {
        fails(&as_other(words), "fretwork.db: Permission denied");
    }
    chown(data.join("fretwork.db"), Some(0), Some(0)).unwrap();
    chown(&data, Some(4712), Some(4712)).unwrap();
    chown(data.join("fretwork.lock"), Some(4712), Some(4712)).unwrap();
    fails(&as_other(&["serve"]), "`chown -R 4712:4712 ");
}

#[tokio::test]
async fn a_backup_on_a_full_disk_leaves_the_old_ones() {
    let (data, store) = fresh().await;
    compute(&store, 1, 1000).await;
    store.close().await;
    let old = TempDir::new().unwrap();
    let words = ["backup", text(old.path()), "--keep", "2", "--data-dir", text(data.path())];
    assert!(run(&words, "").status.success() && run(&words, "").status.success());
    let kept = names(old.path());
    let disk = TempDir::new().unwrap();
    // The disk is gone with the mount namespace, so its files are listed inside.
    let script = "mount -t tmpfs -o size=8m tmpfs \"$0\" && if [ \"$OLD\" ]; then
        cp \"$OLD\"/* \"$0\" && cat /dev/zero >\"$0/filler\" 2>/dev/null
        \"$1\" backup \"$0\" --keep 1 --data-dir \"$DATA\"; echo $?; ls \"$0\"
        cd \"$OLD\" && for file in *; do cmp \"$file\" \"$0/$file\"; done; exit; fi";
    let Some(mut command) = mounting(script, disk.path()) else { return };
    let output = command.env("OLD", old.path()).env("DATA", data.path()).output().unwrap();
    let expected = format!("1\nfiller\n{}\n", kept.join("\n"));
    assert_eq!(String::from_utf8_lossy(&output.stdout), expected, "{output:?}");
    assert_eq!(said(&output).lines().filter(|line| line.starts_with("fretwork: ")).count(), 1);
}

/// Damages the result 1 of a closed database: a byte of its body, or the link from one page of its body to the next.
async fn damage(dir: &Path, link: Option<u32>) {
    let mut db = raw(dir).await;
    if let Some(link) = link {
        let place: i64 = sqlx::query_scalar(
            "SELECT pgoffset FROM dbstat WHERE name = 'result_blob' AND pagetype = 'overflow'
             AND path LIKE '%+000001' ORDER BY path LIMIT 1",
        )
        .fetch_one(&mut db)
        .await
        .unwrap();
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)").await.unwrap();
        db.close().await.unwrap();
        let file = fs::File::options().write(true).open(dir.join("fretwork.db")).unwrap();
        file.write_all_at(&link.to_be_bytes(), place.unsigned_abs()).unwrap();
    } else {
        db.execute(
            "UPDATE result_blob SET body = CAST(substr(body, 1, 20) || x'07' || substr(body, 22) AS BLOB)
             WHERE substr(key, 1, 1) = x'01'",
        )
        .await
        .unwrap();
        db.close().await.unwrap();
    }
}

#[tokio::test]
async fn a_damaged_result_is_left_out_and_named_and_the_rest_is_restored() {
    for link in [None, Some(0), Some(u32::MAX)] {
        let (dir, store) = fresh().await;
        for number in 1..=5 {
            compute(&store, number, 20_000).await;
        }
        let sound = body(&store, 2).await;
        // A study with one finished chunk.
        accepted(store.submit(study(9, 2)).await);
        let first = claim(&store).await;
        assert!(store.finish_chunk(&first, b"1,2", Cost::ZERO).await.unwrap());
        store.close().await;
        damage(dir.path(), link).await;
        let target = TempDir::new().unwrap();
        let (file, data) = (target.path().join("backup.db"), target.path().join("data"));
        // The copy of the files stands for a backup that was damaged later.
        let raw_copy = dir.path().join("fretwork.db");
        for words in [
            ["backup", text(&file), "--data-dir", text(dir.path())],
            ["restore", text(&raw_copy), "--data-dir", text(&data)],
        ] {
            let output = run(&words, "");
            assert_eq!(output.status.code(), Some(2), "{output:?}");
            assert!(said(&output).contains(": 4 results ("), "{output:?}");
            assert!(said(&output).contains(&format!("left out {}: it is damaged", key(1))));
        }
        let store = open(&data).await;
        assert_eq!(body(&store, 2).await, sound);
        assert!(!store.has_result(&key(1)).await.unwrap());
        assert!(store.known(&key(1)).await.unwrap().is_some(), "its scenario is kept");
        compute(&store, 1, 20_000).await;
        assert!(!body(&store, 1).await.is_empty());
        // If a link is damaged, the database is copied row by row, without the chunks of unfinished studies.
        let next = Piece::Chunk { number: u32::from(link.is_none()), of: 2 };
        assert_eq!(claim(&store).await.piece, next);
        store.close().await;
        // The backup does not contain the damage.
        let (saved, _) = restore(&target.path().join("again"), &file, false).await.unwrap();
        assert_eq!((saved.results, saved.evicted, saved.damaged.len()), (4, 1, 0));
    }
}

#[tokio::test]
async fn a_failed_restore_leaves_nothing_behind_and_names_the_option_to_replace() {
    let (dir, store) = fresh().await;
    compute(&store, 1, 1000).await;
    let target = TempDir::new().unwrap();
    let file = target.path().join("backup.db");
    backup(dir.path(), &file).await.unwrap();
    store.close().await;

    let before = names(dir.path());
    let words = ["restore", text(&file), "--data-dir", text(dir.path())];
    fails(&run(&words, ""), "add --replace");
    assert_eq!(names(dir.path()), before);

    // The root page of the table `job` is damaged. A restore cannot leave out this table.
    let root = "SELECT rootpage FROM sqlite_schema WHERE name = 'job'";
    let copy = target.path().join("fretwork.db");
    fs::copy(&file, &copy).unwrap();
    let mut db = raw(target.path()).await;
    let page: i64 = sqlx::query_scalar(root).fetch_one(&mut db).await.unwrap();
    db.close().await.unwrap();
    let damaged = fs::File::options().write(true).open(&copy).unwrap();
    damaged.write_all_at(&[0xa5; 4096], (page.unsigned_abs() - 1) * 4096).unwrap();
    let new = target.path().join("some/new/directory");
    let refused = restore(&new, &copy, false).await;
    assert!(matches!(refused, Err(Moving::Damaged { .. } | Moving::Store(_))), "{refused:?}");
    assert!(!target.path().join("some").exists());
    let refused = restore(dir.path(), &copy, true).await;
    assert!(refused.is_err());
    assert_eq!(names(dir.path()), before);
    let store = open(dir.path()).await;
    assert!(store.has_result(&key(1)).await.unwrap());
    store.close().await;
}
