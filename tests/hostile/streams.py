"""Many clients follow the events of one running job.

    python streams.py TARGET COUNT

Each stream must stay open until the job ends, unless the server refuses it at once.
"""

import asyncio
import contextlib
import json

from client import addresses, argument, ask, attack, connect, head, post, receive, send, target, told

COUNT = argument(1)
SOURCES = addresses(16, COUNT)
# Enough to connect all streams on a busy machine.
SECONDS = 40
# Takes longer than this program.
BLOCKS = [{"amplitude": f"{(2.5, 8)[i % 2] + i % 7 / 100} um", "cycles": 200_000} for i in range(1000)]
JOB = {
    "scenario": {
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "112 GPa", "tangential": "92 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "force"},
        "motion": {"blocks": BLOCKS},
        "cycles": {"from": 200_000, "to": 200_000_000, "count": 1000, "spacing": "linear"},
        "profiles_at": "none",
        "model": {"points": 4096, "tolerance": 1e-4, "compare": True},
    }
}


async def follow(source, key, job, end, free):
    """Follows the job until `end`. Tells what the client got."""
    got, state = b"", "not connected"
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout_at(end):
            try:
                async with free:
                    connection = await connect(source)
            except ConnectionError:
                return "refused"
            with connection:
                state = "no event"
                await send(connection, head("GET", f"/v1/jobs/{job}/events", key))
                while more := await receive(connection):
                    if state == "open":
                        continue
                    got += more
                    if b"\r\n\r\n" in got and not got.startswith(b"HTTP/1.1 200"):
                        return got[9:12].decode()
                    if b"event: snapshot" in got:
                        state = "open"
                return "cut" if state == "open" else "refused"
    return state


async def program():
    end, free = asyncio.get_running_loop().time() + SECONDS, asyncio.Semaphore(200)
    submitted = await ask("127.0.0.1", post("/v1/jobs", target.keys[0], JOB))
    assert submitted and submitted.status in (200, 202), f"the job was not accepted: {submitted}"
    job = json.loads(submitted.body)["id"]
    keys = [target.keys[-1 - place // 250] for place in range(COUNT)]
    streams = [follow(source, key, job, end, free) for source, key in zip(SOURCES, keys)]
    ends = await asyncio.gather(*streams)
    state = await ask("127.0.0.1", head("GET", f"/v1/jobs/{job}", target.keys[0]))
    await ask("127.0.0.1", post(f"/v1/jobs/{job}/cancel", target.keys[0], {}))
    got = told(ends)
    assert json.loads(state.body)["state"] == "running", state.body
    assert set(ends) <= {"open", "503", "refused"}, got
    assert "open" in ends, got
    return got


attack(program)
