"""Checks reports in Chromium: a report of each example is one page of A4 and of Letter, no page cuts a figure, axe-core finds
no violation in light and dark, and nothing is wider than the screen.

    python reports.py http://127.0.0.1:8080

Writes the pages to target/screens.
"""

import json
import pathlib
import re
import sys

from playwright.sync_api import sync_playwright

from browser import LOOKS, ROOT, SCREENS, Browser, ask

BASE = sys.argv[1]
SHEETS = ["A4", "Letter"]
# The height of a sheet without its margins of 8 mm, and its width without those of 10 mm, in px.
AREAS = {"A4": (718, 1062), "Letter": (740, 995)}
RUNS = sorted((ROOT / "examples").glob("*.json"))
STUDIES = sorted((ROOT / "examples/studies").glob("*.json"))


def address(file):
    """The path of the report of an example."""
    job = ask(BASE, "/v1/jobs", json.loads(pathlib.Path(file).read_text()))
    assert job["state"] == "succeeded", job
    return f"/v1/results/{job['key']}/report"


def print_pages(page, name):
    """The number of pages of the page on each sheet."""
    counts = []
    for sheet in SHEETS:
        pdf = page.pdf(format=sheet, print_background=True)
        (SCREENS / f"report-{name}-{sheet}.pdf").write_bytes(pdf)
        counts.append(len(re.findall(rb"/Type\s*/Page\b", pdf)))
    return counts


def main():
    SCREENS.mkdir(parents=True, exist_ok=True)
    reports = {file.stem: address(file) for file in RUNS + STUDIES}
    first, second = reports["steel-ball"], reports["steel-ball-simplified"]
    reports["compared"] = f"{first}?with={second.split('/')[3]}"
    with sync_playwright() as play:
        browser = Browser(play)
        page = browser.page(BASE)
        for name, path in reports.items():
            page.goto(BASE + path)
            counts = print_pages(page, name)
            assert counts == [1, 1] or not any(file.stem == name for file in RUNS), (name, counts)
            # Chromium breaks no page inside an element with this style if the element fits on a page.
            page.emulate_media(media="print")
            for sheet, (width, height) in AREAS.items():
                page.set_viewport_size({"width": width, "height": height})
                cut = page.evaluate(f"""[...document.querySelectorAll('figure')].filter(figure =>
                    getComputedStyle(figure).breakInside !== 'avoid' || figure.offsetHeight > {height}).length""")
                background = page.evaluate("getComputedStyle(document.documentElement).colorScheme")
                assert (cut, background) == (0, "light"), (name, sheet, cut, background)
            page.emulate_media(media="null")
        for name in ("steel-ball", "fit", "compared"):
            for looks in LOOKS:
                view = browser.page(BASE, *reversed(looks[0]))
                view.goto(BASE + reports[name])
                browser.check_looks(view, f"report-{name}", looks)
                view.context.close()
        assert not browser.errors, browser.errors
    print(f"{len(reports)} reports; a run is one page of {' and of '.join(SHEETS)}")


main()
