"""Requests with a missing or repeated `Host`, or with a compressed body.

    python hosts.py TARGET
"""

from client import ask, attack, target, told

AUTHORIZATION = f"Authorization: Bearer {target.reader}"
HOST = "Host: 127.0.0.1"
REQUESTS = {
    "one Host": ("GET /v1/me HTTP/1.1", [HOST], 200),
    "no Host": ("GET /v1/me HTTP/1.1", [], 400),
    "two hosts": ("GET /v1/me HTTP/1.1", [HOST, "Host: other.example"], 400),
    "the same Host twice": ("GET /v1/me HTTP/1.1", [HOST, HOST], 400),
    "an address with a host, but no Host": ("GET http://127.0.0.1/v1/me HTTP/1.1", [], 400),
    "a compressed body": (
        "POST /v1/scenarios HTTP/1.1",
        [HOST, "Content-Type: application/json", "Content-Encoding: gzip", "Content-Length: 2"],
        415,
    ),
}


async def program():
    got, wrong = [], []
    for name, (first, headers, expected) in REQUESTS.items():
        body = "{}" if first.startswith("POST") else ""
        request = "\r\n".join([first, AUTHORIZATION, *headers, "", body]).encode()
        reply = await ask("127.18.0.1", request)
        got.append(str(reply.status))
        if reply.status != expected:
            wrong.append(f"{name}: {reply.status} instead of {expected}")
    assert not wrong, "; ".join(wrong)
    return told(got)


attack(program)
