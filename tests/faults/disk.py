"""Faults of the data directory at the n-th call that reads or writes it, by the preloaded library of shim.c."""

import copy
import mmap
import os
import pathlib
import select
import shutil
import signal
import struct
import subprocess
import time

from checks import STUDY, Submitter, Violation, require
from programs import PATIENCE, Program, Sqlite, fretwork, submission

HERE = pathlib.Path(__file__).resolve().parent
# As in shim.c.
KINDS = ["none", "fails", "fails from then on", "full", "short", "kill", "torn"]
LASTING, DEADLY = {"fails from then on", "full"}, {"kill", "torn"}
# SQLite takes a read that fails for damage.
UNREADABLE = {"fails", "fails from then on"}
# The calls that a kind meets: w(rite), r(ead), t(runcate), s(ync), n(ame), u(nlink).
MET = {"full": "wtsn", "short": "wr"}
# Seconds that a lasting fault lasts from the first call that met it.
LASTS = 0.3
# Runs that a kill has interrupted continue at once.
PLAIN = {"FRETWORK_CRASH_PAUSE": "0s"}


def compile_shim(directory):
    """The library."""
    shim = directory / "shim.so"
    words = ["cc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-o", shim, HERE / "shim.c", "-ldl"]
    subprocess.run(words, check=True)
    return shim


class Control:
    """The memory that this test and the programs share, as `struct control` in shim.c."""

    HEAD, TEXT = struct.Struct("=5I"), 236

    def __init__(self, path):
        self.path = path
        path.write_bytes(bytes(self.HEAD.size + self.TEXT + (1 << 16)))
        with open(path, "r+b") as file:
            self.memory = mmap.mmap(file.fileno(), 0)

    def arm(self, at, kind):
        self.memory[:] = bytes(len(self.memory))
        self.HEAD.pack_into(self.memory, 0, 1, at, KINDS.index(kind), 0, 0)

    def disarm(self):
        self.memory[:4] = bytes(4)

    @property
    def count(self):
        return self.HEAD.unpack_from(self.memory)[3]

    @property
    def hits(self):
        return self.HEAD.unpack_from(self.memory)[4]

    @property
    def met(self):
        """The first call that met the fault, and its file."""
        return self.memory[self.HEAD.size:self.HEAD.size + self.TEXT].split(b"\0")[0].decode()

    def calls(self):
        """The letters of all calls."""
        begin = self.HEAD.size + self.TEXT + 1
        return self.memory[begin:begin + self.count].decode()


class Server(Program):
    """A server on a data directory. It may end at its start."""

    def __init__(self, data, log, environment):
        options = ["--workers", "1"]
        super().__init__(["serve", "--listen", "127.0.0.1:0"], Sqlite(data).where, log, options, PLAIN | environment)
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE)
        require(ready, "the server neither starts nor ends")
        line = self.process.stdout.readline()
        self.port = int(line.rsplit(":", 1)[1]) if "listens on" in line else None

    def end(self, how=signal.SIGTERM):
        """Ends the server. Returns its exit code."""
        self.process.send_signal(how)
        try:
            return self.process.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            raise Violation("the server does not end after SIGTERM") from None
        finally:
            self.close()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()


class Trial:
    """One operation with one fault, in a directory of its own."""

    def __init__(self, place, shim, at, kind, expected):
        self.place, self.at, self.kind, self.expected = place, at, kind, expected
        self.disk = place / "disk"
        self.data, self.log = self.disk / "data", place / "log"
        self.disk.mkdir(parents=True)
        self.control = Control(place / "control")
        self.shimmed = {"LD_PRELOAD": str(shim), "FAULTS_CONTROL": str(self.control.path), "FAULTS_DIRECTORY": str(self.disk)}
        self.servers, self.since = [], None

    def arm(self):
        self.control.arm(self.at, self.kind)

    def disarm(self):
        """Takes the fault away, and waits for a program that it kills."""
        self.calls = self.control.calls()
        self.control.disarm()
        if self.kind in DEADLY and self.control.hits:
            for server in self.servers:
                server.process.wait(timeout=PATIENCE)

    def look(self):
        """Ends a lasting fault after a while."""
        if self.kind in LASTING and self.control.hits:
            self.since = self.since or time.monotonic()
            if time.monotonic() - self.since > LASTS:
                self.control.disarm()

    def start(self, environment=None):
        server = Server(self.data, self.log, environment or {})
        self.servers.append(server)
        return server

    def sound(self):
        """A server that must start."""
        server = self.start()
        require(server.port, f"the next start failed: {self.log.read_text()[-500:]}")
        return server

    def command(self, *words, faulty=False):
        """Runs a command of the program. Returns the exit code and what it printed to standard error."""
        environment = {"PATH": os.environ["PATH"], **PLAIN, **(self.shimmed if faulty else {})}
        try:
            done = subprocess.run([fretwork(), *words], env=environment, capture_output=True, text=True, timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            raise Violation(f"`fretwork {words[0]}` does not end") from None
        require("panicked" not in done.stderr and done.returncode != 101, f"`fretwork {words[0]}` panicked: {done.stderr}")
        return done.returncode, done.stderr

    def must(self, *words):
        code, said = self.command(*words)
        require(code == 0, f"`fretwork {words[0]}` fails with {code}: {said}")

    def verify(self, submitters):
        """Everything acknowledged is in the data directory, before and after a restart, and nothing is damaged."""
        for how in (signal.SIGKILL if self.at % 2 else signal.SIGTERM, signal.SIGTERM):
            # A server that has met a fault and lives must still work.
            server = next((server for server in self.servers if server.process.poll() is None), None) or self.sound()
            for submitter in submitters:
                submitter.verify(server)
            code = server.end(how)
            require(how == signal.SIGKILL or code == 0, f"the server ends with {code}: {self.log.read_text()[-500:]}")
        self.must("check", "--data-dir", self.data)
        require("panicked" not in self.log.read_text(), f"the server panicked: {self.log.read_text()[-1000:]}")

    def close(self):
        for server in self.servers:
            server.close()
        shutil.rmtree(self.place)


class Operation:
    """What is tried with faults. It begins with a copy of a data directory, which has the jobs of `kept`."""

    def __init__(self, name, kept=(), snapshot=None):
        self.name, self.kept, self.snapshot = name, list(kept), snapshot

    def copies(self):
        """Submitters of the jobs in the data directory, which remember ids of their own."""
        return [copy.copy(known) for known in self.kept]

    def run(self, trial):
        if self.snapshot:
            shutil.copytree(self.snapshot, trial.data)
        trial.verify(self.act(trial) + self.copies())


class Submission(Operation):
    """A submission, and the work until its end."""

    def __init__(self, name, body, *arguments, **headers):
        super().__init__(name, *arguments)
        self.body, self.headers = body, headers

    def act(self, trial):
        server = trial.start(trial.shimmed)
        submitter = Submitter(self.body, trial.expected, self.headers)
        if trial.kind in UNREADABLE:
            submitter.allowed = submitter.allowed | {"database-damaged"}
        trial.arm()
        if submitter.submit(server):
            submitter.follow(server, trial.look)
        trial.disarm()
        submitter.allowed = Submitter.allowed
        return [submitter]


class Start(Operation):
    """The start of a server."""

    def act(self, trial):
        trial.arm()
        server = trial.start(trial.shimmed)
        trial.disarm()
        if server.port is None:
            code = server.process.wait(timeout=PATIENCE)
            require(code == (-9 if trial.kind in DEADLY else 1), f"the start ends with {code}")
        return [Submitter(submission(), trial.expected)]


class End(Operation):
    """The end of a server after SIGTERM, when it copies its log into the database."""

    def act(self, trial):
        server = trial.start(trial.shimmed)
        submitter = Submitter(submission(), trial.expected)
        submitter.repeat(server)
        submitter.follow(server)
        trial.arm()
        server.end()
        trial.disarm()
        return [submitter]


class Command(Operation):
    """A command of the program."""

    def __init__(self, name, words, *arguments):
        super().__init__(name, *arguments)
        self.words = words

    def act(self, trial):
        words = [word.format(disk=trial.disk) for word in self.words] + ["--data-dir", trial.data]
        trial.arm()
        code, said = trial.command(*words, faulty=True)
        trial.disarm()
        require(code in ((0, -9) if trial.kind in DEADLY else (0, 1)), f"it ends with {code}: {said}")
        self.check(trial, code == 0, words)
        return []


class Import(Command):
    """An import into a data directory with other jobs."""

    def __init__(self, file, imported, *arguments):
        super().__init__("import", ["import", str(file)], *arguments)
        # The keys in the file.
        self.imported = imported

    def check(self, trial, is_done, words):
        if not is_done:
            trial.must(*words)
        server = trial.sound()
        for key in self.imported:
            Submitter({}, trial.expected).compare(server, key)


class Backup(Command):
    """A backup, which is then restored."""

    def __init__(self, *arguments):
        super().__init__("backup", ["backup", "{disk}/backup.db"], *arguments)

    def check(self, trial, is_done, words):
        file = trial.disk / "backup.db"
        require(file.exists() or not is_done, "the backup that was made is missing")
        for number in range(2):
            # Nothing that has the name of the backup is a part of one.
            if file.exists():
                restored = Trial(trial.place / f"restored-{number}", "", trial.at, "none", trial.expected)
                restored.must("restore", str(file), "--data-dir", restored.data)
                restored.verify(self.copies())
                file.unlink()
            if is_done or number == 1:
                break
            trial.must(*words)
            require(file.exists(), "the repeated backup is missing")


class Restore(Command):
    """The restore of a backup in the place of a database."""

    def __init__(self, file, replaced, *arguments):
        super().__init__("restore", ["restore", str(file), "--replace"], *arguments)
        # A job of the replaced database.
        self.replaced = replaced

    def check(self, trial, is_done, words):
        if not is_done:
            # One of the two databases is in place, and whole.
            server = trial.sound()
            jobs = (self.replaced, *self.kept)
            found = [job.ask(server, "GET", f"/v1/jobs/{job.id}")[0] == 200 for job in jobs]
            require(found[1:] == [not found[0]] * len(self.kept), f"the jobs of both databases: {found}")
            server.end()
            trial.must(*words)


class Disk:
    """All operations, with the undisturbed runs that count their calls."""

    def __init__(self, directory):
        self.directory, self.number, self.expected = directory, 0, {}
        self.shim = compile_shim(directory)

    def trial(self, at, kind):
        self.number += 1
        return Trial(self.directory / str(self.number), self.shim, at, kind, self.expected)

    def prepare(self):
        """Makes the data directories with which operations begin."""
        place = Trial(self.directory / "prepared", self.shim, 0, "none", self.expected)
        server = place.sound()
        exact = submission({"friction": 0.65, "model": {"method": "exact", "points": 64}})
        kept = [Submitter(body, self.expected) for body in (submission({"friction": 0.6}), exact, STUDY)]
        for submitter in kept:
            submitter.verify(server)
        server.end()
        names = ("data", "all.zst", "backup.db", "killed", "other")
        data, imported, backup, killed, other = (self.directory / name for name in names)
        shutil.copytree(place.data, data)
        keys = list(self.expected)
        place.must("export", imported, "--data-dir", place.data)
        place.must("backup", backup, "--data-dir", place.data)
        # A server that was killed, with work that it has not done.
        server = place.sound()
        waiting = Submitter(submission({"friction": 0.61}), self.expected)
        waiting.repeat(server)
        server.end(signal.SIGKILL)
        shutil.copytree(place.data, killed, ignore=shutil.ignore_patterns("*-shm"))
        # Another database, into which the import goes, and which the restore replaces.
        place = Trial(self.directory / "prepared-other", self.shim, 0, "none", self.expected)
        server = place.sound()
        small = Submitter(submission({"friction": 0.62}), self.expected)
        small.verify(server)
        server.end()
        shutil.copytree(place.data, other)
        study = STUDY | {"sweep": STUDY["sweep"] | {"outputs": ["wear_depth"]}}
        operations = [
            Submission("run", submission({"friction": 0.7}), kept, data),
            Submission("run while the client waits", submission({"friction": 0.71}), kept, data, Prefer="wait=60"),
            Submission("study", study, kept, data),
            Import(imported, keys, [small], other),
            Backup(kept, data),
            Restore(backup, small, kept, other),
            Start("first start"),
            Start("start after a kill", [*kept, waiting], killed),
            End("end", kept, data),
        ]
        self.operations = {operation.name: operation for operation in operations}

    def points(self):
        """All points: an operation, the number of a call, and a kind of fault that this call can meet."""
        for operation in self.operations.values():
            trial = self.trial(0, "none")
            try:
                operation.run(trial)
                calls = trial.calls
            finally:
                trial.close()
            print(f"{operation.name}: {len(calls)} calls", {call: calls.count(call) for call in sorted(set(calls))}, flush=True)
            for kind in KINDS[1:]:
                met = MET.get(kind, "wrtsnu")
                yield from ((operation.name, at, kind) for at, call in enumerate(calls, 1) if call in met)

    def attempt(self, name, at, kind):
        """Tries a point. Returns the call that met the fault, and what is wrong."""
        trial = self.trial(at, kind)
        try:
            self.operations[name].run(trial)
            return trial.control.met, None
        except (Violation, OSError, subprocess.SubprocessError, ValueError, KeyError) as error:
            logged = trial.log.read_text()[-3000:] if trial.log.exists() else ""
            return trial.control.met, f"{error!r}\n{logged}"
        finally:
            trial.close()
