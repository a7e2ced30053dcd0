"""Starts the programs that tests and benchmarks measure: servers and workers of fretwork, and a private PostgreSQL.

Reads what Linux tells about them: memory, processor time, open files.
"""

import functools
import http.client
import json
import os
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
BALL = json.loads((ROOT / "examples/steel-ball-simplified.json").read_text())["scenario"]
# Seconds after which a test says that something hangs. No machine is so slow that a program needs so long to start, to stop or to
# answer.
PATIENCE = 180
# Milliseconds in a tick of the processor time.
TICK = 1000 / os.sysconf("SC_CLK_TCK")


@functools.cache
def fretwork():
    """The program that tests/program chooses."""
    return pathlib.Path(subprocess.run([ROOT / "tests/program"], check=True, stdout=subprocess.PIPE, text=True).stdout.strip())


def stat(process):
    """The fields of /proc/…/stat after the name of the program; the first is the state."""
    text = pathlib.Path(f"/proc/{process}/stat").read_text()
    return text[text.rindex(")") + 2:].split()


def memory(process):
    """Resident memory in bytes."""
    status = pathlib.Path(f"/proc/{process}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+) kB", status)[1]) << 10


def open_files(process):
    """How many files and connections a process has open."""
    return len(os.listdir(f"/proc/{process}/fd"))


def milliseconds(process):
    """Processor time in milliseconds."""
    return sum(map(int, stat(process)[11:13])) * TICK


def computing_milliseconds(process):
    """Processor time of the threads of fretwork that compute runs, in milliseconds."""
    threads = [f"{process}/task/{thread}" for thread in os.listdir(f"/proc/{process}/task")]
    computing = [thread for thread in threads if pathlib.Path(f"/proc/{thread}/comm").read_text().startswith("worker-")]
    return sum(map(milliseconds, computing))


class Program:
    """A server or a worker. `where` are the options that name the database."""

    def __init__(self, words, where, log, options=(), environment=None):
        self.log = log
        # Variables of the environment could change the settings.
        environment = {"PATH": os.environ["PATH"], "FRETWORK_LOG": "warn", **(environment or {})}
        with open(log, "a", encoding="utf-8") as file:
            self.process = subprocess.Popen([fretwork(), *words, *where, *options], env=environment,
                                            stdout=subprocess.PIPE, stderr=file, text=True)
        self.pid = self.process.pid

    def stop(self):
        """Stops the program as an administrator does, and returns what it logged."""
        self.process.terminate()
        code = self.process.wait(timeout=PATIENCE)
        self.process.stdout.close()
        logged = self.log.read_text()
        return logged if code == 0 else f"{logged}\nthe program ended with {code}"


class Server(Program):
    """A server on a free port of this machine."""

    def __init__(self, where, log, options=(), environment=None):
        super().__init__(["serve", "--listen", "127.0.0.1:0"], where, log, options, environment)
        line = self.process.stdout.readline()
        found = re.search(r"listens on (http://\S+)", line)
        assert found, f"the server did not start: {log.read_text()}"
        self.base = found[1]
        self.port = int(self.base.rsplit(":", 1)[1])


class Worker(Program):
    """A program that only computes."""

    def __init__(self, where, log, options=()):
        super().__init__(["worker"], where, log, options)


class Sqlite:
    """The directory of a database of SQLite."""

    name = "SQLite"

    def __init__(self, directory):
        self.directory = directory
        self.file = directory / "fretwork.db"
        self.where = ["--data-dir", directory]

    def milliseconds(self):
        """SQLite has no process of its own."""
        return 0

    def stop(self):
        """SQLite has no process of its own."""


class Postgres:
    """A private PostgreSQL, which `tests/postgres` starts and stops."""

    name = "PostgreSQL"

    def __init__(self, *options):
        self.process = subprocess.Popen([ROOT / "tests/postgres", *options], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self.url = self.process.stdout.readline().strip()
        assert self.url, "PostgreSQL did not start"
        self.where = ["--database", self.url]

    def query(self, sql):
        """Executes SQL, and returns the rows of its last statement as lists of texts."""
        command = ["psql", "--no-psqlrc", "--quiet", "--tuples-only", "--no-align", "--field-separator=\t",
                   "--set=ON_ERROR_STOP=1", "--command", sql, self.url]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, f"{done.stderr}\n{sql}"
        return [line.split("\t") for line in done.stdout.splitlines()]

    def value(self, sql):
        """The first number of the answer."""
        return float(self.query(sql)[0][0])

    def milliseconds(self):
        """Processor time of PostgreSQL, with the connections that have ended."""
        parents, own, ended = {}, {}, {}
        for name in os.listdir("/proc"):
            try:
                fields = stat(name) if name.isdigit() else None
            except OSError:  # It has just ended.
                fields = None
            if fields:
                parents[int(name)] = int(fields[1])
                own[int(name)] = sum(map(int, fields[11:13]))
                ended[int(name)] = sum(map(int, fields[13:15]))
        inside = {self.process.pid}
        while more := {child for child, parent in parents.items() if parent in inside} - inside:
            inside |= more
        inside.discard(self.process.pid)
        return sum(own[child] + ended[child] for child in inside) * TICK

    def stop(self):
        """It stops when its standard input ends."""
        self.process.stdin.close()
        self.process.wait(timeout=PATIENCE)
        self.process.stdout.close()


class Client:
    """A connection from a loopback address, which is the owner of its jobs. It connects again if necessary."""

    def __init__(self, port, source="127.0.0.1"):
        self.port, self.source, self.connection = port, source, None

    def connect(self):
        """A new connection."""
        self.close()
        self.connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE,
                                                     source_address=(self.source, 0))

    def ask(self, method, path, body=None, **headers):
        """Sends a request, with underscores in names of headers for hyphens. Returns the answer and its whole body."""
        answer = self.open(method, path, body, **headers)
        return answer, answer.read()

    def open(self, method, path, body=None, **headers):
        """Sends a request. The caller reads the body of the answer."""
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        if body is not None:
            headers["Content-Type"] = "application/json"
            body = body if isinstance(body, bytes) else json.dumps(body).encode()
        for is_last in (self.connection is None, True):
            if self.connection is None:
                self.connect()
            try:
                self.connection.request(method, path, body, headers)
                return self.connection.getresponse()
            except (http.client.RemoteDisconnected, BrokenPipeError, ConnectionResetError):
                # The server closes idle connections.
                self.close()
                if is_last:
                    raise

    def json(self, method, path, body=None, status=200, **headers):
        """Sends a request, requires a status, and returns the document."""
        answer, text = self.ask(method, path, body, **headers)
        assert answer.status == status, f"{method} {path}: {answer.status} {text[:500]}"
        return json.loads(text) if text else None

    def pages(self, path, members):
        """All entries of a list."""
        while path:
            page = self.json("GET", path)
            yield from page[members]
            path = page["next"]

    def close(self):
        """Closes the connection."""
        if self.connection:
            self.connection.close()
        self.connection = None


def submission(scenario=None, **members):
    """The body of a job: the steel ball with other members of the scenario."""
    return {"scenario": BALL | (scenario or {})} | members
