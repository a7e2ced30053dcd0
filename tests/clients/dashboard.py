"""Tests the dashboard of one server in a real browser: run, view, compare, share and cancel.

Checks the accessibility of each view with axe-core, in light and dark, wide and narrow.

    python dashboard.py http://127.0.0.1:8080

Writes screenshots of all views to target/screens.
"""

import functools
import json
import pathlib
import re
import subprocess
import sys
import tempfile

from playwright.sync_api import expect

from browser import LONG, Clock, ask, close, downloaded, item, key_of, near, opened
from comparison import comparison
from library import library
from lines import lines
from plots import every_loop, every_plot
from studies import studies
from vary import VARIED, vary
from views import views

BASE = sys.argv[1]
get = functools.partial(ask, BASE)


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
    expect(page.locator(".estimate h2")).to_have_text("1 field needs correction: Radius R")
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
    page.wait_for_selector("#headline dd")
    expect(page.locator("#result-label")).to_have_text("Ball on Monday")
    return page


def press(page, name):
    """Presses a button in the menu of a result."""
    page.locator(".actions details.menu").evaluate("menu => { menu.open = true; }")
    page.get_by_role("button", name=name).click()


def view_result(page):
    """The numbers at each output cycle are those of the server. Tests download, copy, note and pin."""
    result = get(f"/v1/results/{key_of(page)}")
    expect(page.locator("dd[data-item='/friction']")).to_have_text("0.7")
    slider = page.locator("#output")
    slider.focus()
    page.keyboard.press("Home")
    outputs = result["profiles"]["cycles"]
    for row, at in enumerate(outputs):
        expect(page.locator("#at")).to_have_text(f"N = {at:,.0f}".replace(",", "\u202f"))
        near(page.locator("[data-value=wear_depth]").inner_text(), result["history"]["wear_depth"][row], 5e-3)
        near(page.locator("[data-value=normal_force]").inner_text(), result["history"]["normal_force"][row], 5e-3)
        for name in ["wear_volume", "wear_depth"]:
            error, shown = result["history"][f"{name}_error"][row], page.locator(f"[data-error={name}]")
            if error > 0:
                expect(shown).to_have_text(re.compile("^numerical error (below )?[0-9.]+\u00a0%$"))
                expect(page.locator(f"[data-model-error={name}]")).to_have_text("errors of the theory are not included")
            else:
                expect(shown).to_have_count(0)
        if row < len(outputs) - 1:
            page.keyboard.press("ArrowRight")
    page.keyboard.press("End")

    # The same value in SI units.
    page.select_option("#units", "si")
    expect(page.locator("[data-value=wear_depth]")).to_have_text(re.compile("\u00a0m$"))
    near(page.locator("[data-value=wear_depth]").inner_text(), result["history"]["wear_depth"][-1], 5e-3)
    page.select_option("#units", "engineering")

    # The unit of a number stays while the slider moves, and the page says how long the result took.
    units = set()
    for _ in outputs:
        units.add(page.locator("[data-value=wear_volume]").inner_text().split("\u00a0")[-1])
        page.keyboard.press("ArrowLeft") if slider.evaluate("own => own === document.activeElement") else slider.press("ArrowLeft")
    slider.press("End")
    assert len(units) == 1, units
    expect(page.locator("#computed")).to_have_text(re.compile(r"Computed .*, [\d.]+\u00a0s from start to end, [\d.]+\u00a0s of processor time"))

    # A narrow pressure peak does not flatten the rest of the curve.
    page.select_option("#choose-plot", "pressure")
    expect(page.locator("section[aria-label='Profiles'] figcaption")).to_contain_text("Pressure")
    expect(page.locator("#outside")).to_contain_text("Peak outside the axis")
    page.select_option("#choose-plot", "worn")

    page.click("summary:has-text('Download')")
    for name, start in (("Profiles as CSV", b"#"), ("Full result as NumPy", b"PK"), ("Loops as Arrow", b"ARROW1")):
        assert downloaded(page, page.get_by_role("button", name=name).click).startswith(start), name
    page.get_by_role("button", name="Copy curl command").click()
    command = page.evaluate("navigator.clipboard.readText()")
    with tempfile.TemporaryDirectory() as made:
        subprocess.run(command, shell=True, cwd=made, check=True)
        assert json.loads((pathlib.Path(made) / "result.json").read_text()) == result
    page.get_by_role("button", name="Copy Python code").click()
    python = page.evaluate("navigator.clipboard.readText()")
    printed = subprocess.run([sys.executable, "-c", python], capture_output=True, text=True, check=True).stdout
    assert "100000" in printed or "1.e+05" in printed, printed
    press(page, "Note")
    page.fill("#note", "<b>Agrees</b> with the rig")
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".actions .note")).to_contain_text("<b>Agrees</b> with the rig")
    press(page, "Note")
    page.fill("#note", "Agrees with the rig")
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".actions .note")).to_contain_text("“Agrees with the rig”")
    pin = page.get_by_role("button", name="Pin")
    page.click("summary:has-text('Download')")
    wanted = pin.get_attribute("aria-pressed") == "false"
    pin.click()
    expect(pin).to_have_attribute("aria-pressed", str(wanted).lower())
    expect(pin).to_have_text("Pinned" if wanted else "Pin")
    assert get(f"/v1/results/{key_of(page)}/provenance")["pinned"] is wanted


def search(page):
    """The library finds results by shape and by ranges, and says what it does not understand."""
    exact = key_of(page)
    rule = get("/v1/jobs", get("/v1/examples/steel-ball-simplified"))["key"]
    both = get("/v1/jobs", get("/v1/examples/flat-on-rig"))["key"]
    page.goto(BASE + "/#/library")
    page.click("summary:has-text('Filters')")
    page.select_option("#find-shape", "truncated_paraboloid")
    expect(page.locator(f".entry input[value='{both}']")).to_be_visible()
    expect(page.locator(f".entry input[value='{exact}']")).to_have_count(0)
    page.select_option("#find-shape", "paraboloid")
    page.fill("#find-friction", "plenty")
    expect(page.locator(".error")).to_contain_text("friction")
    page.fill("#find-friction", "0.65..0.75")
    for key in (exact, rule):
        page.check(f".entry input[value='{key}']")
    expect(page.get_by_role("link", name="Compare 2 results")).to_have_attribute("href", f"#/compare?keys={exact},{rule}")
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
        page.wait_for_selector("#headline dd")
        expect(page.locator("#warning-normal_force", has_text="exceeds the yield strength of the")).to_have_count(1 if shown else 0)
    page.context.close()


def hostile_address(browser, key):
    """An address with something else instead of an id sends no request to an address that it has made."""
    page = browser.page(BASE)
    sent = []
    page.on("request", lambda request: sent.append((request.method, request.url.removeprefix(BASE))))
    page.goto(f"{BASE}/#/result/{key}?with=..%2Fjobs%2Fcancel%3Fstate%3Dqueued%23")
    page.wait_for_selector("#compared")
    expect(page.locator("main > .warning")).to_contain_text("cannot be shown")
    page.get_by_role("button", name="Share link").click()
    expect(page.locator("#status")).to_contain_text("Link copied")
    for view in (f"result/{key}?job=..%2Fresults", "result/..%2Fjobs%2Fcancel", "run/..%2Fcancel", "result/..", "run/..", "constructor"):
        page.goto(f"{BASE}/#/{view}")
        page.wait_for_selector("main:not([aria-busy])")
    expect(page.locator("h1")).to_have_text("Page not found")
    posts = [path for method, path in sent if method == "POST" and path not in ("/v1/scenarios", "/v1/evaluate")]
    assert posts == [f"/v1/results/{key}/links?expires_in=30d"], posts
    known = re.compile(rf"/|/#.*|/healthz|/assets/.*|/v1/(me|results/{key}.*|jobs[?].*|jobs/[0-9a-f-]{{36}}[?].*|scenarios|evaluate|examples|schema/scenario)")
    strange = [path for _, path in sent if not known.fullmatch(path)]
    assert not strange, strange
    page.context.close()


def interface(browser):
    """Swagger UI shows all routes."""
    page = browser.page(BASE)
    page.goto(BASE + "/docs/api/")
    count = sum(map(len, get("/openapi.json")["paths"].values()))
    expect(page.locator(".opblock")).to_have_count(count)
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
    page.click("nav >> text=Runs")
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
    page.wait_for_url("**/#/result/*")
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


def main():
    clock = Clock()
    with opened() as browser:
        page = run_steel_ball(browser)
        key = key_of(page)
        view_result(page)
        both, rule = search(page)
        rule_errors(page, both)
        body_warnings(browser)
        hostile_address(browser, key)
        interface(browser)
        clock.passed("a run and its page")
        every_plot(page, BASE, key)
        every_plot(page, BASE, both, scales=["xy"])
        clock.passed("plots")
        views(browser, BASE)
        clock.passed("views of a run")
        cancel(page)
        edit_typed_values(page)
        vary(browser, BASE)
        clock.passed("numbers that vary")
        pages = studies(browser, BASE)
        clock.passed("studies")
        coated = lines(browser, BASE)
        compared = comparison(browser, BASE)
        clock.passed("line contacts and comparisons")
        library(browser, BASE)
        clock.passed("library")
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
            **{name: (address, "#study tbody tr") for name, address in pages.items()},
            "compare": (f"{compared}&at=10000", "#compared"), "compare-mixed": (f"/#/compare?keys={rule},{both},{coated}", "#compared"),
            "line": (f"/#/result/{coated}?history=depths", "#events"), "library": ("/#/library", ".thumbnail path"), "queue": ("/#/queue", "tbody tr"),
            "document": ("/docs/accuracy", ".document table")})
        clock.passed("all views on all screens")
    print("the dashboard passes its tests")


main()
