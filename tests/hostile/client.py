"""What the attacks share: connections from other loopback addresses, raw HTTP/1.1, and the connections of the server.

Each attack is a program. Its first argument is a file that describes the server; see `Target`.
"""

import asyncio
import collections
import itertools
import json
import pathlib
import resource
import socket
import struct
import subprocess
import sys
import traceback

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from programs import PATIENCE

# Linux chooses the port when the socket connects, so that each address has all ports.
IP_BIND_ADDRESS_NO_PORT = 24

# The default limit of open files is often 1024.
_, most = resource.getrlimit(resource.RLIMIT_NOFILE)
resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


class Target:
    """The attacked server: its port, access keys, and a large result that several keys share by link."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            values = json.load(file)
        self.port = values["port"]
        self.links = values["links"]
        # Keys of one owner. Each may have 256 requests at once.
        self.keys = values["keys"]
        # Keys of another owner, who reads answers.
        self.readers = values["readers"]
        self.reader = values["reader"]
        self.bystander = values["bystander"]
        # The key of a user who leaves, and the command that revokes keys.
        self.leaver, self.revoke = values["leaver"], values["revoke"]
        # The key of an administrator.
        self.chief = values["chief"]
        # The address and the secret of the sign-on proxy.
        self.proxy, self.secret = values["proxy"], values["secret"]
        # Whether the server must keep its times: only on a quiet machine.
        self.has_limits = values["has_limits"]


target = Target(sys.argv[1])


def revoke(name):
    """Revokes the keys of a user."""
    subprocess.run([*target.revoke, name], check=True, capture_output=True)


def limit(seconds):
    """How long something may take: `seconds` on a quiet machine (`tests/hostile/run --limits`), else as long as it does not hang."""
    return seconds if target.has_limits else PATIENCE


def lasting(seconds):
    """How long an attack lasts: only half as long where no limits hold."""
    return seconds if target.has_limits else seconds / 2


def argument(place):
    """A number on the command line, after the description of the server."""
    return int(sys.argv[1 + place])


def head(method, path, key=None, **headers):
    """The head of a request. Underscores in names of headers stand for hyphens."""
    lines = [f"{method} {path} HTTP/1.1", f"Host: 127.0.0.1:{target.port}"]
    if key:
        lines.append(f"Authorization: Bearer {key}")
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join(lines + ["", ""]).encode()


def post(path, key, document, **headers):
    """A whole request with a JSON body."""
    body = document if isinstance(document, bytes) else json.dumps(document).encode()
    return head("POST", path, key, Content_Type="application/json", Content_Length=len(body), **headers) + body


def addresses(second, count, each=500):
    """Loopback addresses 127.`second`.0.1 and up for `count` connections, `each` of them from one address."""
    return [f"127.{second}.{place // each >> 8}.{place // each % 256 + 1}" for place in range(count)]


async def connect(source, receive_buffer=None):
    """A connection from a loopback address."""
    connection = socket.socket()
    try:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_IP, IP_BIND_ADDRESS_NO_PORT, 1)
        if receive_buffer:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        connection.bind((source, 0))
        await asyncio.get_running_loop().sock_connect(connection, ("127.0.0.1", target.port))
    except BaseException:
        connection.close()
        raise
    return connection


async def send(connection, text):
    """Sends bytes. False if the server has closed the connection."""
    try:
        await asyncio.get_running_loop().sock_sendall(connection, text)
    except ConnectionError:
        return False
    return True


async def receive(connection, length=65536):
    """Receives bytes; none if the server has closed the connection."""
    try:
        return await asyncio.get_running_loop().sock_recv(connection, length)
    except ConnectionError:
        return b""


def peek(connection):
    """The first bytes that the server has sent, without reading them. None: nothing yet; empty: it closed."""
    try:
        return connection.recv(64, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except BlockingIOError:
        return None
    except ConnectionError:
        return b""


Answer = collections.namedtuple("Answer", "status headers body")


async def answer(connection):
    """Reads one answer; None if the server closes the connection before its end."""
    text = b""
    while b"\r\n\r\n" not in text:
        more = await receive(connection)
        if not more:
            return None
        text += more
    start, body = text.split(b"\r\n\r\n", 1)
    first, *lines = start.decode("latin-1").split("\r\n")
    headers = {name.lower(): value.strip() for name, value in (line.split(":", 1) for line in lines)}
    missing, parts = int(headers.get("content-length", 0)) - len(body), [body]
    while missing > 0:
        more = await receive(connection)
        if not more:
            return None
        parts.append(more)
        missing -= len(more)
    return Answer(int(first.split(" ")[1]), headers, b"".join(parts))


async def ask(source, request):
    """Sends a request on its own connection and reads the answer."""
    # The program waits for the connection and sends at once. If it opened many connections first and had little processor time,
    # the server would close those whose request is late.
    with socket.create_connection(("127.0.0.1", target.port), source_address=(source, 0)) as connection:
        connection.setblocking(False)
        # The server may answer and close before it has the whole request.
        await send(connection, request)
        return await answer(connection)


def outcome(reply):
    """What a client got, for the report. A refusal must say when to try again."""
    if reply is None:
        return "closed"
    if reply.status == 503:
        assert "retry-after" in reply.headers, reply
    assert reply.status != 500, reply
    return str(reply.status)


def told(outcomes):
    """Counts outcomes: `3 x 200, 4 x closed`."""
    counted = collections.Counter(outcomes)
    return ", ".join(f"{counted[name]} x {name}" for name in sorted(counted)) or "nothing"


def held(sources=None):
    """The connections that the server holds, from all or these addresses, by the address and port of the client. Tells how
    many bytes wait for each client."""
    own = {struct.unpack("=I", socket.inet_aton(source))[0] for source in sources or ()}
    found = {}
    with open("/proc/net/tcp", encoding="ascii") as table:
        for line in itertools.islice(table, 1, None):
            _, local, remote, state, queues, _, _, _, _, inode, *_ = line.split()
            # A connection that the server has not accepted yet has no inode.
            accepted = state == "01" and inode != "0"
            source, port = (int(part, 16) for part in remote.split(":"))
            if accepted and (sources is None or source in own) and int(local[9:], 16) == target.port:
                found[socket.inet_ntoa(struct.pack("=I", source)), port] = int(queues.split(":")[0], 16)
    return found


def attack(program):
    """Runs an attack, and prints what the attacker got."""
    try:
        print(asyncio.run(program()))
    except AssertionError as fault:
        sys.exit(str(fault) or traceback.format_exc())
    except OSError as fault:
        # The server has died.
        sys.exit(f"{type(fault).__name__}: {fault}")
