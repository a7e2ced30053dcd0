"""What a test of the dashboard needs: a real browser that remembers complaints, servers that can be killed,
and what stands in a page as numbers.
"""

import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import urllib.request

ROOT = pathlib.Path(__file__).parents[2]
SCREENS = ROOT / "target/screens"
AXE = "4.14.1"
SIZES = {1440: 900, 390: 844}


def ask(base, path, body=None, method=None, wait=20):
    """The server's own word; of a job, once it is finished or has been waited for so many seconds."""
    data = None if body is None else json.dumps(body).encode()
    headers = {"Content-Type": "application/json", "Prefer": f"wait={wait}"}
    request = urllib.request.Request(base + path, data, headers, method=method)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.loads(answer.read() or "null")


def chromium():
    """Where the browser is; it is installed from Debian if there is none."""
    if not shutil.which("chromium"):
        subprocess.run("apt-get update -qq && apt-get install -qq -y chromium", shell=True, check=True)
    return shutil.which("chromium")


def axe():
    """The script of axe-core, from its package."""
    at = ROOT / f"target/clients/axe-core-{AXE}"
    if not at.exists():
        at.mkdir(parents=True)
        subprocess.run(["npm", "pack", "--silent", f"axe-core@{AXE}"], cwd=at, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["tar", "xzf", f"axe-core-{AXE}.tgz", "package/axe.min.js"], cwd=at, check=True)
    return (at / "package/axe.min.js").read_text()


class Server:
    """A server of this test's own, on a port that stays when it is started again."""

    def __init__(self, program, data, *options, **environment):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.words = [program, "--listen", f"127.0.0.1:{self.port}", "--data-dir", data, *options]
        self.environment = {"PATH": os.environ["PATH"], "FRETWORK_LOG": "error", **environment}
        self.base = f"http://127.0.0.1:{self.port}"

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.kill()

    def start(self):
        self.process = subprocess.Popen(self.words, env=self.environment, stdout=subprocess.PIPE, text=True)
        assert "listens on" in self.process.stdout.readline()
        # The address that people click on.
        self.page = re.search(r"dashboard: (\S+)", self.process.stdout.readline())[1]
        return self

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


class Browser:
    """Fresh profiles of one browser; what a page complains of, and whom else it asks, is remembered."""

    def __init__(self, chromium):
        self.chromium, self.complaints, self.script = chromium, [], axe()

    def page(self, base, scheme="light", width=1440, before=None):
        """A page in a fresh profile; the script `before` runs before the page's own."""
        size = {"width": width, "height": SIZES[width]}
        context = self.chromium.new_context(viewport=size, color_scheme=scheme, bypass_csp=False)
        context.grant_permissions(["clipboard-read", "clipboard-write"], origin=base)
        if before:
            context.add_init_script(before)
        page = context.new_page()
        page.set_default_timeout(15000)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self.heard)
        page.on("request", lambda request: request.url.startswith((base, "blob:", "data:"))
            or self.complaints.append(f"asks {request.url}"))
        return page

    def heard(self, message):
        # The browser reports each answer that is not a success (those that are meant are shown), and that this test
        # reads pixels.
        own = ("Failed to load resource", "Canvas2D: Multiple readback")
        if message.type in ("error", "warning") and not message.text.startswith(own):
            self.complaints.append(message.text)

    def examine(self, page, view):
        """No violation of any rule of accessibility in what is shown."""
        page.evaluate(self.script)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
        told = [(rule["id"], [node["html"][:160] for node in rule["nodes"]][:3]) for rule in found]
        assert not told, (view, told)

    def examine_shown(self, page, view):
        """The same, nothing wider than the screen, and a picture of it."""
        self.examine(page, view)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), view
        page.screenshot(path=SCREENS / f"{view}.png", full_page=True)

    def examine_all(self, base, views):
        """Each view, an address and what is there once it is drawn: light and dark, wide and narrow."""
        for width in SIZES:
            for scheme in ("light", "dark"):
                page = self.page(base, scheme=scheme, width=width)
                for view, (address, ready) in views.items():
                    page.goto(base + address)
                    page.wait_for_selector(ready, state="attached")
                    # What is drawn goes on the screen.
                    page.wait_for_timeout(200)
                    self.examine_shown(page, f"{view}-{width}-{scheme}")
                page.context.close()


def canvas(page, figure):
    return page.locator(f"section[aria-label='{figure}'] canvas")


def inked(page, figure):
    """How many pixels of a plot are drawn, and in how many colours."""
    return canvas(page, figure).evaluate("""canvas => {
        const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        const colours = new Set();
        let inked = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) {
            inked++;
            colours.add(`${data[i]} ${data[i + 1]} ${data[i + 2]}`);
        }
        return [inked, colours.size];
    }""")


def below(page, figure):
    """What stands below a plot: names and, where there is a cursor, values."""
    return dict(page.locator(f"section[aria-label='{figure}'] .u-series").evaluate_all(
        "rows => rows.map(row => [row.querySelector('.u-label').textContent, row.querySelector('.u-value').textContent])"))


def number(text):
    """A number as it is shown, back; None where nothing is known."""
    found = re.match(r"(−?[\d.]+)(?:·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?", text)
    if not found:
        assert text == "–", text
        return None
    power = (found[2] or "0").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    return float(found[1].replace("−", "-")) * 10 ** int(power)


def close(shown, true, part=1e-4):
    found = number(shown)
    assert found == true or None not in (found, true) and abs(found - true) <= part * abs(true), (shown, true)
