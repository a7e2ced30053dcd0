"""A caller who may only read sends bodies that are small as bytes and large as trees.

    python bodies.py TARGET

The server must refuse each as faulty or too large, or with 503 while it has no memory for the body.
"""

import asyncio
import time

from client import addresses, ask, attack, outcome, post, target, told

AT_ONCE = 64
SOURCES = addresses(12, AT_ONCE, each=16)
LETTERS = "abcdefghijklmnopqrstuvwxyz"


def names():
    """400 000 short names."""
    return (f"{a}{b}{c}{d}" for a in LETTERS for b in LETTERS for c in LETTERS for d in LETTERS[:23])


BODIES = {
    "blocks": b'{"scenario": {"motion": {"blocks": [' + b",".join([b'{"x": 1}'] * 400_000) + b"]}}}",
    "nesting": b'{"scenario": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
    "members": ('{"scenario": {' + ",".join(f'"{name}":1' for name in names()) + "}}").encode(),
    "string": b'{"label": "' + b"x" * 4_000_000 + b'"}',
    "numbers": b'{"scenario": {"profile": {"shape": "table", "radius": [' + b",".join([b"0.12345"] * 400_000) + b"]}}}",
}


async def program():
    report = []
    for name, body in BODIES.items():
        began = time.monotonic()
        request = post("/v1/scenarios", target.reader, body)
        replies = await asyncio.gather(*(ask(source, request) for source in SOURCES))
        got = told(map(outcome, replies))
        statuses = {reply and reply.status for reply in replies}
        assert statuses <= {413, 422, 503} and statuses != {503}, f"{name}: {got}"
        report.append(f"{name} {got} in {time.monotonic() - began:.1f} s")
    return "; ".join(report)


attack(program)
