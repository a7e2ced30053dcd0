"""The address of the server and the access key, from arguments or from the environment."""

from __future__ import annotations

import os
import pathlib
import warnings

DEFAULT_URL = "http://127.0.0.1:8080"


def base_address(url: str | None) -> str:
    """The address that the server prints at its start: all paths such as `/v1/jobs` are below it."""
    address = (url or os.environ.get("FRETWORK_URL") or DEFAULT_URL).rstrip("/")
    if not address.startswith(("http://", "https://")):
        raise ValueError(f"The address {address!r} must begin with http:// or https://, for example {DEFAULT_URL}")
    if address.endswith("/v1"):
        raise ValueError(f"The address {address!r} must be the base address. Remove /v1")
    return address


def access_key(key: str | None, address: str) -> str:
    """The argument, else FRETWORK_KEY, else the content of the file FRETWORK_KEY_FILE; empty without a key.

    The key of the environment belongs to the server of the environment. No other server gets it.
    """
    if key is not None:
        return key
    file = os.environ.get("FRETWORK_KEY_FILE")
    if ("FRETWORK_KEY" in os.environ or file) and address != base_address(None):
        message = f"The key of the environment is for {base_address(None)}. For {address}, set FRETWORK_URL, or pass `key`"
        warnings.warn(message, stacklevel=4)
        return ""
    if "FRETWORK_KEY" in os.environ:
        return os.environ["FRETWORK_KEY"].strip()
    return pathlib.Path(file).read_text(encoding="utf-8").strip() if file else ""
