#!/usr/bin/env python3
"""Starts what compose.yaml states, where no container engine exists, and tests it. Each container is a process in a chroot, and
has an address of its own on a bridge. A name server knows the services.

    tests/compose.py FRETWORK      as root, on Debian: with this program instead of the image

tests/image does the same with the image of the Dockerfile. Programs of Debian stand in for the other images; none does for that
of Grafana. The test submits jobs to one server and reads them from the other, kills a worker, restarts the servers one by one
while clients send requests, and lets Prometheus evaluate the alerts and the board.
"""

import copy
import ctypes
import ipaddress
import json
import os
import pwd
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
import uuid
from pathlib import Path

from chroot import Image, install, run, run_apart, said

SOURCE = Path(__file__).resolve().parents[1]
TEXT = (SOURCE / "compose.yaml").read_text()
BALL = json.loads((SOURCE / "examples/steel-ball.json").read_text())
BOARD = json.loads((SOURCE / "deploy/grafana/dashboards/fretwork.json").read_text())
# A run of a second or more.
LONG = BALL["scenario"] | {"model": {"tolerance": 1e-4}, "load": {"normal_force": "100 N", "held": "force"}}

# The last three are libraries of HAProxy, whose package would start it.
PACKAGES = [
    "docker-compose", "iproute2", "postgresql", "python3-yaml", "wget",
    "liblua5.3-0", "libopentracing-c-wrapper0", "libpcre2-8-0",
]

# What the official image does at its first and at every start.
POSTGRES = r"""
PATH=$(ls -d /usr/lib/postgresql/*/bin | sort -V | tail -1):$PATH
export PGDATA=/var/lib/postgresql/data PGPASSWORD=$POSTGRES_PASSWORD
if [ ! -s $PGDATA/PG_VERSION ]; then
    printf %s "$POSTGRES_PASSWORD" >/tmp/password
    initdb --username="$POSTGRES_USER" --pwfile=/tmp/password --auth=scram-sha-256 >/dev/null
    echo 'host all all all scram-sha-256' >>$PGDATA/pg_hba.conf
    pg_ctl start --wait --silent --log=/tmp/log --options='-k /tmp -c listen_addresses='
    createdb --host=/tmp --username="$POSTGRES_USER" "$POSTGRES_DB"
    pg_ctl stop --wait --silent
fi
exec postgres -k /tmp -c listen_addresses='*' 2>/tmp/log
"""


def wait_for(condition, what, seconds=60):
    """Waits until a condition is true, and returns its value."""
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, f"{what} takes longer than {seconds} s"
        time.sleep(0.1)
    return value


def prepare(directory):
    """Writes secrets and a certificate to a directory, as the first lines of compose.yaml say. Returns the variables of .env."""
    scripts = re.findall(r"^#\s+(\((?:umask|mkdir) .*?\))$", TEXT, re.MULTILINE | re.DOTALL)
    assert len(scripts) == 2, scripts
    for script in scripts:
        run("bash", "-euc", re.sub(r"\n#", "\n", script), cwd=directory, stderr=subprocess.DEVNULL)
    modes = {".env": 0o600, "tls": 0o700}
    for name, mode in modes.items():
        assert Path(directory, name).stat().st_mode & 0o777 == mode, f"other users can read {name}"
    return dict(line.split("=", 1) for line in Path(directory, ".env").read_text().splitlines())


def interpolated(text, variables):
    """The text with the values of variables, as Compose inserts them."""
    def value(match):
        if match[0] == "$$":
            return "$"
        name, default = match["name"], match["default"]
        assert match["error"] is not None or default is not None, f"{name} may be missing"
        assert name in variables or default is not None, match["error"]
        return variables.get(name, default)

    return re.sub(r"\$\$|\$\{(?P<name>\w+)(:-(?P<default>[^}]*)|:\?(?P<error>[^}]+))?\}", value, text)


def hardware_address(address):
    """It follows from the IP address, so that other containers find a container that has started again."""
    return ":".join(f"{byte:02x}" for byte in b"\x02\x42" + address.packed)


class Network:
    """A bridge that connects all containers, in a network namespace of this process, and the name server."""

    def __init__(self, settings):
        subnet = ipaddress.ip_network(settings["subnet"])
        self.dynamic = ipaddress.ip_network(settings["ip_range"])
        assert self.dynamic.subnet_of(subnet)
        self.gateway, self.prefix = next(subnet.hosts()), subnet.prefixlen
        self.free, self.names, self.links = self.dynamic.hosts(), {}, 0
        new_network = 0x40000000
        assert ctypes.CDLL(None, use_errno=True).unshare(new_network) == 0, os.strerror(ctypes.get_errno())
        run("ip", "link", "set", "lo", "up")
        run("ip", "link", "add", "bridge", "address", hardware_address(self.gateway), "type", "bridge")
        run("ip", "address", "add", f"{self.gateway}/{self.prefix}", "dev", "bridge")
        run("ip", "link", "set", "bridge", "up")
        self.server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.server.bind((str(self.gateway), 53))
        threading.Thread(target=self.answer, daemon=True).start()

    def connect(self, process, address):
        """Connects the network namespace of a process."""
        self.links += 1
        link, inside = f"link{self.links}", ["nsenter", f"--net=/proc/{process}/ns/net", "ip"]
        peer = ["name", "eth0", "address", hardware_address(address), "netns", process]
        run("ip", "link", "add", link, "type", "veth", "peer", *peer)
        run("ip", "link", "set", link, "master", "bridge", "up")
        run(*inside, "address", "add", f"{address}/{self.prefix}", "dev", "eth0")
        run(*inside, "link", "set", "lo", "up")
        run(*inside, "link", "set", "eth0", "up")

    def answer(self):
        """Answers queries for the addresses of services."""
        while True:
            query, client = self.server.recvfrom(512)
            end = query.index(0, 12) + 5
            kind = struct.unpack(">H", query[end - 4:end - 2])[0]
            labels, place = [], 12
            while length := query[place]:
                labels.append(query[place + 1:place + 1 + length].decode())
                place += 1 + length
            known = self.names.get(".".join(labels))
            address = 1
            found = list(known or []) if kind == address else []
            no_such_name = 3
            flags = 0x8180 | (0 if known is not None else no_such_name)
            head = query[:2] + struct.pack(">HHHHH", flags, 1, len(found), 0, 0)
            records = [b"\xc0\x0c" + struct.pack(">HHIH", address, 1, 0, 4) + one.packed for one in found]
            self.server.sendto(head + query[12:end] + b"".join(records), client)


class Container:
    """A container: its file system, its address, and its process."""

    def __init__(self, deployment, service, number):
        self.deployment, self.service, self.settings = deployment, service, deployment.services[service]
        self.name = f"{service}-{number}"
        self.image = copy.copy(deployment.images[self.settings["image"].split(":")[0]])
        if self.settings.get("user") == "root":
            self.image.user = "0:0"
        fixed = self.settings.get("networks", {}).get("default", {}).get("ipv4_address")
        self.address = ipaddress.ip_address(fixed) if fixed else next(deployment.network.free)
        assert fixed is None or self.address not in deployment.network.dynamic, "another container may get this address"
        self.root = self.mount()
        self.process = self.holder = None

    def mount(self):
        """The root of its file system, with its volumes."""
        place = self.deployment.work / self.name
        root = self.image.mount(place / "upper", place)
        for program, path in self.image.programs.items():
            self.image.bind(root, path, f"/usr/local/bin/{program}")
        for volume in self.settings.get("volumes", []):
            source, target, *_ = volume.split(":")
            named = self.deployment.work / "volumes" / source
            if not source.startswith("."):
                assert source in self.deployment.volumes, source
                if not named.exists():
                    named.mkdir(parents=True)
                    os.chown(named, *map(int, self.image.user.split(":")))
            self.image.bind(root, SOURCE / source if source.startswith(".") else named, target)
        for name in self.settings.get("secrets", []):
            self.image.bind(root, self.deployment.prepared / self.deployment.files[name]["file"], f"/run/secrets/{name}")
        # This also makes the places at which it binds /proc and other parts of the system.
        self.image.command(root, [])
        if self.settings.get("read_only"):
            run("mount", "-o", "remount,ro", root)
        return root

    def command(self, words):
        environment = self.settings.get("environment", {})
        inside = ["nsenter", f"--net=/proc/{self.holder.pid}/ns/net"]
        return [*inside, *self.image.command(self.root, words, **environment)]

    def start(self):
        # It keeps the network namespace, as an engine does.
        self.holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
        network = lambda process: os.readlink(f"/proc/{process}/ns/net")
        wait_for(lambda: network(self.holder.pid) != network("self"), "a network namespace")
        self.deployment.network.connect(self.holder.pid, self.address)
        self.deployment.network.names.setdefault(self.service, []).append(self.address)
        words = self.settings.get("entrypoint", self.image.entrypoint) + self.settings.get("command", [])
        log = (self.deployment.work / f"{self.name}.log").open("a")
        self.process = subprocess.Popen(self.command(words), stdout=log, stderr=log)

    def is_healthy(self):
        test = self.settings.get("healthcheck", {}).get("test", ["CMD", *self.image.healthcheck])
        assert test[0] == "CMD" and len(test) > 1, self.name
        assert self.process.poll() is None, f"{self.name} has ended: {self.log()}"
        return subprocess.run(self.command(test[1:]), capture_output=True).returncode == 0

    def log(self):
        return (self.deployment.work / f"{self.name}.log").read_text()[-2000:]

    def end(self, how=signal.SIGTERM):
        """Ends the process, and returns its exit code."""
        self.deployment.network.names[self.service].remove(self.address)
        self.process.send_signal(how)
        grace = self.settings.get("stop_grace_period", "10s").replace("1m", "60s")
        code = self.process.wait(int(grace.removesuffix("s")))
        self.holder.kill()
        self.holder.wait()
        return code

    def restart(self):
        assert self.end() == 0, self.log()
        self.start()
        wait_for(self.is_healthy, f"the start of {self.name}")

    def send(self, method, target, port=8080, body=None, **headers):
        """Sends a request. Returns the answer, which is open."""
        data = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json"} | {name.replace("_", "-"): text for name, text in headers.items()}
        request = urllib.request.Request(f"http://{self.address}:{port}{target}", data, headers, method=method)
        return urllib.request.urlopen(request, timeout=90)

    def read(self, *words, **options):
        with self.send(*words, **options) as answer:
            return json.load(answer)


def check_form(secrets):
    """Debian's Compose accepts the file, and refuses it without the secrets. It is older, and does not know `name`."""
    text = re.sub(r"^name:.*\n", "", TEXT, flags=re.MULTILINE)
    config = ["docker-compose", "--project-directory", str(SOURCE), "--file", "-", "config", "--quiet"]
    ask = lambda variables: subprocess.run(
        config, input=text, text=True, capture_output=True, env={"PATH": os.environ["PATH"]} | variables
    )
    accepted = ask(secrets)
    assert accepted.returncode == 0, accepted.stderr
    for name in secrets:
        refused = ask({other: value for other, value in secrets.items() if other != name})
        assert refused.returncode != 0 and "first lines of compose.yaml" in refused.stderr, (name, refused.stderr)


class Deployment:
    """What compose.yaml states."""

    def __init__(self, fretwork, work):
        self.work = work
        self.prepared = work / "prepared"
        self.prepared.mkdir()
        self.secrets = prepare(self.prepared)
        check_form(self.secrets)
        import yaml  # It may have been installed by this script.

        stated = yaml.safe_load(interpolated(TEXT, self.secrets))
        self.services, self.volumes, self.files = stated["services"], stated["volumes"], stated["secrets"]
        endless = [name for name, one in self.services.items() if "max-size" not in one.get("logging", {}).get("options", {})]
        assert not endless, f"the logs of {endless} can fill the disk"
        self.images = {"fretwork": fretwork} | stand_ins(work)
        self.services = {name: one for name, one in self.services.items() if one["image"].split(":")[0] in self.images}
        self.network = Network(stated["networks"]["default"]["ipam"]["config"][0])
        resolver = work / "resolv.conf"
        resolver.write_text(f"nameserver {self.network.gateway}\n")
        run("mount", "--bind", resolver, "/etc/resolv.conf")
        self.containers = {}

    def start(self, service):
        """Starts a service after those on which it depends, unless it runs."""
        if service in self.containers:
            return
        settings = self.services[service]
        depends = settings.get("depends_on", {})
        for other in depends:
            self.start(other)
            condition = depends[other]["condition"] if isinstance(depends, dict) else "service_started"
            for container in self.containers[other]:
                if condition == "service_healthy":
                    wait_for(container.is_healthy, f"the start of {other}")
                elif condition == "service_completed_successfully":
                    assert container.process.wait(60) == 0, container.log()
        count = settings.get("deploy", {}).get("replicas", 1)
        self.containers[service] = [Container(self, service, number + 1) for number in range(count)]
        for container in self.containers[service]:
            container.start()

    def one(self, service):
        [container] = self.containers[service]
        return container

    def long_running(self):
        containers = sum(self.containers.values(), [])
        return [container for container in containers if container.settings.get("healthcheck") != {"disable": True}]

    def end(self):
        """Ends the containers, and those on which others depend at last."""
        for containers in reversed(self.containers.values()):
            for container in containers:
                if container.process and container.process.poll() is None:
                    container.end()


def of_host(work, user="0:0", entrypoint=(), **programs):
    """An image with the files of this machine, and other programs."""
    image = Image(work, [Path("/")])
    image.user, image.entrypoint, image.programs = user, list(entrypoint), programs
    return image


def stand_ins(work):
    """Programs of Debian instead of images. They run as the users of the images."""
    program = lambda *words: said(SOURCE / "tests/debian-program", *words)
    postgres = pwd.getpwnam("postgres")
    haproxy = ["haproxy", "-db", "-f", "/usr/local/etc/haproxy/haproxy.cfg"]
    return {
        "postgres": of_host(work, f"{postgres.pw_uid}:{postgres.pw_gid}", ["/bin/sh", "-euc", POSTGRES]),
        "haproxy": of_host(work, "99:99", haproxy, haproxy=program("haproxy", "haproxy")),
        "prom/prometheus": of_host(work, "65534:65534", ["prometheus"], prometheus=program("prometheus", "prometheus")),
    }


def check_event_stream(proxy, job, key):
    """The proxy must pass the first event on while the run waits or works."""
    begun = time.monotonic()
    with proxy.send("GET", job["links"]["events"], **key) as stream:
        first = stream.readline()
        took = time.monotonic() - begun
        assert first.strip() and took < 2, (first, took)
        state = proxy.read("GET", job["links"]["self"], **key)["state"]
    assert state in ("queued", "running"), "the event came after the end"
    print(f"an event passes the proxy after {took:.2f} s")


def check_jobs(deployment, key):
    """Jobs end although a worker is killed, and every server shows them."""
    front_a, front_b, proxy = (deployment.one(name) for name in ("front-a", "front-b", "proxy"))
    workers = deployment.containers["worker"]
    submit = lambda server, number: server.read(
        "POST", "/v1/jobs", body={"scenario": LONG | {"friction": 0.3 + number / 100}}, **key
    )
    jobs = [submit(front_a if number % 2 else proxy, number) for number in range(24)]
    check_event_stream(proxy, jobs[-1], key)
    threads = sum(int(worker.settings["environment"]["FRETWORK_WORKERS"]) for worker in workers)
    running = lambda: front_b.read("GET", "/v1/jobs?state=running&limit=200", **key)["jobs"]
    wait_for(lambda: len(running()) == threads, "the start of all threads")
    workers[0].end(signal.SIGKILL)
    ended = [wait_for(lambda: finished(front_b, job, key), "a job", 300) for job in jobs]
    assert {job["state"] for job in ended} == {"succeeded"}, ended
    again = sum(job["attempt"] > 1 for job in ended)
    assert again >= 1, "the killed worker has computed nothing"
    print(f"{len(ended)} jobs end after a worker was killed; {again} of them started again")
    workers[0].start()


def finished(server, job, key):
    job = server.read("GET", job["links"]["self"] + "?wait=60", **key)
    return job if job["times"].get("finished") else None


def check_rolling_restart(deployment, key):
    """Each request gets its answer while the servers restart one by one. A server that stops refuses submissions, and says when to
    try again."""
    proxy, over, counts, refusals = deployment.one("proxy"), threading.Event(), [], []

    def submit(once):
        try:
            proxy.read("POST", "/v1/jobs", body=BALL, Prefer="wait=10", Idempotency_Key=once, **key)
        except urllib.error.HTTPError as refusal:
            pause = refusal.headers["Retry-After"]
            if refusal.code != 503 or pause is None:
                raise
            refusals.append(refusal.code)
            time.sleep(int(pause))
            submit(once)

    def use():
        count = 0
        while not over.is_set():
            proxy.read("GET", "/v1/results?limit=1", **key)
            submit(str(uuid.uuid4()))
            count += 2
        counts.append(count)

    clients = [threading.Thread(target=use) for _ in range(4)]
    for client in clients:
        client.start()
    for name in ("front-a", "front-b"):
        deployment.one(name).restart()
        time.sleep(3)
    over.set()
    for client in clients:
        client.join()
    assert len(counts) == len(clients), "a request failed"
    print(f"{sum(counts)} requests are answered while the servers restart, {len(refusals)} of them at a second attempt")


def check_monitoring(deployment):
    """Prometheus reaches every server and worker, and evaluates the rules and the queries of the board."""
    prometheus = deployment.one("prometheus")
    api = lambda target: prometheus.read("GET", "/api/v1/" + target, port=9090)["data"]
    expected = sorted(name for name in ("front-a", "front-b", "worker") for _ in deployment.containers[name])
    instances = lambda: [one["labels"]["instance"] for one in api("targets")["activeTargets"] if one["health"] == "up"]
    wait_for(lambda: sorted(one.split("/")[0] for one in instances()) == expected, "a scrape of all targets", 90)
    rules = lambda: [rule for group in api("rules")["groups"] for rule in group["rules"]]
    wait_for(lambda: {rule["health"] for rule in rules()} == {"ok"}, "the evaluation of the alerts", 90)

    def missing():
        queries = {target["expr"] for panel in BOARD["panels"] for target in panel.get("targets", [])}
        asked = {query: query.replace("$__rate_interval", "1m") for query in queries if not query.startswith("ALERTS")}
        found = lambda query: api("query?" + urllib.parse.urlencode({"query": query}))["result"]
        return [query for query, text in asked.items() if not found(text)]

    wait_for(lambda: not missing(), "an answer to every query of the board", 90)
    free = api("query?query=fretwork_disk_free_bytes")["result"]
    known = {one["metric"]["instance"].split("/")[0] for one in free if float(one["value"][1]) > 0}
    assert known == {"front-a", "front-b"}, free
    noted = lambda: api("query?query=fretwork_last_backup_timestamp_seconds")["result"]
    wait_for(lambda: any(float(one["value"][1]) > 0 for one in noted()), "the time of the dump", 90)
    firing = [rule["name"] for rule in rules() if rule["state"] == "firing"]
    assert not firing, firing
    print(f"Prometheus scrapes {instances()}")


def check(fretwork, work):
    """Tests compose.yaml with an image of fretwork. The mount namespace must be one of its own."""
    fretwork.programs = getattr(fretwork, "programs", {})
    work.mkdir()
    # An overlay of the root of this machine cannot be kept below it.
    run("mount", "-t", "tmpfs", "tmpfs", work)
    deployment = Deployment(fretwork, work)
    try:
        for service in deployment.services:
            deployment.start(service)
        key = {"Authorization": f"Bearer {deployment.secrets['FRETWORK_ADMIN_KEY']}"}
        for container in deployment.long_running():
            wait_for(container.is_healthy, f"the start of {container.name}")
        front, proxy = deployment.services["front-a"], deployment.one("proxy")
        trusted = front["command"][front["command"].index("--trusted-proxy") + 1]
        assert trusted == str(proxy.address), "the servers do not trust the proxy"
        check_jobs(deployment, key)
        check_rolling_restart(deployment, key)
        check_monitoring(deployment)
        for worker in deployment.containers["worker"]:
            assert worker.end() == 0, worker.log()
    except BaseException:
        for container in sum(deployment.containers.values(), []):
            print(f"== {container.name}\n{container.log()}", file=sys.stderr)
        raise
    finally:
        deployment.end()


def main():
    program, *work = sys.argv[1:]
    if not work:
        install(*PACKAGES)
        run_apart(__file__, Path(program).resolve())
    image = of_host(work[0], "10001:10001", ["fretwork"], fretwork=program)
    image.healthcheck = ["fretwork", "health"]
    image.environment = {"FRETWORK_LISTEN": "0.0.0.0:8080", "FRETWORK_WORKER_LISTEN": "0.0.0.0:8080",
                         "FRETWORK_DATA_DIR": "/data"}
    check(image, Path(work[0], "compose"))


if __name__ == "__main__":
    main()
