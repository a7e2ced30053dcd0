"""The synchronous and the asynchronous client: two loops that drive the flows."""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import time
from collections import deque
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine, Generator, Iterator
from functools import update_wrapper
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

import httpx

from . import api_types as api
from .flows import (
    FIRST_PATIENCE,
    Answer,
    Body,
    Event,
    Flow,
    JobEvents,
    Lines,
    Lost,
    Operations,
    Patience,
    Pause,
    Request,
    follow,
)
from .progress import Silent, chosen
from .settings import access_key, base_address

P = ParamSpec("P")
T = TypeVar("T")
M = TypeVar("M", bound=Callable[..., object])

# The server sends something at least every 15 seconds while a client follows a job, and answers a wait of 1 second.
TIMEOUT = httpx.Timeout(75.0, connect=3.0)
# A computation may take long, so a server that has never answered is first asked what it answers at once.
FIRST = "/healthz"
# The answer to a pause, and to a request whose answer has not ended.
NOTHING = Answer(0, {}, b"")


def _described(method: M, flow: Callable[..., object]) -> M:
    """Gives a method the documentation of its flow. What the flow returns at its end is what the method returns."""
    signature = inspect.signature(flow)
    returned = str(signature.return_annotation).removeprefix("Flow[").removesuffix("]")
    update_wrapper(method, flow)
    method.__signature__ = signature.replace(return_annotation=returned)  # type: ignore[attr-defined]
    return method


def _blocking(flow: Callable[Concatenate[Operations, P], Flow[T]]) -> Callable[Concatenate[Client, P], T]:
    def method(self: Client, /, *args: P.args, **options: P.kwargs) -> T:
        return self._drive(flow(self._operations, *args, **options))

    return _described(method, flow)


def _awaitable(
    flow: Callable[Concatenate[Operations, P], Flow[T]],
) -> Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]]:
    async def method(self: AsyncClient, /, *args: P.args, **options: P.kwargs) -> T:
        return await self._drive(flow(self._operations, *args, **options))

    return _described(method, flow)


def _settings(url: str | None, key: str | None) -> dict[str, Any]:
    address = base_address(url)
    token = access_key(key, address)
    # The client bounds the size of what it decompresses.
    headers = {"accept-encoding": "gzip"} | ({"authorization": f"Bearer {token}"} if token else {})
    return {"base_url": address, "headers": headers, "timeout": TIMEOUT}


def _request(http: httpx.Client | httpx.AsyncClient, step: Request) -> httpx.Request:
    # Empty parameters would remove those of the path.
    return http.build_request(step.method, step.path, params=step.params or None, headers=step.headers, content=step.content)


def _body(response: httpx.Response, step: Request, place: str, patience: float) -> Body:
    """What reads the body of an answer: the lines of a stream that was asked for, or the whole."""
    is_stream = response.is_success and response.headers.get("content-type", "").startswith("text/event-stream")
    if step.on_line and is_stream:
        return Lines(place, response.headers, patience, step.on_line)
    return Body(place, response.headers, patience)


def _answer(response: httpx.Response, body: Body) -> Answer:
    content = b"" if isinstance(body, Lines) else bytes(body.content)
    return Answer(response.status_code, response.headers, content, body.place)


def _lost(error: httpx.RequestError, place: str, has_answered: bool) -> Lost:
    return Lost(f"{place}: {str(error) or type(error).__name__}", not has_answered)


class Client:
    """A server of fretwork.

    `url` is its base address (FRETWORK_URL by default), and `key` an access key. By default, the server of FRETWORK_URL gets
    FRETWORK_KEY, or the key in the file FRETWORK_KEY_FILE.
    `progress` is False, True (a bar of tqdm, if installed), or a function that receives numbers from 0 to 1. After a lost
    connection, and if the server is busy, the client tries again for `patience` seconds (3 if the server has never answered).
    An answer that takes longer than that must arrive with 10 kB per second. `http` are options of `httpx.Client`.
    """

    def __init__(
        self,
        url: str | None = None,
        key: str | None = None,
        *,
        progress: bool | Callable[[float], None] = True,
        patience: float = 60.0,
        **http: Any,
    ) -> None:
        self._operations = Operations(patience, chosen(progress))
        self._http = httpx.Client(**_settings(url, key) | http)
        self.url = base_address(url)
        self._has_answered = False

    run = _blocking(Operations.run)
    submit = _blocking(Operations.submit)
    job = _blocking(Operations.job)
    wait = _blocking(Operations.wait)
    get = _blocking(Operations.get)
    check = _blocking(Operations.check)
    note = _blocking(Operations.note)
    pin = _blocking(Operations.pin)
    report = _blocking(Operations.report)
    plot = _blocking(Operations.plot)
    request = _blocking(Operations.request)
    evaluate = _blocking(Operations.evaluate)
    sweep = _blocking(Operations.sweep)
    sensitivity = _blocking(Operations.sensitivity)
    map = _blocking(Operations.map)
    fit = _blocking(Operations.fit)
    example = _blocking(Operations.example)
    jobs = _blocking(Operations.jobs)
    results = _blocking(Operations.results)
    cancel = _blocking(Operations.cancel)
    derivatives = _blocking(Operations.derivatives)
    measurements = _blocking(Operations.measurements)

    def follow(self, job: api.Job | str) -> Iterator[Event]:
        """Yields the events of a job, or of the job with this id, until it has ended. Resumes after a lost connection."""
        found: deque[Event] = deque()
        events = JobEvents(Silent(), Patience(self._operations.patience), found.append)
        with contextlib.closing(self._steps(follow(job if isinstance(job, str) else job["id"], events), [])) as steps:
            for _ in steps:
                while found:
                    yield found.popleft()

    def _drive(self, flow: Flow[T]) -> T:
        returned: list[T] = []
        for _ in self._steps(flow, returned):
            pass
        return returned[0]

    def _steps(self, flow: Flow[T], returned: list[T]) -> Generator[None, None, None]:
        """Drives a flow, stops after each part of an answer, and at last appends what the flow returns."""
        with contextlib.closing(flow):
            try:
                step = next(flow)
                while True:
                    try:
                        with contextlib.closing(self._do(step)) as answers:
                            for so_far in answers:
                                answer = so_far
                                yield
                    except httpx.RequestError as error:
                        step = flow.throw(_lost(error, self.url, self._has_answered))
                    else:
                        step = flow.send(answer)
            except StopIteration as end:
                returned.append(end.value)

    def _do(self, step: Request | Pause) -> Generator[Answer, None, None]:
        """The answer, after each part of its body as far as it is known."""
        if isinstance(step, Pause):
            time.sleep(step.seconds)
            yield NOTHING
            return
        if not self._has_answered:
            with self._http.stream("GET", FIRST, timeout=FIRST_PATIENCE):
                self._has_answered = True
        response = self._http.send(_request(self._http, step), stream=True)
        with contextlib.closing(response):
            body = _body(response, step, self.url, self._operations.patience)
            for part in response.iter_bytes():
                body.add(part)
                if body.done:
                    break
                yield NOTHING
            yield _answer(response, body)

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()


class AsyncClient:
    """Like `Client`, with methods to await. `http` are options of `httpx.AsyncClient`."""

    def __init__(
        self,
        url: str | None = None,
        key: str | None = None,
        *,
        progress: bool | Callable[[float], None] = False,
        patience: float = 60.0,
        **http: Any,
    ) -> None:
        self._operations = Operations(patience, chosen(progress))
        self._http = httpx.AsyncClient(**_settings(url, key) | http)
        self.url = base_address(url)
        self._has_answered = False

    run = _awaitable(Operations.run)
    submit = _awaitable(Operations.submit)
    job = _awaitable(Operations.job)
    wait = _awaitable(Operations.wait)
    get = _awaitable(Operations.get)
    check = _awaitable(Operations.check)
    note = _awaitable(Operations.note)
    pin = _awaitable(Operations.pin)
    report = _awaitable(Operations.report)
    plot = _awaitable(Operations.plot)
    request = _awaitable(Operations.request)
    evaluate = _awaitable(Operations.evaluate)
    sweep = _awaitable(Operations.sweep)
    sensitivity = _awaitable(Operations.sensitivity)
    map = _awaitable(Operations.map)
    fit = _awaitable(Operations.fit)
    example = _awaitable(Operations.example)
    jobs = _awaitable(Operations.jobs)
    results = _awaitable(Operations.results)
    cancel = _awaitable(Operations.cancel)
    derivatives = _awaitable(Operations.derivatives)
    measurements = _awaitable(Operations.measurements)

    async def follow(self, job: api.Job | str) -> AsyncIterator[Event]:
        """Yields the events of a job, or of the job with this id, until it has ended. Resumes after a lost connection."""
        found: deque[Event] = deque()
        events = JobEvents(Silent(), Patience(self._operations.patience), found.append)
        steps = self._steps(follow(job if isinstance(job, str) else job["id"], events), [])
        async with contextlib.aclosing(steps):
            async for _ in steps:
                while found:
                    yield found.popleft()

    async def _drive(self, flow: Flow[T]) -> T:
        returned: list[T] = []
        async for _ in self._steps(flow, returned):
            pass
        return returned[0]

    async def _steps(self, flow: Flow[T], returned: list[T]) -> AsyncGenerator[None, None]:
        with contextlib.closing(flow):
            try:
                step = next(flow)
                while True:
                    try:
                        async with contextlib.aclosing(self._do(step)) as answers:
                            async for so_far in answers:
                                answer = so_far
                                yield
                    except httpx.RequestError as error:
                        step = flow.throw(_lost(error, self.url, self._has_answered))
                    else:
                        step = flow.send(answer)
            except StopIteration as end:
                returned.append(end.value)

    async def _do(self, step: Request | Pause) -> AsyncGenerator[Answer, None]:
        if isinstance(step, Pause):
            await asyncio.sleep(step.seconds)
            yield NOTHING
            return
        if not self._has_answered:
            async with self._http.stream("GET", FIRST, timeout=FIRST_PATIENCE):
                self._has_answered = True
        response = await self._http.send(_request(self._http, step), stream=True)
        async with contextlib.aclosing(response):
            body = _body(response, step, self.url, self._operations.patience)
            async for part in response.aiter_bytes():
                body.add(part)
                if body.done:
                    break
                yield NOTHING
            yield _answer(response, body)

    async def aclose(self) -> None:
        """Closes the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        await self.aclose()
