"""Tests the dashboard in a real browser: run, view, compare, share, cancel, sign in, and lose the server.

Checks the accessibility of each view with axe-core, in light and dark, wide and narrow.

    python dashboard.py http://127.0.0.1:8080 target/release/fretwork

Writes screenshots of all views to target/screens.
"""

import functools
import json
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

from playwright.sync_api import expect, sync_playwright

from browser import SCREENS, SIZES, Browser, Server, ask, chromium, close, drawn_pixels
from plots import every_loop, every_plot, slide
from studies import studies
from vary import VARIED, beyond_a_limit, vary

BASE, PROGRAM = sys.argv[1:3]
MASTER = "fretwork_" + "0123456789abcdef" * 3
server = functools.partial(Server, PROGRAM)
get = functools.partial(ask, BASE)


def blocks(cycles, points=4096):
    """A thousand amplitude blocks, some of them in gross slip. Takes about 25 s of processor time."""
    amplitudes = (f"{(2.5, 8)[i % 2] + (i % 7) / 100} um" for i in range(1000))
    return {
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "112 GPa", "tangential": "92 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "force"},
        "motion": {"blocks": [{"amplitude": amplitude, "cycles": cycles} for amplitude in amplitudes]},
        "cycles": {"from": cycles, "to": 1000 * cycles, "count": 1000, "spacing": "linear"},
        "profiles_at": "none",
        "model": {"method": "exact", "points": points, "tolerance": 1e-4, "compare": True},
    }


LONG = blocks(200_000)


def item(page, name):
    """The value of an item in a list of names and values."""
    return page.locator(f"[data-item={name}]")


def key_of(page):
    return re.search(r"#/result/([0-9a-f]{64})", page.url)[1]


def first_load(browser):
    """The first load is less than 200 kB, from this server only, under a strict policy. Measures how long it takes."""
    page = browser.page(BASE)
    responses = []
    page.on("response", lambda response: responses.append(response))
    page.goto(BASE + "/")
    page.wait_for_load_state("networkidle")
    total = sum(int(response.headers.get("content-length", 0)) for response in responses)
    assert len(responses) > 10 and total < 200_000, total
    policy = responses[0].headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy, policy
    page.context.close()

    # Measures from the start of navigation, with empty caches, until the regime is shown and the run can be started.
    watch = """window.usable = new Promise((done) => new MutationObserver(() => {
        const run = document.querySelector("button.primary"), regime = document.querySelector("[data-item=regime]");
        if (regime && run && !run.disabled) done(performance.now());
    }).observe(document, {subtree: true, childList: true, attributes: true}))"""
    took = []
    for _ in range(9):
        page = browser.page(BASE, before=watch)
        page.goto(BASE + "/")
        took.append(page.evaluate("window.usable"))
        page.context.close()
    print(f"first load: {total / 1000:.0f} kB, usable after {statistics.median(took):.0f} ms (median of {len(took)}), "
        f"maximum {max(took):.0f} ms")


def first_plot(browser, data):
    """On a new server, the printed address and one click on Run lead to the first plot."""
    with server(data) as own:
        page = browser.page(own.base, before="addEventListener('click', () => window.clicks = (window.clicks ?? 0) + 1, true)")
        page.goto(own.page)
        page.click("button.primary")
        page.wait_for_selector("canvas")
        assert drawn_pixels(page, "Profiles")[0] > 500 and page.evaluate("window.clicks") == 1
        page.context.close()


def run_steel_ball(browser):
    page = browser.page(BASE)
    page.goto(BASE + "/")
    page.select_option("#example", "steel-ball")
    expect(item(page, "regime")).to_have_text("Partial slip")
    example = get("/v1/examples/steel-ball")
    scenario = example["scenario"]
    checked = get("/v1/scenarios", {"scenario": scenario})
    close(item(page, "contact-radius").inner_text(), checked["scales"]["contact_radius"] * 1e6, 1e-3)
    shown = re.sub(r"\D", "", item(page, "characteristic-cycles").inner_text())
    assert shown == str(round(checked["scales"]["cycles"])), shown

    # An error is shown at its field and disappears when it is fixed.
    page.fill("#profile-radius", "-10 mm")
    expect(page.locator("#profile-radius-fault")).to_contain_text("greater than 0")
    expect(page.locator(".estimate h2")).to_have_text("Fix 1 field to continue")
    expect(page.locator("button.primary")).to_be_disabled()
    browser.check_accessibility(page, "form-error")
    # The label of an example disappears when its scenario is edited.
    expect(page.locator("#label")).to_have_value("")
    expect(page.locator("#example")).to_have_value("")
    page.fill("#profile-radius", "10 mm")
    expect(page.locator("#profile-radius-fault")).to_have_text("")
    expect(page.locator("#label")).to_have_value(example["label"])
    expect(page.locator("#example")).to_have_value("steel-ball")

    # The form and the JSON show the same scenario, and a typed label stays.
    page.click("summary:has-text('as JSON')")
    page.fill("#friction", "0.6")
    assert json.loads(page.input_value("#json"))["friction"] == 0.6
    page.fill("#label", "Ball on Monday")
    page.fill("#json", json.dumps({**scenario, "friction": 0.65}))
    expect(page.locator("#friction")).to_have_value("0.65")
    expect(page.locator("#label")).to_have_value("Ball on Monday")
    # While the JSON is invalid, Run would submit an earlier scenario.
    page.fill("#json", '{"friction": ')
    expect(page.locator("#json-fault")).to_contain_text("Invalid JSON")
    expect(page.locator("button.primary")).to_be_disabled()
    page.wait_for_timeout(500)
    expect(page.locator("button.primary")).to_be_disabled()
    page.fill("#friction", "0.6")
    expect(page.locator("#json-fault")).to_have_text("")
    expect(page.locator("button.primary")).to_be_enabled()
    page.fill("#json", json.dumps(scenario))
    expect(page.locator("button.primary")).to_be_enabled()
    # The address restores the form.
    page.reload()
    expect(page.locator("#friction")).to_have_value("0.7")
    expect(page.locator("#label")).to_have_value("Ball on Monday")
    expect(page.locator("button.primary")).to_be_enabled()

    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("canvas")
    expect(page.locator("#result-label")).to_have_text("Ball on Monday")
    return page


def view_result(page):
    """The numbers at each output cycle are those of the server. Tests download, copy, note and pin."""
    result = get(f"/v1/results/{key_of(page)}")
    slider = page.locator("#output")
    slider.focus()
    page.keyboard.press("Home")
    outputs = result["profiles"]["cycles"]
    for row, at in enumerate(outputs):
        expect(page.locator("#at")).to_have_text(f"N = {at:,.0f}".replace(",", "\u202f"))
        close(page.locator("[data-value=wear_depth]").inner_text() or "0", result["history"]["wear_depth"][row] * 1e6)
        close(page.locator("[data-value=normal_force]").inner_text(), result["history"]["normal_force"][row])
        for name in ["wear_volume", "wear_depth"]:
            error, shown = result["history"][f"{name}_error"][row], page.locator(f"[data-error={name}]")
            if error > 0:
                expect(shown).to_have_text(re.compile("^error [0-9.·⁻¹²³⁴⁵⁶⁷⁸⁹⁰]+\u00a0%$"))
            else:
                expect(shown).to_have_count(0)
        if row < len(outputs) - 1:
            page.keyboard.press("ArrowRight")
    page.keyboard.press("End")

    # The same value in SI units.
    page.click("#units")
    close(page.locator("[data-value=wear_depth]").inner_text(), result["history"]["wear_depth"][-1])
    page.click("#units")

    # A narrow pressure peak does not flatten the rest of the curve.
    page.select_option("#choose-plot", "pressure")
    expect(page.locator("section[aria-label='Profiles'] figcaption")).to_contain_text("Pressure")
    expect(page.locator("#difference")).to_contain_text("Peak outside the axis")
    page.select_option("#choose-plot", "worn")

    page.click("summary:has-text('Download')")
    for name, start in (("Profiles as csv", b"#"), ("Full result as npz", b"PK"), ("Loops as arrow", b"ARROW1")):
        with page.expect_download() as download:
            page.get_by_role("button", name=name).click()
        assert pathlib.Path(download.value.path()).read_bytes().startswith(start), name
    page.get_by_role("button", name="Copy curl command").click()
    command = page.evaluate("navigator.clipboard.readText()")
    with tempfile.TemporaryDirectory() as made:
        subprocess.run(command, shell=True, cwd=made, check=True)
        assert json.loads((pathlib.Path(made) / "result.json").read_text()) == result
    page.get_by_role("button", name="Copy Python code").click()
    python = page.evaluate("navigator.clipboard.readText()")
    printed = subprocess.run([sys.executable, "-c", python], capture_output=True, text=True, check=True).stdout
    assert "100000" in printed or "1.e+05" in printed, printed
    page.click("summary:has-text('Download')")

    page.get_by_role("button", name="Note").click()
    page.fill("#note", "<b>Agrees</b> with the rig")
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".actions .note")).to_contain_text("<b>Agrees</b> with the rig")
    page.get_by_role("button", name="Note").click()
    page.fill("#note", "Agrees with the rig")
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".actions .note")).to_contain_text("“Agrees with the rig”")
    pin = page.get_by_role("button", name="Pin")
    wanted = pin.get_attribute("aria-pressed") == "false"
    pin.click()
    expect(pin).to_have_attribute("aria-pressed", str(wanted).lower())
    assert get(f"/v1/results/{key_of(page)}/provenance")["pinned"] is wanted


def compare(browser, page):
    """Compares two results from the library. The address opens the same view in another browser."""
    exact = key_of(page)
    rule = get("/v1/jobs", get("/v1/examples/steel-ball-simplified"))["key"]
    both = get("/v1/jobs", get("/v1/examples/flat-on-rig"))["key"]
    page.goto(BASE + "/#/library")
    page.select_option("#find-shape", "truncated_paraboloid")
    expect(page.locator(f".entry input[value='{both}']")).to_be_visible()
    expect(page.locator(f".entry input[value='{exact}']")).to_have_count(0)
    page.select_option("#find-shape", "paraboloid")
    page.fill("#find-friction", "plenty")
    expect(page.locator(".error")).to_contain_text("friction")
    page.fill("#find-friction", "0.65..0.75")
    for key in (exact, rule):
        page.check(f".entry input[value='{key}']")
    page.get_by_role("link", name="Compare 2 results").click()
    page.wait_for_selector("#difference:has-text('%')")
    page.select_option("#choose-plot", "wear")
    page.locator("#output").fill("2")
    page.select_option("#choose-history", "depth")
    shown = page.locator("#difference").inner_text()
    assert exact in page.url and "at=3000" in page.url, page.url
    other = browser.page(BASE)
    other.goto(page.url)
    other.wait_for_selector("#difference:has-text('%')")
    assert other.locator("#difference").inner_text() == shown
    assert other.input_value("#choose-plot") == "wear" and other.input_value("#choose-history") == "depth"
    assert other.locator("#at").inner_text() == page.locator("#at").inner_text()
    other.context.close()
    return both, rule


def rule_errors(page, both):
    """The table shows the errors of the simplified rule from the server."""
    page.goto(f"{BASE}/#/result/{both}")
    page.wait_for_selector("#comparison")
    errors = get(f"/v1/results/{both}")["comparison"]["errors"]["wear_volume"]
    cells = page.locator("#comparison tbody tr")
    expect(cells).to_have_count(len(errors))
    close(cells.last.locator("td").first.inner_text(), 100 * errors[-1], 1e-2)


def body_warnings(browser):
    """A result has the warnings about the bodies of the job that computed it, also for a guest with a link. A job has its own."""
    scenario = {**get("/v1/examples/steel-ball-simplified")["scenario"], "friction": 0.66}
    bodies = [{**body, "yield_strength": "300 MPa"} for body in scenario["bodies"]]
    weak, strong = get("/v1/jobs", {"scenario": {**scenario, "bodies": bodies}}), get("/v1/jobs", {"scenario": scenario})
    assert weak["key"] == strong["key"] and strong["origin"] == "cached", strong
    link = get(f"/v1/results/{weak['key']}/links", method="POST")["url"].split("?")[1]
    page = browser.page(BASE)
    for words, shown in (("", True), (link, True), (f"job={weak['id']}", True), (f"job={strong['id']}", False)):
        page.goto(BASE + "/#/library")
        page.goto(f"{BASE}/#/result/{weak['key']}?{words}")
        page.wait_for_selector("canvas")
        expect(page.locator(".warning li", has_text="exceeds the yield strength of body")).to_have_count(2 if shown else 0)
    page.context.close()


def hostile_address(browser, key):
    """An address with something else instead of an id sends no request to an address that it has made."""
    page = browser.page(BASE)
    sent = []
    page.on("request", lambda request: sent.append((request.method, request.url.removeprefix(BASE))))
    page.goto(f"{BASE}/#/result/{key}?with=..%2Fjobs%2Fcancel%3Fstate%3Dqueued%23")
    page.wait_for_selector("canvas")
    expect(page.locator("#status")).to_contain_text("Run B cannot be shown")
    page.get_by_role("button", name="Share link").click()
    expect(page.locator("#status")).to_contain_text("Link copied")
    for view in (f"result/{key}?job=..%2Fresults", "result/..%2Fjobs%2Fcancel", "run/..%2Fcancel", "result/..", "run/..", "constructor"):
        page.goto(f"{BASE}/#/{view}")
        page.wait_for_selector("main:not([aria-busy])")
    posts = [path for method, path in sent if method == "POST" and path != "/v1/scenarios"]
    assert posts == [f"/v1/results/{key}/links"], posts
    known = re.compile(rf"/|/#.*|/healthz|/assets/.*|/v1/(results/{key}.*|jobs[?].*|jobs/[0-9a-f-]{{36}}[?].*|scenarios|examples|schema/scenario)")
    strange = [path for _, path in sent if not known.fullmatch(path)]
    assert not strange, strange
    page.context.close()


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
    # The estimate is shown next to the progress.
    expect(item(page, "regime")).to_have_text("Partial slip")
    expect(page.locator("section[aria-label='Scenario']")).to_contain_text("Exact method")
    page.click("#cancel")
    expect(page.locator("#state")).to_have_text("canceled")
    page.get_by_role("link", name="Edit and run again").click()
    expect(page.locator("#friction")).to_have_value("0.7")
    page.click("nav >> text=Queue")
    expect(page.locator(".state.canceled").first).to_be_visible()


def edit_typed_values(page):
    """"Edit and run again" opens what was typed: with a constant depth, 100 N stays 100 N for another radius."""
    scenario = get("/v1/examples/steel-ball-simplified")["scenario"]
    assert scenario["load"] == {"normal_force": "100 N", "held": "depth"}, scenario
    scenario["friction"] = 0.61
    # Another job has the same key but typed the depth.
    canonical = get("/v1/scenarios", {"scenario": scenario})["scenario"]
    assert "normal_force" not in canonical["load"], canonical
    page.goto(BASE + "/#/queue")
    page.goto(f"{BASE}/#/new?scenario={json.dumps(scenario)}&label=Typed force")
    page.click("button.primary")
    page.wait_for_selector("canvas")
    get("/v1/jobs", {"scenario": canonical, "label": "Typed depth"})
    page.goto(BASE + "/#/queue")
    page.get_by_role("link", name="Typed force").first.click()
    page.get_by_role("link", name="Edit and run again").click()
    expect(page.locator("#load-normal_force")).to_have_value("100 N")
    expect(page.locator("#load-held")).to_have_value("depth")
    expect(page.locator("#canonical")).to_be_hidden()
    page.fill("#profile-radius", "20 mm")
    # At a constant force, the contact radius grows with the cube root of R: 188.1 µm · 2^(1/3).
    expect(item(page, "contact-radius")).to_have_text("237\u00a0µm")
    expect(item(page, "normal-force")).to_have_text("100 N")


def library(browser, base):
    """Shows more results than one page. Previews are drawn when the user scrolls to them."""
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    scenario["model"] = {"method": "simplified", "points": 16}
    for i in range(40):
        ask(base, "/v1/jobs", {"scenario": {**scenario, "friction": 0.5 + i / 100}, "label": f"Friction {50 + i} %"})
    page = browser.page(base, width=390)
    page.goto(base + "/#/library")
    entries = page.locator(".entry")
    expect(entries).to_have_count(24)
    page.get_by_role("button", name="Show more").click()
    expect(entries).to_have_count(40)
    expect(page.get_by_role("button", name="Show more")).to_be_hidden()
    assert len(set(entries.locator("h2").all_inner_texts())) == 40
    drawn = page.locator(".thumbnail path.worn")
    assert drawn.count() < 40
    for i in range(0, 40, 3):
        entries.nth(i).scroll_into_view_if_needed()
        expect(entries.nth(i).locator("path.worn")).to_have_attribute("d", re.compile(r"^M0\.0,.*L96\.0,"))
        expect(entries.nth(i).locator(".label")).to_have_text(f"Friction {89 - i} %")
    page.context.close()


def interrupt(browser, data):
    """The server is killed during a run and restarted. The view resumes after the last event it received."""
    with server(data, "--workers", "1") as own:
        page = browser.page(own.base)
        streams = []
        page.on("request", lambda request: "/events" in request.url and streams.append(request.headers))

        def submit(scenario):
            page.goto(own.base + "/#/queue")
            page.goto(f"{own.base}/#/new?scenario={json.dumps(scenario)}&label=Interrupted run")
            page.click("button.primary")
            expect(page.locator("#state")).to_have_text("running")

        def interrupted():
            own.kill()
            expect(page.locator("#banner")).to_be_visible()
            own.start()
            expect(page.locator("#banner")).to_be_hidden()

        submit(blocks(20_000))
        # Progress after the first view comes from the event stream.
        progress = "document.querySelector('progress').value"
        page.wait_for_function(f"before => {progress} > before", arg=page.evaluate(progress))
        interrupted()
        expect(page.locator("[data-item=attempt]")).to_contain_text("2")
        assert "last-event-id" not in streams[0] and int(streams[-1]["last-event-id"]) >= 1, streams
        page.wait_for_url("**/#/result/*", timeout=240000)
        page.wait_for_selector("section[aria-label=History] canvas")

        # After three lost attempts the server gives up.
        submit(LONG)
        failed = page.url
        for attempt in (2, 3):
            interrupted()
            expect(page.locator("[data-item=attempt]")).to_contain_text(str(attempt))
            expect(page.locator("#state")).to_have_text("running")
        interrupted()
        expect(page.locator("#state")).to_have_text("failed")
        expect(page.locator(".error")).to_contain_text("crashed repeatedly")
        expect(page.get_by_role("link", name="Explanation and remedy")).to_have_attribute("href", "/problems/worker-lost")
        expect(page.get_by_role("link", name="Edit and run again")).to_be_visible()

        frictions = iter(range(300, 700))

        def long_run():
            """Submits another long run, and returns the address of its view."""
            friction = next(frictions) / 1000
            label = f"A load spectrum of a thousand blocks, µ = {friction}"
            body = {"scenario": {**LONG, "friction": friction}, "label": label, "tags": ["long"]}
            return f"/#/run/{ask(own.base, '/v1/jobs', body, wait=0)['id']}"

        def cancel():
            ask(own.base, "/v1/jobs/cancel?tag=long", method="POST")

        def running():
            cancel()
            return long_run()

        # The view waits until the time left is shown.
        browser.check_views(own.base, {
            "run-failed": (failed[len(own.base):], ".error"),
            "run-running": (running, "[data-item=left]:text-matches('[0-9]')"),
        })
        canceled = long_run()
        cancel()
        views = [long_run() for _ in range(10)]
        browser.check_views(own.base, {
            "run-queued": (views[-1], "[data-item=regime] >> visible=true"),
            "run-canceled": (canceled, "[data-item=regime] >> visible=true"),
            "queue-busy": ("/#/queue", ".state.running"),
        })
        cancel()
        for _ in range(5):
            long_run()
        from_the_queue(page, own.base)
        page.context.close()


def edit(page, base, key, submitted):
    """"Edit and run again" opens the form with the submitted scenario, each value in its field."""
    expect(page.locator(".sketch svg")).to_be_visible()
    page.get_by_role("link", name="Edit and run again").click()
    expect(item(page, "regime")).to_be_visible()
    scenario = json.loads(page.input_value("#json"))
    if submitted:
        assert scenario == submitted, (scenario, submitted)
    assert ask(base, "/v1/scenarios", {"scenario": scenario})["key"] == key
    fields = page.locator("[data-pointer]").evaluate_all("fields => fields.map(({dataset, value}) => [dataset.pointer, value])")
    assert len(fields) > 8, fields
    for pointer, shown in fields:
        value = scenario
        for name in pointer.split("/")[2:]:
            value = value[int(name)] if isinstance(value, list) else (value or {}).get(name)
        # An omitted value is an empty field. A list is separated by commas.
        read = [] if shown == "" else [number_or_text(text) for text in shown.split(", ")]
        assert read == (value if isinstance(value, list) else [] if value is None else [value]), (pointer, shown, value)


def number_or_text(text):
    try:
        return float(text)
    except ValueError:
        return {"true": True}.get(text, text)


def from_the_queue(page, base):
    """From the queue, each run in each state opens its scenario and goes back to the form."""
    def edit_run(row, state, submitted=None):
        page.goto(base + "/#/queue")
        link = row.first.get_by_role("link")
        label = link.inner_text()
        link.click()
        page.wait_for_url("**/#/run/*")
        assert "scenario" not in page.url
        expect(page.locator("#state")).to_have_text(state)
        edit(page, base, ask(base, f"/v1/jobs/{re.search('run/([^?]+)', page.url)[1]}")["key"], submitted)
        expect(page.locator("#label")).to_have_value(label)

    for state in ("running", "queued", "canceled", "failed"):
        edit_run(page.locator(f"tr:has(.state.{state})"), state)
    examples = [example["body"] for example in ask(base, "/v1/examples")]
    jobs = [ask(base, "/v1/jobs", body, wait=0) for body in examples]
    for body in examples:
        edit_run(page.locator("tr", has=page.get_by_role("link", name=body["label"], exact=True)), "queued", body["scenario"])
    ask(base, "/v1/jobs/cancel?tag=long", method="POST")
    for body, job in zip(examples, jobs):
        assert ask(base, f"/v1/jobs/{job['id']}?wait=20")["state"] == "succeeded", job
        page.goto(base + "/#/queue")
        page.get_by_role("link", name=job["label"], exact=True).click()
        page.wait_for_url("**/#/result/*")
        edit(page, base, job["key"], body["scenario"])


def share(page):
    """The link that the button copies to the clipboard."""
    page.evaluate("navigator.clipboard.writeText('')")
    page.get_by_role("button", name="Share link").click()
    return page.evaluate("""async () => {
        for (;;) {
            const text = await navigator.clipboard.readText();
            if (text) return text;
            await new Promise((done) => setTimeout(done, 50));
        }
    }""")


def sign_in(browser, data):
    with server(data, FRETWORK_ADMIN_KEY=MASTER) as own:
        browser.check_views(own.base, {"sign-in": ("/", "#key")})
        page = browser.page(own.base)
        page.goto(own.base + "/")
        page.fill("#key", "nonsense")
        page.get_by_role("button", name="Sign in").click()
        expect(page.locator("#key-reason")).to_contain_text("rejected this key")
        page.fill("#key", MASTER)
        page.get_by_role("button", name="Sign in").click()
        expect(item(page, "regime")).to_have_text("Partial slip")
        expect(page.locator("#user")).to_contain_text("admin")
        page.click("button.primary")
        page.wait_for_selector("canvas")
        link = share(page)
        # A guest without a key opens the link.
        guest = browser.page(own.base)
        guest.goto(link)
        guest.wait_for_selector("canvas")
        assert guest.locator("#readout").inner_text() == page.locator("#readout").inner_text()
        # The link of a comparison opens both results.
        key = key_of(page)
        page.goto(f"{own.base}/#/result/{key}?with={key}")
        page.wait_for_selector("#difference:has-text('%')")
        guest.goto(share(page))
        guest.wait_for_selector("#difference:has-text('0 %')")
        page.get_by_role("button", name="Sign out").click()
        expect(page.locator("#key")).to_be_visible()
        assert page.evaluate("[sessionStorage.length, Object.values(localStorage).join()]")[0] == 0
        assert MASTER not in page.content()


def lose_the_server(browser, data):
    with server(data) as own:
        pages = [(width, scheme, browser.page(own.base, scheme, width)) for width in SIZES for scheme in ("light", "dark")]
        for _, _, page in pages:
            page.goto(own.base + "/")
            expect(item(page, "regime")).to_have_text("Partial slip")
        own.kill()
        for width, scheme, page in reversed(pages):
            page.fill("#friction", "0.5")
            expect(page.locator("#banner")).to_be_visible()
            browser.check_view(page, f"lost-{width}-{scheme}")
        own.start()
        expect(page.locator("#banner")).to_be_hidden()
        # The form checks the input that was typed while the server was not running.
        expect(item(page, "regime")).to_have_text("Gross slip")
        page.click("nav >> text=Queue")
        expect(page.locator(".empty")).to_contain_text("No jobs")
        page.click("nav >> text=Library")
        expect(page.locator(".empty")).to_contain_text("No results yet")
        page.goto(f"{own.base}/#/result/{'0' * 64}")
        expect(page.locator(".error")).to_be_visible()
        browser.check_views(own.base, {"queue-empty": ("/#/queue", ".empty a"), "library-empty": ("/#/library", "li.empty"),
            "not-found": (f"/#/result/{'0' * 64}", ".error")})
        # The page of a deleted result offers to compute it again.
        done = ask(own.base, "/v1/jobs", ask(own.base, "/v1/examples/steel-ball"))
        address = f"{own.base}/#/result/{done['key']}"
        page.goto(address)
        page.wait_for_selector("canvas")
        ask(own.base, f"/v1/results/{done['key']}", method="DELETE")
        page.goto(own.base + "/#/queue")
        page.goto(address)
        page.get_by_role("link", name="Compute again").click()
        expect(page.locator("#canonical")).to_be_visible()
        expect(item(page, "cached")).to_have_text("No")
        page.click("button.primary")
        page.wait_for_selector("canvas")


def main():
    SCREENS.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as play, tempfile.TemporaryDirectory() as data:
        program = play.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        browser = Browser(program)
        directory = lambda name: str(pathlib.Path(data) / name)
        first_load(browser)
        first_plot(browser, directory("first-plot"))
        page = run_steel_ball(browser)
        key = key_of(page)
        view_result(page)
        both, rule = compare(browser, page)
        rule_errors(page, both)
        body_warnings(browser)
        hostile_address(browser, key)
        every_plot(page, BASE, key)
        every_plot(page, BASE, both, scales=["xy"])
        slide(browser, BASE)
        cancel(page)
        edit_typed_values(page)
        vary(browser, BASE)
        study = studies(browser, BASE)
        for example in get("/v1/examples"):
            every_loop(page, BASE, get("/v1/jobs", example["body"])["key"])
            # A later job without a label does not hide the label.
            get("/v1/jobs", {"scenario": example["body"]["scenario"]})
        # A new run, so that the library begins with a picture. Studies have none.
        get("/v1/jobs", {"scenario": {**example["body"]["scenario"], "friction": 0.6123}})
        page.context.close()
        labelled = "#result-label"
        browser.check_views(BASE, {"form": ("/", "[data-item=regime]"), "form-varied": (VARIED, "[data-item=seconds]"), "result": (f"/#/result/{both}?at=10000", labelled),
            "pressure": (f"/#/result/{key}?plot=pressure&history=radii&at=10000", labelled),
            "compare": (f"/#/result/{rule}?with={key}&plot=wear&at=10000", labelled),
            "study": (f"/#/result/{study}?kind=heat", "section[aria-label=Figure] img[alt]"),
            "library": ("/#/library", ".thumbnail path"), "queue": ("/#/queue", "tbody tr")})
        with server(directory("limits"), "--study-points", "50") as own:
            beyond_a_limit(browser, own.base)
        sign_in(browser, directory("keys"))
        lose_the_server(browser, directory("lost"))
        with server(directory("library")) as own:
            library(browser, own.base)
        interrupt(browser, directory("interrupted"))
        program.close()
        assert not browser.errors, browser.errors
    print("the dashboard passes its tests")


main()
