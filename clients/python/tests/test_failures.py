"""Lost connections, killed servers and busy servers."""

import asyncio
import http.server
import json
import pathlib
import ssl
import subprocess
import threading
from collections.abc import Callable, Iterator
from typing import cast

import httpx
import pytest
from conftest import KEY, PATIENCE, Server

from fretwork_client import ApiError, AsyncClient, Client, Event, JobFailed, ServerUnreachable
from fretwork_client.api_types import Job, Scenario
from fretwork_client.flows import Answer, Flow, Lost, Operations, Pause, Request, finish, send
from fretwork_client.progress import Silent


@pytest.fixture
def own(tmp_path: pathlib.Path) -> Iterator[Server]:
    """A server that the test may kill."""
    server = Server(tmp_path / "data", "")
    yield server
    server.kill()


# Evaluations per minute of a server that refuses the next one. So few that the server cannot permit it before all are sent.
EVALUATIONS = 6


def long_sweep(ball: Scenario) -> tuple[Scenario, dict[str, list[float | str]], list[str]]:
    """A sweep that takes some seconds."""
    return (
        {**ball, "cycles": [100000], "model": {"method": "exact", "tolerance": 0.0005}},
        {"/friction": [0.6 + i / 10000 for i in range(1000)]},
        ["wear_volume"],
    )


def jobs(server: Server) -> list[str]:
    """The ids of all jobs of a server."""
    return [job["id"] for job in httpx.get(f"{server.url}/v1/jobs", trust_env=False).json()["jobs"]]


def test_a_sweep_survives_a_killed_server(own: Server, ball: Scenario) -> None:
    kills: list[float] = []

    def kill_once(part: float) -> None:
        if 0 < part < 1 and not kills:
            kills.append(part)
            own.kill()
            own.start()

    with own.client(progress=kill_once) as client:
        study = client.sweep(*long_sweep(ball))
    assert kills
    assert len(study.table["wear_volume"]) == 1000
    assert (study.table["reason"] == "").all()
    assert jobs(own) == [study.job["id"]]


def test_an_asynchronous_sweep_survives_a_killed_server(own: Server, ball: Scenario) -> None:
    async def sweep() -> str:
        killed = asyncio.Event()
        async with AsyncClient(own.url, "", trust_env=False, progress=lambda _: killed.set()) as client:
            task = asyncio.create_task(client.sweep(*long_sweep(ball)))
            await asyncio.wait_for(killed.wait(), PATIENCE)
            own.kill()
            await asyncio.sleep(0.3)
            own.start()
            return (await task).job["id"]

    found = asyncio.run(sweep())
    assert jobs(own) == [found]


def test_a_job_that_is_sent_twice_is_one_job(own: Server, ball: Scenario) -> None:
    class Forgetful(httpx.HTTPTransport):
        """Loses the answer to the first submission."""

        posts = 0

        def handle_request(self, request: httpx.Request) -> httpx.Response:
            answer = super().handle_request(request)
            self.posts += request.method == "POST"
            if request.method == "POST" and self.posts == 1:
                answer.read()
                raise httpx.ReadError("the connection was reset")
            return answer

    transport = Forgetful()
    with own.client(transport=transport) as client:
        run = client.run(ball)
    assert transport.posts == 2
    assert jobs(own) == [run.job["id"]]


def test_a_canceled_job_is_an_error(own: Server, ball: Scenario) -> None:
    def cancel(_: float) -> None:
        httpx.post(f"{own.url}/v1/jobs/cancel?state=running", trust_env=False).raise_for_status()

    with own.client(progress=cancel) as client, pytest.raises(JobFailed, match="canceled"):
        client.sweep(*long_sweep(ball))


def test_without_a_server_the_client_says_what_to_check(ball: Scenario) -> None:
    with (
        Client("http://127.0.0.1:9", "", patience=0.2, trust_env=False) as client,
        pytest.raises(ServerUnreachable, match="FRETWORK_URL"),
    ):
        client.run(ball)


def test_a_busy_server_delays_runs_and_evaluations(tmp_path: pathlib.Path, ball: Scenario) -> None:
    refused: list[int] = []

    async def compute(server: Server) -> None:
        is_busy, is_full = asyncio.Event(), asyncio.Event()

        async def note(response: httpx.Response) -> None:
            refused.append(response.status_code)
            if response.status_code == 503:
                is_full.set()

        hooks = {"response": [note]}
        busy = AsyncClient(server.url, KEY, trust_env=False, progress=lambda _: is_busy.set())
        async with busy, AsyncClient(server.url, KEY, trust_env=False, event_hooks=hooks) as client:
            # The only worker computes a long sweep until the queue is full.
            long = asyncio.create_task(busy.sweep(*long_sweep(ball)))
            await asyncio.wait_for(is_busy.wait(), PATIENCE)
            sweeps = [client.sweep(ball, {"/friction": [0.6, 0.7 + i / 100]}, ["wear_depth"]) for i in range(8)]
            evaluations = [client.evaluate(ball, ["wear_depth"]) for _ in range(EVALUATIONS + 1)]
            done = asyncio.gather(*sweeps, *evaluations)
            await asyncio.wait_for(is_full.wait(), PATIENCE)
            cancel = httpx.post(
                f"{server.url}/v1/jobs/cancel?state=running", headers={"Authorization": f"Bearer {KEY}"}, trust_env=False
            )
            assert cancel.is_success
            with pytest.raises(JobFailed):
                await long
            assert len(await done) == len(sweeps) + len(evaluations)

    settings = {"FRETWORK_EVALUATE_RATE": str(EVALUATIONS), "FRETWORK_QUEUE_LIMIT": "1", "FRETWORK_WORKERS": "1"}
    server = Server(tmp_path / "data", KEY, **settings)
    try:
        asyncio.run(compute(server))
    finally:
        server.kill()
    assert {429, 503} <= set(refused) <= {200, 202, 429, 503}


def answers(status: int, **headers: str) -> Answer:
    body = json.dumps({"detail": f"status {status}"}).encode()
    return Answer(status, {name.replace("_", "-"): value for name, value in headers.items()}, body)


@pytest.mark.parametrize("status", [429, 502, 503])
def test_a_busy_server_decides_how_long_the_client_waits(status: int) -> None:
    request = Request("POST", "/v1/jobs", headers={"idempotency-key": "a"})
    flow = send(request, 10)
    assert next(flow) is request
    assert flow.send(answers(status, retry_after="7")) == Pause(7)
    assert flow.send(Answer(0, {}, b"")) is request
    assert flow.send(answers(status)) == Pause(0.2)
    assert flow.send(Answer(0, {}, b"")) is request
    assert flow.throw(Lost("reset")) == Pause(0.4)
    assert flow.send(Answer(0, {}, b"")) is request
    # The patience is shorter than this.
    with pytest.raises(ApiError, match=f"status {status}"):
        flow.send(answers(status, retry_after="7"))


def repeated(fail: Callable[[Flow[Answer]], Request | Pause], pauses: list[float]) -> None:
    """Fails each request, until the client gives up."""
    flow = send(Request("GET", "/v1/jobs"), 60)
    next(flow)
    while True:
        pause = fail(flow)
        assert isinstance(pause, Pause)
        pauses.append(pause.seconds)
        flow.send(Answer(0, {}, b""))


@pytest.mark.parametrize("retry_after", ["0", "", "-1", "soon", "9" * 400])
def test_a_server_that_is_always_busy_gets_few_requests(retry_after: str) -> None:
    pauses: list[float] = []
    with pytest.raises(ApiError, match="status 503"):
        repeated(lambda flow: flow.send(answers(503, retry_after=retry_after)), pauses)
    assert len(pauses) < 20
    assert sum(pauses) == pytest.approx(0 if len(retry_after) > 9 else 60)


def test_a_server_that_has_never_answered_is_given_up_soon() -> None:
    pauses: list[float] = []
    with pytest.raises(ServerUnreachable, match="http://there: refused"):
        repeated(lambda flow: flow.throw(Lost("http://there: refused", is_new=True)), pauses)
    assert 0 < sum(pauses) <= 3


def test_a_fault_is_not_sent_again() -> None:
    flow = send(Request("GET", "/v1/jobs"), 10)
    next(flow)
    with pytest.raises(ApiError) as caught:
        flow.send(Answer(500, {}, b"<html>proxy</html>"))
    assert str(caught.value) == "The server answered 500: <html>proxy</html>"


def test_a_stream_that_often_breaks_is_followed_to_its_end() -> None:
    flow = finish(cast(Job, {"id": "a", "state": "queued"}), Silent(), 10)
    stream = next(flow)
    assert isinstance(stream, Request)
    assert stream.on_line
    for n in range(100):
        assert not stream.on_line("event: progress")
        assert not stream.on_line(f'data: {{"progress": {n / 100}}}')
        # A stream that ends at once is asked for ever more seldom.
        assert flow.throw(Lost("reset")) == Pause(min(0.1 * 2.0**n, 5.0))
        assert flow.send(Answer(0, {}, b"")) == stream
    assert not stream.on_line("event: state")
    assert stream.on_line('data: {"state": "succeeded", "job": {"id": "a", "key": "b", "state": "succeeded"}}')
    with pytest.raises(StopIteration) as end:
        flow.send(Answer(200, {}, b""))
    assert end.value.value["state"] == "succeeded"


def test_streams_that_tell_no_progress_end_the_patience() -> None:
    flow = finish(cast(Job, {"id": "a", "state": "queued"}), Silent(), 10)
    pauses: list[float] = []

    def follow() -> None:
        stream = next(flow)
        while True:
            assert isinstance(stream, Request)
            assert stream.on_line
            for line in (":", "event: progress", 'data: {"progress": 0.0}'):
                assert not stream.on_line(line)
            pause = flow.send(Answer(200, {}, b""))
            assert isinstance(pause, Pause)
            pauses.append(pause.seconds)
            stream = flow.send(Answer(0, {}, b""))

    with pytest.raises(ServerUnreachable, match="ended early"):
        follow()
    assert sum(pauses) == pytest.approx(10)


def test_events_are_resumed_after_a_killed_server(tmp_path: pathlib.Path, ball: Scenario) -> None:
    server = Server(tmp_path / "data", "", FRETWORK_CRASH_PAUSE="0s")
    scenario, vary, outputs = long_sweep(ball)
    sweep = {"scenario": scenario, "vary": [{"pointer": "/friction", "values": vary["/friction"]}], "outputs": outputs}
    asked: list[str | None] = []

    def note(request: httpx.Request) -> None:
        if request.url.path.endswith("/events"):
            asked.append(request.headers.get("last-event-id"))

    async def events() -> list[Event]:
        found = []

        async def noted(request: httpx.Request) -> None:
            note(request)

        async with AsyncClient(server.url, "", trust_env=False, event_hooks={"request": [noted]}) as client:
            async for event in client.follow(job):
                found.append(event)
                if event.name == "progress" and event.data["progress"] > 0 and len(asked) == 1:
                    server.kill()
                    server.start()
        return found

    try:
        with server.client() as client:
            job = client.submit({"sweep": sweep})
            found = asyncio.run(events())
            assert client.wait(job).meta["counts"]["points"] == 1000
    finally:
        server.kill()
    states = [event for event in found if event.name == "state"]
    assert asked[0] is None
    assert int(asked[-1] or 0) >= 1
    # Without the header, the second stream would have begun with the first state.
    assert [event.data["state"] for event in states] == ["queued", "running", "succeeded"]
    assert states[-1].data["job"]["id"] == job["id"]


def test_a_lost_server_is_told_at_once(caplog: pytest.LogCaptureFixture, ball: Scenario) -> None:
    with Client("http://127.0.0.1:9", "", trust_env=False) as client, pytest.raises(ServerUnreachable):
        client.run(ball)
    (said,) = caplog.messages
    assert said.startswith("The server does not answer: http://127.0.0.1:9: ")
    assert said.endswith("Trying again for 3 s")


class Empty(http.server.BaseHTTPRequestHandler):
    """Answers with an empty object."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.end_headers()
        self.wfile.write(b"{}")

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def encrypted(tmp_path: pathlib.Path) -> Iterator[tuple[str, str]]:
    """The address of a server with TLS, and the file with its certificate."""
    file = str(tmp_path / "certificate.pem")
    words = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=test -addext subjectAltName=DNS:localhost"
    subprocess.run(["openssl", *words.split(), "-keyout", file, "-out", file], check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(file)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Empty) as server:
        server.socket = context.wrap_socket(server.socket, server_side=True)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"https://localhost:{server.server_port}", file
        server.shutdown()


def test_an_unknown_certificate_is_named(encrypted: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    url, file = encrypted
    with Client(url, "") as client, pytest.raises(ServerUnreachable, match=r"certificate.* SSL_CERT_FILE\.$"):
        client.request("GET", "/v1/me")
    monkeypatch.setenv("SSL_CERT_FILE", file)
    with Client(url, "") as client:
        assert client.request("GET", "/v1/me") == {}


def test_a_request_that_may_be_done_is_not_sent_again() -> None:
    flow = Operations(60, Silent).request("POST", "/v1/keys", {"name": "anna"})
    assert isinstance(next(flow), Request)
    with pytest.raises(ServerUnreachable):
        flow.throw(Lost("reset"))
    flow = Operations(60, Silent).request("POST", "/v1/jobs", {}, headers={"Idempotency-Key": "a"})
    next(flow)
    assert isinstance(flow.throw(Lost("reset")), Pause)
