"""Uses the dashboard as people do, in a real browser: runs, looks, compares, shares, cancels, signs in,
loses the server and gets it back. Looks at every view with axe-core, light and dark.

    python dashboard.py http://127.0.0.1:8080 target/release/fretwork

Pictures of all views go to target/screens.
"""

import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request

from playwright.sync_api import expect, sync_playwright

BASE, PROGRAM = sys.argv[1:3]
ROOT = pathlib.Path(__file__).parents[2]
SCREENS = ROOT / "target/screens"
AXE = "4.14.1"
MASTER = "fretwork_" + "0123456789abcdef" * 3
SIZES = {1440: 900, 390: 844}

# Seconds of work: long enough to be cancelled.
LONG = {
    "profile": {"shape": "paraboloid", "radius": "10 mm"},
    "moduli": {"normal": "112 GPa", "tangential": "92 GPa"},
    "friction": 0.7,
    "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
    "load": {"normal_force": "100 N", "held": "force"},
    "motion": {"blocks": [{"amplitude": f"{1 + (i % 7) / 5} um", "cycles": 20000} for i in range(1000)]},
    "cycles": {"from": 1000, "to": 20000000, "count": 1000, "spacing": "linear"},
    "profiles_at": "none",
    "model": {"method": "exact", "points": 4096, "tolerance": 1e-4, "compare": True},
}


def ask(path, body=None, method=None, base=BASE):
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(base + path, data, {"Content-Type": "application/json", "Prefer": "wait=20"}, method=method)
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

    def __init__(self, data, **environment):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.data, self.environment = data, environment
        self.base = f"http://127.0.0.1:{self.port}"

    def start(self):
        words = [PROGRAM, "--listen", f"127.0.0.1:{self.port}", "--data-dir", self.data]
        environment = {"PATH": os.environ["PATH"], "FRETWORK_LOG": "error", **self.environment}
        self.process = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True)
        assert "listens on" in self.process.stdout.readline()
        return self

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


class Browser:
    """Fresh profiles of one browser; what a page complains of, and whom else it asks, is remembered."""

    def __init__(self, chromium):
        self.chromium, self.complaints, self.script = chromium, [], axe()

    def page(self, base=BASE, scheme="light", width=1440):
        size = {"width": width, "height": SIZES[width]}
        context = self.chromium.new_context(viewport=size, color_scheme=scheme, bypass_csp=False)
        context.grant_permissions(["clipboard-read", "clipboard-write"], origin=base)
        page = context.new_page()
        page.set_default_timeout(15000)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self.heard)
        page.on("request", lambda request: request.url.startswith((base, "blob:", "data:"))
            or self.complaints.append(f"asks {request.url}"))
        return page

    def heard(self, message):
        # The browser reports each answer that is not a success; those that are meant are shown.
        if message.type in ("error", "warning") and not message.text.startswith("Failed to load resource"):
            self.complaints.append(message.text)

    def examine(self, page, view):
        """No violation of any rule of accessibility in what is shown."""
        page.evaluate(self.script)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
        told = [(rule["id"], [node["html"][:160] for node in rule["nodes"]][:3]) for rule in found]
        assert not told, (view, told)


def inked(page, figure):
    """How many pixels of a plot are drawn, and whether in more than one colour."""
    return page.locator(f"section[aria-label='{figure}'] canvas").evaluate("""canvas => {
        const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        const colours = new Set();
        let inked = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) {
            inked++;
            colours.add(`${data[i]} ${data[i + 1]} ${data[i + 2]}`);
        }
        return [inked, colours.size];
    }""")


def number(text):
    """A number as it is shown, back."""
    found = re.match(r"(−?[\d.]+)(?:·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?", text)
    power = (found[2] or "0").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    return float(found[1].replace("−", "-")) * 10 ** int(power)


def close(shown, true, part=1e-4):
    assert abs(number(shown) - true) <= part * abs(true), (shown, true)


def known(page, name):
    return page.locator(f"[data-known={name}]")


def key_of(page):
    return re.search(r"#/result/([0-9a-f]{64})", page.url)[1]


def run_the_ball(browser):
    page = browser.page()
    page.goto(BASE + "/")
    page.select_option("#preset", "steel-ball")
    expect(known(page, "regime")).to_have_text("partial slip")
    scenario = ask("/v1/examples/steel-ball")["scenario"]
    truth = ask("/v1/scenarios", {"scenario": scenario})
    close(known(page, "a0").inner_text(), truth["scales"]["contact_radius"] * 1e6, 1e-3)
    shown = re.sub(r"\D", "", known(page, "n0").inner_text())
    assert shown == str(round(truth["scales"]["cycles"])), shown

    # A fault stands at its field, and goes.
    page.fill("#profile-radius", "-10 mm")
    expect(page.locator("#profile-radius-fault")).to_contain_text("greater than 0")
    expect(page.locator("button.primary")).to_be_disabled()
    browser.examine(page, "faults")
    page.fill("#profile-radius", "10 mm")
    expect(page.locator("#profile-radius-fault")).to_have_text("")

    # The form and the JSON are one.
    page.click("summary:has-text('as JSON')")
    page.fill("#friction", "0.6")
    assert json.loads(page.input_value("#json"))["friction"] == 0.6
    page.fill("#json", json.dumps({**scenario, "friction": 0.65}))
    expect(page.locator("#friction")).to_have_value("0.65")
    page.fill("#json", json.dumps(scenario))
    expect(page.locator("button.primary")).to_be_enabled()
    # Its address opens it again.
    page.reload()
    expect(page.locator("#friction")).to_have_value("0.7")
    expect(page.locator("button.primary")).to_be_enabled()

    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("canvas")
    for figure in ("Profiles", "History", "Fretting loop"):
        pixels, colours = inked(page, figure)
        assert pixels > 500 and colours > 3, (figure, pixels, colours)
    return page


def look(page):
    """The numbers at each instant are the server's; the plot follows the slider."""
    result = ask(f"/v1/results/{key_of(page)}")
    slider = page.locator("#instant")
    slider.focus()
    page.keyboard.press("Home")
    instants = result["profiles"]["cycles"]
    for row, at in enumerate(instants):
        assert re.sub(r"\D", "", page.locator("#at").inner_text()) == str(int(at))
        close(page.locator("[data-value=wear_depth]").inner_text() or "0", result["history"]["wear_depth"][row] * 1e6)
        close(page.locator("[data-value=normal_force]").inner_text(), result["history"]["normal_force"][row])
        if row < len(instants) - 1:
            page.keyboard.press("ArrowRight")
    before = page.locator("section[aria-label='Profiles'] canvas").evaluate("canvas => canvas.toDataURL()")
    page.keyboard.press("Home")
    page.wait_for_timeout(100)
    assert before != page.locator("section[aria-label='Profiles'] canvas").evaluate("canvas => canvas.toDataURL()")
    page.keyboard.press("End")

    # The value under the pointer is the server's.
    page.hover("section[aria-label='Profiles'] .u-over")
    page.wait_for_timeout(100)
    legend = page.locator("section[aria-label='Profiles'] .u-series")
    values = {row.locator(".u-label").inner_text(): row.locator(".u-value").inner_text() for row in legend.all()}
    radius = number(values["Radius r, µm"])
    profiles = result["profiles"]
    nearest = min(range(len(profiles["radius"])), key=lambda i: abs(profiles["radius"][i] * 1e6 - radius))
    close(values["this instant"], profiles["worn"][-1][nearest] * 1e6, 1e-3)

    # In SI the same.
    page.click("#units")
    close(page.locator("[data-value=wear_depth]").inner_text(), result["history"]["wear_depth"][-1])
    page.click("#units")

    # What has no value is a gap, not a spike.
    page.select_option("#choose-plot", "pressure")
    expect(page.locator("section[aria-label='Profiles'] figcaption")).to_contain_text("Pressure")
    expect(page.locator("#apart")).to_contain_text("beyond the axis")
    page.screenshot(path=SCREENS / "pressure-1440.png")
    page.select_option("#choose-plot", "worn")

    page.click("summary:has-text('Download')")
    for name, start in (("Profiles as csv", b"#"), ("Everything as npz", b"PK"), ("Loops as arrow", b"ARROW1")):
        with page.expect_download() as download:
            page.get_by_role("button", name=name).click()
        assert pathlib.Path(download.value.path()).read_bytes().startswith(start), name
    page.get_by_role("button", name="Copy as curl").click()
    command = page.evaluate("navigator.clipboard.readText()")
    with tempfile.TemporaryDirectory() as made:
        subprocess.run(command, shell=True, cwd=made, check=True)
        assert json.loads((pathlib.Path(made) / "result.json").read_text()) == result
    page.get_by_role("button", name="Copy as Python").click()
    python = page.evaluate("navigator.clipboard.readText()")
    printed = subprocess.run([sys.executable, "-c", python], capture_output=True, text=True, check=True).stdout
    assert "100000" in printed or "1.e+05" in printed, printed
    page.click("summary:has-text('Download')")

    page.get_by_role("button", name="Note").click()
    page.fill("#note", "<b>Agrees</b> with the rig")
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".actions .note")).to_contain_text("<b>Agrees</b> with the rig")
    pin = page.get_by_role("button", name="Pin")
    wanted = pin.get_attribute("aria-pressed") == "false"
    pin.click()
    expect(pin).to_have_attribute("aria-pressed", str(wanted).lower())
    assert ask(f"/v1/results/{key_of(page)}/provenance")["pinned"] is wanted


def compare(browser, page):
    """The exact method beside the rule, from the library; the link opens the same view elsewhere."""
    rule = key_of(page)
    exact = ask("/v1/jobs", ask("/v1/examples/steel-ball-exact"))["key"]
    both = ask("/v1/jobs", ask("/v1/examples/flat-on-rig"))["key"]
    page.goto(BASE + "/#/library")
    page.select_option("#find-shape", "truncated_paraboloid")
    expect(page.locator(f".entry input[value='{both}']")).to_be_visible()
    expect(page.locator(f".entry input[value='{rule}']")).to_have_count(0)
    page.select_option("#find-shape", "paraboloid")
    page.fill("#find-friction", "plenty")
    expect(page.locator(".trouble")).to_contain_text("friction")
    page.fill("#find-friction", "0.65..0.75")
    for key in (rule, exact):
        page.check(f".entry input[value='{key}']")
    page.get_by_role("link", name="Compare the two").click()
    page.wait_for_selector("#apart:has-text('%')")
    page.select_option("#choose-plot", "wear")
    page.locator("#instant").fill("2")
    page.select_option("#choose-history", "depth")
    shown = page.locator("#apart").inner_text()
    assert rule in page.url and "at=3000" in page.url, page.url
    other = browser.page()
    other.goto(page.url)
    other.wait_for_selector("#apart:has-text('%')")
    assert other.locator("#apart").inner_text() == shown
    assert other.input_value("#choose-plot") == "wear" and other.input_value("#choose-history") == "depth"
    assert other.locator("#at").inner_text() == page.locator("#at").inner_text()

    page.goto(f"{BASE}/#/result/{both}")
    errors = ask(f"/v1/results/{both}")["comparison"]["errors"]["wear_volume"]
    cells = page.locator("#comparison tbody tr")
    expect(cells).to_have_count(len(errors))
    close(cells.last.locator("td").first.inner_text(), 100 * errors[-1], 1e-2)


def cancel(page):
    page.goto(BASE + "/#/new")
    page.wait_for_selector("#json", state="attached")
    page.reload()
    page.click("summary:has-text('as JSON')")
    page.fill("#json", json.dumps(LONG))
    expect(page.locator("button.primary")).to_be_enabled()
    expect(page.locator("#motion")).to_contain_text("blocks")
    page.click("button.primary")
    page.wait_for_url("**/#/run/*")
    expect(page.locator("#state")).to_have_text("running")
    page.screenshot(path=SCREENS / "run-1440.png")
    page.click("#cancel")
    expect(page.locator("#state")).to_have_text("canceled")
    page.click("nav >> text=Queue")
    expect(page.locator(".state.canceled").first).to_be_visible()


def sign_in(browser, data):
    server = Server(data, FRETWORK_ADMIN_KEY=MASTER).start()
    try:
        page = browser.page(server.base)
        page.goto(server.base + "/")
        page.fill("#key", "nonsense")
        browser.examine(page, "sign in")
        page.screenshot(path=SCREENS / "sign-in-1440.png")
        page.get_by_role("button", name="Sign in").click()
        expect(page.locator("#key-why")).to_contain_text("does not know")
        page.fill("#key", MASTER)
        page.get_by_role("button", name="Sign in").click()
        expect(known(page, "regime")).to_have_text("partial slip")
        expect(page.locator("#who")).to_contain_text("admin")
        page.click("button.primary")
        page.wait_for_selector("canvas")
        page.get_by_role("button", name="Share").click()
        expect(page.locator("#status")).to_contain_text("copied")
        link = page.evaluate("navigator.clipboard.readText()")
        # Who gets the link has no key, and sees the result.
        guest = browser.page(server.base)
        guest.goto(link)
        guest.wait_for_selector("canvas")
        assert guest.locator("#readout").inner_text() == page.locator("#readout").inner_text()
        # So with two beside each other.
        key = key_of(page)
        page.goto(f"{server.base}/#/result/{key}?with={key}")
        page.wait_for_selector("#apart:has-text('%')")
        page.get_by_role("button", name="Share").click()
        expect(page.locator("#status")).to_contain_text("copied")
        guest.goto(page.evaluate("navigator.clipboard.readText()"))
        guest.wait_for_selector("#apart:has-text('0 %')")
        page.get_by_role("button", name="Sign out").click()
        expect(page.locator("#key")).to_be_visible()
        assert page.evaluate("[sessionStorage.length, Object.values(localStorage).join()]")[0] == 0
        assert MASTER not in page.content()
    finally:
        server.kill()


def lose_the_server(browser, data):
    server = Server(data).start()
    try:
        page = browser.page(server.base)
        page.goto(server.base + "/")
        expect(known(page, "regime")).to_have_text("partial slip")
        server.kill()
        page.fill("#friction", "0.5")
        expect(page.locator("#banner")).to_be_visible()
        page.screenshot(path=SCREENS / "lost-1440.png")
        browser.examine(page, "lost")
        server.start()
        expect(page.locator("#banner")).to_be_hidden()
        # It goes on by itself with what was typed meanwhile.
        expect(known(page, "regime")).to_have_text("gross slip")
        page.click("nav >> text=Queue")
        expect(page.locator(".empty")).to_contain_text("No jobs")
        browser.examine(page, "an empty queue")
        page.click("nav >> text=Library")
        expect(page.locator(".empty")).to_contain_text("Nothing here yet")
        page.goto(f"{server.base}/#/result/{'0' * 64}")
        expect(page.locator(".trouble")).to_be_visible()
        browser.examine(page, "trouble")
        # A result that was deleted is computed again from what its address still says.
        done = ask("/v1/jobs", ask("/v1/examples/steel-ball", base=server.base), base=server.base)
        address = f"{server.base}/#/result/{done['key']}"
        page.goto(address)
        page.wait_for_selector("canvas")
        ask(f"/v1/results/{done['key']}", method="DELETE", base=server.base)
        page.goto(server.base + "/#/queue")
        page.goto(address)
        page.get_by_role("link", name="Compute it again").click()
        expect(known(page, "cached")).to_have_text("not yet")
        page.click("button.primary")
        page.wait_for_selector("canvas")
    finally:
        server.kill()


def every_view(browser, key, other):
    views = {"form": "/", "result": f"/#/result/{key}",
        "compare": f"/#/result/{other}?with={key}&plot=wear",
        "library": "/#/library", "queue": "/#/queue"}
    ready = {"form": "[data-known=regime]", "library": ".entry", "queue": "tbody tr"}
    for width in SIZES:
        for scheme in ("light", "dark"):
            page = browser.page(scheme=scheme, width=width)
            for view, address in views.items():
                page.goto(BASE + address)
                page.wait_for_selector(ready.get(view, "canvas"), state="attached")
                page.wait_for_timeout(300)
                browser.examine(page, f"{view} {width} {scheme}")
                assert page.evaluate("document.documentElement.scrollWidth") <= width, (view, width)
                page.screenshot(path=SCREENS / f"{view}-{width}-{scheme}.png", full_page=True)
            page.context.close()


def first_load(browser):
    page = browser.page()
    sizes = []
    page.on("response", lambda answer: sizes.append(answer))
    page.goto(BASE + "/")
    page.wait_for_load_state("networkidle")
    total = sum(int(answer.headers.get("content-length", 0)) for answer in sizes)
    assert len(sizes) > 10 and total < 200_000, total
    policy = sizes[0].headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy, policy
    print(f"the first load is {total / 1000:.0f} kB")


def main():
    SCREENS.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as play, tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
        program = play.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        browser = Browser(program)
        first_load(browser)
        page = run_the_ball(browser)
        key = key_of(page)
        look(page)
        compare(browser, page)
        other = key_of(page)
        cancel(page)
        every_view(browser, other, key)
        sign_in(browser, one)
        lose_the_server(browser, two)
        program.close()
        assert not browser.complaints, browser.complaints
    print("the dashboard does what it should")


main()
