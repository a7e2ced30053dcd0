"""Every plot of the dashboard, read by pointer and by keyboard, and how fast the slider is."""

import re
import statistics

import numpy
from playwright.sync_api import expect

from browser import ask, below, canvas, close, inked, number


def agree(page, figure, x_name, truth):
    """What stands below a plot is what the server says for that x. `truth` has columns of x and y by name."""
    shown = below(page, figure)
    x = number(shown[x_name])
    for name, (xs, ys) in truth.items():
        nearest = min(range(len(xs)), key=lambda i: abs(xs[i] - x))
        if abs(xs[nearest] - x) <= 1e-3 * abs(x):
            close(shown[name], ys[nearest], 1e-3)
        else:
            # Between its points a loop is straight.
            on_the_line = numpy.interp(x, xs, ys) if xs[0] < xs[-1] else numpy.interp(x, xs[::-1], ys[::-1])
            assert abs(number(shown[name]) - on_the_line) <= 1e-3 * max(map(abs, ys)), (name, x, shown)


def read(page, figure, x_name, truth):
    """Reads a plot by pointer and by keyboard; what a screen reader is told is what stands there."""
    pixels, colours = inked(page, figure)
    assert pixels > 500 and colours > 3, (figure, pixels, colours)
    plot = page.locator(f"section[aria-label='{figure}'] [role=slider]")
    area = page.locator(f"section[aria-label='{figure}'] .u-over")
    box = area.bounding_box()
    for part in (0.35, 0.7):
        area.hover(position={"x": part * box["width"], "y": box["height"] / 2})
        expect(page.locator(f"section[aria-label='{figure}'] .u-value").first).to_have_text(re.compile(r"\d"))
        agree(page, figure, x_name, truth)
    plot.focus()
    steps = []
    for key in ("End", "ArrowLeft", "Home", "PageUp", "ArrowRight"):
        page.keyboard.press(key)
        agree(page, figure, x_name, truth)
        steps.append(int(plot.get_attribute("aria-valuenow")))
        told = plot.get_attribute("aria-valuetext")
        assert all(f"{name}: {value}" in told for name, value in below(page, figure).items() if value), told
    last = int(plot.get_attribute("aria-valuemax"))
    assert steps[:3] == [last, last - 1, 0] and 0 < steps[3] == steps[4] - 1 < last, steps
    page.keyboard.press("Escape")
    assert number_free(below(page, figure).values())


def number_free(values):
    return not any(re.search(r"\d", value) for value in values)


PROFILES = {"worn": 1e6, "wear": 1e6, "pressure": 1e-6, "slip": 1e6, "image": 1e6}
HISTORIES = {
    "volume": [("Wear volume", "wear_volume", 1e9)],
    "depth": [("Wear depth", "wear_depth", 1e6)],
    "radii": [("Contact radius", "contact_radius", 1e6), ("Stick radius", "stick_radius", 1e6), ("Scar radius", "scar_radius", 1e6)],
    "forces": [("Normal force", "normal_force", 1), ("Tangential force", "tangential_force", 1)],
    "depths": [("Depth", "indentation_depth", 1e6), ("Amplitude", "amplitude", 1e6)],
    "energy": [("Energy per cycle", "energy_per_cycle", 1e3)],
    "dissipated": [("Dissipated energy", "dissipated_energy", 1e3)],
}


def times(factor, values):
    return [None if value is None else factor * value for value in values]


def every_plot(page, base, key, scales=("x", "", "xy")):
    """Each quantity, each axis, the loop: drawn, and the numbers at the cursor are the server's."""
    result = ask(base, f"/v1/results/{key}")
    profiles, history, loops = result["profiles"], result["history"], result["loops"]
    page.goto(f"{base}/#/result/{key}")
    page.wait_for_selector("canvas")
    radius = times(1e6, profiles["radius"])
    pictures = set()
    for name, factor in PROFILES.items():
        page.select_option("#choose-plot", name)
        truth = {"this instant": (radius, times(factor, profiles[name][-1]))}
        if name == "worn":
            truth["initial"] = (radius, times(1e6, profiles["initial"]))
        else:
            truth["unworn"] = (radius, times(factor, profiles[name][0]))
        assert ("limiting" in below(page, "Profiles")) == (name in ("worn", "wear") and profiles["limiting"] is not None)
        if profiles["limiting"] and name in ("worn", "wear"):
            wear = [end - start for end, start in zip(profiles["limiting"], profiles["initial"])]
            truth["limiting"] = (radius, times(1e6, profiles["limiting"] if name == "worn" else wear))
        read(page, "Profiles", "Radius r", truth)
        pictures.add(canvas(page, "Profiles").evaluate("canvas => canvas.toDataURL()"))
    for name, columns in HISTORIES.items():
        page.select_option("#choose-history", name)
        truth = {}
        for word, column, factor in columns:
            truth[word] = (history["cycles"], times(factor, history[column]))
        if result.get("comparison"):
            _, column, factor = columns[0]
            word = "simplified rule" + (f": {columns[0][0].lower()}" if len(columns) > 1 else "")
            truth[word] = (result["comparison"]["history"]["cycles"], times(factor, result["comparison"]["history"][column]))
        for axes in scales:
            page.select_option("#choose-log", axes)
            if "y" in axes:
                # What is not above zero has no place on a logarithmic axis.
                shown = {word: (xs, [y if y > 0 else None for y in ys]) for word, (xs, ys) in truth.items()}
                shown = {word: columns for word, columns in shown.items() if any(columns[1])}
            else:
                shown = truth
            read(page, "History", "Cycles N", shown)
            pictures.add(canvas(page, "History").evaluate("canvas => canvas.toDataURL()"))
    assert len(pictures) == len(PROFILES) + len(scales) * len(HISTORIES), len(pictures)
    criteria = re.findall(r"=\xa0([^,]+)", page.locator("#criteria").text_content())
    for shown, ratio in zip(criteria, ("energy_ratio", "slip_ratio", "free_ratio"), strict=True):
        close(shown, loops[ratio][-1], 5e-3)
    moved, force = times(1e6, loops["displacement"][-1]), loops["tangential_force"][-1]
    turn = moved.index(min(moved))
    read(page, "Fretting loop", "Displacement", {"this, back": (moved[:turn + 1], force[:turn + 1])})
    read(page, "Fretting loop", "Displacement", {"this, forth": (moved[turn:], force[turn:])})


def every_loop(page, base, key):
    """Each loop is cut into branches that are functions of the displacement, with all of its points."""
    loops = ask(base, f"/v1/results/{key}/loops")["loops"]
    cut = "async ([x, y]) => (await import('/assets/plots.js')).branches(x, y)"
    for moved, force in zip(loops["displacement"], loops["tangential_force"], strict=True):
        branches = page.evaluate(cut, [moved, force])
        assert all(xs == sorted(xs) for xs, _ in branches), (key, moved)
        points = {point for xs, ys in branches for point in zip(xs, ys, strict=True)}
        assert points == set(zip(moved, force)), (key, moved)
        assert len(branches) >= 2 or min(moved) == max(moved), (key, moved)


def slide(browser, base):
    """200 instants of 512 radii: each move of the slider is drawn in the next frame; how long that takes."""
    scenario = ask(base, "/v1/examples/steel-ball")["scenario"]
    scenario["cycles"] = {"from": 500, "to": 100000, "count": 200, "spacing": "linear"}
    scenario["profiles_at"] = "all"
    scenario["model"] = {"method": "simplified", "points": 512}
    key = ask(base, "/v1/jobs", {"scenario": scenario})["key"]
    page = browser.page(base)
    page.goto(f"{base}/#/result/{key}")
    page.wait_for_selector("canvas")
    took = {"script": [], "shown": []}
    for name in ("worn", "pressure"):
        page.select_option("#choose-plot", name)
        page.evaluate("""() => {
            window.steps = new Map();
            const slider = document.getElementById("instant");
            slider.addEventListener("input", () => {
                const start = performance.now(), at = slider.value, own = {};
                requestAnimationFrame((frame) => {
                    // The page's own callback came before: this is what it took, and the rest of the frame follows.
                    own.script = performance.now() - frame;
                    const { port1, port2 } = new MessageChannel();
                    port1.onmessage = () => (own.shown = performance.now() - start);
                    port2.postMessage(null);
                });
                window.steps.set(at, own);
            });
        }""")
        slider = page.locator("#instant").bounding_box()
        middle = slider["y"] + slider["height"] / 2
        # The thumb's middle goes from half its width to half its width before the end.
        left, right = slider["x"] + 8, slider["x"] + slider["width"] - 8
        page.mouse.move(right, middle)
        page.mouse.down()
        for step in range(301):
            page.mouse.move(right - (right - left) * step / 300, middle)
        page.mouse.up()
        page.wait_for_timeout(100)
        steps = page.evaluate("[...window.steps.values()].filter(step => step.shown !== undefined)")
        assert len(steps) >= 200 and page.locator("#at").inner_text() == "N = 0", len(steps)
        for what in ("script", "shown"):
            took[what] += [step[what] for step in steps]
        page.locator("#instant").focus()
        page.keyboard.press("End")
    for what, name in (("script", "a frame's script takes"), ("shown", "from the event to the end of its frame it takes")):
        parts = statistics.quantiles(took[what], n=20)
        print(f"the slider over 200 x 512, {len(took[what])} steps: {name} {parts[9]:.1f} ms, {parts[18]:.1f} at the 95th "
            f"percentile, {max(took[what]):.1f} at worst (16.7 ms are one frame)")
    # One event, two frames: the picture is another one.
    page.select_option("#choose-plot", "wear")
    page.evaluate("""() => {
        const canvas = document.querySelector("section[aria-label=Profiles] canvas"), before = canvas.toDataURL();
        const two = (done) => requestAnimationFrame(() => requestAnimationFrame(done));
        window.redrawn = new Promise((done) => document.getElementById("instant").addEventListener("input",
            () => two(() => done(canvas.toDataURL() !== before)), { once: true }));
    }""")
    page.locator("#instant").focus()
    page.keyboard.press("PageDown")
    assert page.evaluate("window.redrawn")
    page.context.close()
