"""Clients send the head of a request byte by byte, and connect again when the server closes.

    python headers.py TARGET COUNT

The server must close each connection whose head does not become complete. It waits 10 s for a head.
"""

import asyncio
import math
import time

from client import addresses, argument, attack, connect, limit, receive, send

COUNT = argument(1)
SOURCES = addresses(13, COUNT, each=400)
SECONDS = 18
# The server looks at its connections every 5 s.
LONGEST = limit(15)
HEAD = b"GET /v1/results HTTP/1.1\r\nX-Slow: " + b"x" * 100


async def drip(connection):
    """Sends one byte every 2 s, until the server closes."""
    for byte in HEAD:
        if not await send(connection, bytes([byte])):
            return
        await asyncio.sleep(2)


async def life(source, longest):
    """How long a connection lives, in seconds; infinity if the server does not close it within `longest`."""
    began = time.monotonic()
    try:
        async with asyncio.timeout(longest):
            with await connect(source) as connection:
                dripping = asyncio.create_task(drip(connection))
                try:
                    while await receive(connection):
                        pass
                finally:
                    dripping.cancel()
    except ConnectionError:
        pass
    except TimeoutError:
        return math.inf
    return time.monotonic() - began


async def hold(source, end):
    """Keeps one connection open, and connects again until the attack ends. Tells how long the first one lived."""
    lived = await life(source, LONGEST)
    while (left := end - time.monotonic()) > 0:
        await asyncio.sleep(1)
        await life(source, left)
    return lived


async def program():
    end = time.monotonic() + SECONDS
    lives = await asyncio.gather(*(hold(source, end) for source in SOURCES))
    unclosed = lives.count(math.inf)
    assert unclosed == 0, f"{unclosed} connections without a whole head were open after {LONGEST} s"
    return f"{len(lives)} connections; the longest lived {max(lives):.1f} s"


attack(program)
