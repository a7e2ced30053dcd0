"""What can go wrong, as exceptions. Each message says what to change."""

from __future__ import annotations

import json
from dataclasses import dataclass

from .api_types import Job


class FretworkError(Exception):
    """Every error of this package."""


def shown(text: str) -> str:
    """A text of a server for a terminal: control characters are shown as text."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


@dataclass(frozen=True)
class Fault:
    """One fault of a request. `place` is a JSON pointer into the request such as `/scenario/friction`, or a parameter."""

    place: str
    detail: str


class ApiError(FretworkError):
    """The server refused a request. `faults` are all faults that it found; `problem` is the path of a page about the error."""

    def __init__(self, status: int, detail: str, faults: list[Fault], problem: str = "", request_id: str = "") -> None:
        super().__init__("\n".join(map(shown, [detail, *(f"  {fault.place}: {fault.detail}" for fault in faults)])))
        self.status = status
        self.detail = detail
        self.faults = faults
        self.problem = problem
        self.request_id = request_id


class InvalidRequest(ApiError):
    """The request has faults: change what `faults` and the message name."""


class AccessDenied(ApiError):
    """The server requires an access key, or another role: set FRETWORK_KEY or the argument `key`."""


class JobFailed(FretworkError):
    """A job failed or was canceled."""

    def __init__(self, job: Job) -> None:
        error = job.get("error")
        reason = f"{error['title']}. {error['detail']}" if error else f"The job was {job['state']}."
        super().__init__(shown(f"{reason} (job {job['id']})"))
        self.job = job


class ServerUnreachable(FretworkError):
    """The server did not answer, although the client tried again for some time."""


def refusal(status: int, body: bytes, location: str = "", place: str = "") -> ApiError:
    """The exception for an answer with an error. A proxy may answer without the members of RFC 9457."""
    kind = {400: InvalidRequest, 422: InvalidRequest, 401: AccessDenied, 403: AccessDenied}.get(status, ApiError)
    server = f"The server {place}" if place else "The server"
    if status < 400:
        return kind(status, f"{server} redirects to {location[:200]!r}. Enter the address of fretwork in FRETWORK_URL", [])
    try:
        said = json.loads(body)
        detail = str(said["detail"])
        faults = [
            Fault(fault.get("pointer") or fault.get("parameter") or "body", fault["detail"]) for fault in said.get("errors", [])
        ]
        return kind(status, detail, faults, said.get("type", ""), said.get("instance", ""))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return kind(status, f"{server} answered {status}: {body[:200].decode(errors='replace')}", [])
