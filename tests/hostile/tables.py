"""Callers compute studies with large tables and large runs, two callers each of them. Two owners with many callers read these tables
and the large result: reports, statistics, tables and figures, each in another form. Two more owners send scenarios of 2 MB.

    python tables.py TARGET

The server may refuse them with 503. Afterwards it must serve both owners of readers.
"""

import asyncio
import collections
import itertools
import json
import time

from client import addresses, ask, attack, head, lasting, outcome, post, target, told
from server import LARGE, SMALL

READERS, WRITERS, SECONDS, POINTS = 24, 8, 10, 4000
SOURCES = addresses(18, READERS + WRITERS)
SCENARIO = SMALL | {"profiles_at": "all"}
# A table of about 50 MB: 780 worn radii for each point.
CURVES = {"radius": {"from": "100 um", "to": "180 um", "count": 780}, "fields": ["wear"]}
PATHS = [
    "report",
    "statistics",
    "table?format=csv&digits={digits}",
    "profiles?format=csv&digits={digits}",
    "profiles?format=ndjson&digits={digits}",
    "?format=npz&digits={digits}",
    "plot.svg",
    "histogram",
]


def study(number):
    """A sweep with numbers of its own."""
    vary = {"pointer": "/friction", "from": 0.5, "to": 0.8 + number / 100, "count": POINTS}
    return json.dumps({"sweep": {"scenario": SCENARIO, "vary": [vary], "outputs": ["wear_volume"], "profiles": CURVES}}).encode()


def run(number):
    """A run with numbers of its own and about 15 MB of profiles."""
    cycles = {"from": 1000, "to": 100_000, "count": 40, "spacing": "log"}
    return json.dumps({"scenario": LARGE | {"friction": 0.5 + number / 100, "cycles": cycles}}).encode()


def scenario(number):
    """A body of 2 MB: a measured profile of 70 000 points."""
    radius = [place * 1e-8 for place in range(70_000)]
    profile = {"shape": "table", "radius": radius, "height": [r * r / (0.02 + number / 1e6) for r in radius]}
    return json.dumps({"scenario": SCENARIO | {"profile": profile}}).encode()


async def served(request):
    """The body of an answer. Repeats a request that the server refuses for now."""
    while (reply := await ask(SOURCES[0], request)) is None or reply.status == 503:
        await asyncio.sleep(0.2)
    assert reply.status in (200, 202), reply
    return reply.body


async def result(body, key):
    """Computes a job, or joins it. Returns the path of its result."""
    found = json.loads(await served(post("/v1/jobs", key, body)))
    while found["state"] != "succeeded":
        assert found["state"] in ("queued", "running"), found
        await asyncio.sleep(0.2)
        found = json.loads(await served(head("GET", f"/v1/jobs/{found['id']}", key)))
    return f"/v1/results/{found['key']}"


async def read(place, paths, end, got):
    """Reads one view after the other."""
    for number in itertools.count():
        if time.monotonic() >= end:
            return
        view = PATHS[(place + number) % len(PATHS)]
        path = paths[number % len(paths)] + "/" + view.format(digits=4 + place % 8)
        reply = await ask(SOURCES[place], head("GET", path.replace("/?", "?"), (*target.readers, *target.keys)[place % 8]))
        got[view].append(outcome(reply))


async def write(place, body, end, got):
    """Sends a scenario of 2 MB."""
    while time.monotonic() < end:
        key = (target.reader, target.leaver)[place % 2]
        reply = await ask(SOURCES[READERS + place], post("/v1/scenarios", key, body))
        got["scenario"].append(outcome(reply))


async def program():
    large = target.links[0].split("?")[0]
    # To make them takes longer than the server waits for a request.
    scenarios = [scenario(place) for place in range(WRITERS)]
    first = await result(study(0), target.keys[0])
    end, got = time.monotonic() + lasting(SECONDS), collections.defaultdict(list)
    paths = [large, first]
    reading = [read(place, paths, end, got) for place in range(READERS)]
    writing = [write(place, body, end, got) for place, body in enumerate(scenarios)]
    bodies = [study(1), run(1), study(2), run(2)][: 4 if target.has_limits else 2]
    computing = [result(body, key) for body in bodies for key in target.keys[:2]]
    await asyncio.gather(*reading, *writing, *computing)
    for key in (target.readers[0], target.keys[0]):
        for view in ("statistics", "table?format=csv"):
            await served(head("GET", f"{first}/{view}", key))
    return "; ".join(f"{name.split('?')[0] or 'result'} {told(outcomes)}" for name, outcomes in got.items())


attack(program)
