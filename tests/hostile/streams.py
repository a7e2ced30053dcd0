"""Many clients follow the events of one running study.

    python streams.py TARGET COUNT

Each stream must stay open until the job ends, unless the server refuses it at once.
"""

import asyncio
import contextlib
import json
import time

from client import addresses, argument, ask, attack, connect, head, limit, post, receive, send, target, told
from server import STUDY

COUNT = argument(1)
SOURCES = addresses(16, COUNT)
# As long as the other attacks of the group take, and the time to connect all streams.
LEAST, MOST = 30, limit(40)


async def follow(place, key, job, free, states):
    """Follows the job. Notes what the client got."""
    got, states[place] = b"", "not connected"
    try:
        async with free:
            connection = await connect(SOURCES[place])
    except ConnectionError:
        states[place] = "refused"
        return
    with connection:
        states[place] = "no event"
        await send(connection, head("GET", f"/v1/jobs/{job}/events", key))
        while more := await receive(connection):
            if states[place] == "open":
                continue
            got += more
            if b"\r\n\r\n" in got and not got.startswith(b"HTTP/1.1 200"):
                states[place] = got[9:12].decode()
                return
            if b"event: snapshot" in got:
                states[place] = "open"
        states[place] = "cut" if states[place] == "open" else "refused"


async def program():
    free, states, began = asyncio.Semaphore(200), {}, time.monotonic()
    submitted = await ask("127.0.0.1", post("/v1/jobs", target.keys[0], STUDY))
    assert submitted and submitted.status in (200, 202), f"the job was not accepted: {submitted}"
    job = json.loads(submitted.body)["id"]
    keys = [target.keys[-1 - place // 250] for place in range(COUNT)]
    streams = asyncio.gather(*(follow(place, keys[place], job, free, states) for place in range(COUNT)))
    took = 0
    while took < LEAST or took < MOST and {"not connected", "no event"} & set(states.values()):
        await asyncio.sleep(0.5)
        took = time.monotonic() - began
    streams.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await streams
    ends = list(states.values())
    state = await ask("127.0.0.1", head("GET", f"/v1/jobs/{job}", target.keys[0]))
    await ask("127.0.0.1", post(f"/v1/jobs/{job}/cancel", target.keys[0], {}))
    got = told(ends)
    assert json.loads(state.body)["state"] == "running", state.body
    assert set(ends) <= {"open", "503", "refused"}, got
    assert "open" in ends, got
    return got


attack(program)
