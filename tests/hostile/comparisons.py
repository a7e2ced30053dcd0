"""One caller compares scenarios with all results, many times at once, while another lists results.

    python comparisons.py TARGET

The server must not answer each comparing connection many times while a list waits. With limits, a list must not take more
than 0.5 s longer than without the comparisons.
"""

import asyncio
import itertools
import statistics
import time

from client import addresses, answer, attack, connect, head, lasting, outcome, post, send, target, told

AT_ONCE, SECONDS, RESULTS, DELAY = 64, 5, 2000, 0.5
# Most comparisons that the server may answer while a list waits.
OVERTAKING = 8 * AT_ONCE
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
            request = post("/v1/jobs", target.keys[0], {"scenario": scenario(friction)}, Prefer="wait=60")
            await send(connection, request)
            # Beside other attacks, the server may refuse a run for now.
            while (reply := await answer(connection)).status == 503:
                await asyncio.sleep(0.2)
                await send(connection, request)
            assert reply.status == 200, reply


async def compare(source, end, got):
    """Sends comparisons, one after the other. Appends what the client got."""
    with await connect(source) as connection:
        for number in itertools.count():
            if time.monotonic() > end:
                return
            friction = 0.5 + number / 1e6
            await send(connection, post("/v1/results/diff", target.reader, {"a": {"scenario": scenario(friction)}}))
            got.append(outcome(await answer(connection)))
            if got[-1] != "200":
                await asyncio.sleep(0.1)


async def lists(end, got):
    """The times that the lists of another caller take, in seconds, and how many comparisons the server answers meanwhile."""
    times, overtaking = [], []
    with await connect("127.0.0.1") as connection:
        while time.monotonic() < end:
            began, before = time.monotonic(), got.count("200")
            await send(connection, head("GET", "/v1/results?sort=-wear_volume&limit=100", target.bystander))
            reply = await answer(connection)
            assert reply.status == 200, reply
            times.append(time.monotonic() - began)
            overtaking.append(got.count("200") - before)
            await asyncio.sleep(0.02)
    return times, overtaking


async def program():
    frictions = iter(0.3 + place / 1e5 for place in range(RESULTS))
    await asyncio.gather(*(fill(source, frictions) for source in SOURCES[:16]))
    got = []
    alone = statistics.median((await lists(time.monotonic() + 1, got))[0])
    end = time.monotonic() + lasting(SECONDS)
    (times, overtaking), *_ = await asyncio.gather(lists(end, got), *(compare(source, end, got) for source in SOURCES))
    report = (f"{told(got)}; {len(times)} lists of another caller: {alone:.3f} s alone, slowest {max(times):.3f} s, "
              f"behind at most {max(overtaking)} comparisons")
    assert max(overtaking) <= OVERTAKING, report
    assert not target.has_limits or max(times) <= alone + DELAY, report
    return report


attack(program)
