"""Measures how fast the dashboard loads and follows its slider. Nothing else should run at the same time.

    python speed.py http://127.0.0.1:8080
"""

import statistics
import sys

from browser import ask, opened


def first_load(browser, base):
    """From the start of navigation, with empty caches, until the regime is shown and the run can be started."""
    watch = """window.usable = new Promise((done) => new MutationObserver(() => {
        const run = document.querySelector("button.primary"), regime = document.querySelector("[data-item=regime]");
        if (regime && run && !run.disabled) done(performance.now());
    }).observe(document, {subtree: true, childList: true, attributes: true}))"""
    took = []
    for _ in range(9):
        page = browser.page(base, before=watch)
        page.goto(base + "/")
        took.append(page.evaluate("window.usable"))
        page.context.close()
    print(f"first load: usable after {statistics.median(took):.0f} ms (median of {len(took)}), maximum {max(took):.0f} ms")


def slide(browser, base):
    """Moves the slider over 200 output cycles of 512 radii. Each move is drawn in the next frame."""
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    scenario["cycles"] = {"from": 500, "to": 100000, "count": 200, "spacing": "linear"}
    scenario["profiles_at"] = "all"
    scenario["model"] = {"method": "simplified", "points": 512}
    key = ask(base, "/v1/jobs", {"scenario": scenario})["key"]
    page = browser.page(base)
    page.goto(f"{base}/#/result/{key}")
    page.wait_for_selector("#headline dd")
    took = {"script": [], "shown": []}
    for name in ("worn", "pressure"):
        page.select_option("#choose-plot", name)
        page.evaluate("""() => {
            window.steps = new Map();
            const slider = document.getElementById("output");
            slider.addEventListener("input", () => {
                const start = performance.now(), at = slider.value, own = {};
                requestAnimationFrame((frame) => {
                    // The callback of the dashboard has just run in this frame. The message arrives at the end of the frame.
                    own.script = performance.now() - frame;
                    const { port1, port2 } = new MessageChannel();
                    port1.onmessage = () => (own.shown = performance.now() - start);
                    port2.postMessage(null);
                });
                window.steps.set(at, own);
            });
        }""")
        slider = page.locator("#output").bounding_box()
        middle = slider["y"] + slider["height"] / 2
        # The middle of the thumb moves from 8 px behind the left end to 8 px before the right end.
        left, right = slider["x"] + 8, slider["x"] + slider["width"] - 8
        page.mouse.move(right, middle)
        page.mouse.down()
        for step in range(301):
            page.mouse.move(right - (right - left) * step / 300, middle)
        page.mouse.up()
        page.wait_for_timeout(100)
        steps = page.evaluate("[...window.steps.values()].filter(step => step.shown !== undefined)")
        assert len(steps) >= 200 and page.locator("#at").inner_text() == "N = 0", len(steps)
        for phase in ("script", "shown"):
            took[phase] += [step[phase] for step in steps]
        page.locator("#output").focus()
        page.keyboard.press("End")
    for phase, name in (("script", "script per frame"), ("shown", "from the input event to the end of the frame")):
        parts = statistics.quantiles(took[phase], n=20)
        print(f"slider over 200 x 512, {len(took[phase])} steps, {name}: median {parts[9]:.1f} ms, 95th percentile "
            f"{parts[18]:.1f} ms, maximum {max(took[phase]):.1f} ms (one frame is 16.7 ms)")
    # Two frames after one event the figure has changed.
    page.select_option("#choose-plot", "wear")
    page.evaluate("""() => {
        const drawing = document.querySelector("section[aria-label=Profiles] .drawing"), before = drawing.innerHTML;
        const two = (done) => requestAnimationFrame(() => requestAnimationFrame(done));
        window.redrawn = new Promise((done) => document.getElementById("output").addEventListener("input",
            () => two(() => done(drawing.innerHTML !== before)), { once: true }));
    }""")
    page.locator("#output").focus()
    page.keyboard.press("PageDown")
    assert page.evaluate("window.redrawn")
    page.context.close()


def redraw(browser, base):
    """Draws a figure of 8 curves again and again. Prints the time with the layout of the page."""
    page = browser.page(base)
    page.goto(base + "/#/queue")
    for points in (64, 500):
        took = page.evaluate("""async (points) => {
            const { Figure } = await import("/assets/figure/figure.js");
            const figure = new Figure({ name: "test" });
            document.querySelector("main").append(figure.element);
            const x = Array.from({ length: points }, (_, i) => (3e-4 * i) / points), took = [];
            for (let step = 0; step < 200; step++) {
                const curves = Array.from({ length: 8 }, (_, i) => ({ name: `Curve ${i}`, x, y: x.map((r) => (i + 1) * (1 + step / 300) * r * r),
                    ink: i + 1, label: i < 3 ? "apart" : "end" }));
                const start = performance.now();
                figure.show(curves, { x: { title: "Radius", unit: "m" }, y: { title: "Height", unit: "m" } });
                figure.element.getBoundingClientRect();
                took.push(performance.now() - start);
            }
            return took;
        }""", points)
        parts = statistics.quantiles(took, n=20)
        print(f"a figure of 8 x {points}: median {parts[9]:.1f} ms, 95th percentile {parts[18]:.1f} ms")
        assert parts[9] < 5, parts
    page.context.close()


def main():
    with opened() as browser:
        first_load(browser, sys.argv[1])
        redraw(browser, sys.argv[1])
        slide(browser, sys.argv[1])


main()
