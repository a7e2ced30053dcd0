"""The address of the server and the access key, from arguments or from the environment."""

from __future__ import annotations

import os
import pathlib

DEFAULT_URL = "http://127.0.0.1:8080"


def base_address(url: str | None) -> str:
    """The address that the server prints at its start: all paths such as `/v1/jobs` are below it."""
    address = (url or os.environ.get("FRETWORK_URL") or DEFAULT_URL).rstrip("/")
    if not address.startswith(("http://", "https://")):
        raise ValueError(f"The address {address!r} must begin with http:// or https://, for example {DEFAULT_URL}")
    if address.endswith("/v1"):
        raise ValueError(f"The address {address!r} must be the base address. Remove /v1")
    return address


def access_key(key: str | None) -> str:
    """The argument, else FRETWORK_KEY, else the content of the file FRETWORK_KEY_FILE; empty without a key."""
    if key is not None:
        return key
    if "FRETWORK_KEY" in os.environ:
        return os.environ["FRETWORK_KEY"].strip()
    file = os.environ.get("FRETWORK_KEY_FILE")
    return pathlib.Path(file).read_text(encoding="utf-8").strip() if file else ""
