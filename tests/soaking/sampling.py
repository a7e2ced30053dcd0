"""What a soak measures every few seconds: memory, open files, latencies, rows, dead rows and sizes."""

import statistics
import time

import programs
from load import QUICK
from programs import Client, submission

# What is counted in both databases, and where from.
COUNTED = {
    "job": "job", "run": "run", "result": "result WHERE evicted IS NULL",
    "evicted result": "result WHERE evicted IS NOT NULL",
    "result_blob": "result_blob", "outline": "outline WHERE present", "study": "study", "chunk": "chunk",
}
# Those of PostgreSQL only.
COUNTED_SHARED = {"lease": "lease", "turn": "turn", "job_tag": "job_tag"}
REPEATS = 5
# What a series may grow after the warm-up: the larger one of a share of its mean and an amount.
BOUNDS = {
    # The allocator and the caches of 64 MiB fill up slowly.
    "MiB of memory": (0.10, 16),
    # Each user has a connection or two, and each reader of the database a file.
    "open files": (0.10, 16),
    # Upkeep works in rounds of a minute: rows and sizes are saws, of which the last tooth may be unfinished.
    "rows": (0.20, 1000),
    "MiB on disk": (0.15, 8),
    "bytes per row": (0.20, 100),
    # Autovacuum also works in rounds of a minute.
    "dead rows": (0.50, 10_000),
    # A saturated machine with two cores makes medians of five samples noisy.
    "ms": (0.50, 20),
}


def count_rows(counted):
    """The statement that counts rows."""
    counts = [f"SELECT {place}, count(*) FROM {rows}" for place, rows in enumerate(counted.values())]
    return " UNION ALL ".join(counts) + " ORDER BY 1"


def by_unit(counted, counts):
    """Numbers of rows as a part of a sample. The scenarios of evicted results stay for a year, so they grow."""
    return {("rows for a year" if name.startswith("evicted") else "rows", name): int(count)
            for name, (_, count) in zip(counted, counts)}


class Sampler:
    """Takes samples. Each series has a unit and a name."""

    def __init__(self, database, server, running):
        self.database, self.running = database, running
        self.client = Client(server.port, "127.0.0.2")
        self.job = self.client.json("POST", "/v1/jobs", submission(QUICK), Prefer="wait=10")
        # So that the job and the result of the probes are always there.
        self.client.json("PUT", f"/v1/results/{self.job['key']}/pin", status=204)
        self.started = time.time()
        self.times, self.series, self.faults = [], {}, []
        self.last, self.fresh = None, 0

    def sample(self):
        """Takes a sample of everything."""
        self.times.append(time.time() - self.started)
        found = {}
        for name, program in self.running.items():
            found["MiB of memory", name] = programs.memory(program.pid) / 2**20
            found["open files", name] = programs.open_files(program.pid)
        found |= self.database.sizes()
        for name, probe in PROBES.items():
            found["ms", name] = self.time(probe)
        for series, value in found.items():
            self.series.setdefault(series, []).append(value)
        self.last = found

    def time(self, probe):
        """The median time of a probe in milliseconds."""
        times = []
        for _ in range(REPEATS):
            started = time.perf_counter()
            probe(self)
            times.append((time.perf_counter() - started) * 1e3)
        return statistics.median(times)

    def ask(self, method, path, body=None, **headers):
        """Sends the request of a probe, which may be refused like any other."""
        answer, text = self.client.ask(method, path, body, **headers)
        refused = answer.status in (429, 503) and answer.getheader("retry-after")
        if answer.status not in (200, 202) and not refused:
            self.faults.append(f"{method} {path}: {answer.status} {text[:300]}")

    def submit(self, scenario):
        self.ask("POST", "/v1/jobs", submission(QUICK | scenario))

    def submit_new(self):
        self.fresh += 1
        self.submit({"friction": round(0.2 + self.fresh * 1e-6, 6)})

    def evaluate(self):
        body = {"scenario": submission(QUICK)["scenario"], "outputs": ["wear_volume"]}
        self.ask("POST", "/v1/evaluate", body)


PROBES = {
    "read a result": lambda probe: probe.ask("GET", f"/v1/results/{probe.job['key']}"),
    "list jobs": lambda probe: probe.ask("GET", "/v1/jobs"),
    "list results": lambda probe: probe.ask("GET", "/v1/results"),
    "search": lambda probe: probe.ask("GET", "/v1/results?friction=0.3..0.5&sort=wear_depth"),
    "submit a known scenario": lambda probe: probe.submit({}),
    "submit a new scenario": Sampler.submit_new,
    "evaluate": Sampler.evaluate,
}
