"""Follows clients/README.md and clients/javascript/README.md word for word in an empty directory: writes their files, runs
their commands, and checks what they produce. Only the addresses are replaced by those of the server under test.

    python page.py http://127.0.0.1:8080 http://localhost:8000 chromium-headless-shell
"""

import functools
import http.server
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import urllib.request
import xml.dom.minidom

from playwright.sync_api import sync_playwright

# The address of the server, the origin of the pages that call it, and the browser.
BASE, PAGES, BROWSER = sys.argv[1:4]

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from programs import PATIENCE

def text_of(name):
    text = (ROOT / "clients" / name).read_text()
    return text.replace("http://127.0.0.1:8080", BASE).replace("http://localhost:8000", PAGES)


PAGE = text_of("README.md")
# A code block, with a file name if it is a file. Commands for a second terminal have no language.
BLOCK = re.compile(r"(?:^`([^`\n]+)`:\n\n)?^```([a-z]+)\n(.*?)^```$", re.M | re.S)
# The variables that package managers need.
KNOWN = re.compile(r"PATH|PIP_.*|npm_config_.*|NPM_CONFIG_.*|.*_(proxy|PROXY)|SSL_CERT_FILE|NODE_EXTRA_CA_CERTS")


def run(commands, directory):
    """Runs commands that must succeed, and returns their output."""
    names = {name: value for name, value in os.environ.items() if KNOWN.fullmatch(name)}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", commands],
        cwd=directory,
        # pip need not compile what nothing here imports.
        env=names | {"HOME": os.environ["HOME"], "LANG": "C.UTF-8", "PIP_COMPILE": "0"},
        stdout=subprocess.PIPE,
        text=True,
        # Package managers load what they install.
        timeout=5 * PATIENCE,
    )
    assert done.returncode == 0, (commands, done.stdout)
    return done.stdout


def get(address):
    with urllib.request.urlopen(address) as answer:
        return json.load(answer)


def section(title, directory):
    """Follows one section, and returns what its commands print."""
    start = PAGE.index(f"\n## {title}\n")
    end = PAGE.find("\n## ", start + 1)
    printed = followed(PAGE[start : end if end > 0 else None], directory)
    print(f"{title}: followed", flush=True)
    return printed


def followed(page, directory):
    """Follows a page or a section of it, and returns what its commands print."""
    printed = ""
    for name, language, text in BLOCK.findall(page):
        if name:
            (directory / name).write_text(text)
        else:
            assert language == "sh", language
            printed += run(text, directory)
    return printed


class Files(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def check_browser(directory):
    """Serves the page from another origin, and opens it in a browser."""
    files = functools.partial(Files, directory=directory)
    port = int(PAGES.rsplit(":", 1)[1])
    with http.server.ThreadingHTTPServer(("127.0.0.1", port), files) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with sync_playwright() as play:
            page = play.chromium.launch(executable_path=shutil.which(BROWSER), args=["--no-sandbox"]).new_page()
            page.goto(f"{PAGES}/wear.html")
            page.wait_for_selector("#caption:not(:empty), #problem:not(:empty)", timeout=1000 * PATIENCE)
            shown = page.content()
        server.shutdown()
    assert shown.count('<path d="M0,') == 6, shown
    assert "6 profiles from 0 to 100000 cycles" in shown and " um" in shown, shown


def main(directory):
    printed = section("curl", directory)
    done = json.loads((directory / "done.json").read_text())
    assert done["state"] == "succeeded"
    assert "wear_volume[mm^3],wear_depth[um]" in printed, printed
    assert "/scenario/frction" in printed and "Did you mean" in printed, printed
    key = done["key"]
    history = get(f"{BASE}/v1/results/{key}/history")["history"]
    depth = f"{history['wear_depth'][-1] * 1e6:.4f} um"

    printed = section("Python", directory)
    assert len(printed.splitlines()) == 4 and "um deep" in printed, printed
    xml.dom.minidom.parse(str(directory / "wear.svg"))

    section("JavaScript in the browser", directory)
    check_browser(directory)

    section("Grafana", directory)
    query = json.loads((directory / "query.json").read_text())
    rows = get(query["url"].replace("${key}", key))[query["root_selector"]]
    assert len(rows) == 5
    for column in query["columns"]:
        assert all(isinstance(row[column["selector"]], (int, float)) for row in rows), column
    jobs = get(f"{BASE}/v1/jobs?state=succeeded")["jobs"]
    assert {"key", "label"} <= set(jobs[0])

    # The scenario is the one of the curl section, so the numbers are the same.
    shutil.copy(ROOT / "clients/matlab/fretwork.m", directory)
    printed = section("MATLAB and Octave", directory)
    assert printed.splitlines()[-1].endswith(f"{depth} deep"), (printed, depth)
    assert (directory / "wear.png").read_bytes().startswith(b"\x89PNG")

    printed = section("Clients from the contract", directory)
    assert printed.count("cycles:") == 4 + 4, printed
    # Before wear, the half-width of the cylinder is 2√(FR/(πE*)) at 18.5 N/mm, with R = 6 mm and E* = 200 GPa/1.82.
    assert printed.count("half-width 35.86 um\n") == 2 and printed.count("cylinder: line contact") >= 2, printed

    printed = followed(text_of("javascript/README.md"), directory)
    assert re.search(r"^100 %\n[\d.]+ um after 100000 cycles$", printed, re.M), printed
    print("every section of clients/README.md works")


with tempfile.TemporaryDirectory() as made:
    main(pathlib.Path(made))
