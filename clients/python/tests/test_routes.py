"""Every route of openapi/openapi.json can be reached. A new route fails here until a call below reaches it."""

import json
import pathlib
import re
import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from conftest import KEY, PATIENCE, Server

from fretwork_client import Client, Fit, Run, Study
from fretwork_client.api_types import Scenario

ROOT = pathlib.Path(__file__).parents[3]
ROUTES = {
    (method.upper(), path)
    for path, item in json.loads((ROOT / "openapi/openapi.json").read_text(encoding="utf-8"))["paths"].items()
    for method in item
    if method in ("get", "put", "post", "patch", "delete")
}
PATTERNS = {path: re.compile(re.sub(r"\{\w+\}", "[^/]+", path)) for _, path in ROUTES}


def route(request: httpx.Request) -> tuple[str, str]:
    """The route of a request. One without parameters comes before another that has some."""
    found = [path for path, pattern in PATTERNS.items() if pattern.fullmatch(request.url.path)]
    return request.method, min(found, key=lambda path: path.count("{"))


@pytest.fixture
def own(tmp_path: pathlib.Path) -> Iterator[Server]:
    server = Server(tmp_path / "data", KEY)
    yield server
    server.kill()


def people(client: Client, ball: Scenario) -> tuple[Run, Study, Fit]:
    """Calls each method that is not `request`."""
    assert client.check(ball)["cached"] is False
    job = client.submit(ball, label="first", tags=["rig"])
    assert next(client.follow(job)).name == "snapshot"
    run = client.wait(job)
    assert isinstance(run, Run)
    assert client.job(job)["state"] == "succeeded"
    assert client.get(run.key).parts["history"]["wear_volume"][-1] == run.wear_volume.value
    assert client.run(ball).key == run.key
    assert client.evaluate(ball, ["wear_volume"])["wear_volume"] == run.wear_volume.value
    study = client.sweep(ball, {"/friction": {"distribution": {"uniform": {"low": 0.6, "high": 0.7}}}}, ["wear_depth"],
                         design="sobol", samples=8)  # fmt: skip
    start = {"from": 1e-15, "to": 1e-12, "spacing": "log"}
    volume = run.wear_volume.value
    fit = client.fit(
        ball,
        {"/wear/coefficient": start},
        [{"data": [{"output": "wear_volume", "x": [1e4], "y": [volume], "relative": 0.05}]}],
    )
    assert client.derivatives(run, ["wear_volume"], ["/friction"])
    assert client.measurements(ROOT / "examples/measured/volumes.csv", x="cycles", level=False)["columns"]
    assert client.example("steel-ball")["scenario"]
    assert client.jobs()
    assert client.results(tag="rig")[0]["key"] == run.key
    assert client.cancel(job)["state"] == "succeeded"
    client.pin(run)
    assert client.results(pinned="true")[0]["key"] == run.key
    client.pin(run.key, False)
    assert not client.results(pinned="true")
    assert client.note(run) is None
    note = client.note(run, "Agrees with the rig.")
    assert note
    assert note["text"] == "Agrees with the rig."
    assert client.note(run.key, "") is None
    assert b"first" in client.report(run)
    assert client.plot(run, quantity="wear").startswith(b"<svg")
    return run, study, fit


def test_each_route_is_reached(own: Server, ball: Scenario) -> None:
    reached = set()

    def record(response: httpx.Response) -> None:
        if response.status_code < 400:
            reached.add(route(response.request))

    with own.client(event_hooks={"response": [record]}) as client:
        run, study, fit = people(client, ball)
        unused = client.submit({**ball, "friction": 0.5})["id"]
        client.wait(unused)
        of_run, of_study = f"/v1/results/{run.key}", f"/v1/results/{study.key}"
        made = client.request("POST", "/v1/keys", {"name": "anna", "role": "read"})
        others: list[tuple[Any, ...]] = [
            *(("GET", path) for path in ("/healthz", "/readyz", "/metrics", "/openapi.json", "/version", "/problems")),
            *(("GET", f"/{path}") for path in ("problems/not-found", "v1/audit", "v1/me", "v1/schema/scenario", "v1/examples")),
            ("POST", "/v1/session"),
            ("DELETE", "/v1/session"),
            ("GET", "/v1/keys"),
            ("DELETE", f"/v1/keys/{made['id']}"),
            ("PATCH", f"/v1/jobs/{unused}", {"label": "renamed"}),
            ("GET", f"/v1/jobs/{unused}/result"),
            ("GET", f"/v1/jobs/{unused}/so-far"),
            ("POST", "/v1/jobs/cancel?tag=rig"),
            ("DELETE", f"/v1/jobs/{unused}"),
            ("POST", "/v1/results/diff", {"a": {"key": run.key}, "b": {"scenario": ball}}),
            *(("GET", f"{of_run}/{part}") for part in ("history", "history/smooth", "profiles", "loops", "provenance", "note")),
            *(("GET", f"{of_study}/{part}") for part in ("table", "statistics", "histogram")),
            ("GET", f"/v1/results/{fit.key}/verdict"),
            ("POST", f"{of_run}/links"),
            ("DELETE", of_run),
        ]
        client.note(run, "For its route.")
        assert run.key.encode() in client.report(client.run({**ball, "friction": 0.4}), run, units="si")
        for call in others:
            client.request(*call)
    assert reached == ROUTES, f"not reached: {sorted(ROUTES - reached)}"


def test_a_request_returns_json_bytes_or_nothing(client: Client, ball: Scenario) -> None:
    key = client.run(ball).key
    result = client.request("GET", f"/v1/results/{key}", digits=4)
    assert result["key"] == key
    assert client.request("GET", f"/v1/results/{key}/history", format="csv", comments="none").startswith(b"cycles,")
    assert client.request("PUT", f"/v1/results/{key}/pin") is None
    job = client.jobs(key=key)[0]
    # The answer redirects.
    assert client.request("GET", f"/v1/jobs/{job['id']}/result")["key"] == key


def test_a_submission_returns_at_once(own: Server, ball: Scenario) -> None:
    long: Scenario = {**ball, "cycles": [100000], "model": {"method": "exact", "tolerance": 0.0005}}
    with own.client() as client:
        frictions = [0.6 + i / 10000 for i in range(1000)]
        job = client.submit({"sweep": {"scenario": long, "vary": [{"pointer": "/friction", "values": frictions}],
                                       "outputs": ["wear_volume"]}})  # fmt: skip
        assert job["state"] in ("queued", "running")
        events = client.follow(job["id"])
        assert next(events).data["id"] == job["id"]
        client.cancel(job)
        until = time.monotonic() + PATIENCE
        *_, last = events
        assert last.data["job"]["state"] == "canceled"
        assert time.monotonic() < until
