"""Walks once through every view of the dashboard, as an administrator, a user and a guest see them. Each view shows its numbers, which
are those of the server, logs no error, and sends no request to another server. The other programs of tests/clients test each view
in depth.

    python walk.py target/debug/fretwork

Writes screenshots to target/screens.
"""

import json
import re
import sys
import tempfile

from playwright.sync_api import expect

import browser as browsers
from browser import LONG, ROOT, SCREENS, TAKES_SCREENSHOTS, Clock, Server, close, column, curves, ended, item, key_of, near, number, opened
from comparison import row_factor, shown

MASTER = "fretwork_" + "0123456789abcdef" * 3
DEPTH = "#headline [data-value=wear_depth]"
# What a script writes where a number is missing.
MISSING = re.compile(r"NaN|undefined|\[object|Infinity")


class Walk:
    """A page that walks through the views of a server, and the key with which the test asks this server."""

    def __init__(self, browser, own):
        self.browser, self.base = browser, own.base
        self.page = browser.page(own.base)

    def ask(self, path, body=None, **more):
        return browsers.ask(self.base, path, body, headers={"Authorization": f"Bearer {MASTER}"}, **more)

    def computed(self, body):
        """The key and the result of a body."""
        job = self.ask("/v1/jobs", body)
        assert job["state"] == "succeeded", job
        return job["key"], self.ask(f"/v1/results/{job['key']}")

    def open(self, address, ready):
        """Opens a view, and waits until it shows what makes it ready."""
        # A view whose address differs only behind the hash is not loaded again.
        self.page.goto("about:blank")
        self.page.goto(self.base + address)
        self.page.locator(ready).first.wait_for()

    def look(self, name):
        """The view is not wider than the screen, and no number of it is missing."""
        page = self.page
        expect(page.locator("main[aria-busy]")).to_have_count(0)
        text = page.locator("main").inner_text()
        assert not MISSING.search(text), (name, MISSING.search(text), text)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), name
        if TAKES_SCREENSHOTS:
            page.screenshot(path=SCREENS / f"walk-{name}.png", full_page=True)


def sign_in(walk):
    """The page asks for a key, and shows the form when it has one."""
    page = walk.page
    walk.open("/", "#key")
    walk.look("sign-in")
    page.fill("#key", MASTER)
    page.locator("dialog").get_by_role("button", name="Sign in").click()
    expect(page.locator("#user summary")).to_have_text("admin")


def form(walk):
    """The form estimates a scenario, shows a fault, draws the figures, and keeps the run."""
    page = walk.page
    walk.open("/", DEPTH)
    expect(item(page, "regime")).to_have_text("Partial slip")
    page.fill("#friction", "much")
    expect(page.locator(".estimate h2")).to_contain_text("1 field needs correction")
    page.fill("#friction", "0.6")
    page.fill("#label", "Walked")
    expect(page.locator(".estimate")).not_to_have_attribute("aria-busy", "true")
    expect(page.locator("#computing")).to_have_text("")
    scenario = json.loads(page.input_value("#json"))
    outputs = walk.ask("/v1/evaluate", {"scenario": scenario, "outputs": ["wear_depth"]})["outputs"]
    near(page.locator(DEPTH).inner_text(), outputs["wear_depth"], 1e-2)
    walk.look("form")
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("#headline dd")
    return key_of(page)


def result(walk, key, name):
    """The numbers of a result, and a curve for each choice of its figures."""
    page = walk.page
    walk.open(f"/#/result/{key}", "#readout dd")
    found = walk.ask(f"/v1/results/{key}")
    for quantity in ("wear_depth", "wear_volume", "contact_radius"):
        near(page.locator(f"[data-value={quantity}]").first.inner_text(), found["history"][quantity][-1], 5e-3)
    walk.look(name)
    for figure, choice in (("Profiles", "plot"), ("History", "history")):
        for option in page.locator(f"#choose-{choice} option").evaluate_all("all => all.map(({value}) => value)"):
            page.select_option(f"#choose-{choice}", option)
            drawn = curves(page, figure)
            assert drawn and all(re.match(r"M-?\d", path) and not MISSING.search(path) for path in drawn), (name, option, drawn)
    return found


def measured(walk, key):
    """Measured volumes beside a result, and the form of a fit to them."""
    page = walk.page
    walk.open(f"/#/result/{key}", "#add-measurement")
    history = walk.ask(f"/v1/results/{key}")["history"]
    rows = [f"{n};{1.1e18 * v}" for n, v in zip(history["cycles"], history["wear_volume"]) if n]
    page.click("#add-measurement")
    page.fill("#set-text", "\n".join(["N;V [µm³]", *rows]))
    page.wait_for_selector("#set-kind")
    page.fill("#set-name", "rig")
    walk.look("measure-dialog")
    page.click("#add-set:enabled")
    expect(page.locator("[data-set=rig] .verdict")).to_contain_text(re.compile("(9\\.9|10).*% above"))
    assert page.locator("section[aria-label=History] path.measured").count() == len(rows)
    page.click("#fit-these")
    expect(page.locator("#fit-says")).to_contain_text("processor time")
    walk.look("measure")


def run(walk):
    """A run that is computed, in its view and in the list of runs, and canceled."""
    page = walk.page
    job = walk.ask("/v1/jobs", {"scenario": LONG, "label": "Walked for long"}, wait=False)
    walk.open(f"/#/run/{job['id']}", "progress")
    expect(page.locator("#state")).to_have_text("running")
    expect(page.locator("section[aria-label='Results so far'] .curve").first).to_be_attached()
    walk.look("run")
    page.click("nav >> text=Runs")
    expect(page.locator("tr", has=page.get_by_role("link", name="Walked for long"))).to_contain_text("running")
    walk.look("runs")
    page.go_back()
    page.click("#cancel")
    expect(page.locator("#state")).to_have_text("canceled")
    walk.look("run-canceled")


def library(walk, count):
    """All results, and a search that finds one."""
    page = walk.page
    walk.open("/#/library", ".entry")
    expect(page.locator("#total")).to_have_text(f"{count} results")
    expect(page.locator(".thumbnail path").first).to_be_attached()
    walk.look("library")
    page.fill("#find-q", "walked")
    expect(page.locator(".entry th a")).to_have_text(["Walked"])


def compare(walk, keys):
    """The numbers of two runs side by side."""
    page = walk.page
    walk.open(f"/#/compare?keys={','.join(keys)}", "#compared")
    for place, key in enumerate(keys):
        volume = walk.ask(f"/v1/results/{key}")["history"]["wear_volume"][-1]
        assert abs(shown(page, "wear_volume", place) * row_factor(page, "wear_volume") / volume - 1) < 1e-3, (place, volume)
    for figure in ("Profiles", "First history", "Second history", "Fretting loops"):
        assert len(curves(page, figure)) >= len(keys), figure
    walk.look("compare")


def studies(walk):
    """A study of each kind: its table or its figure has the numbers of its result."""
    page = walk.page
    bodies = {file.stem: json.loads(file.read_text()) for file in sorted((ROOT / "examples/studies").glob("*.json"))}
    bodies["sample"] = json.loads(json.dumps(bodies["sweep"]))
    bodies["sample"]["sweep"] |= {"design": "latin_hypercube", "samples": 64, "outputs": ["wear_volume"],
        "vary": [{"pointer": "/friction", "distribution": {"normal": {"mean": 0.6, "standard_deviation": 0.05}}}]}
    for name, body in bodies.items():
        key, found = walk.computed({**body, "label": f"Study: {name}"})
        if name == "fit":
            walk.open(f"/#/result/{key}", "#estimates")
            for parameter in found["parameters"]:
                near(page.locator(f"[data-estimate='{parameter['pointer']}'] dd").inner_text().split("\n")[0], parameter["estimate"], 5e-3)
        else:
            walk.open(f"/#/result/{key}", "#study tbody tr")
        if name in ("map", "sweep", "sample"):
            volumes = column(page, "Wear volume V")
            # The table shows four digits.
            assert all(abs(one / other - 1) < 5.1e-4 for one, other in zip(volumes, found["table"]["wear_volume"])), volumes
        if name == "sensitivity":
            expect(page.locator("[data-verdict=wear_volume]")).to_contain_text("matters most")
        if name == "sample":
            expect(page.locator("#ninety")).to_contain_text("90\u00a0% of the points")
        walk.look(name)
    return len(bodies)


def varied(walk):
    """The form with a number that varies."""
    page = walk.page
    walk.open("/#/new?example=steel-ball-simplified", DEPTH)
    page.get_by_role("button", name="Vary Friction coefficient").click()
    expect(page.locator("button.primary")).to_have_text("Compute 9 runs")
    expect(item(page, "seconds")).to_contain_text("s")
    walk.look("form-varied")


def documents(walk):
    """Each page of the documentation."""
    page = walk.page
    walk.open("/docs/", "nav a")
    links = page.locator("a[href^='/docs/']").evaluate_all("links => [...new Set(links.map((link) => link.pathname))]")
    assert len(links) > 10, links
    for link in links:
        if link != "/docs/api/":
            walk.open(link, "main h1")
    walk.open("/docs/accuracy", "main table")
    walk.look("document")


def keys(walk):
    """An administrator makes a key."""
    page = walk.page
    walk.open("/#/keys", ".new-key")
    page.get_by_label("Name").fill("anna")
    page.get_by_label("Role").select_option("read")
    page.get_by_role("button", name="Make a key").click()
    key = page.locator("#new-key").input_value()
    expect(page.locator(f"[data-key='{key.split('_')[1]}']")).to_contain_text("anna")
    walk.look("keys")
    return key


def reader(walk, own, key, result_key):
    """A user who may only read."""
    guest = Walk(walk.browser, own)
    reply = guest.page.context.request.post(own.base + "/v1/session", headers={"Authorization": f"Bearer {key}"})
    assert reply.status == 204, reply.text()
    guest.open("/", "#limited")
    guest.look("reader-form")
    guest.open(f"/#/result/{result_key}", "#readout dd")
    expect(guest.page.get_by_role("button", name="Pin")).to_have_count(0)
    guest.page.context.close()


def shared(walk, own, key):
    """A guest opens a shared link, which shows the same numbers."""
    page = walk.page
    walk.open(f"/#/result/{key}", "#readout dd")
    page.click("summary:has-text('Download')")
    page.get_by_role("button", name="Share link").click()
    expect(page.locator("#status")).to_contain_text("Link copied")
    link = page.evaluate("navigator.clipboard.readText()")
    guest = Walk(walk.browser, own)
    guest.page.goto(link)
    guest.page.locator("#readout dd").first.wait_for()
    assert guest.page.locator("#readout").inner_text() == page.locator("#readout").inner_text()
    expect(guest.page.locator("nav")).to_be_hidden()
    guest.look("shared")
    guest.page.context.close()


def main():
    SCREENS.mkdir(parents=True, exist_ok=True)
    clock = Clock()
    with opened() as browser, tempfile.TemporaryDirectory() as data, Server(sys.argv[1], data, FRETWORK_ADMIN_KEY=MASTER) as own:
        walk = Walk(browser, own)
        sign_in(walk)
        walk.open("/#/library", ".empty a")
        walk.look("library-empty")
        key = form(walk)
        clock.passed("sign-in and form")
        result(walk, key, "result")
        line, _ = walk.computed(walk.ask("/v1/examples/coated-cylinder"))
        result(walk, line, "line")
        measured(walk, key)
        clock.passed("results")
        run(walk)
        varied(walk)
        count = studies(walk)
        clock.passed("a run and studies")
        other, _ = walk.computed(walk.ask("/v1/examples/steel-ball"))
        library(walk, 3 + count)
        compare(walk, [key, other])
        walk.open(f"/#/result/{'0' * 64}", ".error")
        walk.look("not-found")
        documents(walk)
        clock.passed("library, comparison and documents")
        reader(walk, own, keys(walk), key)
        shared(walk, own, key)
        clock.passed("keys and guests")
    print("every view of the dashboard opens and shows its numbers")


main()
