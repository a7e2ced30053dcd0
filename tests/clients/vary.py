"""Tests the numbers of the form that vary: sweeps, random samples, sensitivities and maps from the form to their tables."""

import json
import re
import urllib.parse

from playwright.sync_api import expect

from browser import ask, column

RANGES = [{"pointer": "/friction", "from": 0.5, "to": 0.8, "count": 4},
    {"pointer": "/wear/coefficient", "from": "2e-5 mm^3/(N m)", "to": "4e-5 mm^3/(N m)", "count": 3, "spacing": "log"}]
# The address of the form with two numbers that vary.
VARIED = "/#/new?" + urllib.parse.urlencode({"study": json.dumps({"sweep": {"vary": RANGES, "outputs": ["wear_volume"]}})})
OUTPUTS = ["wear_volume", "wear_depth", "scar_radius", "contact_radius", "stick_radius", "dissipated_energy", "energy_per_cycle"]


def rows(page):
    return page.locator("#study tbody tr")


def submit(page):
    """Submits the study, and returns its result."""
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("#study")
    return ask(page.url.split("/#")[0], f"/v1/results/{re.search('[0-9a-f]{64}', page.url)[0]}")


def open_form(page, base):
    page.goto(base + "/#/queue")
    page.goto(base + "/#/new?example=steel-ball-simplified")
    expect(page.locator("[data-item=regime]")).to_be_visible()


def sweep(page, base):
    """Two clicks vary friction and compute nine runs. Their table has the values of the API."""
    open_form(page, base)
    toggle = page.get_by_role("button", name="Vary Friction coefficient")
    expect(toggle).to_have_attribute("aria-pressed", "false")
    toggle.click()
    expect(toggle).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#friction-from")).to_have_value("0.56")
    expect(page.locator("#friction-to")).to_have_value("0.84")
    expect(page.locator("button.primary")).to_have_text("Compute 9 runs")
    expect(page.locator("[data-item=seconds]")).to_contain_text("s")
    expect(page.locator("#label")).to_have_value("Sweep: Friction coefficient μ")
    result = submit(page)
    expect(rows(page)).to_have_count(9)
    expect(page.locator("#result-label")).to_have_text("Sweep: Friction coefficient μ")
    friction, volume = result["table"]["/friction"], result["table"]["wear_volume"]
    assert (friction[0], friction[-1], len(set(volume))) == (0.56, 0.84, 9), result["table"]
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    alone = ask(base, "/v1/evaluate", {"scenario": {**scenario, "friction": 0.84}, "outputs": ["wear_volume"]})
    assert abs(volume[-1] / alone["outputs"]["wear_volume"] - 1) < 1e-9, (volume, alone)
    assert abs(column(page, "Wear volume V")[-1] / volume[-1] - 1) < 6e-4, volume


def edit(page):
    """"Edit and run again" opens the same study. Without a number that varies, it is a run again."""
    page.get_by_role("link", name="Edit and run again").click()
    expect(page.locator("#friction-to")).to_have_value("0.84")
    expect(page.locator("[data-item=cached]")).to_have_text("Yes")
    page.fill("#friction-count", "5")
    expect(page.locator("button.primary")).to_have_text("Compute 5 runs")
    page.reload()
    expect(page.locator("#friction-count")).to_have_value("5")
    page.click("#friction-vary")
    expect(page.locator("button.primary")).to_have_text("Save")
    expect(page.locator("#friction")).to_have_value("0.7")
    expect(page.locator("section[aria-label=Study]")).to_be_hidden()
    # Only numbers vary.
    expect(page.locator("#wear-share-vary")).to_be_hidden()
    page.fill("#wear-share", "0.5")
    expect(page.locator("#wear-share-vary")).to_be_visible()
    expect(page.locator("#cycles-vary, #load-held-vary")).to_have_count(0)


def units(page, base):
    """A number without a unit has the unit beside it; another unit can be typed. A faulty end shows its own message."""
    open_form(page, base)
    page.click("#profile-radius-vary")
    page.fill("#profile-radius-from", "plenty")
    expect(page.locator("#profile-radius-from-fault")).to_contain_text("does not begin with a number")
    expect(page.locator("#profile-radius-from")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#profile-radius-to-fault")).to_have_text("")
    expect(page.locator(".estimate h2")).to_have_text("1 field needs correction: Radius R: from in mm")
    expect(page.locator("button.primary")).to_be_disabled()
    page.fill("#profile-radius-from", "5")
    page.fill("#profile-radius-count", "1")
    expect(page.locator("#profile-radius-from-fault")).to_have_text("")
    expect(page.locator("#profile-radius-count-fault")).to_contain_text("from 2 to")
    page.fill("#profile-radius-count", "3")
    page.fill("#profile-radius-to", "2 cm")
    page.select_option("#profile-radius-spacing", "log")
    # A study without outputs has nothing to compute.
    for name in ("wear_volume", "wear_depth", "wear_volume_error", "wear_depth_error"):
        page.uncheck(f"#output-{name}")
    expect(page.locator("#outputs-fault")).to_contain_text("at least one output")
    for name in OUTPUTS:
        page.check(f"#output-{name}")
    expect(page.locator("#outputs-fault")).to_have_text("")
    expect(page.locator("button.primary")).to_be_enabled()
    table = submit(page)["table"]
    assert table["/profile/radius"] == [0.005, 0.01, 0.02] and set(OUTPUTS) < set(table), table


def without_field(page, base):
    """A stored study can vary numbers that have no field. The form keeps their ranges until the user removes them."""
    scenario = ask(base, "/v1/examples/amplitude-blocks")["scenario"]
    vary = [{"pointer": "/motion/blocks/0/amplitude", "from": "1 um", "to": "3 um", "count": 2},
        {"pointer": "/friction", "from": 0.6, "to": 0.8, "count": 3},
        {"pointer": "/profile/radius", "from": "9 mm", "to": "11 mm", "count": 2}]
    profiles = {"radius": [0, "50 um"], "fields": ["wear", "slip"]}
    body = {"sweep": {"scenario": scenario, "vary": vary, "outputs": ["wear_volume"], "profiles": profiles}}
    key = ask(base, "/v1/jobs", body)["key"]
    page.goto(f"{base}/#/result/{key}")
    page.get_by_role("link", name="Edit and run again").click()
    own = page.locator("#motion-blocks-0-amplitude-from")
    expect(own).to_have_value("1")
    expect(page.locator("button.primary")).to_have_text("Compute 12 runs")
    expect(page.locator("[data-item=cached]")).to_have_text("Yes")
    expect(page.locator("section[aria-label=Study]")).to_contain_text("/motion/blocks/0/amplitude")
    # The study keeps profiles, for which the form has no fields either.
    expect(page.locator("#profiles")).to_contain_text("Wear depth, Slip amplitude")
    assert "profiles" in urllib.parse.unquote(page.url), page.url
    page.get_by_role("button", name="Remove the profiles").click()
    own.fill("1.5")
    page.reload()
    expect(own).to_have_value("1.5")
    expect(page.locator("#profiles")).to_have_count(0)
    assert "profiles" not in urllib.parse.unquote(page.url), page.url
    expect(page.locator("#profile-radius-from")).to_have_value("9")
    # A number leaves the study with its field. The others stay.
    page.select_option("#shape", "cone")
    expect(page.locator("button.primary")).to_have_text("Compute 6 runs")
    expect(own).to_have_value("1.5")
    # A number that is missing in the JSON stays too. Its range says what is wrong.
    text = json.loads(page.input_value("#json"))
    page.click("summary:has-text('as JSON')")
    page.fill("#json", json.dumps({**text, "motion": {"amplitude": "2 um"}}))
    expect(page.locator("#motion-blocks-0-amplitude-from-fault")).not_to_be_empty()
    expect(page.locator("button.primary")).to_be_disabled()
    page.get_by_role("button", name="Remove /motion/blocks/0/amplitude").click()
    expect(own).to_have_count(0)
    expect(page.locator("button.primary")).to_have_text("Compute 3 runs")
    expect(page.locator("button.primary")).to_be_enabled()


def limits(page, base):
    """The suggested range of a number stays within the limits of a scenario."""
    ball = ask(base, "/v1/examples/steel-ball")["scenario"]
    body = ball["bodies"][1]
    power = {"shape": "power", "exponent": 20, "at_radius": "0.2 mm", "height": "5 um"}
    for name, changed, expected in (
            ("motion-stick_ratio", {"motion": {"stick_ratio": 0.9999}}, ("0.7999", "0.9999")),
            ("motion-stick_ratio", {"motion": {"stick_ratio": 0}}, ("0", "0.9999")),
            ("model-tolerance", {"model": {"tolerance": 0.03}}, ("0.024", "0.03")),
            ("model-tolerance", {"model": {"tolerance": 1e-4}}, ("1e-4", "1.2e-4")),
            ("model-xi", {"model": {"method": "simplified", "xi": 1000}}, ("800", "1000")),
            ("profile-exponent", {"profile": power}, ("16", "20")),
            ("bodies-0-poisson_ratio", {"bodies": [{**body, "poisson_ratio": 0.5}, body]}, ("0.4", "0.5")),
            ("bodies-0-poisson_ratio", {"bodies": [{**body, "poisson_ratio": -0.9}, body]}, ("-0.999", "-0.72")),
            ("wear-share", {"wear": {**ball["wear"], "share": 1}}, ("0.8", "1")),
            ("friction", {"friction": 100}, ("80", "100")),
            ("profile-slope_angle", {"profile": {"shape": "cone", "slope_angle": "80 deg"}}, ("64", "89.95")),
            ("profile-radius", {}, ("8", "12"))):
        page.goto(base + "/#/queue")
        page.goto(f"{base}/#/new?{urllib.parse.urlencode({'scenario': json.dumps({**ball, **changed})})}")
        page.click(f"#{name}-vary")
        for end, value in zip(("from", "to"), expected):
            expect(page.locator(f"#{name}-{end}")).to_have_value(value)
        page.wait_for_selector(".estimate:not([aria-busy])")
        for end in ("from", "to"):
            expect(page.locator(f"#{name}-{end}-fault")).to_have_text("")


def empty(page, base):
    """A field that the user has emptied is empty after a reload too."""
    open_form(page, base)
    page.click("#profile-radius-vary")
    for field in ("from", "count"):
        page.fill(f"#profile-radius-{field}", "")
        expect(page.locator(f"#profile-radius-{field}-fault")).not_to_be_empty()
        page.reload()
        expect(page.locator(f"#profile-radius-{field}")).to_have_value("")
        expect(page.locator("#profile-radius-to")).to_have_value("12")
        expect(page.locator(".range")).to_contain_text("mm")
        expect(page.locator("button.primary")).to_be_disabled()
    page.fill("#profile-radius-to", "")
    page.reload()
    expect(page.locator("#profile-radius-to")).to_have_value("")
    page.check("#design-random")
    page.fill("#samples", "")
    expect(page.locator("#samples-fault")).not_to_be_empty()
    page.reload()
    expect(page.locator("#samples")).to_have_value("")
    expect(page.locator("#profile-radius-from")).to_have_value("")


def distributions(page, base):
    """A random sample has distributions. Their parameters follow from the range, and a faulty one shows its message."""
    open_form(page, base)
    page.click("#profile-radius-vary")
    expect(page.locator("#profile-radius-count")).to_be_visible()
    page.check("#design-random")
    expect(page.locator("#profile-radius-count")).to_have_count(0)
    # A normal distribution with the mean and the standard deviation of the uniform one between 8 and 12.
    page.select_option("#profile-radius-spacing", "normal")
    expect(page.locator("#profile-radius-spacing")).to_be_focused()
    expect(page.locator("#profile-radius-mean")).to_have_value("10")
    expect(page.locator("#profile-radius-standard_deviation")).to_have_value("1.155")
    page.fill("#profile-radius-standard_deviation", "-1")
    expect(page.locator("#profile-radius-standard_deviation-fault")).to_contain_text("greater than 0")
    expect(page.locator("#profile-radius-mean-fault")).to_have_text("")
    expect(page.locator("button.primary")).to_be_disabled()
    known = {"normal": {"mean": "10 mm", "standard_deviation": "0.5 mm"}, "triangular": {"low": "8 mm", "mode": "10 mm", "high": "12 mm"},
        "lognormal": {"median": "9.798 mm", "factor": 1.124}}
    for name, parameters in known.items():
        page.select_option("#profile-radius-spacing", name)
        if name == "normal":
            # In per cent of the mean.
            page.fill("#profile-radius-standard_deviation", "5 %")
        expect(page.locator("button.primary")).to_be_enabled()
        study = json.loads(urllib.parse.parse_qs(page.url.split("?")[1])["study"][0])["sweep"]
        assert study["vary"] == [{"pointer": "/profile/radius", "distribution": {name: parameters}}], study["vary"]
    # A sweep has the range again.
    page.check("#design-sweep")
    expect(page.locator("#profile-radius-from")).to_have_value("8")
    # A distribution with parameters that the form does not have stays what it is.
    entry = '[{"pointer": "/friction", "distribution": {"lognormal": {"mean": 0.6, "standard_deviation": 0.05}}}]'
    page.goto(base + "/#/queue")
    page.goto(f'{base}/#/new?study={{"sweep": {{"design": "latin_hypercube", "seed": 0, "vary": {entry}, "outputs": ["wear_volume"]}}}}')
    expect(page.locator("#not-shown")).to_be_visible()


def outputs(page, base):
    """Outputs at a cycle, of the unworn contact, of the limiting state, and events are chosen in words."""
    open_form(page, base)
    page.click("#friction-vary")
    page.fill("#friction-count", "3")
    for name, at in (("wear_depth", "1000"), ("unworn.stick_radius", None), ("limit.wear_volume", None), ("events.shakedown", None)):
        page.select_option("#more-output", name)
        if at:
            page.select_option("#more-at", at)
        else:
            expect(page.locator("#more-at")).to_be_hidden()
        page.click("#more-add")
    expect(page.locator("#outputs")).to_contain_text("Largest wear depth at N\u00a0=\u00a01\u202f000")
    table = submit(page)["table"]
    assert {"wear_depth@1000", "unworn.stick_radius", "limit.wear_volume", "events.shakedown"} < set(table), table
    heads = [head.split(" (")[0] for head in page.locator("#study thead th").all_inner_texts()]
    assert heads == ["Point", "Friction coefficient μ", "Wear volume V", "Largest wear depth", "Largest wear depth at N\u00a0=\u00a01\u202f000",
        "Unworn stick radius c", "Limiting wear volume V", "Wear practically stops at N"], heads


def designs(page, base):
    """The form announces as many runs as the study has, for each design."""
    open_form(page, base)
    page.click("#load-normal_force-vary")
    expect(page.locator("#design-map")).to_be_disabled()
    page.click("#motion-amplitude-vary")
    form = None
    for design, samples, announced in (("random", 16, 16), ("sensitivity", 32, 32 * 4), ("map", None, 625), ("sweep", None, 81)):
        page.check(f"#design-{design}")
        if samples:
            page.fill("#samples", "many")
            expect(page.locator("#samples-fault")).not_to_be_empty()
            page.fill("#samples", str(samples))
        expect(page.locator("button.primary")).to_have_text(f"Compute {announced} runs")
        expect(page.locator("button.primary")).to_be_enabled()
        form = page.url
        result = submit(page)
        assert result["counts"]["points"] == announced, (design, result["counts"])
        assert ("map" if design == "map" else "sensitivity" if design == "sensitivity" else "sweep") in result
        page.goto(form)
        expect(page.locator("[data-item=cached]")).to_have_text("Yes")
    # The map covers two decades around the values of the scenario.
    page.check("#design-map")
    expect(page.locator("#load-normal_force-from")).to_have_value("10")
    expect(page.locator("#load-normal_force-to")).to_have_value("1000")
    # Three numbers are no map.
    page.click("#friction-vary")
    expect(page.locator("#design-map")).to_be_disabled()
    expect(page.locator("#design-sweep")).to_be_checked()
    # The fields show the ranges of the sweep, not those of the map.
    expect(page.locator("#load-normal_force-from")).to_have_value("80")
    expect(page.locator("#load-normal_force-count")).to_have_value("9")


def vary_all(page, base):
    """One button varies all numbers of a run, which makes a sensitivity with a name of its own and says what it varies."""
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    key = ask(base, "/v1/jobs?include=result", {"scenario": {**scenario, "friction": 0.713}, "label": "Coupling P"})["key"]
    page.goto(f"{base}/#/result/{key}")
    page.get_by_role("link", name="Edit and run again").click()
    page.click("#friction-vary")
    expect(page.locator("#label")).to_have_value("Coupling P: sweep")
    page.click("#vary-all")
    expect(page.locator("#design-sensitivity")).to_be_checked()
    expect(page.locator("#label")).to_have_value("Coupling P: sensitivity")
    for field, low, high in (("load-normal_force", "80", "120"), ("wear-coefficient", "2.424e-5", "3.636e-5"), ("friction", "0.5704", "0.8556")):
        expect(page.locator(f"#{field}-from")).to_have_value(low)
        expect(page.locator(f"#{field}-to")).to_have_value(high)
    expect(page.locator("#model-xi-from")).to_have_count(0)
    page.fill("#samples", "32")
    result = submit(page)
    count = len(result["sensitivity"]["vary"])
    assert count > 5 and result["counts"]["points"] == 32 * (count + 2), result["counts"]
    expect(page.locator("#result-label")).to_have_text("Coupling P: sensitivity")
    expect(page.locator("#verdicts")).to_contain_text(f"if each of the {count} numbers varies by ±20\u00a0%")


def beyond_a_limit(browser, base):
    """The form says how many points a study has, and which limit it exceeds, before the user submits it. The server has a
    limit of 50 points."""
    page = browser.page(base)
    open_form(page, base)
    page.click("#friction-vary")
    expect(page.locator("[data-item=points]")).to_have_text("9")
    page.click("#profile-radius-vary")
    expect(page.locator("[data-item=points]")).to_have_text("81")
    expect(page.locator("#excess")).to_contain_text("has 81 points, and the limit of this server is 50")
    expect(page.locator("button.primary")).to_be_disabled()
    browser.check_accessibility(page, "study-excess")
    page.fill("#friction-count", "5")
    expect(page.locator("[data-item=points]")).to_have_text("45")
    expect(page.locator("#excess")).to_have_count(0)
    assert submit(page)["counts"]["points"] == 45
    page.context.close()


def keyboard(page, base):
    """Without a mouse: vary friction, change the range, choose an output, and compute."""
    open_form(page, base)

    def tab_to(field):
        for _ in range(60):
            page.keyboard.press("Tab")
            if page.evaluate("document.activeElement.id") == field:
                return
        raise AssertionError(f"Tab does not reach {field}")

    page.focus("#label")
    tab_to("friction-vary")
    page.keyboard.press("Space")
    expect(page.locator("#friction-vary")).to_be_focused()
    for field, text in (("friction-from", "0.4"), ("friction-to", "0.6"), ("friction-count", "6")):
        tab_to(field)
        page.keyboard.press("Control+A")
        page.keyboard.type(text)
    tab_to("design-sweep")
    page.keyboard.press("ArrowDown")
    expect(page.locator("#design-random")).to_be_focused()
    expect(page.locator("button.primary")).to_have_text("Compute 256 runs")
    page.keyboard.press("ArrowUp")
    tab_to("output-stick_radius")
    page.keyboard.press("Space")
    expect(page.locator("button.primary")).to_have_text("Compute 6 runs")
    expect(page.locator("button.primary")).to_be_enabled()
    page.keyboard.press("Control+Enter")
    page.wait_for_selector("#study")
    expect(rows(page)).to_have_count(6)
    expect(page.locator("#study thead")).to_contain_text("Stick radius c")


def vary(browser, base):
    page = browser.page(base)
    sweep(page, base)
    edit(page)
    units(page, base)
    browser.check_accessibility(page, "study")
    without_field(page, base)
    limits(page, base)
    empty(page, base)
    distributions(page, base)
    outputs(page, base)
    designs(page, base)
    vary_all(page, base)
    keyboard(page, base)
    entry = '[{"pointer": "/friction", "from": 0.5, "to": 0.6}]'
    for study in ("5", f'{{"sweep": {{"vary": {entry.replace("from", "values")}}}}}', f'{{"sweep": {{"vary": {entry}, "other": 1}}}}'):
        page.goto(base + "/#/queue")
        expect(page.locator("h1")).to_have_text("Runs")
        page.goto(f"{base}/#/new?study={study}")
        expect(page.locator("#not-shown")).to_be_visible()
    page.context.close()
