"""Types the examples of the help and of clients/README.md in a terminal, as a user does, and checks what the terminal shows.

    python terminal.py target/debug/fretwork http://127.0.0.1:8080
"""

import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import uuid

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM, BASE = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
NAME = f"fretwork-{uuid.uuid4().hex[:8]}"
WIDTH, HEIGHT = 130, 60


def tmux(*words):
    done = subprocess.run(["tmux", "-L", NAME, *words], capture_output=True, text=True, timeout=120)
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


def check(directory):
    (directory / "examples").mkdir()
    for name in ["cylinder-on-flat", "run-in", "steel-ball"]:
        shutil.copy(ROOT / f"examples/{name}.json", directory / "examples")
    shutil.copy(ROOT / "examples/steel-ball.json", directory / "job.json")
    shown, lines = examples("")
    assert shown.startswith("Fretting wear") and len(shown.splitlines()) <= 40, shown
    block = re.search(r"^## The command line$.*?^```console\n(.*?)^```$", (ROOT / "clients/README.md").read_text(), re.M | re.S)
    lines += examples("report")[1] + examples("submit")[1] + block[1].splitlines()
    assert len(lines) >= 12, lines
    key = None
    # Without words, the program is the server.
    for line in (line for line in map(str.strip, lines) if line != "fretwork"):
        if " KEY" in line:
            line = line.replace(" KEY", f" {key}")
        text, code = typed(line)
        assert code == 0, (line, text)
        key = re.search(r"succeeded  ([0-9a-f]{64})", text.replace("\n", "")) or key
        key = key[1] if isinstance(key, re.Match) else key
        print(f"{line}: typed", flush=True)
    assert (directory / "result.npz").read_bytes().startswith(b"PK")
    assert (directory / "worn.svg").read_text().startswith("<svg")
    text, code = typed("fretwork run job.json -o r.png")
    assert code == 1 and "Enter one of .json, .ndjson, .csv, .npz, .arrow" in text, text
    text, code = typed("fretwork run job.json -o r.csv")
    assert code == 0 and re.search(r"wear_volume +\S+ mm\^3 ± \S+ %", text), text


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
    print("the terminal shows what the help and clients/README.md promise")


main()
