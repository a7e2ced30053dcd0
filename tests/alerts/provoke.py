"""Provokes the trouble of every alert on real servers, and tests with promtool that the alerts fire, and that every query of the
board finds something.

    provoke.py fretwork promtool

The metrics of a server before and after the trouble become the series of a test for `promtool test rules`, in which each
lasts for an hour. So the test has real metrics, and takes seconds.
"""

import json
import os
import re
import resource
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from contextlib import closing
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(PROJECT / "tests"))

from programs import PATIENCE

FRETWORK, PROMTOOL = sys.argv[1:]
RULES = PROJECT / "deploy/alerts.yml"
BOARD = json.loads((PROJECT / "deploy/grafana/dashboards/fretwork.json").read_text())
BALL = json.loads((PROJECT / "examples/steel-ball.json").read_text())
# A run of about 25 s of processor time.
LONG = BALL["scenario"] | {
    "load": {"normal_force": "100 N", "held": "force"},
    "motion": {"blocks": [{"amplitude": f"{(2.5, 8)[i % 2] + i % 7 / 100} um", "cycles": 200_000} for i in range(1000)]},
    "cycles": [200_000_000],
    "model": {"points": 4096, "tolerance": 1e-4},
}
MINUTES = 60


class Server:
    """A server or a worker on a free port. `instance` tells it apart from the others of its database."""

    started = []

    def __init__(self, *words, instance=None, files=None, mount=()):
        command = [*mount, FRETWORK, *words, "--listen", "127.0.0.1:0"]
        limit = (lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))) if files else None
        environment = {"PATH": os.environ["PATH"], "FRETWORK_LOG": "off"}
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, preexec_fn=limit)
        self.started.append(self)
        self.labels = ['job="fretwork"'] + ([f'instance="{instance}"'] if instance else [])
        self.address = re.search(r"http://\S+", self.process.stdout.readline())[0]

    def send(self, method, target, body=None, **headers):
        """Sends a request. Returns the status and the text of its answer."""
        data = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json"} | {name.replace("_", "-"): text for name, text in headers.items()}
        request = urllib.request.Request(self.address + target, data, headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def submit(self, body, **headers):
        status, text = self.send("POST", "/v1/jobs", body, **headers)
        assert status in (200, 202), text
        return json.loads(text)

    def scrape(self):
        """The samples as Prometheus would store them: value by series."""
        up = f"up{{{','.join(self.labels)}}}"
        try:
            status, text = self.send("GET", "/metrics")
        except OSError:
            return {up: "0"}
        assert status == 200, text
        checked = subprocess.run([PROMTOOL, "check", "metrics"], input=text, text=True, capture_output=True)
        assert checked.returncode == 0, checked.stderr
        samples = {up: "1"}
        for line in text.splitlines():
            name, labels, value = re.fullmatch(r"(?:#.*|(\w+)(?:{(.*)})? (\S+))", line).groups()
            if name:
                labels = ",".join(self.labels + ([labels] if labels else []))
                samples[f"{name}{{{labels}}}"] = value
        return samples

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


def healthy_then_troubled(data):
    """A server that works, with five troubles, and killed."""
    files = 200
    server = Server("--data-dir", data, "--workers", "1", "--memory-cache", "0", files=files)
    job = server.submit(BALL, Prefer="wait=60")
    assert job["state"] == "succeeded", job
    subprocess.run([FRETWORK, "backup", f"{data}/backup", "--data-dir", data], check=True, stdout=subprocess.DEVNULL)
    healthy = server.scrape()

    with closing(sqlite3.connect(f"{data}/fretwork.db", isolation_level=None)) as db:
        db.execute("UPDATE result SET digest = zeroblob(32)")
        server.submit(BALL, Prefer="wait=60", Cache_Control="no-cache")
        db.execute("UPDATE result_blob SET body = zeroblob(length(body))")
        status, _ = server.send("GET", job["links"]["result"])
        assert status == 500, status
        # The worker needs minutes for these.
        for friction in range(30, 70):
            server.submit({"scenario": LONG | {"friction": friction / 100}})
        db.execute("UPDATE run SET created = created - 1200000 WHERE state = 'queued'")
        # While a transaction reads, the log cannot be moved into the database.
        with closing(sqlite3.connect(f"{data}/fretwork.db", isolation_level=None)) as reader:
            reader.execute("BEGIN")
            reader.execute("SELECT count(*) FROM room").fetchone()
            db.execute("CREATE TABLE large (bytes BLOB)")
            for _ in range(5):
                db.execute("INSERT INTO large VALUES (zeroblob(30000000))")
            opened = int(float(healthy['process_open_fds{job="fretwork"}']))
            host, port = server.address.removeprefix("http://").split(":")
            idle = [socket.create_connection((host, int(port))) for _ in range(int(0.85 * files) - opened)]
            troubled = server.scrape()
    for connection in idle:
        connection.close()
    server.kill()
    return healthy, troubled, server.scrape()


def full(data):
    """A server on a full disk. None if the system permits no mount."""
    script = 'mount -t tmpfs -o size=3m tmpfs "$0" && exec "$@"'
    for options in ([], ["--map-root-user"]):
        mount = ["unshare", "--mount", *options, "sh", "-c", script, data]
        if subprocess.run([*mount, "true"], capture_output=True).returncode == 0:
            break
    else:
        return None
    server = Server("--data-dir", data, mount=mount)
    for friction in range(1, 1000):
        body = {"scenario": BALL["scenario"] | {"friction": friction / 1000}}
        # A submission can fit where its result does not. Such a run waits for space.
        status, _ = server.send("POST", "/v1/jobs", body, Prefer="wait=2")
        if status == 507:
            break
    assert status == 507, "the disk did not fill up"
    samples = server.scrape()
    server.kill()
    return samples


def fill(address):
    """Fills the disk of a database, up to the last page."""
    create = "CREATE TABLE filler (bytes TEXT); ALTER TABLE filler ALTER COLUMN bytes SET STORAGE PLAIN"
    execute = lambda words: subprocess.run(["psql", "--quiet", address, "--command", words], stderr=subprocess.DEVNULL).returncode == 0
    assert execute(create)
    for pages in (256, 1):
        while execute(f"INSERT INTO filler SELECT repeat('x', 8000) FROM generate_series(1, {pages})"):
            pass


def full_on_postgres():
    """A server whose PostgreSQL has a full disk: before and after. None if the system permits no mount."""
    if os.geteuid() != 0 or subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode:
        return None
    command = [PROJECT / "tests/postgres", "--disk", "32m"]
    database = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        address = database.stdout.readline().strip()
        place = address.split("host=")[1]
        for words in (f"CREATE TABLESPACE small LOCATION '{place}/small'", "CREATE DATABASE team TABLESPACE small"):
            subprocess.run(["psql", "--quiet", address, "--command", words], check=True)
        team = address.replace("/postgres?", "/team?")
        [postgres] = subprocess.run(["pgrep", "-P", str(database.pid), "postgres"], capture_output=True, text=True).stdout.split()
        disk = f"/proc/{postgres}/root{place}/small"
        server = Server("--database", team, "--database-disk", disk, instance="front")
        before = server.scrape()
        fill(team)
        statuses = set()
        for friction in range(1, 100):
            body = {"scenario": BALL["scenario"] | {"friction": friction / 1000}}
            statuses.add(server.send("POST", "/v1/jobs", body)[0])
        assert 507 in statuses and server.send("GET", "/readyz")[0] == 503, statuses
        after = server.scrape()
        free = [float(samples['fretwork_disk_free_bytes{job="fretwork",instance="front"}']) for samples in (before, after)]
        assert free[0] > free[1] + 1e6, free
        return after
    finally:
        for server in Server.started:
            server.kill()
        database.communicate("")


def without_its_log(data):
    """The metrics after a start without the log, which a kill has left."""
    server = Server("--data-dir", data)
    for friction in range(1, 10):
        server.submit({"scenario": BALL["scenario"] | {"friction": friction / 1000}})
    server.kill()
    os.remove(f"{data}/fretwork.db-wal")
    server = Server("--data-dir", data)
    samples = server.scrape()
    server.kill()
    return samples


def moved(data):
    """The metrics after the database was moved."""
    server = Server("--data-dir", data)
    os.rename(f"{data}/fretwork.db", f"{data}/moved.db")
    status, _ = server.send("GET", "/readyz")
    assert status == 503, status
    samples = server.scrape()
    server.kill()
    return samples


def restarted(data):
    """The metrics after four starts. The database has no backup."""
    phases = []
    for _ in range(4):
        server = Server("--data-dir", data)
        phases.append(server.scrape())
        server.kill()
    return phases


def on_postgres():
    """The metrics of a server and a worker that share PostgreSQL: with an open transaction, before and after some runs, after a
    restart of the worker, and without it."""
    database = subprocess.Popen([PROJECT / "tests/postgres"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        shared = ["--database", database.stdout.readline().strip()]
        start_worker = lambda: Server("worker", *shared, "--workers", "1", instance="worker")
        front, worker = Server(*shared, "--workers", "0", instance="front"), start_worker()
        before = front.scrape() | worker.scrape()
        with subprocess.Popen(["psql", "--no-psqlrc", "--quiet", shared[1]], stdin=subprocess.PIPE, text=True) as backup:
            print("BEGIN ISOLATION LEVEL REPEATABLE READ; SELECT FROM job;", file=backup.stdin, flush=True)
            until = time.monotonic() + PATIENCE
            while len(old_snapshots(held := front.scrape() | worker.scrape())) < 2:
                assert time.monotonic() < until, held
                time.sleep(0.2)
            backup.stdin.close()
        for friction in range(30, 40):
            job = front.submit({"scenario": BALL["scenario"] | {"friction": friction / 100}})
            front.send("GET", job["links"]["self"] + "?wait=60")
        after = front.scrape() | worker.scrape()
        worker.kill()
        worker = start_worker()
        restarted = front.scrape() | worker.scrape()
        worker.kill()
        return [held, before, after, restarted, front.scrape()]
    finally:
        for server in Server.started:
            server.kill()
        database.communicate("")


def old_snapshots(samples):
    """The ages of transactions that have been open for more than a second."""
    return [one for one in samples if one.startswith("fretwork_oldest_snapshot_age_seconds") and float(samples[one]) > 1]


def an_hour_later(samples):
    """The metrics that a transaction of some seconds would cause if it had stayed open."""
    return samples | {one: str(float(samples[one]) + 3600) for one in old_snapshots(samples)}


def queries(board):
    """The queries of the board, with the interval that Grafana would insert."""
    parts = [target for panel in board["panels"] for target in panel.get("targets", [])] + board["annotations"]["list"]
    return [part["expr"].replace("$__rate_interval", "5m") for part in parts]


def values(one, phases, minutes):
    found = [samples.get(one, "_").replace("NaN", "_") for samples, _ in phases]
    # After a failed scrape, Prometheus marks the series as stale.
    return " ".join(f"stale _x{minutes - 1}" if value == "_" else f"{value}x{minutes - 1}" for value in found)


def board_test(phases, minutes=MINUTES):
    """A test that each query of the board found something at some time."""
    known = [({one: value.replace("NaN", "0") for one, value in samples.items()}, alerts) for samples, alerts in phases]
    duration = len(phases) * minutes - 1
    found = lambda query: f"count(last_over_time(({query})[{duration}m:1m])) > bool 0"
    return {
        "name": "board",
        "interval": "1m",
        "input_series": [
            {"series": one, "values": values(one, known, minutes)} for one in sorted({one for samples, _ in known for one in samples})
        ],
        "promql_expr_test": [
            {"expr": found(query), "eval_time": f"{duration}m", "exp_samples": [{"labels": "{}", "value": 1}]}
            for query in queries(BOARD)
        ],
    }


def rule_test(name, phases, minutes=MINUTES):
    """A test of the alerts after each phase: pairs of samples and the names of the alerts that must have fired."""
    series = {one for samples, _ in phases for one in samples if not one.startswith(("fretwork_http", "fretwork_run_dur"))}
    fired = f'count by (alertname) (max_over_time(ALERTS{{alertstate="firing"}}[{minutes - 2}m]))'
    expected = lambda alerts: [{"labels": f'{{alertname="{alert}"}}', "value": 1} for alert in sorted(alerts)]
    return {
        "name": name,
        "interval": "1m",
        "input_series": [{"series": one, "values": values(one, phases, minutes)} for one in sorted(series)],
        "promql_expr_test": [
            {"expr": fired, "eval_time": f"{minutes * end - 1}m", "exp_samples": expected(alerts)}
            for end, (_, alerts) in enumerate(phases, 1)
        ],
    }


def main():
    directory = tempfile.mkdtemp()
    data = lambda name: str(Path(directory, name))
    try:
        os.mkdir(data("full"))
        healthy, troubled, down = healthy_then_troubled(data("one"))
        starts = restarted(data("two"))
        troubles = {
            "FretworkDigitsDiffer", "FretworkDatabaseDamaged", "FretworkQueueStuck", "FretworkLogGrows",
            "FretworkFilesRunOut",
        }
        phases = [(healthy, set()), (troubled, troubles), (down, {"FretworkDown"})]
        held, *with_workers, front_alone = on_postgres()
        shared = [(samples, set()) for samples in with_workers] + [(front_alone, {"FretworkNoWorker"})]
        tests = [
            rule_test("troubles", phases),
            rule_test("several servers", shared, 12),
            board_test(shared, 12),
            rule_test("starts", [(samples, set()) for samples in starts[:3]] + [(starts[3], {"FretworkRestarts"})], 12),
            rule_test("open transaction", [(held, set()), (an_hour_later(held), {"FretworkOldSnapshot"})], 12),
            rule_test("no log", [(healthy, set()), (without_its_log(data("three")), {"FretworkCommitsLost"})]),
            rule_test("moved database", [(healthy, set()), (moved(data("four")), {"FretworkFilesMoved"})]),
            rule_test("no backup", [(healthy, set()), (starts[0], {"FretworkBackupOld"})], 3000),
        ]
        provoked = troubles | {
            "FretworkDown", "FretworkRestarts", "FretworkBackupOld", "FretworkNoWorker", "FretworkCommitsLost", "FretworkFilesMoved",
            "FretworkOldSnapshot",
        }
        disk = {"FretworkDiskFillsUp", "FretworkDiskFull"}
        tests += [
            rule_test(name, [(before, set()), (samples, disk)])
            for name, before, samples in [
                ("full disk", healthy, full(data("full"))),
                ("full disk of PostgreSQL", with_workers[0], full_on_postgres()),
            ]
            if samples
        ]
        if len(tests) < 10:
            print("not provoked: the alerts of a full disk, because this system permits no mount", file=sys.stderr)
        rules = set(re.findall(r"- alert: (\w+)", RULES.read_text()))
        assert rules == provoked | disk, rules ^ (provoked | disk)
        file = Path(directory, "test.yml")
        file.write_text(json.dumps({"rule_files": [str(RULES)], "evaluation_interval": "1m", "tests": tests}))
        subprocess.run([PROMTOOL, "test", "rules", file], check=True)
    finally:
        for server in Server.started:
            server.kill()
        shutil.rmtree(directory)


main()
