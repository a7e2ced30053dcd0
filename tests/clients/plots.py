"""Tests every plot of the dashboard with the mouse and the keyboard."""

import re

import numpy
from playwright.sync_api import expect

from browser import ask, canvas, close, drawn_pixels, legend, number

LOOP = "Fretting loop"


def check_legend(page, figure, x_name, expected):
    """Compares the legend with the server's values at the same x. `expected` has columns of x and y by name."""
    shown = legend(page, figure)
    x = number(shown[x_name])
    for name, (xs, ys) in expected.items():
        nearest = min(range(len(xs)), key=lambda i: abs(xs[i] - x))
        # Between its points a loop is a straight line. A branch is shown at the points of the other one, too, and these may lie
        # close to its own.
        if abs(xs[nearest] - x) <= 1e-3 * abs(x) and figure != LOOP:
            close(shown[name], ys[nearest], 1e-3)
        else:
            interpolated = numpy.interp(x, xs, ys) if xs[0] < xs[-1] else numpy.interp(x, xs[::-1], ys[::-1])
            assert abs(number(shown[name]) - interpolated) <= 1e-3 * max(map(abs, ys)), (name, x, shown)


def read_plot(page, figure, x_name, expected):
    """Reads a plot with the mouse and the keyboard. A screen reader gets the same values as the legend."""
    pixels, colours = drawn_pixels(page, figure)
    assert pixels > 500 and colours > 3, (figure, pixels, colours)
    plot = page.locator(f"section[aria-label='{figure}'] [role=slider]")
    area = page.locator(f"section[aria-label='{figure}'] .u-over")
    box = area.bounding_box()
    for fraction in (0.35, 0.7):
        area.hover(position={"x": fraction * box["width"], "y": box["height"] / 2})
        expect(page.locator(f"section[aria-label='{figure}'] .u-value").first).to_have_text(re.compile(r"\d"))
        check_legend(page, figure, x_name, expected)
    plot.focus()
    steps = []
    for key in ("End", "ArrowLeft", "Home", "PageUp", "ArrowRight"):
        page.keyboard.press(key)
        check_legend(page, figure, x_name, expected)
        steps.append(int(plot.get_attribute("aria-valuenow")))
        spoken = plot.get_attribute("aria-valuetext")
        assert all(f"{name}: {value}" in spoken for name, value in legend(page, figure).items() if value), spoken
    last = int(plot.get_attribute("aria-valuemax"))
    assert steps[:3] == [last, last - 1, 0] and 0 < steps[3] == steps[4] - 1 < last, steps
    page.keyboard.press("Escape")
    assert not any(re.search(r"\d", value) for value in legend(page, figure).values())


PROFILES = {"worn": 1e6, "wear": 1e6, "pressure": 1e-6, "slip": 1e6, "image": 1e6}
HISTORIES = {
    "volume": [("Wear volume", "wear_volume", 1e9)],
    "depth": [("Largest wear depth", "wear_depth", 1e6)],
    "radii": [("Contact radius", "contact_radius", 1e6), ("Stick radius", "stick_radius", 1e6), ("Scar radius", "scar_radius", 1e6)],
    "forces": [("Normal force", "normal_force", 1), ("Tangential force amplitude", "tangential_force", 1)],
    "depths": [("Indentation depth", "indentation_depth", 1e6), ("Displacement amplitude", "amplitude", 1e6)],
    "energy": [("Energy per cycle", "energy_per_cycle", 1e3)],
    "dissipated": [("Dissipated energy", "dissipated_energy", 1e3)],
}


def scaled(factor, values):
    return [None if value is None else factor * value for value in values]


def every_plot(page, base, key, scales=("x", "", "xy")):
    """Draws each quantity on each kind of axes. The legend shows the values of the server."""
    result = ask(base, f"/v1/results/{key}")
    profiles, history, loops = result["profiles"], result["history"], result["loops"]
    page.goto(f"{base}/#/result/{key}")
    page.wait_for_selector("canvas")
    radius = scaled(1e6, profiles["radius"])
    pictures = set()
    for name, factor in PROFILES.items():
        page.select_option("#choose-plot", name)
        unworn = profiles["initial"] if name == "worn" else profiles[name][0]
        expected = {"Current": (radius, scaled(factor, profiles[name][-1])), "Unworn": (radius, scaled(factor, unworn))}
        assert ("Limit" in legend(page, "Profiles")) == (name in ("worn", "wear") and profiles["limiting"] is not None)
        if profiles["limiting"] and name in ("worn", "wear"):
            wear = [end - start for end, start in zip(profiles["limiting"], profiles["initial"])]
            expected["Limit"] = (radius, scaled(1e6, profiles["limiting"] if name == "worn" else wear))
        read_plot(page, "Profiles", "Radius r", expected)
        pictures.add(canvas(page, "Profiles").evaluate("canvas => canvas.toDataURL()"))
    for name, columns in HISTORIES.items():
        page.select_option("#choose-history", name)
        expected = {}
        for word, column, factor in columns:
            expected[word] = (history["cycles"], scaled(factor, history[column]))
        if result.get("comparison"):
            word, column, factor = columns[0]
            rule = result["comparison"]["history"]
            expected[f"Simplified rule: {word}"] = (rule["cycles"], scaled(factor, rule[column]))
        for axes in scales:
            page.select_option("#choose-log", axes)
            if "y" in axes:
                # A logarithmic axis shows positive values only.
                shown = {word: (xs, [y if y > 0 else None for y in ys]) for word, (xs, ys) in expected.items()}
                shown = {word: columns for word, columns in shown.items() if any(columns[1])}
            else:
                shown = expected
            read_plot(page, "History", "Cycles N", shown)
            pictures.add(canvas(page, "History").evaluate("canvas => canvas.toDataURL()"))
    assert len(pictures) == len(PROFILES) + len(scales) * len(HISTORIES), len(pictures)
    ratios = re.findall(r"=\xa0([^,]+)", page.locator("#ratios").text_content())
    names = ("energy_ratio", "slip_ratio", "free_ratio", "actuator_energy_ratio", "actuator_slip_ratio")
    for shown, ratio in zip(ratios, [loops[name] for name in names if name in loops], strict=True):
        close(shown, ratio[-1], 5e-3)
    moved, force = scaled(1e6, loops["displacement"][-1]), loops["tangential_force"][-1]
    turn = moved.index(min(moved))
    read_plot(page, LOOP, "Displacement", {"Unloading": (moved[:turn + 1], force[:turn + 1])})
    read_plot(page, LOOP, "Displacement", {"Loading": (moved[turn:], force[turn:])})


def every_loop(page, base, key):
    """Each loop is split into branches that are functions of the displacement and together have all of its points."""
    loops = ask(base, f"/v1/results/{key}/loops")["loops"]
    split = "async ([x, y]) => (await import('/assets/plots.js')).branches(x, y)"
    for moved, force in zip(loops["displacement"], loops["tangential_force"], strict=True):
        if None in moved:
            # A line contact without a reference has no displacement.
            assert set(moved) == {None}, (key, moved)
            continue
        branches = page.evaluate(split, [moved, force])
        assert all(xs == sorted(xs) for xs, _ in branches), (key, moved)
        points = {point for xs, ys in branches for point in zip(xs, ys, strict=True)}
        assert points == set(zip(moved, force)), (key, moved)
        assert len(branches) >= 2 or min(moved) == max(moved), (key, moved)
