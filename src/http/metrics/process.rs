//! Metrics of the process: processor time, memory and file descriptors, by the names that all Prometheus clients use.

use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};

use fretwork_job::clock::now;

/// Registers the metrics of this process. Outside Linux, there is only the time of its start.
pub fn register(registry: &mut Registry) {
    let help = "When the server started, in seconds since 1970";
    let started = ConstGauge::new(now() as f64 / 1e3);
    registry.register_with_unit("start_time", help, Unit::Seconds, started);
    #[cfg(target_os = "linux")]
    registry.register_collector(Box::new(linux::Process));
}

#[cfg(target_os = "linux")]
mod linux {
    use std::fmt;
    use std::fs;

    use prometheus_client::collector::Collector;
    use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric as _};
    use prometheus_client::metrics::MetricType;
    use prometheus_client::metrics::counter::ConstCounter;
    use prometheus_client::metrics::gauge::ConstGauge;
    use prometheus_client::registry::Unit;
    use rustix::process::{Resource, getrlimit};
    use rustix::time::{ClockId, clock_gettime};

    /// Measures this process whenever a client asks for the metrics.
    #[derive(Debug)]
    pub(super) struct Process;

    impl Collector for Process {
        fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> Result<(), fmt::Error> {
            let cpu = clock_gettime(ClockId::ProcessCPUTime);
            let help = "Processor time of all threads";
            let cpu = ConstCounter::new(cpu.tv_sec as f64 + cpu.tv_nsec as f64 / 1e9);
            let kind = MetricType::Counter;
            cpu.encode(encoder.encode_descriptor("cpu", help, Some(&Unit::Seconds), kind)?)?;
            for (name, help, unit, value) in [
                ("resident_memory", "Memory in use", Some(&Unit::Bytes), resident_memory()),
                ("open_fds", "Open file descriptors", None, open_files()),
                ("max_fds", "Largest number of open file descriptors", None, max_files()),
            ] {
                // An unknown value is left out.
                let Some(value) = value else { continue };
                let gauge = ConstGauge::new(value as f64);
                gauge.encode(encoder.encode_descriptor(name, help, unit, MetricType::Gauge)?)?;
            }
            Ok(())
        }
    }

    /// The resident memory of the process, in bytes.
    fn resident_memory() -> Option<u64> {
        let pages = fs::read_to_string("/proc/self/statm").ok()?;
        let pages: u64 = pages.split(' ').nth(1)?.parse().ok()?;
        Some(pages * rustix::param::page_size() as u64)
    }

    fn open_files() -> Option<u64> {
        Some(fs::read_dir("/proc/self/fd").ok()?.count() as u64)
    }

    /// The soft limit of open files; `None` if there is no limit.
    fn max_files() -> Option<u64> {
        getrlimit(Resource::Nofile).current
    }
}
