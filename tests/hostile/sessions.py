"""Web pages and programs try to use the session of a browser, or to act as the sign-on proxy.

    python sessions.py TARGET

None may read or change anything: pages on another port and of another origin, a repeated header, a forged proxy, a key that
was revoked, a session that the attacker has chosen, an event stream of a session that has ended, and access keys.
"""

import asyncio
import json
import time

from client import ask, attack, connect, head, limit, outcome, post, receive, revoke, send, target, told
from server import STUDY

SOURCE = "127.14.0.1"
HERE = f"http://127.0.0.1:{target.port}"
NAME = f"fretwork-{target.port}"
# The server forgets a revoked key within a second.
REVOKED = limit(5)
# The server ends the streams of a session within this time.
STREAM = limit(10)


async def sign_in(key, **headers):
    """Signs in as a page of the server does. Returns the cookie as the browser sends it."""
    request = head("POST", "/v1/session", key, Origin=HERE, Content_Length=0, **headers)
    reply = await ask(SOURCE, request)
    assert reply.status == 204, reply
    return reply.headers["set-cookie"].split(";")[0]


async def status(source, method="GET", path="/v1/jobs", **headers):
    """The status of a request without a key."""
    more = {} if method == "GET" else {"Content_Length": 0}
    reply = await ask(source, head(method, path, **more, **headers))
    assert "access-control-allow-credentials" not in reply.headers, reply
    return reply.status


async def pages(cookie):
    """Requests that the browser of the user sends for pages of other origins."""
    others = [f"http://127.0.0.1:{target.port + 1}", "https://example.org", "null"]
    origins = [{"Origin": origin} for origin in others]
    sites = [{"Sec_Fetch_Site": site} for site in ["same-site", "cross-site"]]
    both = [{**origin, **site} for origin in origins for site in sites]
    found = []
    for headers in [*origins, *sites, *both, {"Origin": f"{HERE}\r\nOrigin: {others[0]}"}]:
        for method, path in [("GET", "/v1/jobs"), ("POST", "/v1/jobs/cancel?state=queued"), ("DELETE", "/v1/session")]:
            found.append(await status(SOURCE, method, path, Cookie=cookie, **headers))
    # A change needs proof that it comes from a page of the server.
    found.append(await status(SOURCE, "DELETE", "/v1/session", Cookie=cookie))
    return found


async def proxies():
    """Requests that name a user, but do not come from the proxy, or name two."""
    named = {"X_Remote_User": "chief", "X_Fretwork_Proxy_Secret": target.secret}
    wrong = target.secret[:-1] + "!"
    twice = {"X_Remote_User": "chief\r\nX-Remote-User: anna", "X_Fretwork_Proxy_Secret": target.secret}
    secrets = {"X_Remote_User": "chief", "X_Fretwork_Proxy_Secret": f"{wrong}\r\nX-Fretwork-Proxy-Secret: {target.secret}"}
    assert await status(target.proxy, **named) == 200, "the proxy itself is refused"
    return [
        await status(SOURCE, **named),
        await status(SOURCE, X_Forwarded_For=target.proxy, **named),
        await status(target.proxy, X_Remote_User="chief"),
        await status(target.proxy, X_Remote_User="chief", X_Fretwork_Proxy_Secret=wrong),
        await status(target.proxy, **twice),
        await status(target.proxy, **secrets),
        await status(target.proxy, "DELETE", "/v1/session", Origin="https://example.org", **named),
    ]


async def fixation(cookie):
    """A session that the attacker has chosen, or two sessions."""
    chosen = f"{NAME}={'0' * 64}"
    found = [await status(SOURCE, Cookie=chosen), await status(SOURCE, Cookie=f"{chosen}; {cookie}")]
    given = await sign_in(target.keys[0], Cookie=chosen)
    assert given != chosen, "the server took the session of the attacker"
    found.append(await status(SOURCE, Cookie=chosen))
    # The session that was there before ends.
    await sign_in(target.keys[1], Cookie=given)
    found.append(await status(SOURCE, Cookie=given))
    return found


async def revoked():
    """The session of a key that was revoked."""
    cookie = await sign_in(target.leaver)
    assert await status(SOURCE, Cookie=cookie) == 200
    revoke("leaver")
    end = time.monotonic() + REVOKED
    while await status(SOURCE, Cookie=cookie) == 200:
        assert time.monotonic() < end, f"the session of a revoked key is valid after {REVOKED} s"
        await asyncio.sleep(0.1)
    return [await status(SOURCE, Cookie=cookie)]


async def stream():
    """An event stream that a browser has opened before its user signs out."""
    cookie = await sign_in(target.bystander)
    reply = await ask(SOURCE, post("/v1/jobs", target.bystander, STUDY))
    assert reply.status == 202, reply
    job = f"/v1/jobs/{json.loads(reply.body)['id']}"
    events = await connect(SOURCE)
    with events:
        await send(events, head("GET", f"{job}/events", Cookie=cookie))
        seen = b""
        while b"event: snapshot" not in seen:
            seen += await receive(events)
        assert (await ask(SOURCE, head("DELETE", "/v1/session", Cookie=cookie, Origin=HERE, Content_Length=0))).status == 204
        async with asyncio.timeout(STREAM):
            # The last chunk of a chunked body is empty.
            while not seen.endswith(b"\r\n0\r\n\r\n"):
                more = await receive(events)
                assert more, "the server closed the connection in the middle of an answer"
                seen += more
    assert b'"succeeded"' not in seen, "the stream outlived its session"
    found = [await status(SOURCE, path=f"{job}/events", Cookie=cookie)]
    assert (await ask(SOURCE, post(f"{job}/cancel", target.bystander, {}))).status == 200
    return found


async def keys(cookie):
    """Access keys, for callers who are no administrators, and for other pages in the browser of one."""
    chief = await sign_in(target.chief)
    before = json.loads((await ask(SOURCE, head("GET", "/v1/keys", target.chief))).body)["keys"]
    link = target.links[0].split("?")[1]
    named = {"X_Remote_User": "chief", "X_Fretwork_Proxy_Secret": target.secret}
    callers = [
        (SOURCE, "", {"Cookie": cookie, "Origin": HERE}),
        (SOURCE, f"?{link}", {}),
        (SOURCE, f"?{link}", {"Cookie": chief, "Origin": HERE}),
        (SOURCE, "", {"Authorization": f"Bearer {target.reader}"}),
        (SOURCE, "", {"Authorization": f"Bearer {target.reader}", "Cookie": chief, "Origin": HERE}),
        (target.proxy, "", named),
        (target.proxy, "", {**named, "Cookie": chief, "Origin": HERE}),
        (SOURCE, "", {"Cookie": chief, "Origin": f"http://127.0.0.1:{target.port + 1}"}),
        (SOURCE, "", {"Cookie": chief, "Sec_Fetch_Site": "same-site"}),
        (SOURCE, "", {}),
    ]
    found = []
    for source, query, headers in callers:
        for method, path in [("GET", "/v1/keys"), ("POST", "/v1/keys"), ("DELETE", f"/v1/keys/{before[0]['id']}")]:
            found.append(await status(source, method, path + query, **headers))
    # A change with the cookie of an administrator needs proof that it comes from a page of the server.
    found.append(await status(SOURCE, "POST", "/v1/keys", Cookie=chief))
    after = json.loads((await ask(SOURCE, head("GET", "/v1/keys", target.chief))).body)["keys"]
    assert [(key["id"], key["revoked"]) for key in after] == [(key["id"], key["revoked"]) for key in before], after
    return found


async def program():
    cookie = await sign_in(target.keys[0])
    found = [*await pages(cookie), *await proxies(), *await fixation(cookie), *await keys(cookie), *await revoked(), *await stream()]
    assert set(found) <= {401, 403}, told(map(str, found))
    # The attacks have not ended the session of the user.
    reply = await ask(SOURCE, head("GET", "/v1/me", Cookie=cookie))
    assert outcome(reply) == "200" and json.loads(reply.body)["name"] == "attacker", reply
    return told(map(str, found))


attack(program)
