"""Servers that are not fretwork, or do harm."""

import asyncio
import contextlib
import gzip
import io
import json
import socket
import socketserver
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from fretwork_client import ApiError, AsyncClient, Client, Fault, ServerUnreachable
from fretwork_client.api_types import Scenario

JSON = "application/json"
JOB = {"id": "a", "state": "running", "key": "b", "warnings": []}
DONE = {**JOB, "state": "succeeded"}
# Megabytes of zeros in kilobytes.
BOMB = gzip.compress(bytes(300 << 20))
# A server that sends a byte every 0.1 s.
DRIPS = "x-drips: yes"
Given = tuple[str, str, bytes]


class Hostile(socketserver.ThreadingTCPServer):
    """Gives the answers of a test. `asked` has the first lines of all requests."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, answer: Callable[[str], Given]) -> None:
        super().__init__(("127.0.0.1", 0), Exchange)
        self.answer = answer
        self.asked: list[str] = []
        self.url = f"http://127.0.0.1:{self.server_address[1]}"


class Exchange(socketserver.StreamRequestHandler):
    """One request and one answer."""

    server: Hostile

    def handle(self) -> None:
        first = self.rfile.readline().decode().strip()
        length = 0
        while (line := self.rfile.readline().decode().strip().lower()) != "":
            length = int(line.split(":")[1]) if line.startswith("content-length:") else length
        self.rfile.read(length)
        self.server.asked.append(first)
        status, headers, body = self.server.answer(first)
        head = f"HTTP/1.1 {status}\r\nconnection: close\r\ncontent-length: {len(body)}\r\n{headers}\r\n\r\n"
        # A client that does not want more closes the connection.
        with contextlib.suppress(OSError):
            self.wfile.write(head.encode() + body[: 1 if DRIPS in headers else None])
            for byte in body[1:] if DRIPS in headers else b"":
                time.sleep(0.1)
                self.wfile.write(bytes([byte]))


@pytest.fixture
def hostile() -> Iterator[Callable[[Callable[[str], Given]], Hostile]]:
    servers: list[Hostile] = []

    def start(answer: Callable[[str], Given]) -> Hostile:
        servers.append(Hostile(answer))
        threading.Thread(target=servers[-1].serve_forever, daemon=True).start()
        return servers[-1]

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def page(_: str) -> Given:
    return "200 OK", "content-type: text/html", b"<html>Sign in</html>"


def redirect(_: str) -> Given:
    return "302 Found", "location: https://login.example.org/", b""


def bomb(_: str) -> Given:
    return "200 OK", f"content-type: {JSON}\r\ncontent-encoding: gzip", BOMB


def nested(_: str) -> Given:
    return "200 OK", f"content-type: {JSON}\r\ncontent-encoding: gzip, gzip", gzip.compress(BOMB)


def no_job(_: str) -> Given:
    return "200 OK", f"content-type: {JSON}", b"[]"


def drip(_: str) -> Given:
    return "200 OK", f"content-type: {JSON}\r\n{DRIPS}", json.dumps({**DONE, "label": "long" * 1000}).encode()


def deep(_: str) -> Given:
    return "200 OK", f"content-type: {JSON}", b"[" * 100_000


def after_submission(status: str, headers: str, body: bytes) -> Callable[[str], Given]:
    def answer(first: str) -> Given:
        is_submission = first.startswith("POST")
        return ("202 Accepted", f"content-type: {JSON}", json.dumps(JOB).encode()) if is_submission else (status, headers, body)

    return answer


def stored(body: bytes) -> Callable[[str], Given]:
    def answer(first: str) -> Given:
        return ("200 OK", f"content-type: {JSON}", json.dumps(DONE).encode() if first.startswith("POST") else body)

    return answer


def zip_bomb() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("meta.npy", "w", force_zip64=True) as member:
        for _ in range(1100):
            member.write(bytes(1 << 20))
    return file.getvalue()


EVENTS = "content-type: text/event-stream"
CASES: dict[str, tuple[Callable[[str], Given], str]] = {
    "a web page": (page, "is not JSON. Check FRETWORK_URL. It begins with: '<html>"),
    "a redirect": (redirect, "redirects to 'https://login.example.org/'"),
    "a bomb": (bomb, "has more than 256 MiB"),
    "a nested bomb": (nested, "has the encoding 'gzip, gzip'"),
    "a list": (no_job, "something else than a job: '\\[\\]'"),
    "deep JSON": (deep, "is not JSON"),
    "a byte now and then": (drip, "has not ended after"),
    "a byte of a line now and then": (
        after_submission("200 OK", f"{EVENTS}\r\n{DRIPS}", b": " * 1000),
        "A line of .* has not ended after",
    ),
    "no stream": (after_submission("200 OK", "content-type: text/html", b"<html>"), "is not a stream of events"),
    "an event with half a job": (
        after_submission("200 OK", EVENTS, b'event: snapshot\ndata: {"state": "succeeded"}\n'),
        "an event that it does not have",
    ),
    "an event with endless progress": (
        after_submission("200 OK", EVENTS, b'event: progress\ndata: {"progress": 1' + b"0" * 400 + b"}\n"),
        "an event that it does not have",
    ),
    "an odd event": (after_submission("200 OK", EVENTS, b"event: snapshot\ndata: [1]\n"), "an event that it does not have"),
    "a bomb as a stream": (after_submission("200 OK", f"{EVENTS}\r\ncontent-encoding: gzip", BOMB), "has more than 16 MiB"),
    "no arrays": (stored(b"<html>"), "is not a result"),
    "a bomb of arrays": (stored(zip_bomb()), "is not a result"),
}


@pytest.mark.parametrize("name", CASES)
def test_a_strange_answer_is_an_error_that_says_what_to_check(
    name: str, hostile: Callable[[Callable[[str], Given]], Hostile], ball: Scenario
) -> None:
    answer, words = CASES[name]
    server = hostile(answer)
    with Client(server.url, "", progress=False, patience=1, trust_env=False) as client, pytest.raises(ApiError, match=words):
        client.run(ball)

    async def run() -> Any:
        async with AsyncClient(server.url, "", patience=1, trust_env=False) as client:
            return await client.run(ball)

    with pytest.raises(ApiError, match=words):
        asyncio.run(run())
    # No request was sent again.
    assert len(server.asked) <= 8, server.asked


def test_an_id_leads_to_no_other_path(hostile: Callable[[Callable[[str], Given]], Hostile]) -> None:
    server = hostile(no_job)
    with Client(server.url, "", trust_env=False) as client, pytest.raises(ApiError, match="something else than a job"):
        client.cancel("../a?b#c")
    assert server.asked[1:] == ["POST /v1/jobs/%2E%2E%2Fa%3Fb%23c/cancel HTTP/1.1"]


def test_a_server_that_accepts_and_says_nothing_is_given_up_after_its_health(ball: Scenario) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        with Client(url, "", progress=False, trust_env=False) as client, pytest.raises(ServerUnreachable):
            client.run(ball)
        # The request itself, which may take long, was never sent.
        connection, _ = silent.accept()
        with connection:
            assert connection.recv(100).startswith(b"GET /healthz ")


def test_control_characters_of_a_server_do_not_reach_the_terminal() -> None:
    error = ApiError(400, "bad\x1b[2J", [Fault("/a\nb", "\x07")])
    assert str(error) == "bad\\x1b[2J\n  /a\\nb: \\x07"


@pytest.mark.parametrize("body", [b"[]", b"null", b"{}", b'{"outputs": 5, "units": 7}'])
def test_something_else_than_outputs_is_an_error(
    body: bytes, hostile: Callable[[Callable[[str], Given]], Hostile], ball: Scenario
) -> None:
    server = hostile(lambda _: ("200 OK", f"content-type: {JSON}", body))
    with Client(server.url, "", trust_env=False) as client, pytest.raises(ApiError, match="something else than outputs"):
        client.evaluate(ball, ["wear_volume"])


@pytest.mark.parametrize("body", [b"[]", b"null", b"{}", b'{"scenario": 5, "columns": {}, "notes": [], "tables": []}'])
def test_something_else_than_an_example_or_measured_numbers_is_an_error(
    body: bytes, hostile: Callable[[Callable[[str], Given]], Hostile]
) -> None:
    server = hostile(lambda _: ("200 OK", f"content-type: {JSON}", body))
    with Client(server.url, "", trust_env=False) as client:
        with pytest.raises(ApiError, match="something else than an example"):
            client.example("steel-ball")
        with pytest.raises(ApiError, match="something else than measured numbers"):
            client.measurements(__file__)
