//! The commands that talk to a server: HTTPS, busy servers, other versions, keys and exit codes.

use std::fs;
use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rcgen::{CertificateParams, KeyPair};
use rustls::crypto::ring;
use rustls::pki_types::PrivateKeyDer;
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use serde_json::Value;
use tempfile::TempDir;

use crate::encryption::authority;
use crate::program::{fails, fretwork, run, serve, serve_by, text};

const BALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/steel-ball.json");
const SAME_VERSION: &str =
    concat!("200 OK\r\n\r\n{\"version\":\"", env!("CARGO_PKG_VERSION"), "\"}");
const ID: &str = "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11";

/// Gives one answer. Returns the head of the request.
fn answer(mut stream: impl Read + Write, answer: &str) -> String {
    let mut reader = BufReader::new(&mut stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        // A client that trusts no certificate sends nothing.
        if reader.read_line(&mut head).unwrap_or(0) == 0 {
            return head;
        }
    }
    let head = head.to_lowercase();
    let length = head.split("content-length: ").nth(1).and_then(|rest| rest.lines().next());
    let mut body = vec![0; length.map_or(0, |length| length.parse().unwrap())];
    reader.read_exact(&mut body).unwrap();
    let (status, rest) = answer.split_once("\r\n").unwrap();
    write!(stream, "HTTP/1.1 {status}\r\nconnection: close\r\n{rest}").unwrap();
    stream.flush().unwrap();
    head
}

/// A server that gives these answers, one for each connection. Returns its port, and the requests.
fn answering(tls: Option<Arc<ServerConfig>>, answers: &[&str]) -> (u16, JoinHandle<Vec<String>>) {
    answering_at(0, tls, answers)
}

fn answering_at(
    port: u16,
    tls: Option<Arc<ServerConfig>>,
    answers: &[&str],
) -> (u16, JoinHandle<Vec<String>>) {
    let listener = TcpListener::bind(("127.0.0.1", port)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let answers: Vec<_> = answers.iter().map(ToString::to_string).collect();
    let serve = move || {
        let next = |text: &String| {
            let (stream, _) = listener.accept().unwrap();
            let Some(tls) = &tls else { return answer(stream, text) };
            let connection = ServerConnection::new(Arc::clone(tls)).unwrap();
            let mut stream = StreamOwned::new(connection, stream);
            let head = answer(&mut stream, text);
            stream.conn.send_close_notify();
            let _ = stream.flush();
            head
        };
        answers.iter().map(next).collect()
    };
    (port, thread::spawn(serve))
}

fn watch(answers: &[&str]) -> Output {
    let (port, _) = answering(None, answers);
    run(&["watch", ID, "--url", &format!("http://127.0.0.1:{port}")], "")
}

#[test]
fn the_command_line_trusts_the_authority_that_the_environment_names() {
    let (authority, key) = (authority(), KeyPair::generate().unwrap());
    let wanted = CertificateParams::new(["localhost".to_owned()]).unwrap();
    let certificate = wanted.signed_by(&key, &authority).unwrap();
    let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let config = config.with_safe_default_protocol_versions().unwrap().with_no_client_auth();
    let key = PrivateKeyDer::try_from(key.serialize_der()).unwrap();
    let config = config.with_single_cert(vec![certificate.der().clone()], key).unwrap();
    let health = "200 OK\r\ncontent-length: 0\r\n\r\n";
    let (port, server) = answering(Some(Arc::new(config)), &[health; 3]);
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("root.pem");
    fs::write(&file, authority.pem()).unwrap();
    let asked = |host: &str, trusts: bool| {
        let mut command = fretwork(&["health", "--url", &format!("https://{host}:{port}/")]);
        if trusts {
            command.env("SSL_CERT_FILE", &file);
        }
        command.output().unwrap()
    };
    fails(
        &asked("localhost", false),
        "name the certificates of your own authority in SSL_CERT_FILE",
    );
    fails(&asked("127.0.0.1", true), "not valid for name");
    assert_eq!(text(&asked("localhost", true).stdout), "ok\n");
    assert!(server.join().unwrap()[2].starts_with("get /healthz http/1.1\r\n"));
}

#[test]
fn an_address_for_tls_of_a_server_without_tls_is_named() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("https://{}", listener.local_addr().unwrap());
    let server = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        assert!(stream.read(&mut [0; 4096]).unwrap() > 0);
        stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n").unwrap();
    });
    fails(&run(&["health", "--url", &address], ""), "does not speak TLS");
    server.join().unwrap();
}

#[test]
fn a_command_that_waits_survives_a_restart_of_the_server() {
    let (port, server) = answering(None, &[SAME_VERSION, "200 OK\r\n\r\n{\"state\":\"running\"}"]);
    let address = format!("http://127.0.0.1:{port}");
    let mut command = fretwork(&["watch", ID, "--url", &address]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    server.join().unwrap();
    let mut said = String::new();
    BufReader::new(child.stderr.as_mut().unwrap()).read_line(&mut said).unwrap();
    assert_eq!(said, format!("lost {address}; trying again for 120s\n"));
    // A proxy answers before the server does.
    let ended = format!("200 OK\r\n\r\n{{\"id\":\"{ID}\",\"key\":\"0\",\"state\":\"succeeded\"}}");
    let (_, server) = answering_at(port, None, &["502 Bad Gateway\r\n\r\n", &ended]);
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), ""));
    // A silent server would keep the request itself waiting for longer than the command says.
    assert!(server.join().unwrap()[0].starts_with("get /healthz "));
}

#[test]
fn a_busy_server_gets_the_same_submission_again() {
    let busy = "503 Busy\r\nretry-after: 1\r\ncontent-length: 0\r\n\r\n";
    let job = format!("202 Accepted\r\n\r\n{{\"id\":\"{ID}\",\"state\":\"queued\",\"key\":\"0\"}}");
    let (port, server) = answering(None, &[SAME_VERSION, busy, &job]);
    let address = format!("http://127.0.0.1:{port}");
    let output = run(&["submit", BALL, "--url", &address], "");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "the server is busy; next attempt in 1 s\n");
    let requests = server.join().unwrap();
    let once = |request: &String| {
        request.lines().find(|line| line.starts_with("idempotency-key: ")).unwrap().to_owned()
    };
    assert_eq!(once(&requests[1]), once(&requests[2]));

    // The user decides about a long pause. An error that stays is no reason for another attempt.
    for status in ["429 Many\r\nretry-after: 3600", "500 Error\r\nretry-after: 1"] {
        let refused = format!("{status}\r\n\r\n{{\"detail\":\"Come back.\"}}");
        let output = watch(&[SAME_VERSION, &refused]);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(1), "Come back.\n"));
    }
}

#[test]
fn the_exit_code_tells_how_a_job_ended() {
    for (state, code) in [("succeeded", 0), ("failed", 3), ("canceled", 4)] {
        let ended = format!(
            "200 OK\r\n\r\n{{\"id\":\"{ID}\",\"key\":\"0\",\"state\":\"{state}\",\"error\":{{\"detail\":\"Why.\"}}}}"
        );
        let output = watch(&[SAME_VERSION, "200 OK\r\n\r\n{\"state\":\"running\"}", &ended]);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(code), "Why.\n"));
        assert!(text(&output.stdout).starts_with(&format!("{ID}  {state}")));
    }
    let usage = run(&["watch"], "");
    assert_eq!(usage.status.code(), Some(2));
}

/// No text with a control character, except the ends of lines.
fn is_harmless(output: &Output) -> bool {
    let said = [text(&output.stdout), text(&output.stderr)].concat();
    !said.contains(|letter: char| (letter.is_control() && letter != '\n') || letter == '\u{202e}')
}

#[test]
fn a_terminal_obeys_nothing_that_a_server_sends() {
    let evil = "\\u001b]0;x\\u0007\\u009b31m\\u202e";
    let job = format!(
        "200 OK\r\n\r\n{{\"id\":\"{evil}\",\"key\":\"0\",\"state\":\"failed\",\"label\":\"{evil}\",\"error\":{{\"detail\":\"{evil}\"}}}}"
    );
    let output = watch(&[SAME_VERSION, &job]);
    assert_eq!(output.status.code(), Some(3));
    assert!(is_harmless(&output), "{output:?}");
    assert!(text(&output.stderr).contains("\\u{1b}]0;x\\u{7}\\u{9b}31m"), "{output:?}");
    let version = format!("200 OK\r\n\r\n{{\"version\":\"{evil}\"}}");
    let refused = format!("409 No\r\n\r\n{{\"detail\":\"{evil}\"}}");
    let output = watch(&[&version, &refused]);
    assert!(is_harmless(&output) && text(&output.stderr).lines().count() == 2, "{output:?}");
    let answer = format!("200 OK\r\n\r\n{{\"outputs\":{{\"{evil}\":null}}}}");
    let (port, _) = answering(None, &[SAME_VERSION, &answer]);
    let output = run(&["evaluate", BALL, "--url", &format!("http://127.0.0.1:{port}")], "");
    assert!(output.status.success() && is_harmless(&output), "{output:?}");
    let jobs = "200 OK\r\n\r\n{\"jobs\":[{\"id\":\"0\",\"state\":\"queued\",\"key\":\"0\",\"label\":\"a\\nb\"}]}";
    let (port, _) = answering(None, &[SAME_VERSION, jobs]);
    let output = run(&["list", "--url", &format!("http://127.0.0.1:{port}")], "");
    assert_eq!(text(&output.stdout), "0  queued     0  a\\nb\n");
}

#[test]
fn a_server_that_is_not_fretwork_is_named() {
    fails(&watch(&[SAME_VERSION, "200 OK\r\n\r\n<html>"]), "is not the JSON of fretwork. Check");
    fails(&watch(&[SAME_VERSION, "200 OK\r\n\r\n{}"]), "is no job. Check FRETWORK_URL");
    let (port, _) = answering(None, &[SAME_VERSION, "200 OK\r\n\r\nnull"]);
    let list = run(&["list", "--url", &format!("http://127.0.0.1:{port}")], "");
    fails(&list, "is not the JSON of fretwork. Check");
    let (port, _) = answering(None, &[SAME_VERSION, "200 OK\r\n\r\n{\"outputs\":[]}"]);
    let evaluated = run(&["evaluate", BALL, "--url", &format!("http://127.0.0.1:{port}")], "");
    fails(&evaluated, "is no evaluation. Check FRETWORK_URL");
    let long = "200 OK\r\n\r\n".to_owned() + &" ".repeat((1 << 27) + 1);
    fails(&watch(&[SAME_VERSION, &long]), "is not the JSON of fretwork. Check");
}

#[test]
fn a_server_that_does_not_wait_gets_two_requests_per_second_at_most() {
    let running = "200 OK\r\n\r\n{\"state\":\"running\"}";
    let ended = format!("200 OK\r\n\r\n{{\"id\":\"{ID}\",\"key\":\"0\",\"state\":\"succeeded\"}}");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let began = Instant::now();
    // Without pauses, the job gets hundreds of requests before it ends.
    let server = thread::spawn(move || {
        let accept = || listener.accept().unwrap().0;
        answer(accept(), SAME_VERSION);
        answer(accept(), running);
        let (first, mut requests) = (Instant::now(), 1);
        loop {
            let stream = accept();
            requests += 1;
            if first.elapsed() > Duration::from_millis(100) {
                answer(stream, &ended);
                return requests;
            }
            answer(stream, running);
        }
    });
    let output = run(&["watch", ID, "--url", &format!("http://127.0.0.1:{port}")], "");
    assert_eq!(output.status.code(), Some(0));
    let (requests, most) = (server.join().unwrap(), 1.0 + 2.0 * began.elapsed().as_secs_f64());
    assert!(requests > 1 && f64::from(requests) <= most, "{requests} of {most}");
}

#[test]
fn an_id_leads_to_no_other_path() {
    let (port, server) = answering(None, &[SAME_VERSION, "200 OK\r\n\r\n{}"]);
    run(&["cancel", "../a?b#c d", "--url", &format!("http://127.0.0.1:{port}")], "");
    let asked = server.join().unwrap();
    assert!(asked[1].starts_with("post /v1/jobs/%2e%2e%2fa%3fb%23c%20d/cancel "), "{}", asked[1]);
}

#[test]
fn a_server_of_another_version_is_a_warning() {
    let (port, _) =
        answering(None, &["200 OK\r\n\r\n{\"version\":\"9.1\"}", "200 OK\r\n\r\n{\"jobs\":[]}"]);
    let output = run(&["list", "--url", &format!("http://127.0.0.1:{port}")], "");
    assert_eq!((output.status.code(), text(&output.stdout)), (Some(0), ""));
    let said = text(&output.stderr);
    assert!(
        said.starts_with("warning: the server is of version 9.1, and this program of"),
        "{said}"
    );
}

#[test]
fn a_wrong_key_and_a_wrong_address_say_what_to_enter() {
    let dir = TempDir::new().unwrap();
    let key = "fretwork_".to_owned() + &"0123456789abcdef".repeat(3);
    let mut command = fretwork(&[]);
    command.env("FRETWORK_ADMIN_KEY", &key);
    let (_server, address) = serve_by(command, dir.path());
    let list = |url: &str, key: Option<&str>| -> Output {
        let mut command: Command = fretwork(&["list", "--url", url]);
        key.map(|key| command.env("FRETWORK_KEY", key));
        command.output().unwrap()
    };
    assert_eq!(list(&address, Some(&key)).status.code(), Some(0));
    for wrong in [None, Some("fretwork_wrong")] {
        let output = list(&address, wrong);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.ends_with(" Enter a key in FRETWORK_KEY or FRETWORK_KEY_FILE.\n"), "{said}");
    }
    fails(&list(&format!("{address}/v1/"), None), "must be the address of the server: http://");
    fails(&list("wear.example", None), "must begin with http:// or https://");
    let output = list("http://0.0.0.0:1", Some(&key));
    let said = text(&output.stderr);
    assert!(
        said.starts_with("warning: http://0.0.0.0:1 gets the access key unencrypted"),
        "{said}"
    );
    fails(&list("http://[::1]:1", Some(&key)), "no server answers");
}

#[test]
fn a_canceled_job_ends_with_4() {
    let dir = TempDir::new().unwrap();
    let (_server, address) = serve(dir.path(), &[]);
    let with = |words: &[&str], input: &str| run(&[words, &["--url", &address]].concat(), input);
    let job: Value = serde_json::from_slice(&fs::read(BALL).unwrap()).unwrap();
    // The study must not end before its cancellation.
    let vary =
        serde_json::json!([{"pointer": "/friction", "from": 0.6, "to": 0.8, "count": 100_000}]);
    let sweep = serde_json::json!({"sweep": {"scenario": job["scenario"], "vary": vary, "outputs": ["wear_depth"]}});
    let submitted = with(&["submit", "-"], &sweep.to_string());
    let id = text(&submitted.stdout).split(' ').next().unwrap().to_owned();
    assert_eq!(with(&["cancel", &id], "").status.code(), Some(0));
    let output = with(&["watch", &id], "");
    assert_eq!(output.status.code(), Some(4), "{}", text(&output.stdout));
}

/// What `doctor` prints, and its exit code.
fn examined(url: &str, options: &[&str]) -> (Option<i32>, String) {
    let output = run(&[&["doctor", "--url", url], options].concat(), "");
    assert_eq!(text(&output.stderr), "");
    (output.status.code(), text(&output.stdout).to_owned())
}

#[test]
fn the_doctor_lists_what_would_fail_and_the_worst_is_the_exit_code() {
    let dir = TempDir::new().unwrap();
    let (mut server, address) = serve(dir.path(), &[]);
    let (code, said) = examined(&address, &[]);
    let bad: Vec<_> = said.lines().filter(|line| !line.starts_with("ok     ")).collect();
    assert_eq!(code, Some(1), "{said}");
    assert!(
        bad.len() == 1 && bad[0].starts_with("warns  backup: none is known. Make one every day."),
        "{said}"
    );
    let backups = dir.path().join("backups/");
    let words = ["backup", backups.to_str().unwrap(), "--data-dir", dir.path().to_str().unwrap()];
    assert!(run(&words, "").status.success());
    let (code, said) = examined(&address, &[]);
    assert_eq!((code, said.lines().count()), (Some(0), 7), "{said}");
    assert!(said.contains("\nok     backup: 0 h old.\n"), "{said}");

    server.kill().unwrap();
    server.wait().unwrap();
    let (code, said) = examined(&address, &[]);
    assert_eq!((code, said.lines().count()), (Some(2), 1));
    assert!(said.starts_with("fails  server: no server answers at "), "{said}");
}

#[test]
fn the_doctor_finds_keys_versions_and_clocks_that_are_wrong() {
    let key = "fretwork_".to_owned() + &"0123456789abcdef".repeat(3);
    let (dir, mut command) = (TempDir::new().unwrap(), fretwork(&[]));
    command.env("FRETWORK_ADMIN_KEY", &key);
    let (_server, address) = serve_by(command, dir.path());
    let (code, said) = examined(&address, &[]);
    assert_eq!(code, Some(2));
    assert!(
        said.contains(
            "\nfails  server: This server requires an access key. Enter a key in FRETWORK_KEY "
        ),
        "{said}"
    );
    let (code, said) = examined(&address, &["--key", &key]);
    assert_eq!(code, Some(1), "{said}");
    // Without TLS, there is no proxy to examine.
    assert!(!said.contains("proxy"), "{said}");

    let metrics = "date: Sun, 06 Nov 1994 08:49:37 GMT\r\n\r\nfretwork_build_info{version=\"9.1\",numerics=\"1\"} 1\n\
        fretwork_disk_free_bytes 5\nfretwork_last_backup_timestamp_seconds NaN\nfretwork_lost_commits 3\nfretwork_store_errors_total{kind=\"damaged\"} 0\n";
    let metrics = format!("200 OK\r\n{metrics}");
    let full = "503 No\r\n\r\n{\"detail\":\"The disk is full.\"}";
    let none = "404 Not Found\r\n\r\n{}";
    let (port, _) = answering(None, &[full, &metrics]);
    let (code, said) = examined(&format!("http://127.0.0.1:{port}"), &[]);
    assert_eq!(code, Some(2));
    for bad in [
        "fails  readiness: The disk is full. ",
        "warns  version: 9.1. ",
        "warns  disk: 5 B free. ",
        "warns  backup: none is known. ",
        "warns  clock: differs from that of the server by ",
        "fails  damage: 3 acknowledged changes are missing, ",
    ] {
        assert!(said.contains(bad), "{bad}: {said}");
    }
    let no_server = "503 Service Unavailable\r\n\r\n<html>";
    let (port, _) = answering(None, &[no_server, no_server]);
    let (code, said) = examined(&format!("http://127.0.0.1:{port}"), &[]);
    let reason = "fails  readiness: a proxy answers, but no fretwork. Start fretwork. ";
    assert!(code == Some(2) && said.starts_with(reason) && !said.contains("clock"), "{said}");
    let (port, _) = answering(None, &[full, none]);
    let (code, said) = examined(&format!("http://127.0.0.1:{port}"), &[]);
    let last = said.lines().last().unwrap();
    assert!(last.starts_with("fails  server: the server answers 404. Check FRETWORK_URL. The"));
    assert_eq!(code, Some(2));
}
