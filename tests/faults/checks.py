"""What must hold after every fault, on either database: a client that keeps what the server has acknowledged, and compares."""

import http.client
import json
import pathlib
import subprocess
import sys
import time
import uuid

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from programs import BALL, PATIENCE, Client, submission

# What a server may answer after a fault.
ALLOWED = {"busy", "disk-full", "not-ready", "draining"}
# A study of several chunks, and a run that a worker computes.
STUDY = {"sweep": {
    "scenario": BALL | {"model": {"method": "exact", "points": 256}, "cycles": [1000, 10000]},
    "vary": [{"pointer": "/friction", "from": 0.6, "to": 0.8, "count": 24}],
    "outputs": ["wear_volume"],
}}


class Violation(Exception):
    """A promise that the server did not keep."""


def require(holds, what):
    """Fails with what is wrong."""
    if not holds:
        raise Violation(what)


def finished(job):
    return job["state"] in ("succeeded", "failed", "canceled")


class Submitter:
    """Submits one job, again and again with one idempotency key, to servers of one database."""

    allowed = ALLOWED
    # A wait for the end of the job, where each request would meet faults.
    wait = ""

    def __init__(self, body, expected, headers=None):
        # The label finds all jobs of this submitter.
        self.label = str(uuid.uuid4())
        self.body, self.headers = body | {"label": self.label}, {"Idempotency_Key": self.label, **(headers or {})}
        # The bytes of results by their keys, which an undisturbed server has computed.
        self.expected = expected
        # The acknowledged job.
        self.id = None

    def ask(self, server, method, path, body=None, **headers):
        """The status and the document of an answer; `None` if none came."""
        client = Client(server.port)
        try:
            answer, text = client.ask(method, path, body, **headers)
        except (OSError, http.client.HTTPException) as error:
            try:
                server.process.wait(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                raise Violation(f"{method} {path}: {error!r}, although the server lives") from None
            return None, None
        finally:
            client.close()
        if answer.status >= 500:
            kind = json.loads(text)["type"].rsplit("/", 1)[1]
            require(kind in self.allowed, f"{method} {path} answers {answer.status} {kind}")
        return answer.status, text

    def submit(self, server):
        """Submits the job. Returns the job if the server has acknowledged it."""
        status, text = self.ask(server, "POST", "/v1/jobs", self.body, **self.headers)
        if status is None or status >= 500:
            return None
        require(status in (200, 202), f"POST answers {status} {text}")
        job = json.loads(text)
        require(self.id in (None, job["id"]), f"POST with the same idempotency key makes {job['id']} after {self.id}")
        self.id = job["id"]
        return job

    def follow(self, server, look=lambda: None):
        """Waits until the job has ended or the server. Calls `look` meanwhile."""
        begun = time.monotonic()
        while server.process.poll() is None:
            look()
            status, text = self.ask(server, "GET", f"/v1/jobs/{self.id}{self.wait}")
            require(status != 404, f"the acknowledged job {self.id} is lost")
            if status == 200 and finished(json.loads(text)):
                return json.loads(text)
            require(time.monotonic() - begun < PATIENCE, f"the job does not end: {status} {text}")
            time.sleep(0.02)
        return None

    def repeat(self, server):
        """Submits until the server acknowledges the job. After a fault, it may refuse for a while."""
        begun = time.monotonic()
        while not (job := self.submit(server)):
            require(server.process.poll() is None, f"the server has ended: {server.log.read_text()[-500:]}")
            require(time.monotonic() - begun < PATIENCE, "the server does not accept jobs any more")
            time.sleep(0.1)
        return job

    def verify(self, server):
        """Nothing acknowledged is lost: there is one job, and it gets its result, without a fault of its own."""
        self.repeat(server)
        job = self.follow(server)
        require(job, f"the server has ended: {server.log.read_text()[-500:]}")
        require(job["state"] == "succeeded", f"the job did not succeed: {job}")
        status, text = self.ask(server, "GET", f"/v1/jobs?label={self.label}")
        require(status == 200, f"the list of jobs answers {status} {text}")
        found = [job["id"] for job in json.loads(text)["jobs"]]
        require(found == [self.id], f"one idempotency key made the jobs {found}")
        self.compare(server, job["key"])

    def compare(self, server, key):
        """A result has the bytes that an undisturbed server has computed. The first such server tells them."""
        status, text = self.ask(server, "GET", f"/v1/results/{key}")
        require(status == 200, f"the result {key} answers {status} {text[:300]}")
        require(self.expected.setdefault(key, text) == text, f"the result {key} has other bytes")
