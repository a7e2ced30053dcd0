"""The attacked server: a program with bounded memory, access keys, and one large result."""

import http.client
import itertools
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from programs import PATIENCE

MEMORY = 512 << 20
# The soft limit of open files with which most systems start a program.
FILES = 1024
# One key may have 256 requests at once, so the attackers have several.
KEYS, READERS, SHARERS = 16, 4, 4
# The address of the sign-on proxy, and its secret.
PROXY, SECRET = "127.0.0.77", "the-secret-of-the-proxy"
# A result with 62 MB of JSON. The server computes smaller results, but serves those of earlier versions.
LARGE = {
    "profile": {"shape": "paraboloid", "radius": "10 mm"},
    "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
    "friction": 0.7,
    "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
    "load": {"normal_force": "100 N", "held": "depth"},
    "motion": {"amplitude": "2 um"},
    "cycles": {"from": 1000, "to": 100_000, "count": 168, "spacing": "log"},
    "profiles_at": "all",
    "model": {"points": 4096},
}
SMALL = LARGE | {"cycles": [1000], "profiles_at": "none", "model": {"method": "simplified", "points": 16}}
# A study of about 40 minutes of processor time. No attack takes so long.
BLOCKS = [{"amplitude": f"{(2.5, 8)[i % 2] + i % 7 / 100} um", "cycles": 200_000} for i in range(1000)]
SPECTRUM = LARGE | {
    "load": {"normal_force": "100 N", "held": "force"},
    "motion": {"blocks": BLOCKS},
    "cycles": {"from": 200_000, "to": 200_000_000, "count": 1000, "spacing": "linear"},
    "profiles_at": "none",
    "model": {"tolerance": 1e-4},
}
FRICTION = {"pointer": "/friction", "from": 0.5, "to": 0.9, "count": 100}
STUDY = {"sweep": {"scenario": SPECTRUM, "vary": [FRICTION], "outputs": ["wear_volume"]}}


def cgroup():
    """The command that starts a program with bounded memory. Empty if systemd is missing or may not do this."""
    user = [] if os.geteuid() == 0 else ["--user"]
    bounds = [f"--property=MemoryMax={MEMORY}", "--property=MemorySwapMax=0"]
    command = ["systemd-run", *user, "--scope", "--quiet", "--collect", *bounds]
    try:
        subprocess.run([*command, "true"], check=True, capture_output=True, timeout=PATIENCE)
    except (OSError, subprocess.SubprocessError):
        return []
    return command


class Server:
    """A running server. With limits, its answers must be as fast as on a quiet machine."""

    def __init__(self, program, data, has_limits):
        self.program, self.data, self.has_limits, self.numbers = program, data, has_limits, itertools.count()
        # The largest memory that was seen, in bytes.
        self.most = 0
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        large = self.imported_result()
        self.log = open(data / "log", "w+", encoding="utf-8")
        self.process = subprocess.Popen(
            # Variables could change the settings, but systemd-run needs them.
            [*cgroup(), "env", "-i", f"FRETWORK_AUTH_SECRET={SECRET}", program, "--listen", "127.0.0.1:0", "--data-dir", data,
             "--log", "error", "--trusted-proxy", PROXY, "--auth-header", "X-Remote-User", "--auth-role", "submit"],
            stdout=subprocess.PIPE,
            stderr=self.log,
            text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (min(FILES, most), most)),
        )
        self.base = re.search(r"listens on (http://\S+)", self.process.stdout.readline())[1]
        self.port = int(self.base.rsplit(":", 1)[1])
        self.bystander = self.key("bystander", "submit")
        links = self.links(large, [self.key(f"sharer{number}", "submit") for number in range(SHARERS)])
        self.large = links[0]
        values = {
            "port": self.port,
            "keys": [self.key("attacker", "submit") for _ in range(KEYS)],
            "links": links,
            "readers": [self.key("readers", "read") for _ in range(READERS)],
            "reader": self.key("reader", "read"),
            "bystander": self.bystander,
            "leaver": self.key("leaver", "submit"),
            "chief": self.key("chief", "admin"),
            "revoke": [str(program), "keys", "revoke", "--data-dir", str(data)],
            "proxy": PROXY,
            "secret": SECRET,
            "has_limits": has_limits,
        }
        # For the programs that attack.
        self.target = data / "target.json"
        self.target.write_text(json.dumps(values))

    def key(self, name, role):
        """A new access key."""
        command = [self.program, "keys", "add", name, "--role", role, "--data-dir", self.data]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return re.search(r"fretwork_\w+", text)[0]

    def imported_result(self):
        """The key of a large result, which is imported before the server starts."""
        scenario, result = self.data / "large.json", self.data / "result.json"
        scenario.write_text(json.dumps(LARGE))
        for command in (["run", scenario, "-o", result], ["import", "--data-dir", self.data, result]):
            subprocess.run([self.program, *command], check=True, capture_output=True)
        with open(result, "rb") as file:
            return re.search(rb'"key":"(\w+)"', file.read(200))[1].decode()

    def links(self, large, keys):
        """Share links of several keys to the large result."""
        answers = [self.post(f"/v1/results/{large}/links", key) for key in keys]
        return [json.loads(text)["url"] for _, text in answers]

    def ask(self, method, path, key=None, body=None, **headers):
        """Sends a request on a new connection from 127.0.0.1. Returns the status and the body of the answer."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        if key:
            headers["Authorization"] = f"Bearer {key}"
        try:
            connection.request(method, path, body, headers)
            response = connection.getresponse()
            return response.status, response.read()
        finally:
            connection.close()

    def post(self, path, key, document=None, **headers):
        """Sends JSON."""
        body = None if document is None else json.dumps(document)
        return self.ask("POST", path, key, body, **headers, **{"Content-Type": "application/json"})

    def health(self):
        """Checks the health, with limits by the program itself: it waits at most 5 s."""
        if self.has_limits:
            command = [self.program, "health", "--url", self.base]
            subprocess.run(command, check=True, capture_output=True, text=True, timeout=PATIENCE)
        else:
            status, text = self.ask("GET", "/healthz")
            assert status == 200, text

    def submit(self):
        """Submits a job that is not cached, as a caller who does not attack."""
        scenario = SMALL | {"friction": 0.2 + next(self.numbers) / 1e5}
        status, text = self.post("/v1/jobs", self.bystander, {"scenario": scenario})
        assert status in (200, 202), text

    def recover(self, seconds):
        """Reads the large result whole. It may be refused for some seconds after an attack."""
        end = time.monotonic() + seconds
        status, text = self.ask("GET", self.large)
        while status == 503 and time.monotonic() < end:
            time.sleep(0.2)
            status, text = self.ask("GET", self.large)
        assert status == 200, f"the large result is answered {status}: {text}"

    def forget_peak(self):
        """Starts a new measurement of the peak memory."""
        pathlib.Path(f"/proc/{self.process.pid}/clear_refs").write_text("5")

    def peak(self):
        """The largest resident memory since then, in bytes; None if the server has died."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        # A dead process has no memory.
        found = re.search(r"VmHWM:\s+(\d+) kB", status)
        return found and int(found[1]) << 10

    def bound_memory(self):
        """Kills the server if it took too much memory, as a cgroup does."""
        peak = self.peak() or 0
        self.most = max(self.most, peak)
        if peak > MEMORY:
            self.process.kill()

    def stop(self):
        """Stops the server, and returns the errors that it logged."""
        self.process.terminate()
        self.process.wait(timeout=PATIENCE)
        self.process.stdout.close()
        with self.log:
            self.log.seek(0)
            return self.log.read()
