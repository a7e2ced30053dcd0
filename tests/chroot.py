"""File systems of containers as chroots. Only for root, in a mount namespace of its own."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path


def run(*command, **options):
    return subprocess.run([str(word) for word in command], check=True, **options)


def said(*command):
    return run(*command, stdout=subprocess.PIPE, text=True).stdout.strip()


def install(*packages):
    """Installs packages of Debian that are missing."""
    quiet = {"stdout": subprocess.DEVNULL, "env": os.environ | {"DEBIAN_FRONTEND": "noninteractive"}}
    command = ["apt-get", "install", "-y", "-qq", "--no-upgrade", "--no-install-recommends", *packages]
    if subprocess.run(command, stderr=subprocess.DEVNULL, **quiet).returncode != 0:
        # The list of packages may be missing or old.
        run("apt-get", "update", "-qq", **quiet)
        run(*command, **quiet)


def run_apart(script, *words):
    """Runs a script with mounts and processes of its own, and with a new directory as its last word. Removes the directory
    when they have all gone: a directory that is still mounted below it would be emptied, too."""
    if os.geteuid() != 0:
        sys.exit(f"{script} must run as root, because it mounts file systems")
    work = tempfile.mkdtemp(prefix="fretwork-", dir=os.environ.get("TMPDIR", "/var/tmp"))
    apart = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"]
    try:
        sys.exit(subprocess.run([*apart, sys.executable, script, *words, work]).returncode)
    finally:
        shutil.rmtree(work)


class Image:
    """A stage of the Dockerfile: its layers from the lowest, and its settings."""

    def __init__(self, work, layers):
        self.work, self.layers = work, layers
        self.directory, self.environment, self.user, self.key = "/", {}, "0:0", layers[-1].name
        self.entrypoint, self.healthcheck = [], []

    def mount(self, upper, place):
        """Mounts the layers below `upper`. Returns the root, which is in the directory `place`."""
        root, scratch = place / "root", place / "scratch"
        for directory in (root, scratch, upper):
            directory.mkdir(parents=True, exist_ok=True)
        lower = ":".join(str(layer) for layer in reversed(self.layers))
        run("mount", "-t", "overlay", "-o", f"lowerdir={lower},upperdir={upper},workdir={scratch}", "overlay", root)
        return root

    @contextmanager
    def mounted(self, upper):
        """Mounts the layers below `upper`, gives the root, and unmounts all."""
        root = self.mount(upper, self.work)
        try:
            yield root
        finally:
            run("umount", "--recursive", root)
            shutil.rmtree(self.work / "scratch")

    def add(self, step, change, content=""):
        """Adds a layer, unless it exists. Returns whether it was made."""
        self.key = hashlib.sha256(f"{self.key}\n{step}\n{content}".encode()).hexdigest()[:20]
        layer = self.work / "layers" / self.key
        made = not layer.exists()
        print(f"{'RUNS  ' if made else 'CACHED'} {step[:100]}", flush=True)
        if made:
            part = self.work / "part"
            with self.mounted(part) as root:
                change(root)
            part.rename(layer)
        self.layers.append(layer)
        return made

    def bind(self, root, source, target):
        place = root / target.lstrip("/")
        if Path(source).is_dir():
            place.mkdir(parents=True, exist_ok=True)
        elif not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.touch()
        run("mount", "--rbind", source, place)
        run("mount", "--make-rslave", place)

    def command(self, root, words, **more):
        """A command in the image, with the environment of the image and `more`, and no other."""
        for path in ("/proc", "/dev", "/etc/resolv.conf"):
            self.bind(root, path, path)
        enter = f"cd {shlex.quote(self.directory)} && exec {shlex.join(words)}"
        path = {"PATH": "/usr/local/cargo/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
        environment = [f"{name}={value}" for name, value in (path | self.environment | more).items()]
        return ["env", "-i", *environment, "chroot", f"--userspec={self.user}", str(root), "/bin/sh", "-c", enter]
