"""Clients send the head of a request byte by byte, and connect again when the server closes.

    python headers.py TARGET COUNT

The server must close each connection whose head is not complete after 10 s.
"""

import asyncio
import contextlib
import time

from client import addresses, argument, attack, connect, receive, send

COUNT = argument(1)
SOURCES = addresses(13, COUNT, each=400)
SECONDS = 18
# The server looks at its connections every 5 s.
LONGEST = 15
HEAD = b"GET /v1/results HTTP/1.1\r\nX-Slow: " + b"x" * 100


async def drip(connection):
    """Sends one byte every 2 s, until the server closes."""
    for byte in HEAD:
        if not await send(connection, bytes([byte])):
            return
        await asyncio.sleep(2)


async def hold(source, end, lives):
    """Keeps one connection open, and notes how long each lived. Waits before it connects again."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout_at(end):
            while True:
                began = time.monotonic()
                with contextlib.suppress(ConnectionError), await connect(source) as connection:
                    dripping = asyncio.create_task(drip(connection))
                    try:
                        while await receive(connection):
                            pass
                    finally:
                        dripping.cancel()
                        lives.append(time.monotonic() - began)
                await asyncio.sleep(1)


async def program():
    end, lives = asyncio.get_running_loop().time() + SECONDS, []
    await asyncio.gather(*(hold(source, end, lives) for source in SOURCES))
    assert lives, "no connection was made"
    longest = max(lives)
    assert longest < LONGEST, f"a connection without a whole head lived {longest:.1f} s"
    return f"{len(lives)} connections; the longest lived {longest:.1f} s"


attack(program)
