"""HTTP/2 clients (with prior knowledge) give no window to the answers of many streams, or send half a preface.

    python http2.py TARGET

The server must end each answer that its client does not take, and close a connection whose preface does not become
complete. It waits 10 s for a preface.
"""

import asyncio
import itertools
import math
import struct
import time

from client import addresses, attack, connect, limit, receive, send, target, told

CONNECTIONS, STREAMS, PREFACES = 8, 32, 64
SOURCES = addresses(19, CONNECTIONS + PREFACES)
# The server may wait 10 s for memory. Then a connection may take nothing for 20 s, and the server looks every 5 s.
DEADLINE, PREFACE_DEADLINE = limit(45), limit(15)
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, RST_STREAM, SETTINGS, PING = 0, 1, 3, 4, 6
END_STREAM, END_HEADERS, ACK = 1, 4, 1
INITIAL_WINDOW_SIZE = 4
# The field `:status: 200` (RFC 7541, appendix A).
STATUS_200 = b"\x88"


def frame(kind, flags, stream, payload=b""):
    """A frame (RFC 9113, section 4.1)."""
    return struct.pack(">I", len(payload))[1:] + struct.pack(">BBI", kind, flags, stream) + payload


def text(value):
    """A string without Huffman coding (RFC 7541, section 5.2)."""
    value = value.encode()
    length, prefix = len(value), b""
    if length >= 127:
        length, prefix = length - 127, b"\x7f"
        while length >= 128:
            prefix += bytes([length % 128 + 128])
            length //= 128
    return prefix + bytes([length]) + value


def request(path):
    """The header block of a request, each field as a literal without an index."""
    fields = {":method": "GET", ":scheme": "http", ":authority": f"127.0.0.1:{target.port}", ":path": path}
    return b"".join(b"\0" + text(name) + text(value) for name, value in fields.items())


def paths(place):
    """The addresses that one connection requests: each is another form of a large result."""
    path, link = target.links[place % len(target.links)].split("?")
    for stream in range(STREAMS):
        yield f"{path}?{link}&format=json&digits={4 + stream % 12}&points={3900 - stream // 12 - 3 * place}"


class Frames:
    """Reads frames from a connection."""

    def __init__(self, connection):
        self.connection, self.text = connection, b""

    async def read(self):
        """The next frame: kind, flags, stream and payload. None if the server has closed the connection."""
        while (whole := self.whole()) is None:
            more = await receive(self.connection)
            if not more:
                return None
            self.text += more
        kind, flags, stream = struct.unpack(">BBI", self.text[3:9])
        payload, self.text = self.text[9:whole], self.text[whole:]
        return kind, flags, stream, payload

    def whole(self):
        """The length of the next frame; None if it has not arrived yet."""
        length = 9 + int.from_bytes(self.text[:3], "big")
        return length if len(self.text) >= max(9, length) else None


async def show_life(connection):
    """Sends a ping every second."""
    while await send(connection, frame(PING, 0, 0, bytes(8))):
        await asyncio.sleep(1)


async def starve(place):
    """Requests answers and gives them no window. Tells how each of them ended."""
    connection = await connect(SOURCES[place])
    with connection:
        await send(connection, PREFACE + frame(SETTINGS, 0, 0, struct.pack(">HI", INITIAL_WINDOW_SIZE, 0)))
        for stream, path in enumerate(paths(place)):
            await send(connection, frame(HEADERS, END_STREAM | END_HEADERS, 2 * stream + 1, request(path)))
        pings = asyncio.create_task(show_life(connection))
        frames, waiting = Frames(connection), {2 * stream + 1: "no answer" for stream in range(STREAMS)}
        got = []
        try:
            async with asyncio.timeout(DEADLINE):
                while waiting and (read := await frames.read()):
                    kind, flags, stream, payload = read
                    if kind == SETTINGS and not flags & ACK:
                        await send(connection, frame(SETTINGS, ACK, 0))
                    if kind == HEADERS and stream in waiting:
                        waiting[stream] = "200" if payload.startswith(STATUS_200) else "refused"
                    ends = kind in (HEADERS, DATA) and flags & END_STREAM
                    if stream in waiting and (ends or kind == RST_STREAM):
                        got.append(waiting.pop(stream) + (" then ended" if ends else " then reset"))
            got += [f"{name} then closed" for name in waiting.values()]
        except TimeoutError:
            got += [f"{name} and waits" for name in waiting.values()]
        pings.cancel()
        await asyncio.wait([pings])
    return got


async def half_a_preface(source):
    """Sends half a preface. Tells after how many seconds the server closes; infinity if it does not."""
    began = time.monotonic()
    with await connect(source) as connection:
        await send(connection, PREFACE[:-4])
        try:
            async with asyncio.timeout(PREFACE_DEADLINE):
                while await receive(connection):
                    pass
        except TimeoutError:
            return math.inf
    return time.monotonic() - began


async def program():
    began = time.monotonic()
    prefaces = asyncio.gather(*map(half_a_preface, SOURCES[CONNECTIONS:]))
    ends = await asyncio.gather(*map(starve, range(CONNECTIONS)))
    got = told(itertools.chain.from_iterable(ends))
    took, longest = time.monotonic() - began, max(await prefaces)
    report = f"{got} after {took:.0f} s; half a preface lived {longest:.1f} s"
    assert "waits" not in got and longest < math.inf, report
    return report


attack(program)
