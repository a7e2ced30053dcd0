"""Clients connect and send nothing.

    python idle.py TARGET COUNT

The server must not hold more connections than its limit.
"""

import asyncio

from client import addresses, argument, attack, connect, held

COUNT = argument(1)
SOURCES = addresses(15, COUNT)
SECONDS = 25
# The default of --connections.
LIMIT = 4096


async def stay(source, end, free, opened):
    """Connects, and keeps the connection."""
    try:
        async with asyncio.timeout_at(end), free:
            opened.append(await connect(source))
    except (ConnectionError, TimeoutError):
        pass


async def program():
    loop = asyncio.get_running_loop()
    end, free, opened = loop.time() + SECONDS, asyncio.Semaphore(200), []
    staying = asyncio.gather(*(stay(source, end, free, opened) for source in SOURCES))
    most = idle = 0
    while loop.time() < end:
        # While the kernel lists its table, connections close and others open. Two lists share what the server holds.
        most, idle = max(most, len(held().keys() & held().keys())), max(idle, len(held(SOURCES)))
        await asyncio.sleep(1)
    await staying
    assert most <= LIMIT, f"the server held {most} connections"
    for connection in opened:
        connection.close()
    return f"{len(opened)} connected; the server held at most {idle} of them, and {most} connections in total"


attack(program)
