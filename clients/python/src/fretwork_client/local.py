"""A server of one's own, which lives as long as the client or the interpreter."""

from __future__ import annotations

import atexit
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from typing import Any

from .client import Client
from .errors import FretworkError


class LocalClient(Client):
    """A client with a server of its own. `close` stops the server."""

    def __init__(self, server: subprocess.Popen[str], url: str, **options: Any) -> None:
        # A proxy in the environment does not know this machine.
        super().__init__(url, key="", trust_env=False, **options)
        self._server = server
        atexit.register(self.close)

    def close(self) -> None:
        """Stops the server, and deletes its temporary database."""
        super().close()
        atexit.unregister(self.close)
        stop(self._server)


def stop(server: subprocess.Popen[str]) -> None:
    """The guard stops the server when its input ends."""
    if server.stdin and server.stdout:
        server.stdin.close()
        server.wait(timeout=60)
        server.stdout.close()


def local(program: str | None = None, *, data: str | os.PathLike[str] | None = None, **options: Any) -> LocalClient:
    """Starts the program `fretwork` on a free port, and returns a client.

    Without `data`, the database is temporary. `data` names a directory that keeps it. The server stops when the client is
    closed, or when the interpreter ends, even if it crashes. `options` are those of `Client`.
    """
    # A notebook may run in an environment that is not in PATH.
    found = shutil.which(program or "fretwork") or shutil.which(program or "fretwork", path=sysconfig.get_path("scripts"))
    if not found:
        raise FretworkError(
            f"The program {program or 'fretwork'!r} is missing. Install its wheel in this environment, or pass its path: "
            "local(program=…). For a running server, use Client(url)."
        )
    temporary = "" if data else tempfile.mkdtemp(prefix="fretwork-")
    guard = [sys.executable, "-I", str(pathlib.Path(__file__).with_name("guard.py")), temporary]
    command = [found, "serve", "--listen", "127.0.0.1:0", "--drain-seconds", "0", "--data-dir", os.fspath(data or temporary)]
    # Settings of another server do not apply. Ctrl-C interrupts the caller, not the server, hence a new session.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("FRETWORK_")}
    with tempfile.TemporaryFile("w+") as log:
        server = subprocess.Popen(
            [*guard, *command],
            env=environment | {"FRETWORK_LOG": "error"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            start_new_session=True,
        )
        assert server.stdout
        line = server.stdout.readline()
        url = re.search(r"listens on (http://\S+)", line)
        if not url:
            stop(server)
            log.seek(0)
            raise FretworkError(f"The program {found} did not start: {log.read().strip() or line.strip()}")
    return LocalClient(server, url[1], **options)
