"""One caller sends studies that are small as bytes and large as work, and calls models of UM-Bridge with large configs.

    python studies.py TARGET

The server must refuse each study as faulty or too large, or with 503 while it has no memory for the body. It may answer the
calls, one after the other for each worker. Another caller evaluates a small scenario meanwhile. The server must not answer each
connection that calls while the evaluation waits. With limits, it must not take longer than 1 s.
"""

import asyncio
import itertools
import json
import time

from client import addresses, answer, ask, attack, connect, lasting, outcome, post, send, target, told

AT_ONCE, SECONDS, LONGEST = 32, 5, 1
# The heights of the profile that the calls vary. Each takes several runs for a gradient.
HEIGHTS = range(1, 6)
SOURCES = addresses(13, 2 * AT_ONCE)
SCENARIO = {
    "profile": {"shape": "paraboloid", "radius": "10 mm"},
    "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
    "friction": 0.7,
    "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
    "load": {"normal_force": "100 N"},
    "motion": {"amplitude": "2 um"},
    "cycles": [1000],
    "profiles_at": "none",
    "model": {"method": "simplified", "points": 16},
}
RANGE = {"pointer": "/friction", "from": 0.5, "to": 0.7}


def study(**members):
    """The body of a sweep."""
    sweep = {"scenario": SCENARIO, "vary": [RANGE | {"count": 3}], "outputs": ["wear_volume"]}
    return json.dumps({"sweep": sweep | members}).encode()


STUDIES = {
    "members": study(vary=[RANGE | {"count": 2}] * 50_000),
    "values": study(vary=[{"pointer": "/friction", "values": [0.5] * 700_000}]),
    "outputs": study(outputs=["wear_volume"] * 200_000),
    "samples": study(vary=[RANGE], design="sobol", samples=2**32 - 1),
    "grid": study(vary=[{"pointer": f"/{name}", "from": 1, "to": 2, "count": 10**9} for name in ("friction", "motion/amplitude")]),
}


def call_body():
    """A call with a config of 100 kB: a scenario with a measured profile. FRICTION stands for a number in it."""
    radius = [place * 1e-6 for place in range(2500)]
    height = [r * r / 0.02 for r in radius]
    profile = {"shape": "table", "radius": radius, "height": height}
    scenario = SCENARIO | {"profile": profile, "friction": "FRICTION"}
    pointers = [f"/profile/height/{point}" for point in HEIGHTS]
    config = {"scenario": scenario, "parameters": pointers, "outputs": ["wear_volume"]}
    point = [height[index] for index in HEIGHTS]
    call = {"name": "wear", "config": config, "input": [point], "outWrt": 0, "inWrt": 0, "sens": [1]}
    return json.dumps(call).replace('"FRICTION"', "FRICTION").encode()


CALL = call_body()


def calls(place):
    """Calls whose configs differ, so that the server reads each anew."""
    for number in itertools.count():
        # Written once above: while this program writes JSON, it cannot measure the evaluations.
        body = CALL.replace(b"FRICTION", str(0.5 + place / 1e3 + number / 1e6).encode())
        yield post("/Gradient" if number % 2 else "/Evaluate", target.keys[place % len(target.keys)], body)


async def submit(name, body):
    """The same study on many connections at once. Answers what they got."""
    began = time.monotonic()
    request = post("/v1/jobs", target.keys[0], body)
    replies = await asyncio.gather(*(ask(source, request) for source in SOURCES[:AT_ONCE]))
    got, statuses = told(map(outcome, replies)), {reply and reply.status for reply in replies}
    assert statuses <= {413, 422, 503} and statuses != {503}, f"{name}: {got}"
    return f"{name} {got} in {time.monotonic() - began:.1f} s"


async def call(place, end, got):
    """Calls, one after the other. Appends what the client got."""
    with await connect(SOURCES[AT_ONCE + place]) as connection:
        for request in calls(place):
            if time.monotonic() > end:
                return
            await send(connection, request)
            reply = await answer(connection)
            got.append(outcome(reply))
            if reply is None or reply.headers.get("connection") == "close":
                return


async def evaluate(end, got):
    """The longest time of an evaluation of another caller, in seconds, and most calls that the server answers meanwhile."""
    slowest = overtaking = 0
    with await connect("127.0.0.1") as connection:
        while time.monotonic() < end:
            began, before = time.monotonic(), len(got)
            body = {"scenario": SCENARIO, "outputs": ["wear_volume"]}
            await send(connection, post("/v1/evaluate", target.bystander, body))
            reply = await answer(connection)
            assert reply.status == 200, reply
            slowest, overtaking = max(slowest, time.monotonic() - began), max(overtaking, len(got) - before)
            await asyncio.sleep(0.02)
    return slowest, overtaking


async def program():
    report = [await submit(name, body) for name, body in STUDIES.items()]
    end, got = time.monotonic() + lasting(SECONDS), []
    (slowest, overtaking), *_ = await asyncio.gather(evaluate(end, got), *(call(place, end, got) for place in range(AT_ONCE)))
    report.append(f"calls {told(got)}; another caller's evaluation: {slowest:.2f} s, behind at most {overtaking} calls")
    assert overtaking < 2 * AT_ONCE and (not target.has_limits or slowest < LONGEST), report[-1]
    return "; ".join(report)


attack(program)
