//! The text formats of the metrics, and the metrics of the process.

use crate::keeping::eventually;
use crate::program::serve;
use crate::server::{Server, metric};

#[tokio::test]
async fn the_metrics_are_prometheus_text_unless_openmetrics_is_preferred() {
    let server = Server::start().await;
    let plain = server.get("/metrics").await;
    assert_eq!(plain.header("content-type"), Some("text/plain; version=0.0.4; charset=utf-8"));
    // The `Accept` header of Prometheus 2.42.
    let wanted = "application/openmetrics-text;version=1.0.0,application/openmetrics-text;version=0.0.1;q=0.75,\
        text/plain;version=0.0.4;q=0.5,*/*;q=0.1";
    let open = server.send("GET", "/metrics", &[("Accept", wanted)], "").await;
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    assert_eq!(open.header("content-type"), Some(kind));
    assert!(open.text().ends_with("\n# EOF\n"));
    for (prometheus, open_metrics) in [
        ("# TYPE fretwork_jobs_total counter", "# TYPE fretwork_jobs counter"),
        ("# TYPE fretwork_build_info gauge", "# TYPE fretwork_build info"),
        ("# TYPE fretwork_database_bytes gauge", "# UNIT fretwork_database_bytes bytes"),
        ("# HELP fretwork_workers Worker threads.", "# HELP fretwork_workers Worker threads."),
    ] {
        assert!(plain.text().lines().any(|line| line == prometheus), "{}", plain.text());
        assert!(open.text().lines().any(|line| line == open_metrics), "{}", open.text());
    }
    // Both formats have the same samples.
    let samples = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        lines.filter_map(|line| Some(line.rsplit_once(' ')?.0.to_owned())).collect()
    };
    let (plain, mut open) = (samples(plain.text()), samples(open.text()));
    // The first request is counted in the second answer.
    open.retain(|name| !name.starts_with("fretwork_http_request"));
    assert_eq!(plain, open);
}

#[tokio::test]
async fn metrics_show_the_process_and_its_files() {
    let dir = tempfile::TempDir::new().unwrap();
    let (process, address) = serve(dir.path(), &[]);
    let address = address.strip_prefix("http://").unwrap().parse().unwrap();
    let started = metric(address, "process_start_time_seconds").await;
    let now = fretwork_job::clock::now() as f64 / 1e3;
    assert!((now - 60.0..=now).contains(&started), "{started} {now}");
    let idle = [(); 20].map(|()| std::net::TcpStream::connect(address).unwrap());
    // The server accepts connections in order. So all idle connections are open when it answers this request.
    let files = metric(address, "process_open_fds").await;
    drop(idle);
    // The server may also close files that it opened only for its start.
    eventually(async || metric(address, "process_open_fds").await <= files - 20.0).await;
    assert!(metric(address, "process_max_fds").await > files);
    assert!(metric(address, "process_cpu_seconds_total").await > 0.0);
    let resident = metric(address, "process_resident_memory_bytes").await;
    // The peak is read last, because each request may take more memory.
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    let peak: f64 = peak.trim().trim_end_matches(" kB").parse().unwrap();
    assert!((1e6..=peak * 1024.0).contains(&resident), "{resident} {peak}");
    let database = std::fs::metadata(dir.path().join("fretwork.db")).unwrap().len() as f64;
    assert_eq!(metric(address, "fretwork_database_bytes").await, database);
    assert!(metric(address, "fretwork_database_log_bytes").await >= 0.0);
}
