"""Computes fretting wear with a server of fretwork. Start with `Client`, `AsyncClient` or `local`."""

from .client import AsyncClient, Client
from .errors import AccessDenied, ApiError, Fault, FretworkError, InvalidRequest, JobFailed, ServerUnreachable
from .flows import Event
from .local import LocalClient, local
from .results import Evaluation, Fit, Number, Result, Run, Study
from .tables import Table
from .traces import Trace, read_trace

__all__ = [
    "AccessDenied",
    "ApiError",
    "AsyncClient",
    "Client",
    "Evaluation",
    "Event",
    "Fault",
    "Fit",
    "FretworkError",
    "InvalidRequest",
    "JobFailed",
    "LocalClient",
    "Number",
    "Result",
    "Run",
    "ServerUnreachable",
    "Study",
    "Table",
    "Trace",
    "local",
    "read_trace",
]
