"""Tests the page as a user with a compliant rig sees it: each threshold says at which place it holds, and is the number of the API
and of the command line. From the first click to the number.

    python rig.py /path/to/fretwork http://127.0.0.1:8080 [--long]

With --long, it tries 40 random contacts, else 6.
"""

import functools
import json
import random
import re
import subprocess
import sys
import urllib.request

from playwright.sync_api import expect

from browser import ask, item, key_of, near, opened

PROGRAM, BASE = sys.argv[1:3]
get = functools.partial(ask, BASE)
DEPTH = "#headline [data-value=wear_depth]"
PLACES = {"contact": "gross_slip_amplitude", "actuator": "actuator_gross_slip_amplitude"}
FIRST = get("/v1/examples")[0]["body"]["scenario"]
RIG = "20 N/um"
# A number such as 6.508 µm.
LENGTH = r"[\d.]+\s[nµm]?m"


def form(browser, amplitude, width=1280):
    """The first example behind a rig, typed into the form, and its scenario."""
    page = browser.page(BASE, width=width)
    page.goto(BASE + "/")
    page.wait_for_selector(DEPTH)
    label = page.locator("label[for=motion-amplitude]")
    expect(label).to_have_text("Amplitude U (half the stroke)")
    page.fill("#motion-amplitude", amplitude)
    page.fill("#motion-rig_stiffness", RIG)
    expect(label).to_have_text("Amplitude at the actuator U (half the stroke)")
    settled(page)
    scenario = json.loads(page.input_value("#json"))
    assert scenario == {**FIRST, "motion": {"amplitude": f"{amplitude} um", "rig_stiffness": RIG}}, scenario
    return page, scenario


def settled(page):
    expect(page.locator(".estimate")).not_to_have_attribute("aria-busy", "true")
    expect(page.locator("#computing")).to_have_text("")


def computed(scenario):
    """The result of the command line."""
    done = subprocess.run([PROGRAM, "run", "-"], input=json.dumps(scenario), capture_output=True, text=True, check=True)
    result = json.loads(done.stdout)
    assert re.search(f"Regime of the unworn contact +{result['regime']}\n", done.stderr), done.stderr
    assert f"Amplitude at the {'reference' if 'length' in scenario['profile'] else 'contact'}" in done.stderr, done.stderr
    return result


def lengths(place):
    """The lengths of a text, in order."""
    return re.findall(LENGTH, place.inner_text())


def agree(shown, expected, tolerance):
    assert len(shown) == len(expected), (shown, expected)
    for own, number in zip(shown, expected):
        near(own, number, tolerance)


def headline(page, result):
    """The numbers at the last cycle: the thresholds of the actuator beside the regime, those of the contact below."""
    history, unworn = result["history"], result["unworn"]
    regime = "Partial slip" if history["stick_radius"][-1] > 0 else "Gross slip"
    expect(page.locator("#headline [data-value=regime]")).to_have_text(regime)
    beside = page.locator("#headline > :last-child .errors")
    expect(beside).to_contain_text("Gross-slip threshold at the actuator")
    assert ("unworn gross slip" in beside.inner_text()) == (regime == "Partial slip" and result["regime"] == "gross_slip")
    # The form and the job have other output cycles, so the last digits differ.
    agree(lengths(beside), [unworn[PLACES["actuator"]], history[PLACES["actuator"]][-1]], 0.01)
    for name in (PLACES["contact"], "amplitude"):
        place = page.locator(f"[data-value={name}]")
        expect(page.locator("div", has=place).last.locator("dt")).to_contain_text("at the contact")
        near(place.text_content(), history[name][-1], 0.01)


def run(browser, amplitude):
    """Estimate, headline, title, details, library and report of one run."""
    page, scenario = form(browser, amplitude)
    result = computed(scenario)
    unworn = result["unworn"]
    thresholds = [unworn[PLACES[place]] for place in ("actuator", "contact")]
    # At the thresholds, the force is that of friction: the actuator moves by its share of the rig more.
    assert abs(thresholds[0] - thresholds[1] - 0.7 * 100 / 20e6) < 1e-11, thresholds
    typed = float(amplitude) * 1e-6
    assert result["regime"] == ("gross_slip" if typed > thresholds[0] else "partial_slip")
    expect(item(page, "regime")).to_have_text(result["regime"].replace("_", " ").capitalize())
    estimate = page.locator(".estimate dd", has_text="at the actuator")
    expect(estimate).to_have_text(re.compile(f"^{LENGTH} at the actuator, {LENGTH} at the contact$"))
    agree(lengths(estimate), thresholds, 1e-3)
    headline(page, result)
    browser.check_view(page, f"rig-form-{amplitude}")
    page.click("button.primary:enabled")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector(DEPTH)
    headline(page, result)
    title = f"U at the actuator = {amplitude}\u00a0µm".replace(" = ", "\u00a0=\u00a0")
    expect(page.locator("h1")).to_contain_text(title)
    for place, name in PLACES.items():
        own = page.locator("dt", has_text=f"Gross-slip threshold at the {place}").locator("xpath=following-sibling::dd[1]").last
        near(own.inner_text(), unworn[name], 1e-3)
    key = key_of(page)
    stored = get(f"/v1/results/{key}")
    assert [stored["unworn"][name] for name in PLACES.values()] == [unworn[name] for name in PLACES.values()]
    assert [stored["history"][name] for name in PLACES.values()] == [result["history"][name] for name in PLACES.values()]
    page.goto(f"{BASE}/#/library?columns=name,regime,amplitude,gross_slip_amplitude")
    row = page.locator("tr", has=page.locator(f"a[href$='{key}']"))
    expect(row).to_contain_text(title)
    heads = page.locator("thead")
    for head in ("Regime, unworn", "Amplitude at the contact or reference, unworn", "Gross-slip threshold at the contact or reference, unworn"):
        expect(heads).to_contain_text(head)
    agree(lengths(row)[-2:], [unworn["amplitude"], unworn[PLACES["contact"]]], 1e-3)
    with urllib.request.urlopen(f"{BASE}/v1/results/{key}/plot.svg") as answer:
        assert f"in {result['regime'].replace('_', ' ')} when unworn" in answer.read().decode()
    page.goto(f"{BASE}/v1/results/{key}/report")
    headline(page, result)
    expect(page.locator("h1")).to_contain_text(title)
    for place, name in PLACES.items():
        own = page.locator("dt", has_text=f"Gross-slip threshold at the {place}").locator("xpath=following-sibling::dd[1]").last
        near(own.inner_text(), unworn[name], 1e-3)
    page.context.close()
    return key


def line(browser):
    """The amplitude of a line contact is at its reference."""
    # No other test gives this run a label.
    scenario = {**get("/v1/examples/cylinder-on-flat")["scenario"], "friction": 0.85}
    page = browser.page(BASE)
    page.goto(f"{BASE}/#/new?scenario={json.dumps(scenario)}")
    expect(page.locator("label[for=motion-amplitude]")).to_have_text("Amplitude at the reference U (half the stroke)")
    key = get("/v1/jobs", {"scenario": scenario})["key"]
    for address in (f"#/result/{key}", "#/library"):
        page.goto(f"{BASE}/{address}")
        expect(page.locator("h1, th").filter(has_text="U\u00a0at the reference\u00a0=\u00a025\u00a0µm").first).to_be_visible()
    page.goto(f"{BASE}/#/result/{key}")
    expect(page.locator("section[aria-label='Fretting loop']")).to_contain_text("Displacement at the reference")
    page.goto(f"{BASE}/v1/results/{key}/report")
    expect(page.locator("h1")).to_contain_text("U\u00a0at the reference\u00a0=\u00a025\u00a0µm")
    page.context.close()


def comparison(browser, keys):
    """The thresholds of both places at the chosen output cycle."""
    page = browser.page(BASE)
    page.goto(f"{BASE}/#/compare?keys={','.join(keys)}")
    for place, name in PLACES.items():
        row = page.locator("#compared tr", has_text=f"Gross-slip threshold at the {place}")
        last = [get(f"/v1/results/{key}/history")["history"][name][-1] * 1e6 for key in keys]
        expect(row).to_contain_text("(µm)")
        for cell, expected in zip(row.locator("td .number").all(), last, strict=True):
            assert abs(float(cell.inner_text()) / expected - 1) < 1e-3, (name, expected)
    page.context.close()


def fretting_map(browser):
    """A map behind a rig, and at its contact: the axis says the place, and the boundaries are the thresholds of the runs."""
    page, scenario = form(browser, "6.52")
    page.click("#load-normal_force-vary")
    page.click("#motion-amplitude-vary")
    page.check("#design-map")
    for field, text in {"load-normal_force-from": "60", "load-normal_force-to": "120", "load-normal_force-count": "2",
            "motion-amplitude-from": "3", "motion-amplitude-to": "9", "motion-amplitude-count": "60"}.items():
        page.fill(f"#{field}", text)
    expect(page.locator("label[for=motion-amplitude-from]")).to_have_text("Amplitude at the actuator U (half the stroke)")
    page.select_option("#amplitudes-at", "contact")
    expect(page.locator("label[for=motion-amplitude-from]")).to_have_text("Amplitude U (half the stroke)")
    checked = get("/v1/scenarios", {"scenario": scenario})["unworn"]
    motion = json.loads(page.input_value("#json"))["motion"]
    assert motion == {"amplitude": checked["amplitude"]}, motion
    page.reload()
    expect(page.locator("#amplitudes-at")).to_have_value("contact")
    page.select_option("#amplitudes-at", "actuator")
    expect(page.locator("#json")).to_have_value(re.compile("rig_stiffness"))
    assert json.loads(page.input_value("#json")) == scenario
    maps = {"actuator": finished(page)}
    page.go_back()
    page.wait_for_selector("#amplitudes-at")
    page.select_option("#amplitudes-at", "contact")
    expect(page.locator("#json")).not_to_have_value(re.compile("rig_stiffness"))
    page.fill("#motion-amplitude-from", "1.5")
    page.fill("#motion-amplitude-to", "4.5")
    maps["contact"] = finished(page)
    for place, key in maps.items():
        study = get(f"/v1/results/{key}?rows=1000")
        boundary = study["boundary"]
        for row, force in enumerate(boundary["/load/normal_force"]):
            own = {**scenario, "load": {**scenario["load"], "normal_force": force}}
            if place == "contact":
                own["motion"] = {"amplitude": 3e-6}
            unworn = get("/v1/scenarios", {"scenario": own})["unworn"]
            assert boundary["/motion/amplitude"][row] == unworn[PLACES[place]], (place, force)
            # The boundary after the runs lies between two amplitudes of the map.
            step = 3 ** (1 / 59)
            regimes = []
            for share in (1 / step, step):
                own["motion"]["amplitude"] = boundary["after_run"][row] * share
                regimes.append(get("/v1/evaluate", {"scenario": own, "outputs": ["stick_radius"]})["outputs"]["stick_radius"] > 0)
            assert regimes == [True, False], (place, force, boundary, regimes)
        page.goto(f"{BASE}/#/result/{key}?kind=regimes")
        figure = page.locator("section[aria-label=Figure]")
        expect(page.locator("#study thead")).to_contain_text("Regime, unworn")
        expect(page.locator("section[aria-label=Table]")).to_contain_text("Outputs are those after the last cycle if their heading says no other time.")
        expect(page.locator("main")).to_contain_text("Thin: the boundary after the last cycle, within one amplitude step.")
        title = "Amplitude at the actuator U" if place == "actuator" else "Amplitude U"
        expect(figure.locator(".later")).to_be_attached()
        for text in (f"{title} (µm)", "Unworn", "After the last cycle"):
            expect(figure.locator("svg text", has_text=re.compile(f"^{re.escape(text)}$")).first).to_be_visible()
        browser.check_view(page, f"rig-map-{place}")
        with urllib.request.urlopen(f"{BASE}/v1/results/{key}/plot.svg?kind=regimes") as answer:
            drawn = re.sub("<[^>]*>", "", answer.read().decode())
        assert ("Amplitude at the actuator (µm)" in drawn) == (place == "actuator"), drawn
        assert "Thin: the boundary after the last cycle, within one amplitude step." in drawn, drawn
    page.context.close()


def random_contact(number):
    """A contact behind a rig: every shape, held at constant force or depth, by both methods."""
    draw = random.Random(number)
    between = lambda low, high: low * (high / low) ** draw.random()
    radius, angle, length = between(2e-3, 0.1), between(0.005, 0.05), "10 mm"
    profile = [{"shape": "paraboloid", "radius": radius}, {"shape": "cone", "slope_angle": angle},
        {"shape": "truncated_paraboloid", "radius": radius, "flat_radius": between(1e-4, 3e-4)},
        {"shape": "cylinder", "radius": radius, "length": length}, {"shape": "wedge", "slope_angle": angle, "length": length}][number % 5]
    is_line = "length" in profile
    motion = {"rig_stiffness": between(1e6, 1e9)} | ({"reference_distance": "60 mm"} if is_line else {})
    return {"profile": profile, "moduli": {"normal": "113 GPa"} | ({} if is_line else {"tangential": "93 GPa"}), "friction": between(0.2, 1),
        "wear": {"coefficient": "3e-5 mm^3/(N m)"}, "load": {"normal_force": between(20, 2000), "held": "force" if is_line else draw.choice(["force", "depth"])},
        "motion": motion, "cycles": {"normalized": [between(0.5, 3)]}, "model": {"method": "exact" if is_line else draw.choice(["exact", "simplified"]), "points": 16}}


def after_run(scenario, unworn):
    """The amplitude of the actuator at which the contact slips as a whole after the run, by trying amplitudes."""
    def excess(amplitude):
        return amplitude - get("/v1/evaluate", {"scenario": moved(scenario, amplitude), "outputs": [PLACES["actuator"]]})["outputs"][PLACES["actuator"]]

    low = high = unworn
    while excess(low) >= 0:
        low *= 0.9
    while excess(high) < 0:
        high *= 1.1
    while high / low > 1.0002:
        middle = (low + high) / 2
        low, high = (low, middle) if excess(middle) >= 0 else (middle, high)
    return (low + high) / 2


def moved(scenario, amplitude):
    return {**scenario, "motion": {**scenario["motion"], "amplitude": amplitude}}


def any_contact(page, scenario):
    """Page, API, command line and map state thresholds that separate partial from gross slip, unworn and after the run."""
    name = PLACES["actuator"]
    limit = get("/v1/scenarios", {"scenario": moved(scenario, 1e-6)})["unworn"][name]
    worn = after_run(scenario, limit)
    study = {"scenario": moved(scenario, 1e-6), "normal_force": {"from": scenario["load"]["normal_force"], "to": 1.2 * scenario["load"]["normal_force"], "count": 2},
        "amplitude": {"from": 0.97 * worn, "to": 1.03 * worn, "count": 9}, "outputs": ["stick_radius"]}
    boundary = get(get("/v1/jobs", {"map": study})["links"]["result"])["boundary"]
    assert boundary["/motion/amplitude"][0] == limit, (scenario, boundary, limit)
    assert abs(boundary["after_run"][0] / worn - 1) < 1e-3, (scenario, boundary, worn)
    for share, regime in ((0.999, "partial_slip"), (1.001, "gross_slip")):
        own = moved(scenario, share * limit)
        checked, result = get("/v1/scenarios", {"scenario": own}), computed(own)
        assert (checked["regime"], result["regime"], result["unworn"][name]) == (regime, regime, limit), (own, checked["regime"], result["regime"])
        last = computed(moved(scenario, share * worn))["history"]
        assert (last["stick_radius"][-1] == 0) == (regime == "gross_slip"), (scenario, worn, share)
        assert (share * worn >= last[name][-1]) == (regime == "gross_slip"), (scenario, worn, share)
        page.goto("about:blank")
        page.goto(f"{BASE}/#/new?scenario={json.dumps(own)}")
        expect(item(page, "regime")).to_have_text(regime.replace("_", " ").capitalize())
        agree(lengths(page.locator(".estimate dd", has_text="at the actuator")), [limit, result["unworn"][PLACES["contact"]]], 1e-3)
        settled(page)
        agree(lengths(page.locator("#headline [data-value=threshold]")), [result["history"][name][-1]], 0.01)


def finished(page):
    """Computes the study of the form, and returns its key."""
    page.click("button.primary:enabled")
    page.wait_for_url("**/#/result/*")
    return key_of(page)


def main():
    with opened() as browser:
        keys = [run(browser, amplitude) for amplitude in ("3.2", "6.52", "6.6")]
        comparison(browser, keys)
        line(browser)
        fretting_map(browser)
        page = browser.page(BASE)
        for number in range(40 if "--long" in sys.argv else 6):
            any_contact(page, random_contact(number))
    print("the page says at which place a threshold holds")


main()
