"""Clients with small receive buffers request a large result, each in another form. Half of them use share links, the
others the keys of one owner.

    python answers.py TARGET COUNT RATE

They take RATE bytes per second, or nothing. The server must close each connection that leaves bytes waiting.
"""

import asyncio
import itertools
import time

from client import addresses, argument, attack, connect, head, held, limit, peek, receive, send, target, told

COUNT, RATE = argument(1), argument(2)
SOURCES = addresses(11 if RATE else 10, COUNT, each=250)
# From the request of a connection on. The server may wait 5 s for memory, and make the answer in 5 s. Then a connection
# may take nothing for 20 s, and the server looks every 5 s.
DEADLINE = limit(45)
PARTS = [
    ("", "format=json"),
    ("", "format=npz"),
    ("/profiles", "format=csv"),
    ("/profiles", "format=json&layout=records"),
    ("/profiles", "format=ndjson"),
    ("/profiles", "format=arrow"),
]
# Each eighth request is for the whole result as it is stored.
UNCHANGED = 8
CODINGS = ["identity", "zstd", "gzip"]
# The two attacks with this program share no form.
POINTS = 4000 if RATE else 4096
FORMS = list(itertools.product(range(4, 12), ["si", "engineering"], PARTS))


def form(place):
    """The request of one client. One key may have 256 requests at once, also by its links."""
    by_link, number = place % 2 == 0, place // 2
    digits, units, (part, form) = FORMS[place % len(FORMS)]
    points = POINTS - place // len(FORMS)
    path, link = target.links[number % len(target.links)].split("?")
    key = None if by_link else target.readers[number % len(target.readers)]
    credentials = f"{link}&" if by_link else ""
    coding = CODINGS[place // len(PARTS) % len(CODINGS)]
    view = "" if place % UNCHANGED == 0 else f"{form}&digits={digits}&units={units}&points={points}"
    part = part if view else ""
    address = f"{path}{part}?{credentials}{view}"
    return head("GET", address, key, Accept_Encoding=coding)


async def trickle(connection):
    """Takes a few bytes per second, until the server closes."""
    while await receive(connection, max(1, RATE // 4)):
        await asyncio.sleep(0.25)


async def start(place):
    """Sends the request of one client. Returns its connection, and when it sent the request."""
    connection = await connect(SOURCES[place], receive_buffer=4096)
    await send(connection, form(place))
    return connection, time.monotonic()


async def program():
    began = dict(await asyncio.gather(*(start(place) for place in range(COUNT))))
    # An answer can pause while the server makes its next bytes, so one look is not enough.
    seen, readers, quiet, took = {}, [], 0, 0
    while quiet < 2:
        await asyncio.sleep(1)
        unread, now = held(SOURCES), time.monotonic()
        for connection in began:
            if connection not in seen and (first := peek(connection)) is not None:
                seen[connection] = first[9:12].decode() or "closed"
                if RATE:
                    readers.append(asyncio.create_task(trickle(connection)))
        waiting = [connection for connection in began if connection not in seen or unread.get(connection.getsockname())]
        quiet = 0 if waiting else quiet + 1
        took = max([took, *(now - began[connection] for connection in waiting)])
        assert took < DEADLINE, f"{told(seen.values())}; {len(waiting)} connections wait after {took:.0f} s"
    for reader in readers:
        reader.cancel()
    for connection in began:
        connection.close()
    assert "500" not in seen.values(), told(seen.values())
    return f"{told(seen.values())}; no connection waits after {took:.0f} s"


attack(program)
