"""The mixed load of a soak: users who submit, read, follow, cancel and delete as fast as the server lets them.

Each process of users has one loopback address, so it is one owner of jobs. A user checks each answer: its status must be one
that the request allows, or 429 or 503 with `Retry-After`.
"""

import collections
import http.client
import itertools
import json
import multiprocessing
import os
import random
import threading
import time
import traceback

from programs import Client, submission

PROCESSES, USERS = 2, 12
# Seconds after which a job may have been deleted by the upkeep of the server, long before --keep-jobs.
YOUNG = 10
# Seconds that a refused user pauses. Less than `Retry-After`, because the server must be saturated.
PAUSE = 0.05
# How many jobs, bodies and results a process of users remembers.
REMEMBERED = 500
MOST_FAULTS = 20
FRICTION = {"pointer": "/friction", "from": 0.3, "to": 0.7}
AMPLITUDE = {"pointer": "/motion/amplitude", "from": "1 um", "to": "2 um"}
QUICK = {"profiles_at": "none", "model": {"method": "simplified", "points": 32}, "cycles": [1000]}
PARTS = ["", "/history", "/profiles", "/loops"]
# The last one takes a tenth of a second, so that the workers always have more to do than they can.
MODELS = [{"method": "simplified", "points": 256}, {"method": "exact"}, {"method": "exact", "tolerance": 1e-4}]
FORMATS = ["json", "npz"], ["json", "csv", "ndjson", "arrow"]
SEARCHES = ["", "?kind=sweep", "?friction=0.3..0.5&sort=wear_depth", "?method=exact&sort=-wear_volume&limit=20",
            "?evicted=true", "?note=soak", "?friction=2.."]
LISTS = ["", "?state=queued", "?state=failed", "?label=soak&limit=10", "?tag=study"]


class Report:
    """What the users of a process have seen."""

    def __init__(self):
        # Acknowledged jobs with the time of the answer, and those that may have been deleted.
        self.jobs, self.deleted = {}, set()
        self.statuses, self.faults = collections.Counter(), []

    def fault(self, text):
        """Notes a fault. The first ones tell enough."""
        if len(self.faults) < MOST_FAULTS:
            self.faults.append(text)


class Shared:
    """What the users of one process know together."""

    def __init__(self, report):
        self.report = report
        self.recent = collections.deque(maxlen=REMEMBERED)
        self.bodies = collections.deque(maxlen=REMEMBERED)
        self.results = collections.deque(maxlen=REMEMBERED)
        self.keys = itertools.count()


class User:
    """A user with a connection."""

    def __init__(self, number, port, source, shared):
        self.random = random.Random(number)
        self.client = Client(port, source)
        self.shared, self.report = shared, shared.report
        self.name = number
        self.action = ""

    def work(self, ended):
        """Does one thing after the other until the end."""
        actions, weights = zip(*ACTIONS.items())
        while not ended.is_set():
            action = self.random.choices(actions, weights)[0]
            self.action = action.__name__
            try:
                action(self)
            except (OSError, http.client.HTTPException, ValueError, KeyError, AssertionError) as error:
                self.client.close()
                place = traceback.extract_tb(error.__traceback__)[-1]
                self.report.fault(f"{self.action}: {error!r} in line {place.lineno} of {place.filename}")
                ended.wait(PAUSE)
        self.client.close()

    def ask(self, allowed, method, path, body=None, **headers):
        """Sends a request and checks the status. Returns it with headers and body; it is None if the request was refused."""
        answer, text = self.client.ask(method, path, body, **headers)
        is_accepted = self.accepts(allowed, answer, f"{method} {path}: {text[:300]}")
        return answer.status if is_accepted else None, answer, text

    def accepts(self, allowed, answer, said):
        """Whether the request was done. Notes a fault if it was answered with a status that it does not allow."""
        status = answer.status
        self.report.statuses[self.action, status] += 1
        if status in (429, 503) and answer.getheader("retry-after"):
            time.sleep(PAUSE)
            return False
        if status not in allowed:
            self.report.fault(f"{self.action}: {status}, {said}")
        return status in allowed

    def submit(self, body, **headers):
        """Submits a job. Returns it, or None if it was refused."""
        status, _, text = self.ask((200, 202), "POST", "/v1/jobs", body, **headers)
        if status is None:
            return None
        job = json.loads(text)
        self.report.jobs[job["id"]] = time.time()
        self.shared.recent.append(job)
        if job["state"] == "succeeded":
            self.note_result(job)
        return job

    def note_result(self, job):
        kind = "study" if "study" in job["tags"] else "run"
        self.shared.results.append((job["key"], kind))

    def some(self, remembered):
        """One of the things that are remembered; None at the beginning."""
        try:
            return self.random.choice(remembered)
        except IndexError:
            return None

    def may_be_missing(self, job):
        """The statuses with which a job may be missing: none while it is young and no user has deleted it."""
        age = time.time() - self.report.jobs[job["id"]]
        return (404,) if age > YOUNG or job["id"] in self.report.deleted else ()

    def number(self, low, high):
        return round(self.random.uniform(low, high), 9)

    # Submissions.

    def run(self):
        """A new run of one of both methods, with or without profiles."""
        scenario = {
            "friction": self.number(0.4, 0.9),
            "model": self.random.choice(MODELS),
            "load": {"normal_force": "100 N", "held": "force"},
            "profiles_at": self.random.choice(["none", "none", "last", "all"]),
        }
        body = submission(scenario, label="soak", tags=["run", self.random.choice("abc")])
        self.shared.bodies.append(body)
        waits = {"Prefer": "wait=2"} if self.random.random() < 0.5 else {}
        self.submit(body, Priority=f"u={self.random.randrange(8)}", **waits)

    def repeat(self):
        """A known scenario: its result is cached, or its run is joined, or it was evicted and is computed again."""
        if body := self.some(self.shared.bodies):
            self.submit(body, Prefer="wait=2")

    def recompute(self):
        """A known scenario that is computed again. Equal scenarios must have equal bytes."""
        if body := self.some(self.shared.bodies):
            job = self.submit(body, Prefer="wait=5", Cache_Control="no-cache")
            assert not job or job["recomputed"] in (None, "same", "replaced"), job

    def repeat_request(self):
        """A submission that is sent twice with an idempotency key is one job."""
        key = f"\"{self.name}-{next(self.shared.keys)}\""
        body = submission(QUICK | {"friction": self.number(0.4, 0.9)}, label="soak")
        first, second = (self.submit(body, Idempotency_Key=key) for _ in range(2))
        assert not first or not second or first["id"] == second["id"], (first, second)

    def leave(self):
        """A client that goes before it has its answer. Its job may exist."""
        body = json.dumps(submission(QUICK | {"friction": self.number(0.4, 0.9)})).encode()
        self.client.connect()
        headers = {"Content-Type": "application/json", "Prefer": "wait=10"}
        self.client.connection.request("POST", "/v1/jobs", body, headers)
        time.sleep(self.random.choice([0, 0.01, 0.1]))
        self.client.close()

    def study(self):
        """A sweep, a map or sensitivities. A sweep may have profiles."""
        scenario = submission(QUICK)["scenario"]
        vary = [FRICTION | {"to": self.number(0.6, 0.9)}, AMPLITUDE]
        # The largest are several chunks.
        samples = self.random.choice([64, 4096, 16_384])
        sweep = {"scenario": scenario, "vary": vary, "design": "sobol", "samples": samples, "outputs": ["wear_volume"]}
        radii = {"from": 0, "to": "150 um", "count": 31}
        curves = {"samples": 512, "profiles": {"radius": radii, "fields": ["wear", "pressure"]}}
        count = {"count": 24, "spacing": "log"}
        body = self.random.choice([
            {"sweep": sweep},
            {"sweep": sweep | curves},
            {"sensitivity": {"scenario": scenario, "vary": vary, "method": "sobol", "samples": 64,
                             "outputs": ["wear_depth"]}},
            {"map": {"scenario": scenario | {"friction": self.number(0.4, 0.9)},
                     "normal_force": {"from": "1 N", "to": "1 kN"} | count,
                     "amplitude": {"from": "0.1 um", "to": "20 um"} | count, "outputs": ["wear_volume"]}},
        ])
        self.submit(body | {"label": "soak", "tags": ["study"]}, Prefer="wait=1")

    # Answers at once.

    def evaluate(self):
        scenario = submission(QUICK | {"friction": self.number(0.4, 0.9)})["scenario"]
        outputs = {"outputs": ["wear_volume", "limit.wear_volume"]}
        self.ask((200,), "POST", "/v1/evaluate", {"scenario": scenario} | outputs)

    def check_scenario(self):
        self.ask((200,), "POST", "/v1/scenarios", submission({"friction": self.number(0.4, 0.9)}))

    # Jobs.

    def list_jobs(self):
        self.ask((200,), "GET", "/v1/jobs" + self.random.choice(LISTS))

    def look(self):
        """Waits a moment for a job."""
        if job := self.some(self.shared.recent):
            allowed = (200, *self.may_be_missing(job))
            status, _, text = self.ask(allowed, "GET", f"/v1/jobs/{job['id']}?wait={self.random.choice([0, 1])}")
            if status == 200:
                found = json.loads(text)
                assert found["state"] != "failed", found
                if found["state"] == "succeeded":
                    self.note_result(found)

    def follow(self):
        """Follows a job to its end, or leaves before."""
        if not (job := self.some(self.shared.recent)):
            return
        allowed = (200, 204, *self.may_be_missing(job))
        answer = self.client.open("GET", f"/v1/jobs/{job['id']}/events")
        if self.accepts(allowed, answer, "events") and answer.status == 200:
            until = time.time() + self.random.choice([0, 1, 5])
            while time.time() < until and answer.readline():
                pass
            self.client.close()
        else:
            answer.read()

    def cancel(self):
        if job := self.some(self.shared.recent):
            self.ask((200, *self.may_be_missing(job)), "POST", f"/v1/jobs/{job['id']}/cancel")

    def cancel_all(self):
        """Cancels all queued jobs of this owner with a tag."""
        owner = f"&owner={self.client.source}"
        self.ask((200,), "POST", f"/v1/jobs/cancel?state=queued&tag={self.random.choice('abc')}{owner}")

    def delete(self):
        """Deletes a job, unless it is unfinished."""
        if job := self.some(self.shared.recent):
            # The answer may come after another user has looked for the job.
            self.report.deleted.add(job["id"])
            self.ask((204, 404, 409), "DELETE", f"/v1/jobs/{job['id']}")

    # Results.

    def read(self):
        """A result or a part of it, in one of its formats."""
        if not (found := self.some(self.shared.results)):
            return
        key, kind = found
        part = self.random.choice(["", "/table"] if kind == "study" else PARTS)
        form = self.random.choice(FORMATS[1 if part else 0])
        coding = self.random.choice(["identity", "gzip", "zstd"])
        path = f"/v1/results/{key}{part}?format={form}"
        # A run without profiles has no such part, and an old result may be forgotten.
        status, answer, _ = self.ask((200, 404, 410), "GET", path, Accept_Encoding=coding)
        if status == 200:
            tag = answer.getheader("etag")
            self.ask((304, 404, 410), "GET", path, Accept_Encoding=coding, If_None_Match=tag)

    def figure(self):
        if found := self.some(self.shared.results):
            query = "" if found[1] == "study" else "?quantity=wear_volume"
            # Fretting maps and sweeps are drawn, sensitivities too; a part may be missing.
            self.ask((200, 404, 410), "GET", f"/v1/results/{found[0]}/plot.svg{query}")

    def search(self):
        self.ask((200,), "GET", "/v1/results" + self.random.choice(SEARCHES))

    def provenance(self):
        if found := self.some(self.shared.results):
            self.ask((200, 404), "GET", f"/v1/results/{found[0]}/provenance")

    def annotate(self):
        """Writes a note, and pins and unpins the result."""
        if found := self.some(self.shared.results):
            path = f"/v1/results/{found[0]}"
            self.ask((204, 403, 404, 410), "PUT", f"{path}/note", {"text": "soak"})
            self.ask((204, 404, 410), "PUT", f"{path}/pin")
            # If this is refused, the result stays pinned, so it is tried again.
            while self.ask((204, 403, 404, 410), "DELETE", f"{path}/pin")[0] is None:
                pass

    def remove(self):
        """Deletes a result. The next submission of its scenario computes it again."""
        if found := self.some(self.shared.results):
            self.ask((204, 404, 409, 410), "DELETE", f"/v1/results/{found[0]}")

    def compare(self):
        one, other = self.some(self.shared.results), self.some(self.shared.results)
        if one and other and one[1] == other[1] == "run":
            self.ask((200, 404, 410), "POST", "/v1/results/diff", {"keys": [one[0], other[0]]})

    def measure(self):
        self.ask((200,), "GET", self.random.choice(["/metrics", "/healthz", "/version"]))


# How often users do each thing.
ACTIONS = {
    User.run: 30, User.repeat: 12, User.recompute: 2, User.repeat_request: 3, User.leave: 2, User.study: 3,
    User.evaluate: 6, User.check_scenario: 2,
    User.list_jobs: 3, User.look: 8, User.follow: 4, User.cancel: 4, User.cancel_all: 0.2, User.delete: 5,
    User.read: 10, User.figure: 2, User.search: 2, User.provenance: 2, User.annotate: 1, User.remove: 1,
    User.compare: 1, User.measure: 1,
}


def work(number, port, ended, pipe):
    """One process of users."""
    # The server and the probes come first.
    os.nice(5)
    report = Report()
    shared = Shared(report)
    source = f"127.0.0.{10 + number}"
    users = [User(number * USERS + user, port, source, shared) for user in range(USERS)]
    threads = [threading.Thread(target=user.work, args=(ended,)) for user in users]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    pipe.send(report)


class Load:
    """All processes of users. They start at once."""

    def __init__(self, port):
        context = multiprocessing.get_context("fork")
        self.ended = context.Event()
        self.processes, self.pipes = [], []
        for number in range(PROCESSES):
            ours, theirs = context.Pipe()
            process = context.Process(target=work, args=(number, port, self.ended, theirs))
            process.start()
            theirs.close()
            self.processes.append(process)
            self.pipes.append(ours)

    def is_alive(self):
        """Whether all processes of users live."""
        return all(process.is_alive() for process in self.processes)

    def stop(self):
        """Ends the load. Returns what the users have seen."""
        self.ended.set()
        whole = Report()
        for process, pipe in zip(self.processes, self.pipes):
            try:
                report = pipe.recv()
            except EOFError:
                whole.fault("a process of users has died")
                continue
            process.join()
            whole.jobs |= report.jobs
            whole.deleted |= report.deleted
            whole.statuses += report.statuses
            whole.faults += report.faults
        return whole
