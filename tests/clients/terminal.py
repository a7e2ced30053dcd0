"""Types the examples of the help and of the documents in a terminal, as a user does, and checks what the terminal shows.

    python terminal.py target/debug/fretwork http://127.0.0.1:8080
"""

import json
import math
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from programs import PATIENCE

PROGRAM, BASE = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
NAME = f"fretwork-{uuid.uuid4().hex[:8]}"
WIDTH, HEIGHT = 130, 60


def tmux(*words):
    done = subprocess.run(["tmux", "-L", NAME, *words], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout


def typed(line):
    """Types a line. Returns what the screen shows when the command has ended, and its exit code."""
    tmux("send-keys", "-l", f"clear; {line}; echo \"=$?\"; tmux -L {NAME} wait-for -S ended")
    tmux("send-keys", "Enter")
    tmux("wait-for", "ended")
    screen = tmux("capture-pane", "-p", "-J")
    text, code = re.search(r"\A(.*)^=(\d+)$", screen, re.M | re.S).groups()
    return text, int(code)


def examples(command):
    """The examples in the help of a command, without their explanations."""
    help_text, code = typed(f"fretwork {command} -h")
    assert code == 0
    lines = re.findall(r"^  (fretwork .*?)(?:  .*)?$", help_text.split("Examples:")[1], re.M)
    return help_text, lines


def documented():
    """The commands in the documents that need no other machine. tests/it/documents.rs runs those of docs/calibration.md, and
    tests/examples the blocks `sh`."""
    for name in ["docs/operating.md", "docs/sharing.md", "clients/command-line.md"]:
        for block in re.findall(r"^```console\n(.*?)^```$", (ROOT / name).read_text(), re.M | re.S):
            yield from re.findall(r"^((?:FRETWORK_DATA_DIR=\S+ )?fretwork .*?)(?:  +#.*)?$", block, re.M)


def prepare(directory):
    """Writes the files that the examples name, and makes a database with one result."""
    (directory / "examples").mkdir()
    for name in ["cylinder-on-flat", "run-in", "steel-ball"]:
        shutil.copy(ROOT / f"examples/{name}.json", directory / "examples")
    shutil.copy(ROOT / "examples/steel-ball.json", directory / "job.json")
    volumes = (ROOT / "examples/measured/volumes.csv").read_text().replace("µm³", "mm^3").replace(",", ".")
    (directory / "volumes.csv").write_text(re.sub(r"(?<=;)(?=\d)(.*)$", r"\1e-9", volumes, flags=re.M))
    trace = (f"{x},{min(0.0, (x / 200) ** 2 - 1) + 0.01 * math.sin(x)}" for x in range(-400, 401, 10))
    (directory / "trace.csv").write_text("\n".join(["x [um],z [um]", *trace]))
    sweep = json.loads((ROOT / "examples/studies/sweep.json").read_text())
    sweep["sweep"]["scenario"]["model"] = {"method": "exact", "tolerance": 0.0005}
    sweep["sweep"]["vary"] = [{"pointer": "/friction", "from": 0.6, "to": 0.8, "count": 5000}]
    (directory / "slow.json").write_text(json.dumps(sweep))
    text, code = typed("fretwork run job.json -o result.json && fretwork import result.json")
    assert code == 0, text
    return json.loads((directory / "result.json").read_text())["key"]


def check(directory):
    key = prepare(directory)
    shown, lines = examples("")
    assert shown.startswith("Fretting wear") and len(shown.splitlines()) <= 40, shown
    for command in ["report", "submit", "fit", "export", "import", "check", "keys"]:
        lines += examples(command)[1]
    lines += documented()
    # A server runs until it is stopped, and a worker needs PostgreSQL.
    lines = [line for line in map(str.strip, lines) if not re.match(r"fretwork($| --listen| worker)", line)]
    assert len(lines) >= 30, lines
    token = None
    for line in lines:
        line = line.replace(" KEY", f" {key}").replace("7262301e...", key).replace("/var/lib/fretwork", "data")
        line = line.replace("0a1b2c3d", str(token)).replace("ssh other fretwork", "fretwork")
        if "export" in line or "backup" in line:
            (directory / line.split()[2]).unlink(missing_ok=True)
        text, code = typed(line)
        assert code == 0, (line, text)
        if "submit job.json --wait" in line:
            assert re.search(r"succeeded  [0-9a-f]{64}", text.replace("\n", "")), text
        if "keys list" in line:
            token = re.search(r"^([0-9a-f]{8}) .* guest ", text, re.M)
            token = token and token[1]
        print(f"{line}: typed", flush=True)
    assert (directory / "result.npz").read_bytes().startswith(b"PK")
    assert (directory / "worn.svg").read_text().startswith("<svg")
    text, code = typed("fretwork run job.json -o r.png")
    assert code == 1 and "End the name with one of .json, .ndjson, .csv, .npz, .arrow" in text, text
    text, code = typed("fretwork run job.json -o r.csv")
    assert code == 0 and re.search(r"Wear volume +\S+ mm\^3 ± \S+ %", text), text
    for line in ["fretwork run slow.json -o slow.csv", "fretwork submit slow.json --wait"]:
        tmux("send-keys", f"clear; {line}", "Enter")
        until = time.monotonic() + PATIENCE
        while not re.search(r"^\[#+ *\] +\d+ %", tmux("capture-pane", "-p"), re.M):
            assert time.monotonic() < until, tmux("capture-pane", "-p")
            time.sleep(0.1)
        tmux("send-keys", "C-c")
        print(f"{line}: shows a bar", flush=True)
    # The interrupted command leaves its job on the server.
    text, _ = typed("fretwork list --limit 1")
    assert typed(f"fretwork cancel {text[:36]}")[1] == 0


def main():
    with tempfile.TemporaryDirectory() as made:
        path = pathlib.Path(made)
        (path / "bin").mkdir()
        (path / "bin/fretwork").symlink_to(PROGRAM)
        names = {"PATH": f"{path}/bin:{os.environ['PATH']}", "FRETWORK_URL": BASE, "LANG": "C.UTF-8", "PS1": ""}
        words = " ".join(f"{name}={shlex.quote(value)}" for name, value in names.items())
        size = ["-x", str(WIDTH), "-y", str(HEIGHT)]
        tmux("-f", "/dev/null", "new-session", "-d", *size, "-c", made, f"env {words} bash --norc --noprofile")
        try:
            check(path)
        finally:
            tmux("kill-server")
    print("the terminal shows what the help and the documents promise")


main()
