"""Takes the pictures of the documents: the first page, and a saved result.

    python pictures.py http://127.0.0.1:8080

Writes docs/screenshots.
"""

import io
import sys

from PIL import Image

from browser import ROOT, ask, opened

BASE = sys.argv[1]
PICTURES = ROOT / "docs/screenshots"
# A page has few colours. With a palette its picture has a third of the bytes.
COLOURS = 96


def take(page, name, address, height):
    """Waits until the figures of a view are drawn, and takes its picture."""
    page.set_viewport_size({"width": 1280, "height": height})
    page.goto(BASE + address)
    page.wait_for_selector(".curve")
    page.wait_for_load_state("networkidle")
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(PICTURES / f"{name}.png", optimize=True)


def main():
    key = ask(BASE, "/v1/jobs", ask(BASE, "/v1/examples/steel-ball"))["key"]
    with opened() as browser:
        page = browser.page(BASE, width=1280)
        take(page, "first-page", "/", 720)
        take(page, "result", f"/#/result/{key}", 1516)
    print(f"{PICTURES} has the pictures of this program")


main()
