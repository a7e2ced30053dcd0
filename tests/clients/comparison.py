"""Tests the comparison of runs: from the library to the numbers, their differences, the address, CSV, share and the keyboard; and
that a run says which run it was edited from.
"""

import csv
import re

from playwright.sync_api import expect

from browser import ask, downloaded, factor, key_of, number, readout

CHANGES = [{}, {"friction": 0.6}, {"motion": {"amplitude": "2.8 um"}}, {"load": {"normal_force": "160 N", "held": "force"}},
           {"wear": {"coefficient": "2e-5 mm^3/(N m)"}}]
NAMES = ["As it is", "Less friction", "Larger amplitude", "Heavier load", "Tougher pair"]


def submit(base, change, label, **more):
    scenario = {**ask(base, "/v1/examples/steel-ball")["scenario"], "model": {"method": "exact"}, "load": {"normal_force": "120 N", "held": "force"}, **change}
    return ask(base, "/v1/jobs", {"scenario": scenario, "label": label, **more})["key"]


def cell(page, name, place):
    return page.locator(f"[data-cell='{name} {place}']")


def row_factor(page, name):
    """The factor from the unit of a row to SI units."""
    unit = page.locator("tr", has=cell(page, name, 0)).locator("th .muted").inner_text()
    return factor(unit.strip(" ()").replace("\u00a0", " "))


def shown(page, name, place):
    return number(cell(page, name, place).locator(".number").inner_text())


def letters(page):
    return [text[0] for text in page.locator("#compared thead .mark-run").all_inner_texts()]


def expected(results):
    """What the table must show after the last cycle, by the names of the rows, in SI units."""
    last = {name: [result["history"][name][-1] for result in results] for name in ("wear_volume", "wear_depth", "dissipated_energy", "scar_radius")}
    return {**last, "volume_per_energy": [volume / energy for volume, energy in zip(last["wear_volume"], last["dissipated_energy"], strict=True)],
            "peak_pressure": [result["unworn"]["peak_pressure"] for result in results]}


def check_numbers(page, results):
    """The values and the differences of the table are those of the results."""
    for name, values in expected(results).items():
        scale = row_factor(page, name)
        for place, value in enumerate(values):
            assert abs(shown(page, name, place) * scale / value - 1) < 1e-3, (name, place, value)
            if place:
                by, share = re.match(r"(\S+)(?: \((.*)\u00a0%\))?", cell(page, name, place).locator(".delta").inner_text().replace("±\u20090", "0")).groups()
                assert abs(number(by.replace("+", "")) * scale - (value - values[0])) < 2e-3 * max(map(abs, values)), (name, place, by)
                assert share is None or abs(number(share.replace("+", "")) - 100 * (value / values[0] - 1)) < 0.1 + abs(value / values[0] - 1), (name, share)


def choose(page, base, keys):
    """From the first click to the comparison."""
    page.goto(base + "/#/new")
    page.click("nav >> text=Library")
    check_all(page, keys)


def check_all(page, keys):
    """Checks results in the library, and compares all that are checked."""
    # Other tests compute many runs with other loads.
    page.click("summary:has-text('Filters')")
    page.wait_for_selector(".entry")
    page.locator(".library tbody").evaluate_all("parts => parts.forEach((part) => part.dataset.old = true)")
    page.fill("#find-normal_force", "120 N..160 N")
    # A click may hit a row only when all rows have been drawn again.
    expect(page.locator("[data-old]")).to_have_count(0)
    for key in keys:
        page.check(f".entry input[value='{key}']")
    page.get_by_role("link", name="Compare 5 results").click()
    page.wait_for_selector("#compared")


def compare(page, base, keys, results):
    choose(page, base, keys)
    assert letters(page) == list("ABCDE")
    expect(page.locator("#compared thead .name")).to_have_text(NAMES)
    expect(page.locator("#at")).to_have_text("N = 100\u202f000")
    # What differs comes first, and only that.
    first = page.locator("#compared tbody").first.locator("th[scope=row]")
    expect(first).to_have_text(["Friction coefficient μ", "Wear coefficient k_w", "Normal force F", "Amplitude U"])
    expect(cell(page, "/friction", 1)).to_have_text("0.6")
    check_numbers(page, results)
    # Which run wore most per joule: the one with less friction.
    expect(page.locator("tr", has=cell(page, "volume_per_energy", 0)).locator("td", has_text="highest")).to_have_attribute("data-cell", "volume_per_energy 1")
    expect(cell(page, "wear_volume", 2)).to_contain_text("numerical error")
    expect(page.locator("tr", has=cell(page, "wear_volume", 2)).locator("th")).to_contain_text("errors of the theory are not included")
    expect(cell(page, "regime", 0)).to_contain_text("Partial slip")
    # The equal ones are folded.
    expect(page.locator("#equal dl")).to_be_hidden()
    page.locator("#equal summary").click()
    expect(page.locator("#equal dl")).to_contain_text("10\u00a0mm")


def baseline(page, results):
    """A button makes a run the baseline. The letters, and so the colours, stay with the runs."""
    page.get_by_role("button", name="D: Heavier load. Make it the baseline").press("Enter")
    assert letters(page) == list("DABCE") and "letters=DABCE" in page.url, page.url
    expect(page.locator("#compared thead .name").first).to_be_focused()
    check_numbers(page, [results[place] for place in (3, 0, 1, 2, 4)])
    colours = "marks => marks.map((mark) => mark.className)"
    before = page.locator("#compared thead .sample").evaluate_all(colours)
    page.reload()
    page.wait_for_selector("#compared")
    assert letters(page) == list("DABCE")
    assert page.locator("#compared thead .sample").evaluate_all(colours) == before and len(set(before)) == 5, before
    page.get_by_role("button", name="A: As it is. Make it the baseline").click()
    assert letters(page) == list("ADBCE")


def curves(page):
    """Each figure has a curve of each run, in the colour of its heading. The cursors of both histories move together."""
    inks = page.locator("#compared thead .sample").evaluate_all("marks => marks.map((mark) => mark.className.match(/ink-\\d/)[0])")
    for figure in ("Profiles", "First history", "Second history", "Fretting loops"):
        drawn = page.locator(f"section[aria-label='{figure}'] .curve").evaluate_all("paths => paths.map((path) => path.getAttribute('stroke').slice(6, -1))")
        assert set(drawn) == set(inks), (figure, drawn, inks)
    history = page.locator("section[aria-label='First history']").get_by_role("slider")
    history.press("End")
    first, second = readout(page, "First history"), readout(page, "Second history")
    assert list(first) == ["A", "D", "B", "C", "E", "Cycles"] and first["Cycles"] == second["Cycles"], (first, second)
    assert first["A"].endswith("µm³") and second["A"].endswith("µm"), (first, second)
    history.press("+")
    assert "zoom-first=" in page.url, page.url
    history.press("0")
    # Another output cycle, by the keyboard.
    page.locator("#output").focus()
    page.keyboard.press("ArrowLeft")
    expect(page.locator("#at")).to_have_text("N = 30\u202f000")
    expect(page.locator("section[aria-label='Profiles'] .caption")).to_contain_text("30\u202f000")
    page.keyboard.press("End")


def table(page, keys, results):
    """The CSV has the numbers of the server in SI units."""
    head, *rows = csv.reader(downloaded(page, page.get_by_role("button", name="Table as CSV").click).decode().splitlines())
    order = [0, 3, 1, 2, 4]
    assert head[:4] == ["Quantity", "Unit", "A: As it is", "D: Heavier load"] and head[7:9] == ["D − A", "(D − A)/|A|"], head
    found = {row[0]: row for row in rows}
    volumes = [results[place]["history"]["wear_volume"][-1] for place in order]
    row = found["Wear volume"]
    assert row[1] == "m^3" and all(abs(float(text) / value - 1) < 1e-9 for text, value in zip(row[2:7], volumes, strict=True)), row
    assert abs(float(row[8]) - (volumes[1] / volumes[0] - 1)) < 1e-9 and "numerical error" in row[-1], row
    assert found["Key"][2:7] == [keys[place] for place in order] and found["Friction coefficient μ"][4] == "0.6", found
    assert len({len(row) for row in [head, *rows]}) == 1
    # A saved figure stands alone, so it names the runs beside their letters.
    page.click("[aria-label='Save comparison-first']")
    saved = downloaded(page, page.get_by_role("button", name="Save comparison-first as SVG").click).decode()
    assert "A: As it is" in saved and "D: Heavier load" in saved and "E: Tougher pair" in saved, saved


def remove(page, base, keys):
    """Runs can be removed, and the library adds others."""
    page.get_by_role("button", name="Remove E: Tougher pair").click()
    assert letters(page) == list("ADBC")
    expect(page.locator("h1")).to_have_text("Comparison of 4 runs")
    page.get_by_role("link", name="Add a run…").click()
    check_all(page, keys[4:])
    expect(page.locator("h1")).to_have_text("Comparison of 5 runs")


def share(browser, page, base, keys):
    """The link opens the same view for a guest. The links are in the order of the keys."""
    page.goto(f"{base}/#/compare?keys={','.join(keys)}&letters=DABCE&plot=wear")
    page.wait_for_selector("#compared")
    page.get_by_role("button", name="Share link").click()
    expect(page.locator("#status")).to_contain_text("Link copied")
    link = page.evaluate("navigator.clipboard.readText()")
    guest = browser.page(base)
    sent = []
    guest.on("request", lambda request: sent.append(request.url))
    guest.goto(link)
    guest.wait_for_selector("#compared")
    assert guest.locator("#compared").inner_text() == page.locator("#compared").inner_text()
    assert guest.input_value("#choose-plot") == "wear" and letters(guest) == list("DABCE")
    expect(guest.get_by_role("button", name="Share link")).to_have_count(0)
    assert sum("/v1/results/" in url and "link=" in url and "/smooth" not in url for url in sent) == 5 and not any("/v1/jobs" in url for url in sent), sent
    # Another baseline keeps each link with its key.
    guest.get_by_role("button", name="A: Less friction. Make it the baseline").click()
    guest.reload()
    guest.wait_for_selector("#compared")
    assert letters(guest) == list("ADBCE")
    guest.context.close()


def limits(page, base, keys):
    """More runs than letters, results that are missing, and runs without common output cycles."""
    many = [submit(base, {"friction": 0.5 + place / 100}, f"Many {place}") for place in range(9)]
    page.goto(f"{base}/#/compare?keys={','.join(many)}")
    page.wait_for_selector("#compared")
    assert letters(page) == list("ABCDEFGH")
    expect(page.locator("main > .warning")).to_contain_text("compares at most 8")
    lines = page.locator("#compared thead .sample").evaluate_all("marks => marks.map((mark) => mark.className)")
    assert len({re.search(r"ink-\d", line)[0] for line in lines}) == len({line.split()[2:][0] if line.split()[2:] else "" for line in lines}) == 8, lines
    other = submit(base, {"cycles": [500, 2000]}, "Others")
    page.goto(f"{base}/#/compare?keys={keys[0]},{'0' * 64},{other},..%2Fjobs,{keys[0]}")
    page.wait_for_selector("#compared")
    expect(page.locator("main > .warning")).to_have_count(2)
    assert letters(page) == ["A", "C"]
    # Without a common cycle, each run is shown at its end, and the table says where this is.
    expect(page.locator("#at")).to_have_text("End of each run")
    expect(cell(page, "cycles", 1).locator(".number")).to_have_text("2\u202f000")
    # ξ follows from the other inputs, so that it is an output.
    rules = [submit(base, {"model": {"method": "simplified"}, "friction": friction}, f"Rule {friction}") for friction in (0.6, 0.8)]
    page.goto(f"{base}/#/compare?keys={','.join(rules)}")
    expect(page.locator("#compared tbody").first.locator("th[scope=row]")).to_have_text(["Friction coefficient μ"])
    expect(page.locator("#compared tbody").last).to_contain_text("ξ")
    page.goto(f"{base}/#/compare?keys={'0' * 64}")
    expect(page.get_by_role("link", name="library", exact=True)).to_be_visible()


def named(browser, base):
    """Curves are named by what differs. Before the points of smooth lines have come, no straight line joins the outputs."""
    keys = [submit(base, {"load": {"normal_force": f"{force} N", "held": "force"}}, f"Force {force}") for force in (140, 150)]
    page = browser.page(base)
    waiting = []
    page.route("**/history/smooth*", lambda route: waiting.append(route))
    page.goto(f"{base}/#/compare?keys={','.join(keys)}")
    first = page.locator("section[aria-label='First history']")
    expect(first.locator(".curve")).to_have_count(2)
    expect(first.locator(".curve[stroke-width='0']")).to_have_count(2)
    expect(first.locator(".drawing")).to_contain_text("A: 140\u00a0N")
    for route in waiting:
        route.continue_()
    expect(first.locator(".curve[stroke-width='2']")).to_have_count(2)
    # In the units of each unworn contact.
    page.select_option("#choose-scale", "ratio")
    page.click("[aria-label='Save comparison-profile']")
    head, *rows = csv.reader(downloaded(page, page.get_by_role("button", name="Save comparison-profile as CSV").click).decode().splitlines())
    own = ask(base, f"/v1/results/{keys[1]}")
    radius, scales = own["profiles"]["radius"], own["scales"]
    assert head == ["Radius (1)", "A: 140 N (1)", "Radius (1)", "B: 150 N (1)"], head
    assert abs(float(rows[-1][2]) - radius[-1] / scales["contact_radius"]) < 1e-9, rows[-1]
    assert abs(float(rows[-1][3]) - own["profiles"]["worn"][-1][-1] / scales["indentation_depth"]) < 1e-9, rows[-1]
    page.click("[aria-label='Save comparison-first']")
    saved = downloaded(page, page.get_by_role("button", name="Save comparison-first as SVG").click).decode()
    assert ">140\u00a0N<" in saved and ">150\u00a0N<" in saved and "Force 140" not in saved, saved
    # A result whose points come late is drawn without lines, and again with them.
    waiting.clear()
    page.add_init_script("AbortSignal.timeout = () => { const at_once = new AbortController(); setTimeout(() => at_once.abort()); return at_once.signal; }")
    page.goto(f"{base}/#/result/{keys[0]}")
    page.reload()
    lines = page.locator("section[aria-label='History'] .curve")
    expect(lines.first).to_have_attribute("stroke-width", "0")
    for route in waiting:
        route.continue_()
    expect(lines.first).to_have_attribute("stroke-width", "2")
    page.context.close()


def derived(page, base, key):
    """A run that was edited says from which run, what differs, and leads to the comparison of both."""
    page.goto(f"{base}/#/result/{key}")
    page.wait_for_selector("#headline dd")
    page.get_by_role("link", name="Edit and run again").click()
    page.fill("#friction", "0.57")
    # A result does not contain the yield strengths, and nothing of it follows from them.
    page.fill("#bodies-0-yield_strength", "3 GPa")
    page.fill("#label", "Edited")
    expect(page.locator("button.primary")).to_be_enabled()
    page.reload()
    expect(page.locator("#friction")).to_have_value("0.57")
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    expect(page.locator("#derived")).to_have_text("Derived from As it is: Friction coefficient μ 0.7 → 0.57; Body 1: yield strength – → 3\u00a0GPa. Compare both")
    own = key_of(page)
    assert ask(base, f"/v1/jobs?tag=from:{key}")["jobs"][0]["key"] == own
    # Also without the id of the job.
    page.goto(f"{base}/#/queue")
    page.goto(f"{base}/#/result/{own}")
    page.locator("#derived").get_by_role("link", name="Compare both").click()
    expect(page.locator("#compared thead .name")).to_have_text(["As it is", "Edited"])
    expect(page.locator("#compared tbody").first.locator("th[scope=row]")).to_have_text(["Friction coefficient μ", "Body 1: yield strength"])
    # The address of earlier versions leads here.
    page.goto(f"{base}/#/result/{key}?with={own}")
    page.wait_for_url("**/#/compare?*")
    expect(page.locator("#compared thead .name")).to_have_text(["As it is", "Edited"])
    # An example has no source.
    page.goto(f"{base}/#/new?from={key}")
    page.select_option("#example", "steel-ball-simplified")
    expect(page.locator("#friction")).to_be_visible()
    assert "from=" not in page.url and "scenario=" in page.url, page.url


def comparison(browser, base):
    keys = [submit(base, change, name) for change, name in zip(CHANGES, NAMES, strict=True)]
    results = [ask(base, f"/v1/results/{key}") for key in keys]
    page = browser.page(base)
    compare(page, base, keys, results)
    baseline(page, results)
    curves(page)
    table(page, keys, results)
    remove(page, base, keys)
    share(browser, page, base, keys)
    limits(page, base, keys)
    named(browser, base)
    derived(page, base, keys[0])
    page.context.close()
    return f"/#/compare?keys={','.join(keys)}"
