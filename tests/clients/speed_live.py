"""Measures how fast the first page follows what is typed: from the key to the frame that shows all figures of the new value.

    python speed_live.py http://127.0.0.1:8080
"""

import statistics
import sys

from playwright.sync_api import expect

from browser import opened

COUNT = 200

# Notes when a key is pressed, and when the frame ends that shows the figures of the value. The figures are drawn as soon as the
# answer is read, in the same task.
WATCH = """
window.took = new Map();
window.pressed = null;
addEventListener("keydown", ({ key }) => { window.pressed = { key, at: performance.now() }; }, true);
addEventListener("input", ({ target }) => { if (window.pressed) window.pressed.value = target.value; }, true);
const send = window.fetch;
window.fetch = async (path, options) => {
    const response = await send(path, options);
    if (path !== "/v1/evaluate" || !response.ok) return response;
    const { amplitude } = JSON.parse(options.body).scenario.motion, read = response.json.bind(response);
    response.json = async () => {
        const answer = await read(), key = window.pressed;
        if (key?.value && amplitude === `${key.value} um` && !window.took.has(key.value)) requestAnimationFrame(() => {
            const { port1, port2 } = new MessageChannel();
            port1.onmessage = () => window.took.set(key.value, performance.now() - key.at);
            port2.postMessage(null);
        });
        return answer;
    };
    return response;
};
"""


def type_values(browser, base):
    page = browser.page(base, before=WATCH)
    page.goto(base + "/")
    page.wait_for_selector("[data-value=wear_depth]")
    page.select_option("#method", "exact")
    field = page.locator("#motion-amplitude")
    for prefix in range(200, 200 + COUNT):
        if prefix % 10 == 0:
            # The last digit is typed by the keys below.
            field.fill(f"{prefix / 100:.1f}")
        value = f"{prefix / 100:.2f}"
        field.press(value[-1])
        page.wait_for_function("value => window.took.has(value)", arg=value)
        field.press("Backspace")
        # A person types a key about every 150 ms.
        page.wait_for_timeout(150)
    took = page.evaluate("[...window.took].filter(([value]) => value.length === 4).map(([, own]) => own)")
    assert len(took) == COUNT, len(took)
    expect(page.locator(".figures svg.drawing >> visible=true")).to_have_count(5)
    parts = statistics.quantiles(took, n=20)
    print(f"{len(took)} values typed, from the key to the frame with all figures: median {parts[9]:.0f} ms, 95th percentile "
        f"{parts[18]:.0f} ms, maximum {max(took):.0f} ms")
    page.context.close()


with opened() as browser:
    type_values(browser, sys.argv[1])
