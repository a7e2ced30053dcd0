"""One caller compares scenarios with all results, many times at once, while another lists results.

    python comparisons.py TARGET

The list must not take more than 0.5 s longer than without the comparisons.
"""

import asyncio
import itertools
import statistics
import time

from client import addresses, answer, attack, connect, head, outcome, post, send, target, told

AT_ONCE, SECONDS, RESULTS, DELAY = 64, 5, 2000, 0.5
SOURCES = addresses(17, AT_ONCE)


def scenario(friction):
    """A small run."""
    return {
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
        "friction": friction,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "depth"},
        "motion": {"amplitude": "2 um"},
        "cycles": [1000, 10000],
        "profiles_at": "none",
        "model": {"method": "simplified", "points": 16},
    }


async def fill(source, frictions):
    """Computes results, one after the other."""
    with await connect(source) as connection:
        for friction in frictions:
            request = post("/v1/jobs", target.keys[0], {"scenario": scenario(friction)}, Prefer="wait=10")
            await send(connection, request)
            reply = await answer(connection)
            assert reply.status == 200, reply


async def compare(source, end):
    """Sends comparisons, one after the other. Answers what the client got."""
    got = []
    with await connect(source) as connection:
        while time.monotonic() < end:
            friction = 0.5 + len(got) / 1e6
            await send(connection, post("/v1/results/diff", target.reader, {"a": {"scenario": scenario(friction)}}))
            got.append(outcome(await answer(connection)))
            if got[-1] != "200":
                await asyncio.sleep(0.1)
    return got


async def lists(end):
    """The times that the lists of another caller take, in seconds."""
    times = []
    with await connect("127.0.0.1") as connection:
        while time.monotonic() < end:
            began = time.monotonic()
            await send(connection, head("GET", "/v1/results?sort=-wear_volume&limit=100", target.bystander))
            reply = await answer(connection)
            assert reply.status == 200, reply
            times.append(time.monotonic() - began)
            await asyncio.sleep(0.02)
    return times


async def program():
    frictions = iter(0.3 + place / 1e5 for place in range(RESULTS))
    await asyncio.gather(*(fill(source, frictions) for source in SOURCES[:16]))
    alone = statistics.median(await lists(time.monotonic() + 1))
    end = time.monotonic() + SECONDS
    times, *got = await asyncio.gather(lists(end), *(compare(source, end) for source in SOURCES))
    slowest = max(times)
    got = told(itertools.chain.from_iterable(got))
    report = f"{got}; {len(times)} lists of another caller: {alone:.3f} s alone, slowest {slowest:.3f} s"
    assert slowest <= alone + DELAY, report
    return report


attack(program)
