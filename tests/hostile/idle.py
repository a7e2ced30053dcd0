"""Clients connect and send nothing.

    python idle.py TARGET COUNT

The server must not hold more connections than its limit.
"""

import asyncio
import time

from client import addresses, argument, attack, connect, held

COUNT = argument(1)
SOURCES = addresses(15, COUNT)
SECONDS = 25
# The default of --connections.
LIMIT = 4096


async def program():
    end, free = time.monotonic() + SECONDS, asyncio.Semaphore(200)

    async def open_one(source):
        async with free:
            try:
                return await asyncio.wait_for(connect(source), SECONDS)
            except (ConnectionError, TimeoutError):
                return None

    connections = await asyncio.gather(*map(open_one, SOURCES))
    most = 0
    while time.monotonic() < end:
        most = max(most, len(held(SOURCES)))
        await asyncio.sleep(1)
    opened = [connection for connection in connections if connection]
    for connection in opened:
        connection.close()
    assert most <= LIMIT, f"the server held {most} idle connections"
    return f"{len(opened)} connected; the server held at most {most} after that"


attack(program)
