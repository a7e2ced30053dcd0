"""What the client sends and how it reads the answers, without a connection.

A flow is a generator. It yields a `Request` or a `Pause`, and receives an `Answer`. If the connection was lost, the driver
throws `Lost` into the flow. So the synchronous and the asynchronous client share everything but the loop that drives a flow.
"""

from __future__ import annotations

import json
import logging
import os
import pathlib
import time
import urllib.parse
import uuid
import zipfile
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

from . import api_types as api
from .errors import ApiError, InvalidRequest, JobFailed, ServerUnreachable, refusal
from .progress import Progress
from .results import Evaluation, Fit, Result, Run, Study
from .tables import Array
from .traces import Trace
from .values import plain

T = TypeVar("T")
# With quantities or arrays, a scenario is a dict of any type.
Scenario = api.Scenario | Mapping[str, Any]
Flow = Generator["Request | Pause", "Answer", T]
# Numbers to vary: values, a range such as {"from": 1, "to": 2, "count": 5}, or {"distribution": …}, by JSON pointer.
Vary = Mapping[str, Sequence[float | str] | Array | Mapping[str, Any]]

FINISHED = ("succeeded", "failed", "canceled")
# The members of which a job has one.
KINDS = ("scenario", "sweep", "sensitivity", "map", "fit")
# Answers after which the same request may succeed: too many requests, a proxy without a server, a server that starts or stops.
TEMPORARY = (429, 502, 503)
LONGEST_PAUSE = 5.0
# How long the client tries again, in seconds, if the server has never answered: it may be somewhere else.
FIRST_PATIENCE = 3.0
# These can be sent again after a lost connection, although nobody knows whether the server has received them.
REPEATABLE = ("GET", "HEAD", "PUT", "DELETE")
# Largest answer in bytes, also when it is decompressed. The largest result is smaller.
LARGEST = 1 << 28
# Longest line of a stream in bytes.
LONGEST_LINE = 1 << 24
# An answer may take the patience of the client, and longer if it arrives with so many bytes per second.
SLOWEST = 10_000
LOG = logging.getLogger("fretwork_client")


@dataclass(frozen=True)
class Request:
    """One request. `on_line` receives the lines of a stream until it returns True."""

    method: str
    path: str
    params: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    content: bytes | None = None
    on_line: Callable[[str], bool] | None = None


@dataclass(frozen=True)
class Pause:
    """The driver waits for this time."""

    seconds: float


@dataclass(frozen=True)
class Answer:
    """The answer to a request. The body of a stream is empty. `place` is the address of the server, for error texts."""

    status: int
    headers: Mapping[str, str]
    content: bytes
    place: str = ""

    def json(self) -> Any:
        """The JSON of the body."""
        try:
            return json.loads(self.content)
        except (ValueError, RecursionError):
            raise self.strange("JSON") from None

    def strange(self, expected: str) -> ApiError:
        """The exception for an answer that no server of fretwork gives."""
        said = self.content[:200].decode(errors="replace")
        detail = f"The answer of {self.place or 'the server'} is not {expected}. Check FRETWORK_URL. It begins with: {said!r}"
        return ApiError(self.status, detail, [])


class Body:
    """Collects the body of an answer. Refuses one that is too large or slow, or has an encoding that was not asked for."""

    def __init__(self, place: str, headers: Mapping[str, str], patience: float) -> None:
        self.place, self.content, self.done = place, bytearray(), False
        self.patience, self.began = max(patience, FIRST_PATIENCE), 0.0
        encoding = headers.get("content-encoding", "identity").strip().lower()
        if encoding not in ("gzip", "identity"):
            raise ApiError(0, f"The answer of {place} has the encoding {encoding[:40]!r}, which the client did not ask for", [])

    def add(self, part: bytes) -> None:
        """Adds the next bytes."""
        self.content += part
        self.check(part, f"The answer of {self.place}", LARGEST)

    def check(self, part: bytes, name: str, most: int) -> None:
        """Refuses more bytes, or too few in the time since the first of them, which is in `part` if there are no others."""
        count = len(self.content)
        if count <= len(part):
            self.began = time.monotonic()
        spent = time.monotonic() - self.began
        if count > most:
            raise ApiError(0, f"{name} has more than {most >> 20} MiB. Check FRETWORK_URL", [])
        if spent > self.patience + count / SLOWEST:
            raise ApiError(0, f"{name} has not ended after {spent:.0f} s. Check FRETWORK_URL, or raise `patience`", [])


class Lines(Body):
    """Hands the lines of a stream to a function until it returns True."""

    def __init__(self, place: str, headers: Mapping[str, str], patience: float, on_line: Callable[[str], bool]) -> None:
        super().__init__(place, headers, patience)
        self.on_line = on_line

    def add(self, part: bytes) -> None:
        """Reads the next bytes."""
        *lines, rest = (self.content + part).split(b"\n") if b"\n" in part else [self.content + part]
        self.content = rest
        self.check(part, f"A line of {self.place}", LONGEST_LINE)
        self.done = self.done or any(self.on_line(line.decode(errors="replace").rstrip("\r")) for line in lines)


class Lost(Exception):
    """The connection failed before the whole answer arrived. `is_new`: the server has never answered this client."""

    def __init__(self, reason: str, is_new: bool = False) -> None:
        super().__init__(reason)
        self.is_new = is_new


class Patience:
    """How long the client still tries again, in seconds, without the time of the requests themselves."""

    def __init__(self, seconds: float) -> None:
        self.whole = seconds
        self.renew()

    def renew(self) -> None:
        """The server has answered: the next failure is a new one."""
        self.go_on()
        self.tries, self.began = 0, self.heard

    def go_on(self) -> None:
        """The server does something, so the patience begins again. The pauses still grow."""
        self.left, self.heard = self.whole, time.monotonic()

    def pause(self, error: Exception, retry_after: str = "", is_new: bool = False, spent: float = 0.0) -> Pause:
        """The next pause: twice as long as the last one, or as the server asks. Raises the error if no patience is left.

        `spent` is the time of the request that failed. That of the first one does not count, so that there is a second one.
        """
        if self.tries > 0:
            self.left -= spent
        if is_new:
            self.left = min(self.left, FIRST_PATIENCE - (time.monotonic() - self.began))
        own = min(0.1 * 2.0 ** min(self.tries, 10), LONGEST_PAUSE)
        asked = float(retry_after) if retry_after.isdecimal() else 0.0
        if self.left <= 0 or asked > self.left:
            raise error
        self.tries += 1
        wanted = max(asked, min(own, self.left))
        self.left -= wanted
        return Pause(wanted)


def unreachable(reason: str) -> ServerUnreachable:
    """The exception when the client gives up."""
    return ServerUnreachable(f"{reason}. Check that the server runs, and the address in FRETWORK_URL.")


def attempt(request: Request, patience: Patience) -> Flow[Answer | None]:
    """Sends a request once. After a failure that may pass, pauses and returns None. Raises the `ApiError` of other failures."""
    began = time.monotonic()
    try:
        answer = yield request
    except Lost as lost:
        if "CERTIFICATE_VERIFY_FAILED" in str(lost):
            advice = "Name the certificates of your own authority in SSL_CERT_FILE."
            raise ServerUnreachable(f"The server is not trusted: {lost}. {advice}") from None
        spent, is_first = time.monotonic() - max(began, patience.heard), patience.tries == 0
        pause = patience.pause(unreachable(f"The server did not answer: {lost}"), is_new=lost.is_new, spent=spent)
        if is_first:
            LOG.warning("The server does not answer: %s. Trying again for %.0f s", lost, pause.seconds + patience.left)
        yield pause
        return None
    location = answer.headers.get("location", "")
    if answer.status < 300 or (answer.status == 303 and location.startswith("/v1/")):
        return answer
    error = refusal(answer.status, answer.content, location, answer.place)
    if answer.status not in TEMPORARY:
        raise error
    yield patience.pause(error, answer.headers.get("retry-after", ""))
    return None


def send(request: Request, seconds: float) -> Flow[Answer]:
    """The answer to a request that the server may receive twice."""
    patience = Patience(seconds)
    while True:
        answer = yield from attempt(request, patience)
        if answer is not None:
            return answer


def post(path: str, body: Mapping[str, Any], patience: float, **headers: str) -> Flow[Any]:
    """Sends JSON, and returns the JSON of the answer. The server must do the same if it receives this twice."""
    body = plain(body)
    named = {"content-type": "application/json"} | {name.replace("_", "-"): value for name, value in headers.items()}
    answer = yield from send(Request("POST", path, headers=named, content=json.dumps(body).encode()), patience)
    return answer.json()


def get(path: str, patience: float, **params: object) -> Flow[Answer]:
    """The answer to a request that changes nothing."""
    return (yield from send(Request("GET", path, _words(params)), patience))


@dataclass(frozen=True)
class Event:
    """An event of a job: `snapshot` (the data are the job), `state` or `progress`. The last one, a state, has the `job`."""

    name: str
    data: Mapping[str, Any]


class JobEvents:
    """Reads the server-sent events of a job: progress, and at the end the job itself. `notice` receives each event.

    `last_id` is the id of the last whole event.
    """

    def __init__(self, progress: Progress, patience: Patience, notice: Callable[[Event], object] = id) -> None:
        self.progress = progress
        self.patience = patience
        self.notice = notice
        self.began = time.monotonic()
        self.job: api.Job | None = None
        self.last_id = ""
        self._kind = self._id = ""
        self._most = 0.0

    def line(self, line: str) -> bool:
        """Reads a line. Returns True when the job has ended."""
        # A stream that ends at once, again and again, is asked for ever more seldom, and not for ever without progress.
        if time.monotonic() - self.began > LONGEST_PAUSE:
            self.patience.renew()
        name, _, value = line.partition(":")
        if name == "event":
            self._kind = value.strip()
        if name == "id":
            value = value.strip()
            self._id = value if value.isascii() and value.isdecimal() else ""
        if not line:
            # The whole event has arrived.
            self.last_id = self._id
        if name != "data":
            return False
        try:
            data = json.loads(value)
            progress = float(data.get("progress", 0))
            job = data if self._kind == "snapshot" else data.get("job")
            has_ended = bool(job) and _job(job)["state"] in FINISHED
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError, ApiError):
            detail = f"The server sent an event that it does not have: {value[:200]!r}. Check FRETWORK_URL"
            raise ApiError(200, detail, []) from None
        self.notice(Event(self._kind, data))
        if "progress" in data:
            self.progress.show(progress)
        if progress > self._most:
            self._most = progress
            self.patience.go_on()
        if has_ended:
            self.job = cast(api.Job, job)
        # The states follow the snapshot of a job that has ended.
        return has_ended and self._kind != "snapshot"


def finish(job: api.Job, progress: Progress, seconds: float) -> Flow[api.Job]:
    """Follows a job to its end."""
    if job["state"] in FINISHED:
        return job
    patience = Patience(seconds)
    return (yield from follow(job["id"], JobEvents(progress, patience)))


def follow(job_id: str, events: JobEvents) -> Flow[api.Job]:
    """Follows a job to its end. After a lost connection, the next stream begins after the last state that was received."""
    patience = events.patience
    while True:
        events.began = time.monotonic()
        headers = {"accept": "text/event-stream"} | ({"last-event-id": events.last_id} if events.last_id else {})
        stream = Request("GET", f"/v1/jobs/{_part(job_id)}/events", headers=headers, on_line=events.line)
        answer = yield from attempt(stream, patience)
        if events.job:
            return events.job
        if answer is not None:
            if answer.content:
                raise answer.strange("a stream of events")
            yield patience.pause(unreachable("The stream of events ended early"))


def submit(body: Mapping[str, Any], patience: float, wait: float = 1) -> Flow[api.Job]:
    """Submits a job once, however often the request is sent. Waits up to `wait` seconds for its end."""
    key = str(uuid.uuid4())
    job = yield from post("/v1/jobs", body, patience, idempotency_key=key, prefer=f"wait={wait:.0f}")
    return _job(job)


def _has_texts(value: Any, *names: str) -> bool:
    """Whether a value is an object with these texts."""
    return isinstance(value, dict) and all(isinstance(value.get(name), str) for name in names)


def _strange(expected: str, answer: Any) -> ApiError:
    """The exception for JSON that no server of fretwork answers."""
    said = str(answer)[:200]
    return ApiError(200, f"The server answered with something else than {expected}: {said!r}. Check FRETWORK_URL", [])


def _job(job: Any) -> api.Job:
    """The job of an answer."""
    if not _has_texts(job, "id", "state", "key") or (job.get("error") and not _has_texts(job["error"], "title", "detail")):
        raise _strange("a job", job)
    return cast(api.Job, job)


@dataclass(frozen=True)
class Operations:
    """The operations of both clients, as flows. `patience` is the time in seconds for tries after a failure."""

    patience: float
    show: Callable[[], Progress]

    def run(self, scenario: Scenario, *, label: str | None = None, tags: Sequence[str] = ()) -> Flow[Run]:
        """Computes a scenario, or reads its stored result."""
        return (yield from self._compute(Run, "scenario", scenario, label, tags))

    def submit(self, body: Scenario | api.JobBody, *, label: str | None = None, tags: Sequence[str] = ()) -> Flow[api.Job]:
        """Submits a scenario, or a job such as `{"sweep": …}`, and returns its job at once. `wait` returns the result."""
        words: dict[str, Any] = ({"label": label} if label else {}) | ({"tags": list(tags)} if tags else {})
        return (yield from submit(_task(body) | words, self.patience, wait=0))

    def job(self, job: api.Job | str) -> Flow[api.Job]:
        """The present state of a job, or of the job with this id."""
        return _job((yield from get(_of_job(job), self.patience)).json())

    def wait(self, job: api.Job | str) -> Flow[Run | Study]:
        """Waits for the end of a job, and returns its result. Raises `JobFailed` if it has none."""
        progress = self.show()
        try:
            ended = yield from finish((yield from self.job(job)), progress, self.patience)
        finally:
            progress.close()
        return (yield from self._stored(succeeded(ended)["key"], ended))

    def get(self, key: str) -> Flow[Run | Study]:
        """Reads a stored result."""
        return (yield from self._stored(key))

    def check(self, body: Scenario | api.JobBody) -> Flow[api.Checked]:
        """Checks a scenario or a job: its key, the unworn contact, warnings and the estimated time. Computes nothing."""
        checked = yield from post("/v1/scenarios", _task(body), self.patience)
        if not _has_texts(checked, "key"):
            raise _strange("a checked scenario", checked)
        return cast(api.Checked, checked)

    def note(self, result: Result | str, text: str | None = None) -> Flow[api.Note | None]:
        """The note of a result or of its key; None without a note. `text` replaces it first, and `""` deletes it."""
        path = f"{_of_result(result)}/note"
        if text:
            content = json.dumps({"text": text}).encode()
            yield from send(Request("PUT", path, headers={"content-type": "application/json"}, content=content), self.patience)
        elif text is not None:
            yield from send(Request("DELETE", path), self.patience)
        return (yield from self._entry(_of_result(result))).get("note")

    def pin(self, result: Result | str, pinned: bool = True) -> Flow[None]:
        """Pins a result, or its key, so that the server never evicts it. `pinned=False` ends this."""
        yield from send(Request("PUT" if pinned else "DELETE", f"{_of_result(result)}/pin"), self.patience)

    def report(self, result: Result | str, *beside: Result | str, units: str = "engineering") -> Flow[bytes]:
        """The report of a result, or a comparison with others, as one HTML file. `units` is `engineering` or `si`."""
        words = urllib.parse.urlencode([("units", units), *(("with", _key(other)) for other in beside)])
        return (yield from send(Request("GET", f"{_of_result(result)}/report?{words}"), self.patience)).content

    def plot(self, /, result: Result | str, **options: str | int) -> Flow[bytes]:
        """A figure of a result as SVG. `options` are the parameters of `plot.svg` in the API, such as `quantity="wear"`."""
        return (yield from get(f"{_of_result(result)}/plot.svg", self.patience, **options)).content

    def request(
        self, /, method: str, path: str, body: Any = None, *, headers: Mapping[str, str] | None = None, **params: str | int
    ) -> Flow[Any]:
        """Sends any request of the API. Returns the JSON of the answer, or its bytes; None if it is empty.

        `body` is JSON, or bytes. `params` are the parameters after `?`. After a lost connection, a POST or PATCH is sent again
        only if `headers` have an `Idempotency-Key`. If the answer redirects to another path of the server, this is read.
        """
        named = {name.lower(): value for name, value in (headers or {}).items()}
        content = body if isinstance(body, bytes | None) else json.dumps(plain(body)).encode()
        kind = "application/octet-stream" if isinstance(body, bytes) else "application/json"
        named = ({} if content is None else {"content-type": kind}) | named
        is_repeatable = method in REPEATABLE or "idempotency-key" in named
        wanted = Request(method, path, _words(params), named, content)
        answer = yield from send(wanted, self.patience if is_repeatable else 0.0)
        if answer.status == 303:
            answer = yield from get(answer.headers["location"], self.patience)
        is_json = answer.headers.get("content-type", "").partition(";")[0].endswith("json")
        return answer.json() if is_json and answer.content else answer.content or None

    def evaluate(self, scenario: Scenario, outputs: Sequence[str]) -> Flow[Evaluation]:
        """Computes some outputs of a short run, such as `wear_depth@10000`. The server stores nothing."""
        body = {"scenario": scenario, "outputs": list(outputs)}
        answer: Any = yield from post("/v1/evaluate", body, self.patience)
        parts = [answer.get(name, {}) for name in ("outputs", "units", "reasons")] if isinstance(answer, dict) else []
        if not parts or not parts[0] or not all(isinstance(part, dict) for part in parts):
            raise _strange("outputs", answer)
        return Evaluation(*parts)

    def sweep(
        self,
        /,
        scenario: Scenario,
        vary: Vary,
        outputs: Sequence[str],
        *,
        label: str | None = None,
        tags: Sequence[str] = (),
        **options: Any,
    ) -> Flow[Study]:
        """Computes outputs for many values of some numbers. `options` are `design`, `samples`, `seed` and `profiles`.

        `vary` has, for the JSON pointer of each number, its values, or a range such as `{"from": 1, "to": 2, "count": 5}`.
        """
        body = {"scenario": scenario, "vary": _varied(vary), "outputs": list(outputs), **options}
        return (yield from self._compute(Study, "sweep", body, label, tags))

    def sensitivity(
        self,
        /,
        scenario: Scenario,
        vary: Vary | Sequence[str],
        outputs: Sequence[str],
        *,
        method: str = "sobol",
        label: str | None = None,
        tags: Sequence[str] = (),
        **options: Any,
    ) -> Flow[Study]:
        """Says how strongly each number changes each output. `method` is `sobol`, `morris` or `local`.

        For `local`, `vary` may be a list of pointers. `options` are `samples`, `seed` and `confidence`.
        """
        body = {"scenario": scenario, "vary": _varied(vary), "outputs": list(outputs), "method": method, **options}
        return (yield from self._compute(Study, "sensitivity", body, label, tags))

    def map(
        self,
        scenario: Scenario,
        normal_force: api.Axis,
        amplitude: api.Axis,
        outputs: Sequence[str] = (),
        *,
        label: str | None = None,
        tags: Sequence[str] = (),
    ) -> Flow[Study]:
        """Computes the slip regime for many normal forces and amplitudes."""
        body: dict[str, Any] = {"scenario": scenario, "normal_force": normal_force, "amplitude": amplitude}
        if outputs:
            body["outputs"] = list(outputs)
        return (yield from self._compute(Study, "map", body, label, tags))

    def fit(
        self,
        /,
        scenario: Scenario,
        parameters: Mapping[str, Mapping[str, Any]] | Sequence[api.FitParameter],
        tests: Sequence[api.FitTest],
        *,
        label: str | None = None,
        tags: Sequence[str] = (),
        **options: Any,
    ) -> Flow[Fit]:
        """Estimates numbers of a scenario from measurements.

        `parameters` has a range for each JSON pointer, or is the list of the API. `tests` and `options` are those of a
        fit in the API.
        """
        body = {"scenario": scenario, "parameters": _varied(parameters), "tests": list(tests), **options}
        return (yield from self._compute(Fit, "fit", body, label, tags))

    def example(self, name: str) -> Flow[api.JobBody]:
        """One of the examples of the server, such as `steel-ball`."""
        body = (yield from get(f"/v1/examples/{_part(name)}", self.patience)).json()
        if not isinstance(body, dict) or not any(isinstance(body.get(kind), dict) for kind in KINDS):
            raise _strange("an example", body)
        return cast(api.JobBody, body)

    def jobs(self, /, **search: str | int) -> Flow[list[api.Job]]:
        """Jobs, the newest first. `search` has parameters of `GET /v1/jobs`, such as `state="running"` or `limit=200`."""
        return cast(list[api.Job], _listed((yield from get("/v1/jobs", self.patience, **search)), "jobs"))

    def results(self, /, **search: str | int) -> Flow[list[api.ResultEntry]]:
        """Stored results. `search` has parameters of `GET /v1/results`, such as `wear_depth="..2um"` or `shape="cone"`."""
        return cast(list[api.ResultEntry], _listed((yield from get("/v1/results", self.patience, **search)), "results"))

    def cancel(self, job_id: api.Job | str) -> Flow[api.Job]:
        """Cancels a job, or the job with this id. Its run stops if no other job needs it."""
        return _job((yield from post(f"{_of_job(job_id)}/cancel", {}, self.patience)))

    def derivatives(self, run: Run | str, outputs: Sequence[str], parameters: Sequence[str]) -> Flow[list[api.Derivative]]:
        """Derivatives of the outputs of a run, or of its key, with respect to numbers of its scenario (JSON pointers)."""
        path = f"{_of_result(run)}/derivatives"
        names = {"outputs": ",".join(outputs), "parameters": ",".join(parameters)}
        return cast(list[api.Derivative], _listed((yield from get(path, self.patience, **names)), "derivatives"))

    def measurements(self, /, file: str | os.PathLike[str] | Trace, **options: str | int) -> Flow[api.Measured]:
        """Reads a file of measured numbers, or a trace of `read_trace`.

        `options` are the parameters of `POST /v1/measurements`, such as `x` and `y`. For a trace, `prepare` is `trace`.
        """
        if isinstance(file, Trace):
            content, options = file.text().encode(), {"prepare": "trace", **options}
        else:
            content = pathlib.Path(file).read_bytes()
        headers = {"content-type": "application/octet-stream"}
        request = Request("POST", "/v1/measurements", _words(options), headers, content)
        found = (yield from send(request, self.patience)).json()
        lists = [found.get(name) for name in ("columns", "notes", "tables")] if isinstance(found, dict) else [None]
        if not all(isinstance(part, list) for part in lists) or "prepared" not in found:
            raise _strange("measured numbers", found)
        return cast(api.Measured, found)

    def _compute(self, kind: type[ResultT], name: str, body: Any, label: str | None, tags: Sequence[str]) -> Flow[ResultT]:
        submission: dict[str, Any] = {name: body, "tags": list(tags)} | ({"label": label} if label else {})
        progress = self.show()
        try:
            job = yield from submit(submission, self.patience)
            job = yield from finish(job, progress, self.patience)
        finally:
            progress.close()
        return (yield from self._read(kind, succeeded(job), job["warnings"]))

    def _entry(self, path: str) -> Flow[api.ResultEntry]:
        """What the lists say about a result."""
        entry = (yield from get(f"{path}/about", self.patience)).json()
        if not _has_texts(entry, "key"):
            raise _strange("an entry of a result", entry)
        return cast(api.ResultEntry, entry)

    def _stored(self, key: str, job: api.Job | None = None) -> Flow[Run | Study]:
        """Reads a result of any kind, that of a job or of no job that is known."""
        path = _of_result(key)
        entry = yield from self._entry(path)
        said = (yield from get(f"{path}/warnings", self.patience)).json()
        warnings = said.get("warnings") if isinstance(said, dict) else None
        kinds: dict[str | None, type[Run | Study]] = {"run": Run, "fit": Fit}
        return (yield from self._read(kinds.get(entry.get("kind"), Study), job or entry, warnings or []))

    def _read(self, kind: type[ResultT], about: api.Job | api.ResultEntry, warnings: Sequence[api.Warning]) -> Flow[ResultT]:
        path = _of_result(about["key"])
        answer = yield from get(path, self.patience, format="npz")
        picture = yield from self._picture(path)
        try:
            return kind.read(about, warnings, answer.content, picture)
        except (ValueError, KeyError, TypeError, OSError, MemoryError, zipfile.BadZipFile):
            raise answer.strange("a result") from None

    def _picture(self, path: str) -> Flow[bytes | None]:
        """The figure of a result as SVG; None if the server has no figure for it."""
        try:
            return (yield from get(f"{path}/plot.svg", self.patience, width="560", height="360")).content
        except InvalidRequest:
            return None


ResultT = TypeVar("ResultT", bound=Result)


def succeeded(job: api.Job) -> api.Job:
    """The job, if it has a result."""
    if job["state"] != "succeeded":
        raise JobFailed(job)
    return job


def _task(body: Mapping[str, Any]) -> dict[str, Any]:
    """A job. A scenario alone becomes one, as on the command line."""
    return dict(body) if any(kind in body for kind in KINDS) else {"scenario": body}


def _key(result: Result | str) -> str:
    return result if isinstance(result, str) else result.key


def _of_result(result: Result | str) -> str:
    """The path of a result."""
    return f"/v1/results/{_part(_key(result))}"


def _of_job(job: api.Job | str) -> str:
    """The path of a job."""
    return f"/v1/jobs/{_part(job if isinstance(job, str) else job['id'])}"


def _listed(answer: Answer, name: str) -> list[Any]:
    """The list of an answer."""
    page = answer.json()
    if isinstance(page, dict) and isinstance(page.get(name), list):
        return cast(list[Any], page[name])
    raise answer.strange(f"a list of {name}")


def _part(name: str) -> str:
    """A part of a path. A name cannot lead to another path."""
    return urllib.parse.quote(name, safe="").replace(".", "%2E")


def _words(params: Mapping[str, object]) -> dict[str, str]:
    """Parameters as the API writes them: `true`, not `True`."""
    return {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in params.items()}


def _varied(vary: Mapping[str, Any] | Sequence[str] | Sequence[api.FitParameter]) -> list[dict[str, Any]]:
    """The entries of `vary` or `parameters` in the API."""
    if not isinstance(vary, Mapping):
        return [{"pointer": entry} if isinstance(entry, str) else dict(entry) for entry in vary]
    return [
        {"pointer": pointer} | (dict(values) if isinstance(values, Mapping) else {"values": list(values)})
        for pointer, values in vary.items()
    ]
