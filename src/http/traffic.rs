//! Counts of the connections, for the metrics.

use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;

/// What the connections of a server do. The listener counts, and the metrics show it.
#[derive(Debug, Clone, Default)]
pub struct Traffic {
    open: Gauge,
}

/// An open connection. It counts until it is dropped.
#[derive(Debug)]
pub struct Open(Gauge);

impl Traffic {
    /// Counts a connection.
    #[must_use]
    pub fn open(&self) -> Open {
        self.open.inc();
        Open(self.open.clone())
    }

    /// Registers the metrics.
    pub fn register(&self, registry: &mut Registry) {
        registry.register("connections", "Open connections", self.open.clone());
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        self.0.dec();
    }
}
