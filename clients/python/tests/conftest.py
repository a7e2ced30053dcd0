"""Servers for the tests. The variable FRETWORK names the program."""

import os
import pathlib
import socket
import subprocess
from collections.abc import Iterator
from typing import Any, cast

import pytest

from fretwork_client import Client, api_types

KEY = "fretwork_" + "0123456789abcdef" * 3
PROGRAM = pathlib.Path(os.environ["FRETWORK"]).resolve()
# Seconds after which a test says that something hangs.
PATIENCE = 180


class Server:
    """A server that keeps its port and its database when it is killed and started again."""

    def __init__(self, data: pathlib.Path, key: str, **settings: str) -> None:
        self.data, self.key, self.settings = data, key, settings
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.start()

    def start(self) -> None:
        environment = self.settings | {"FRETWORK_LOG": "error"} | ({"FRETWORK_ADMIN_KEY": self.key} if self.key else {})
        command = [str(PROGRAM), "serve", "--listen", f"127.0.0.1:{self.port}", "--data-dir", str(self.data)]
        self.process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout
        assert "listens on" in self.process.stdout.readline()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout
        self.process.stdout.close()

    def client(self, **options: Any) -> Client:
        return Client(self.url, self.key, trust_env=False, **{"progress": False} | options)


@pytest.fixture(scope="session", params=["", KEY], ids=["without keys", "with keys"])
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("data"), request.param)
    yield server
    server.kill()


@pytest.fixture
def client(server: Server) -> Iterator[Client]:
    with server.client() as client:
        yield client


@pytest.fixture
def ball() -> api_types.Scenario:
    """A steel ball on a steel flat, with the fast method."""
    steel: api_types.Body = {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}
    return {
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "bodies": [steel, steel],
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "depth"},
        "motion": {"amplitude": "2.256 um"},
        "cycles": [1000, 10000],
        "model": {"method": "simplified", "points": 64},
    }


def changed(scenario: api_types.Scenario, **members: Any) -> api_types.Scenario:
    """A scenario with other members, which may be wrong."""
    return cast(api_types.Scenario, {**scenario, **members})
