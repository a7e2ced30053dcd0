"""Checks reports in a browser: those of all examples, of five runs and of a sample, opened from disk and from the server. They draw
their figures, can be read and zoomed, ask no server, and have the numbers as HTML without scripts. A label of markup injects nothing,
and a served report cannot use the session. In Chromium, each is printed on one or two pages of A4 and of Letter, and axe-core finds
no violation in light and dark. Firefox opens five from disk, with --long all.

    python reports.py target/debug/fretwork http://127.0.0.1:8080 [--long]

Writes the pages to target/screens.
"""

import json
import pathlib
import re
import subprocess
import sys
import urllib.request

from playwright.sync_api import expect

from browser import FIREFOX, LOOKS, ROOT, SCREENS, ask, downloaded, opened, readout

PROGRAM, BASE, *options = sys.argv[1:]
IS_LONG = "--long" in options
# Reports that are also opened from the server, and the only ones that Firefox opens from disk without --long.
SERVED = ("steel-ball", "five", "sample", "map", "fit")
SHEETS = ["A4", "Letter"]
RUNS = sorted((ROOT / "examples").glob("*.json"))
STUDIES = sorted((ROOT / "examples/studies").glob("*.json"))
CHANGES = [{}, {"friction": 0.6}, {"motion": {"amplitude": "2.8 um"}}, {"load": {"normal_force": "160 N", "held": "force"}},
           {"wear": {"coefficient": "2e-5 mm^3/(N m)"}}]
# Largest file without the documents, in bytes.
SIZE = 1_500_000
# It would be elements, the end of a script or of the style, or an attribute.
HOSTILE = "\"'><script>injected = 1</script><img src=x onerror='injected = 1'></script></style><!-- ]]> &lt;b>\\"
# In the frame of each kind of report, a figure that has been drawn.
FIGURES = {"compare": "[aria-label='First history']", "study": "[aria-label=Figure]", "fit": ".plots section", "run": "[aria-label=History]"}


def read(path):
    return json.loads(pathlib.Path(path).read_text())


def key_of(body):
    job = ask(BASE, "/v1/jobs", body)
    assert job["state"] == "succeeded", job
    return job["key"]


def made():
    """The name, the kind and the address of each report. All labels are hostile."""
    scenario = read(ROOT / "examples/steel-ball.json")["scenario"]
    found = {file.stem: ("run", key_of({**read(file), "label": HOSTILE})) for file in RUNS}
    found |= {file.stem: ("fit" if file.stem == "fit" else "study", key_of({**read(file), "label": HOSTILE})) for file in STUDIES}
    sweep = read(ROOT / "examples/studies/sweep.json")["sweep"]
    sample = {**sweep, "vary": [{"pointer": "/friction", "distribution": {"normal": {"mean": 0.7, "standard_deviation": 0.03}}},
                                {"pointer": "/motion/amplitude", "from": "1 um", "to": "3 um"}], "design": "sobol", "samples": 256}
    found["sample"] = ("study", key_of({"sweep": sample, "label": HOSTILE}))
    first, *others = [key_of({"label": HOSTILE, "scenario": {**scenario, "model": {"method": "exact"}, **change}}) for change in CHANGES]
    found["five"] = ("compare", first + "/report?" + "&".join(f"with={key}" for key in others))
    return {name: (kind, f"/v1/results/{key}" + ("" if "?" in key else "/report")) for name, (kind, key) in found.items()}


def saved(name, path):
    """The report as a file, and its content. Its size is bounded."""
    with urllib.request.urlopen(BASE + path) as answer:
        text = answer.read().decode()
    shell, data = text.split('<script id="data" type="application/json">')
    assert len(shell.encode()) < SIZE, (name, len(shell.encode()))
    file = SCREENS / f"report-{name}.html"
    file.write_text(text)
    return file, json.loads(data.split("</script>")[0])


def drawn(page, kind):
    """Waits until the views have drawn the report: a figure with curves, bars or dots."""
    figure = page.locator(f"#main {FIGURES[kind]} figure:visible").first
    expect(figure.locator("svg path").first).to_be_attached()
    expect(page.locator("#units")).to_be_visible()
    expect(page.locator("#main #origin")).to_be_attached()
    return figure


def check_text(page):
    """Nothing of the label has become an element, and it can be read."""
    assert page.evaluate("typeof injected") == "undefined"
    assert page.locator("img").count() == 0 and page.locator("script").count() == 3
    assert HOSTILE in page.locator("#main").inner_text() or page.locator("#compared").count()


def check_use(page, kind, figure):
    """The report is read with the pointer, zoomed and saved, and has both systems of units."""
    canvas = figure.locator(".canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    # There is nothing to read between two bars.
    for share in (0.5, 0.4, 0.3):
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + share * box["height"])
        if figure.locator(".values .name").count():
            break
    expect(figure.locator(".values .name").first).to_be_visible()
    if figure.locator(".zoom").count():
        figure.locator(".zoom button").first.click()
        expect(figure.get_by_role("button", name="Reset")).to_be_enabled()
    figure.locator("summary", has_text="Save").click()
    assert b"<svg" in downloaded(page, figure.get_by_role("button", name="as SVG").click)
    before = page.locator("#main").inner_text()
    page.select_option("#units", "si")
    expect(page.locator("#main")).not_to_have_text(before)
    assert page.locator("a[href^='/docs/']:visible").count() == 0


def check_sandbox(page):
    """A served report has an origin of its own, and reaches nothing."""
    tried = page.evaluate("""async () => {
        const told = async (act) => { try { await act(); return "done"; } catch (error) { return error.name; } };
        return [origin, await told(() => document.cookie), await told(() => localStorage.length), await told(() => fetch("/v1/me")),
            await told(() => import("/assets/page/dom.js"))];
    }""")
    assert tried == ["null", "SecurityError", "SecurityError", "TypeError", "TypeError"], tried


def check_plain(browser, file, content):
    """Without scripts, the report has inputs and numbers as HTML."""
    context = browser.program("light").new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(file.as_uri())
    rows = page.locator("#main tr")
    for heading in ("Shape", "Key"):
        expect(rows.filter(has=page.get_by_role("rowheader", name=heading, exact=True)).first).to_be_visible()
    assert page.locator("#main section").nth(1).locator("tr").count() > 2
    assert page.locator("#main h1").inner_text() in (HOSTILE, "Comparison of runs")
    assert page.locator("img").count() == 0 and content["key"] in page.locator("#origin").inner_text()
    context.close()


def print_pages(page, name):
    """The number of pages of the report on each sheet."""
    counts = []
    for sheet in SHEETS:
        pdf = page.pdf(format=sheet, print_background=True)
        (SCREENS / f"report-{name}-{sheet}.pdf").write_bytes(pdf)
        counts.append(len(re.findall(rb"/Type\s*/Page\b", pdf)))
    return counts


def check_measured(browser, key):
    """The command compares a run with measured numbers: 5 % more than computed."""
    result, numbers, page_file = [SCREENS / f"measured.{end}" for end in ("json", "csv", "html")]
    run = ask(BASE, f"/v1/results/{key}")
    result.write_text(json.dumps(run))
    history = run["history"]
    rows = [f"{at},{1.05 * volume:e}" for at, volume in list(zip(history["cycles"], history["wear_volume"], strict=True))[1::4]]
    numbers.write_text("\n".join(["cycles,wear_volume [m^3]", *rows]))
    subprocess.run([PROGRAM, "report", result, "--measured", numbers, "-o", page_file], check=True)
    page = browser.page(page_file.as_uri())
    page.goto(page_file.as_uri())
    expect(page.locator(".measured-sets .verdict")).to_contain_text("On average the measured values are 5\u00a0% above the computed ones.")
    page.locator("section[aria-label=History] .canvas").hover()
    assert any("measured.csv" in name for name in readout(page, "History")), readout(page, "History")
    page.context.close()


def main():
    SCREENS.mkdir(parents=True, exist_ok=True)
    reports = made()
    chosen = {name: reports[name] for name in SERVED} if FIREFOX and not IS_LONG else reports
    with opened() as browser:
        for name, (kind, path) in chosen.items():
            file, content = saved(name, path)
            # A page may request nothing but this address.
            page = browser.page(file.as_uri())
            page.goto(file.as_uri())
            figure = drawn(page, kind)
            check_text(page)
            if not FIREFOX:
                counts = print_pages(page, name)
                assert max(counts) <= 2, (name, counts)
            check_use(page, kind, figure)
            page.context.close()
            # The driver of Firefox cannot turn scripts off.
            if not FIREFOX:
                check_plain(browser, file, content)
        check_measured(browser, reports["steel-ball"][1].split("/")[3])
        page = browser.page(BASE)
        for name in SERVED:
            kind, path = reports[name]
            page.goto(BASE + path)
            drawn(page, kind)
            check_text(page)
        assert not browser.errors, browser.errors
        check_sandbox(page)
        page.context.close()
        # The browser has told what the policy forbids.
        browser.errors.clear()
        for name in () if FIREFOX else ("steel-ball", "fit", "five"):
            for looks in LOOKS:
                view = browser.page(BASE, *reversed(looks[0]))
                view.goto(BASE + reports[name][1])
                drawn(view, reports[name][0])
                browser.check_looks(view, f"report-{name}", looks)
                view.context.close()
    print(f"{len(chosen)} reports, opened from disk{'' if FIREFOX else ' and printed on at most two pages'}")


main()
