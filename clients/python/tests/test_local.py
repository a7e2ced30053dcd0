"""Servers of one's own stop with their interpreter."""

import os
import pathlib
import signal
import subprocess
import sys
import sysconfig
import time

import httpx
import pytest
from conftest import PATIENCE, PROGRAM

import fretwork_client


def listens(url: str) -> bool:
    try:
        return httpx.get(f"{url}/healthz", trust_env=False).is_success
    except httpx.TransportError:
        return False


@pytest.mark.parametrize("end", ["pass", "os.kill(os.getpid(), signal.SIGKILL)", "os._exit(3)", "1 / 0"])
def test_the_server_stops_with_the_interpreter(end: str, tmp_path: pathlib.Path) -> None:
    code = f"import os, signal, fretwork_client; own = fretwork_client.local({str(PROGRAM)!r}); print(own.url); own.evaluate"
    script = f"{code}\nimport sys; sys.stdout.flush()\n{end}"
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                          text=True)  # fmt: skip
    assert done.returncode == {"pass": 0, "1 / 0": 1, "os._exit(3)": 3}.get(end, -signal.SIGKILL)
    until = time.monotonic() + PATIENCE
    while listens(done.stdout.strip()) or any(tmp_path.iterdir()):
        assert time.monotonic() < until, list(tmp_path.iterdir())
        time.sleep(0.05)


def test_a_database_can_be_kept(tmp_path: pathlib.Path, ball: fretwork_client.api_types.Scenario) -> None:
    keys = []
    for _ in range(2):
        with fretwork_client.local(str(PROGRAM), data=tmp_path, progress=False) as client:
            run = client.run(ball)
            keys.append(run.key)
    assert run.job["origin"] == "cached"
    assert keys[0] == keys[1]


def test_a_program_in_the_environment_of_python_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(PROGRAM.parent))
    with fretwork_client.local() as client:
        assert client.url


def test_a_missing_program_is_an_error() -> None:
    with pytest.raises(fretwork_client.FretworkError, match="Install its wheel"):
        fretwork_client.local("no-such-program")


def test_a_program_that_does_not_start_says_why(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "file"
    file.write_text("not a directory")
    with pytest.raises(fretwork_client.FretworkError, match=r"did not start: .*file"):
        fretwork_client.local(str(PROGRAM), data=file)
