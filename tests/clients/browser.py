"""Helpers for the tests of the dashboard: a browser that records errors, servers that a test can kill, and the
numbers that a page shows.
"""

import contextlib
import json
import math
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request

from playwright.sync_api import expect, sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

import programs

SCREENS = ROOT / "target/screens"
SIZES = {1440: 900, 1280: 720, 720: 450, 390: 844}
# 720 is a screen of 1440 at 200 % zoom.
# The tests run in Firefox if its path is given, else in Chromium. This one has no windows, and takes less processor time.
FIREFOX, CHROMIUM = os.environ.get("FIREFOX"), "chromium-headless-shell"
DOWNLOADS = ROOT / "target/screens/downloads"
# `tests/run` and `tests/all` take no screenshots, and look at each page three times instead of six.
IS_SHORT = "NO_SCREENSHOTS" in os.environ
TAKES_SCREENSHOTS = not FIREFOX and not IS_SHORT
# The screens and colour schemes of one page. It is loaded on the first one.
LOOKS = [[(1440, "light"), (1440, "dark"), (1280, "light")], [(720, "dark")], [(390, "light"), (390, "dark")]]
if IS_SHORT:
    LOOKS = [[(1440, "light"), (1440, "dark")], [(390, "light")]]
if FIREFOX:
    # A page of Firefox has one scheme.
    LOOKS = [[look for look in looks if look[1] == scheme] for looks in LOOKS for scheme in dict(reversed(look) for look in looks)]
# The rules of axe-core that look at colours. A scheme changes nothing else.
COLOURS = ["color-contrast", "link-in-text-block"]
# In milliseconds.
PATIENCE = 1000 * programs.PATIENCE
expect.set_options(timeout=PATIENCE)
# A slow machine must not change what a page shows: the page waits longer for smooth lines than it does for users.
PATIENT = f"AbortSignal.timeout = ((timeout) => () => timeout.call(AbortSignal, {PATIENCE // 2}))(AbortSignal.timeout)"
OPEN = ("queued", "running", "canceling")


def ask(base, path, body=None, method=None, wait=True, headers=None):
    """The JSON answer of the server. Waits until a submitted job has ended, unless `wait` is false."""
    data = None if body is None else json.dumps(body).encode()
    headers = {"Content-Type": "application/json", "Prefer": f"wait={60 if wait else 0}", **(headers or {})}
    request = urllib.request.Request(base + path, data, headers, method=method)
    with urllib.request.urlopen(request, timeout=programs.PATIENCE) as answer:
        found = json.loads(answer.read() or "null")
    if wait and body is not None and path.startswith("/v1/jobs") and found.get("state") in OPEN:
        query = path.partition("?")[2]
        return ended(base, found["id"], query)
    return found


def ended(base, job, query=""):
    """Waits until a job has ended, and returns it."""
    until = time.monotonic() + programs.PATIENCE
    while (found := ask(base, f"/v1/jobs/{job}?wait=60{query and '&' + query}"))["state"] in OPEN:
        assert time.monotonic() < until, found
    return found


class Clock:
    """Prints how long each part of a test took."""

    def __init__(self):
        self.begun = time.monotonic()

    def passed(self, part):
        now = time.monotonic()
        print(f"-- {now - self.begun:.0f} s: {part}", flush=True)
        self.begun = now


def axe():
    """The script of axe-core, which `tests/clients/install` has installed."""
    return (ROOT / "target/clients/node/node_modules/axe-core/axe.min.js").read_text()


class Server:
    """A server of this test. It keeps its port when it is restarted."""

    def __init__(self, program, data, *options, **environment):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.command = [program, "--listen", f"127.0.0.1:{self.port}", "--data-dir", data, *options]
        self.environment = {"PATH": os.environ["PATH"], "FRETWORK_LOG": "error", "FRETWORK_CRASH_PAUSE": "0s", **environment}
        self.base = f"http://127.0.0.1:{self.port}"

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.kill()

    def start(self):
        self.process = subprocess.Popen(self.command, env=self.environment, stdout=subprocess.PIPE, text=True)
        assert "listens on" in self.process.stdout.readline()
        # The printed address of the dashboard.
        self.page = re.search(r"dashboard: (\S+)", self.process.stdout.readline())[1]
        return self

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


class Browser:
    """Fresh profiles of one browser. Records the errors of its pages and their requests to other servers."""

    def __init__(self, play):
        self.play, self.programs, self.errors, self.seen = play, {}, [], set()

    def program(self, scheme):
        """The browser, started when it is first needed. Firefox has one colour scheme for all of its pages."""
        scheme = scheme if FIREFOX else "light"
        if scheme not in self.programs:
            self.programs[scheme] = self.start(scheme)
        return self.programs[scheme]

    def start(self, scheme):
        if not FIREFOX:
            return self.play.chromium.launch(executable_path=shutil.which(CHROMIUM), args=["--no-sandbox"])
        settings = {
            "layout.css.prefers-color-scheme.content-override": ["dark", "light"].index(scheme),
            "dom.events.testing.asyncClipboard": True,
            # The list of downloads would take the focus.
            "browser.download.alwaysOpenPanel": False,
        }
        return self.play.firefox.launch(
            channel="moz-firefox", executable_path=FIREFOX, firefox_user_prefs=settings, downloads_path=DOWNLOADS)

    def page(self, base, scheme="light", width=1440, before=None):
        """A page in a fresh profile. The script `before` runs before the scripts of the page."""
        size = {"width": width, "height": SIZES[width]}
        context = self.program(scheme).new_context(viewport=size, color_scheme="null" if FIREFOX else scheme, bypass_csp=False)
        context.add_init_script(PATIENT)
        if not FIREFOX and base.startswith("http"):
            context.grant_permissions(["clipboard-read", "clipboard-write"], origin=base)
        if before:
            context.add_init_script(before)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: self.errors.append(f"{page.url}: {error.message} {error.stack}"))
        page.on("console", self.record_message)
        page.on("request", lambda request: request.url.startswith((base, "blob:", "data:"))
            or self.errors.append(f"request to {request.url}"))
        return page

    def tell(self):
        """Prints what each open page shows, so that a failed test says why."""
        for page in (page for program in self.programs.values() for context in program.contexts for page in context.pages):
            print(f"-- {page.url} shows:\n{page.locator('body').inner_text(timeout=1000)}\n-- errors: {self.errors}", flush=True)

    def record_message(self, message):
        # The browser also logs each error status, which the tests provoke.
        if message.type in ("error", "warning") and not message.text.startswith("Failed to load resource"):
            self.errors.append(message.text)

    def check_accessibility(self, page, view, rules=None):
        """axe-core finds no violation of these rules, by default of all, in the page as it is now."""
        if page.evaluate("typeof axe") == "undefined":
            page.evaluate(axe())
        options = {"resultTypes": ["violations"]} | ({"runOnly": rules} if rules else {})
        found = page.evaluate("options => axe.run(document, options)", options)["violations"]
        violations = [(rule["id"], [node["html"][:160] for node in rule["nodes"]][:3]) for rule in found]
        assert not violations, (view, violations)

    def check_view(self, page, view, rules=None):
        """Checks accessibility and that nothing is wider than the screen, and takes a screenshot."""
        self.check_accessibility(page, view, rules)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), view
        # The driver of Firefox adds a style to the page, which the page forbids.
        if TAKES_SCREENSHOTS:
            page.screenshot(path=SCREENS / f"{view}.png", full_page=True)

    def check_looks(self, page, view, looks):
        """Checks a view on each of these screens and in each scheme. The page has the first one."""
        for width, scheme in looks:
            if (width, scheme) != looks[0]:
                self.change(page, width, scheme)
            # The layout of 1280 is that of 1440.
            is_seen = (view, width) in self.seen or width == 1280 and (view, 1440) in self.seen
            self.check_view(page, f"{view}-{width}-{scheme}", COLOURS if is_seen else None)
            self.seen.add((view, width))
        if len(looks) > 1:
            self.change(page, *looks[0])

    def change(self, page, width, scheme):
        """Shows a page on another screen. Figures follow the size of the screen in the next frame."""
        page.set_viewport_size({"width": width, "height": SIZES[width]})
        if not FIREFOX:
            page.emulate_media(color_scheme=scheme)
        page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def check_views(self, base, views):
        """Checks each view in light and dark, on several screens. A view is an address, or a function that makes one, and a
        selector to wait for."""
        for looks in LOOKS:
            page = self.page(base, *reversed(looks[0]))
            for view, (address, ready) in views.items():
                page.goto(base + (address() if callable(address) else address))
                page.wait_for_selector(ready, state="attached")
                self.check_looks(page, view, looks)
            page.context.close()


@contextlib.contextmanager
def opened():
    """A browser, which must record no errors."""
    DOWNLOADS.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as play:
        browser = Browser(play)
        try:
            yield browser
        except BaseException:
            browser.tell()
            raise
        for program in browser.programs.values():
            program.close()
    assert not browser.errors, browser.errors


def downloaded(page, click):
    """The bytes of the file that a click downloads. Firefox does not tell the test that a download begins."""
    if not FIREFOX:
        with page.expect_download() as download:
            click()
        return pathlib.Path(download.value.path()).read_bytes()
    before = set(DOWNLOADS.iterdir())
    click()
    made = []

    def is_made():
        made[:] = [path for path in set(DOWNLOADS.iterdir()) - before if path.suffix != ".part" and path.stat().st_size]
        return made

    until(page, is_made)
    return made[0].read_bytes()


def drop(page, place, *files):
    """Drops files on a place of the page. A file has a name and a text."""
    page.locator(place).first.evaluate("""(place, files) => {
        const data = new DataTransfer();
        for (const [name, text] of files) data.items.add(new File([text], name));
        place.dispatchEvent(new DragEvent("drop", {dataTransfer: data, bubbles: true, cancelable: true}));
    }""", files)


def until(page, holds):
    """Waits until a condition holds."""
    end = time.monotonic() + programs.PATIENCE
    while not holds():
        assert time.monotonic() < end, "the condition does not hold"
        page.wait_for_timeout(50)


def drag(page, place, *paths, **texts):
    """Drags files, folders or texts of these types from outside onto the middle of a place, as a person does. Only Chromium can."""
    page.locator(place).first.scroll_into_view_if_needed()
    box = page.locator(place).first.bounding_box()
    data = {"items": [{"mimeType": f"text/{kind.replace('_', '-')}", "data": text} for kind, text in texts.items()],
            "files": [str(path) for path in paths], "dragOperationsMask": 1}
    devtools = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        devtools.send("Input.dispatchDragEvent", {"type": kind, "data": data, "x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2})
    devtools.detach()


def curves(page, figure):
    """The paths of the curves of a figure."""
    return page.locator(f"section[aria-label='{figure}'] .curve").evaluate_all("paths => paths.map(path => path.getAttribute('d'))")


def smoothed(page):
    """Waits until the history of a result is drawn through more points than its output cycles."""
    page.wait_for_selector("#headline dd")
    until(page, lambda: [path.count("L") > 30 for path in curves(page, "History")][:1] == [True])


def readout(page, figure):
    """The values at the cursor of a figure by the names of the curves and of the x axis."""
    return dict(page.locator(f"section[aria-label='{figure}'] .values li").evaluate_all(
        "rows => rows.map(row => [row.querySelector('.name')?.textContent ?? '', row.querySelector('.value').textContent])"))


POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
PREFIXES = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1, "k": 1e3, "M": 1e6, "G": 1e9}
UNITS = {**{prefix + unit: factor for prefix, factor in PREFIXES.items() for unit in ("m", "Pa", "J", "N")},
    "": 1, "m³": 1, "mm³": 1e-9, "µm³": 1e-18, "N/m": 1, "N/mm": 1e3, "%": 1, "deg": math.pi / 180, "mm³/(N m)": 1e-9, "mm³/J": 1e-9}


def split(text):
    """The number and the unit of a shown text; None for a dash."""
    found = re.match(r"(−?[\d.]+)(?:[·×]10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?\s*(.*)", text.replace("\u202f", ""))
    if not found:
        assert text == "–", text
        return None, ""
    return float(found[1].replace("−", "-")) * 10 ** int((found[2] or "0").translate(POWERS)), found[3].replace("\u00a0", " ")


def number(text):
    """The number of a shown text, without its unit."""
    return split(text)[0]


def factor(unit):
    """The factor from a shown unit, such as µm or 10³ µm³, to SI units."""
    power = re.match(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+) ?", unit)
    return 10 ** int(power[1].translate(POWERS)) * UNITS[unit[power.end():]] if power else UNITS[unit]


def value(text):
    """A shown quantity in SI units; None for a dash."""
    shown, unit = split(text)
    return None if shown is None else shown * factor(unit)


def column(page, name):
    """A column of the table of a study in SI units, and its place."""
    heads = page.locator("#study thead th").all_inner_texts()
    place, head = next((place, head) for place, head in enumerate(heads) if head.split(" (")[0] == name)
    unit = head.partition(" (")[2].removesuffix(")").replace("\u00a0", " ")
    return [number(text) * factor(unit) for text in page.locator(f"#study tbody td:nth-child({place + 1})").all_inner_texts()]


def near(shown, expected, tolerance=1e-4):
    """Asserts that a shown quantity is the expected one in SI units, within a relative tolerance."""
    found = value(shown)
    assert found == expected or None not in (found, expected) and abs(found - expected) <= tolerance * abs(expected), (shown, expected)


def close(shown, expected, tolerance=1e-4):
    """Asserts that a shown text is the expected number within a relative tolerance."""
    found = number(shown)
    assert found == expected or None not in (found, expected) and abs(found - expected) <= tolerance * abs(expected), (shown, expected)


def blocks(cycles, points=4096, count=1000):
    """Amplitude blocks, some of them in gross slip. A thousand take about 25 s of processor time."""
    amplitudes = (f"{(2.5, 8)[i % 2] + (i % 7) / 100} um" for i in range(count))
    return {
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "112 GPa", "tangential": "92 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "force"},
        "motion": {"blocks": [{"amplitude": amplitude, "cycles": cycles} for amplitude in amplitudes]},
        "cycles": {"from": cycles, "to": count * cycles, "count": count, "spacing": "linear"},
        "profiles_at": "none",
        "model": {"method": "exact", "points": points, "tolerance": 1e-4, "compare": True},
    }


LONG = blocks(200_000)


def item(page, name):
    """The value of an item in a list of names and values."""
    return page.locator(f"[data-item={name}]")


def key_of(page):
    return re.search(r"#/result/([0-9a-f]{64})", page.url)[1]
