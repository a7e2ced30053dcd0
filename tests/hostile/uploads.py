"""Clients send the body of a request byte by byte.

    python uploads.py TARGET COUNT

The server must answer 408, or close, because the body arrives with less than 4 KiB/s after 10 s.
"""

import asyncio
import contextlib
import time

from client import addresses, answer, argument, attack, connect, head, limit, outcome, send, target, told

COUNT = argument(1)
SOURCES = addresses(14, COUNT, each=250)
DEADLINE = limit(20)


async def drip(connection, chunked):
    """Sends one byte every 0.5 s."""
    while await send(connection, b"1\r\n \r\n" if chunked else b" "):
        await asyncio.sleep(0.5)


async def upload(place):
    """Sends one request, half of them without a length. Tells what the client got, and after how many seconds."""
    began, dripping, got = time.monotonic(), None, "waits"
    chunked = place % 2 == 1
    length = {"Transfer_Encoding": "chunked"} if chunked else {"Content_Length": 4_000_000}
    request = head("POST", "/v1/scenarios", target.keys[place // 250], Content_Type="application/json", **length)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(DEADLINE):
            try:
                with await connect(SOURCES[place]) as connection:
                    await send(connection, request)
                    dripping = asyncio.create_task(drip(connection, chunked))
                    got = outcome(await answer(connection))
            except ConnectionError:
                got = "closed"
    if dripping:
        dripping.cancel()
    return got, time.monotonic() - began


async def program():
    ends = await asyncio.gather(*(upload(place) for place in range(COUNT)))
    got = told(name for name, _ in ends)
    assert {name for name, _ in ends} <= {"408", "503", "closed"}, got
    assert "408" in got, got
    return f"{got}; the last after {max(took for _, took in ends):.1f} s"


attack(program)
