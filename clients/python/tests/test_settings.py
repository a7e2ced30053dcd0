"""Settings from the environment, numbers as text, and the examples of the README."""

import pathlib
import re
from typing import Any

import pytest
from conftest import PROGRAM

from fretwork_client import Client
from fretwork_client.display import number
from fretwork_client.settings import access_key, base_address

HERE = "http://127.0.0.1:8080"
README = pathlib.Path(__file__).parents[1] / "README.md"


def test_the_environment_names_server_and_key(monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path) -> None:
    for name in ("FRETWORK_URL", "FRETWORK_KEY", "FRETWORK_KEY_FILE"):
        monkeypatch.delenv(name, raising=False)
    assert base_address(None) == "http://127.0.0.1:8080"
    assert access_key(None, HERE) == ""
    file = tmp_path / "key"
    file.write_text("of a file\n")
    monkeypatch.setenv("FRETWORK_KEY_FILE", str(file))
    assert access_key(None, HERE) == "of a file"
    monkeypatch.setenv("FRETWORK_KEY", "a key")
    assert access_key(None, HERE) == "a key"
    assert access_key("", HERE) == ""
    monkeypatch.setenv("FRETWORK_URL", "https://wear.example/fretwork/")
    assert base_address(None) == "https://wear.example/fretwork"
    assert base_address("http://other") == "http://other"


def test_another_server_does_not_get_the_key_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FRETWORK_KEY", "secret")
    monkeypatch.setenv("FRETWORK_URL", "https://wear.example/")
    with Client("https://wear.example") as client:
        assert client._http.headers["authorization"] == "Bearer secret"
    with pytest.warns(UserWarning, match="is for https://wear.example"), Client("https://other.example") as client:
        assert "authorization" not in client._http.headers


@pytest.mark.parametrize(("url", "advice"), [("wear.example", "http://"), ("http://wear.example/v1/", "Remove /v1")])
def test_a_wrong_address_says_what_to_change(url: str, advice: str) -> None:
    with pytest.raises(ValueError, match=advice):
        base_address(url)


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (1.48063e-6, 1.17e-8, "m", "1.481 ± 0.012 µm"),
        (1.82223e-13, 1.437e-15, "m^3", "(1.822 ± 0.014)·10⁻⁴ mm³"),
        (0.7, 0.0, "1", "0.7"),
        (100.0, 12.0, "N", "100 ± 12 N"),
    ],
)
def test_a_number_has_the_digits_of_its_error(value: float, error: float, unit: str, text: str) -> None:
    assert number(value, error, unit) == text


def test_the_examples_of_the_readme_work(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("PATH", str(PROGRAM.parent), prepend=":")
    names: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S):
        exec(block, names)
    names["client"].close()
    said = capsys.readouterr().out
    assert re.search(r"\(.* ± .*\)·10⁻⁴ mm³ .* ± .* µm", said), said
    assert "/scenario/frction unknown member `frction`. Did you mean `friction`?" in said
