"""Connections that are cut: between a server and PostgreSQL at the n-th message, and between a client and a server before the answer."""

import json
import re
import signal
import socket
import struct
import sys
import threading
import time

from checks import STUDY, Submitter, Violation, require
from disk import HERE, PLAIN, Trial
from programs import PATIENCE, Program, submission

sys.path.append(str(HERE.parent / "soaking"))

from databases import Postgres

# What happens to the n-th message from the server to PostgreSQL: its connection is cut before it, or after it without its answer; all
# connections are cut, and new ones for a while; or the server is killed.
KINDS = ["cut", "unanswered", "all cut", "kill"]
# Seconds without new connections, and seconds in which PostgreSQL does what was asked without an answer.
AWAY, DONE = 0.3, 0.1


class Connection:
    """A connection of the server, and that of the proxy to PostgreSQL."""

    def __init__(self, proxy, client):
        self.proxy, self.client, self.is_muted = proxy, client, False
        self.server = socket.socket(socket.AF_UNIX)
        self.server.connect(proxy.socket)
        for pump in (self.ask, self.answer):
            threading.Thread(target=pump, daemon=True).start()

    def cut(self):
        for end in (self.client, self.server):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # It has been cut already.

    def read(self, size):
        """Bytes of the server's message."""
        data = b""
        while len(data) < size:
            more = self.client.recv(size - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def ask(self):
        """Forwards messages, one by one. The first one has no letter before its length."""
        try:
            head = self.read(4)
            while True:
                message = head + self.read(struct.unpack("!I", head[-4:])[0] - 4)
                if self.proxy.pass_on(self):
                    self.server.sendall(message)
                if self.is_muted:
                    time.sleep(DONE)
                    break
                head = self.read(5)
        except (OSError, EOFError):
            pass
        self.cut()

    def answer(self):
        try:
            while data := self.server.recv(1 << 16):
                if not self.is_muted:
                    self.client.sendall(data)
        except OSError:
            pass
        self.cut()


class Proxy:
    """Stands before PostgreSQL. It counts messages and knows nothing of their contents."""

    def __init__(self, postgres):
        directory = re.search(r"host=(\S+)", postgres.url)[1]
        self.socket = f"{directory}/.s.PGSQL.5432"
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"postgres://fretwork@127.0.0.1:{self.listener.getsockname()[1]}/postgres?sslmode=disable"
        self.lock, self.connections, self.away = threading.Lock(), [], 0
        self.at, self.kind, self.count, self.process = None, None, 0, None
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            if time.monotonic() < self.away:
                client.close()
            else:
                self.connections.append(Connection(self, client))

    def arm(self, at, kind, process):
        with self.lock:
            self.at, self.kind, self.count, self.process = at, kind, 0, process

    def pass_on(self, connection):
        """Counts a message. Returns whether it reaches PostgreSQL."""
        with self.lock:
            self.count += 1
            if self.count != self.at:
                return True
        if self.kind == "unanswered":
            connection.is_muted = True
            return True
        if self.kind == "all cut":
            self.away = time.monotonic() + AWAY
            for other in list(self.connections):
                other.cut()
        if self.kind == "kill":
            self.process.kill()
        connection.cut()
        return False


class Server(Program):
    """A server whose tables are behind the proxy."""

    def __init__(self, url, log):
        options = ["--workers", "1", "--lease", "1s"]
        super().__init__(["serve", "--listen", "127.0.0.1:0"], ["--database", url], log, options, PLAIN)
        line = self.process.stdout.readline()
        require("listens on" in line, f"the server did not start: {log.read_text()[-500:]}")
        self.port = int(line.rsplit(":", 1)[1])

    def end(self, how):
        self.process.send_signal(how)
        code = self.process.wait(timeout=PATIENCE)
        self.process.stdout.close()
        require(how == signal.SIGKILL or code == 0, f"the server ends with {code}: {self.log.read_text()[-500:]}")


class Network:
    """All operations on PostgreSQL, and a server on SQLite that tells the right results."""

    def __init__(self, directory):
        self.expected, self.number, self.submitters = {}, 0, []
        self.log, self.postgres = directory / "server.log", Postgres()
        self.proxy = Proxy(self.postgres)
        self.reference = Trial(directory / "reference", "", 0, "none", self.expected)
        self.right = self.reference.sound()
        self.server = Server(self.proxy.url, self.log)

    def submitter(self, name):
        """A submission that no other one equals, whose result is known."""
        self.number += 1
        friction = round(0.5 + 1e-5 * self.number, 5)
        if name == "study":
            scenario = STUDY["sweep"]["scenario"] | {"motion": {"amplitude": f"{2 + 1e-4 * self.number:.4f} um"}}
            body, headers = {"sweep": STUDY["sweep"] | {"scenario": scenario}}, {}
        else:
            body, headers = submission({"friction": friction}), {"Prefer": "wait=60"} if name == "run while the client waits" else {}
        Submitter(body, self.expected).verify(self.right)
        submitter = Submitter(body, self.expected, headers)
        submitter.wait = "?wait=1"
        return submitter

    def points(self):
        for name in ("run", "run while the client waits", "study"):
            submitter = self.submitter(name)
            self.proxy.arm(0, "none", None)
            require(submitter.submit(self.server), "an undisturbed submission fails")
            submitter.follow(self.server)
            count = self.proxy.count
            print(f"{name}: {count} messages", flush=True)
            yield from ((name, at, kind) for kind in KINDS for at in range(1, count + 1))

    def attempt(self, name, at, kind):
        """Tries a point. Returns whether a message met the fault, and what is wrong."""
        submitter = self.submitter(name)
        logged = len(self.log.read_text())
        try:
            self.proxy.arm(at, kind, self.server.process)
            if submitter.submit(self.server):
                submitter.follow(self.server)
            is_met = self.proxy.count >= at
            self.proxy.arm(0, "none", None)
            if kind == "kill" and is_met:
                self.server.end(signal.SIGKILL)
                self.server = Server(self.proxy.url, self.log)
            submitter.verify(self.server)
            require("panicked" not in self.log.read_text()[logged:], "the server panicked")
            self.submitters.append(submitter)
            return is_met, None
        except (Violation, OSError, ValueError, KeyError) as violation:
            if self.server.process.poll() is not None:
                self.server = Server(self.proxy.url, self.log)
            return True, f"{violation!r}\n{self.log.read_text()[logged:][-3000:]}"

    def hang_up(self, server, name, dice):
        """A client goes before the answer, and submits twice more at the same time. Returns what is wrong."""
        submitter = self.submitter(name)
        headers = {name.replace("_", "-"): value for name, value in submitter.headers.items()}
        body = json.dumps(submitter.body)
        head = {"Host": "localhost", "Content-Type": "application/json", "Content-Length": len(body), **headers}
        request = "POST /v1/jobs HTTP/1.1\r\n" + "".join(f"{name}: {value}\r\n" for name, value in head.items()) + "\r\n" + body
        with socket.create_connection(("127.0.0.1", server.port)) as client:
            client.sendall(request.encode())
            time.sleep(dice.choice([0, 0, 0.001, 0.003, 0.01, 0.03]))
            if dice.random() < 0.5:
                # The connection is reset.
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        wrong = []

        def repeat():
            try:
                submitter.repeat(server)
            except Violation as violation:
                wrong.append(str(violation))
        both = [threading.Thread(target=repeat) for _ in range(2)]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()
        try:
            submitter.verify(server)
        except Violation as violation:
            wrong.append(str(violation))
        return "; ".join(wrong)

    def verify_all(self):
        """After a restart, everything acknowledged is there, and the tables agree."""
        self.server.end(signal.SIGTERM)
        self.server = Server(self.proxy.url, self.log)
        for submitter in self.submitters:
            submitter.verify(self.server)
        self.server.end(signal.SIGTERM)
        require(not (faults := self.postgres.faults()), f"the tables have {faults}")

    def close(self):
        for server in (self.server, self.right):
            # It may have ended already.
            server.process.kill()
            server.process.wait()
            server.process.stdout.close()
        self.proxy.listener.close()
        self.postgres.stop()
