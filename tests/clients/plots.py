"""Tests every plot of the dashboard with the mouse and the keyboard."""

import re

import numpy
from playwright.sync_api import expect

from browser import ask, close, curves, near, readout, value

LOOP = "Fretting loop"


def check_readout(page, figure, x_name, expected):
    """Compares the readout with the server's values at the same x. `expected` has columns of x and y by name."""
    shown = readout(page, figure)
    x = value(shown[x_name])
    for name, (xs, ys) in expected.items():
        nearest = min(range(len(xs)), key=lambda i: abs(xs[i] - x))
        # Between its points a loop is a straight line. A branch is shown at the points of the other one, too, and these may lie
        # close to its own.
        if abs(xs[nearest] - x) <= 1e-3 * abs(x) and figure != LOOP:
            near(shown[name], ys[nearest], 1e-3)
        else:
            interpolated = numpy.interp(x, xs, ys) if xs[0] < xs[-1] else numpy.interp(x, xs[::-1], ys[::-1])
            assert abs(value(shown[name]) - interpolated) <= 1e-3 * max(map(abs, ys)), (name, x, shown)


def read_plot(page, figure, x_name, expected):
    """Reads a figure with the mouse and the keyboard. A screen reader gets the same values as the readout."""
    assert all(path.startswith("M") for path in curves(page, figure)), figure
    plot = page.locator(f"section[aria-label='{figure}'] [role=slider]")
    box = plot.bounding_box()
    for fraction in (0.35, 0.7):
        plot.hover(position={"x": fraction * box["width"], "y": box["height"] / 2})
        expect(page.locator(f"section[aria-label='{figure}'] .value").first).to_have_text(re.compile(r"\d"))
        check_readout(page, figure, x_name, expected)
    plot.focus()
    steps = []
    for key in ("End", "ArrowLeft", "Home", "PageUp", "ArrowRight"):
        page.keyboard.press(key)
        check_readout(page, figure, x_name, expected)
        steps.append(int(plot.get_attribute("aria-valuenow")))
        spoken = plot.get_attribute("aria-valuetext")
        assert all(f"{name}: {text}" in spoken for name, text in readout(page, figure).items() if text), spoken
    last = int(plot.get_attribute("aria-valuemax"))
    assert steps[:3] == [last, last - 1, 0] and 0 < steps[3] == steps[4] - 1 < last, steps
    page.keyboard.press("Escape")
    assert not any(re.search(r"\d", text) for text in readout(page, figure).values())


PROFILES = ["worn", "wear", "pressure", "slip", "image"]
HISTORIES = {
    "volume": {"Wear volume": "wear_volume"},
    "depth": {"Largest wear depth": "wear_depth"},
    "radii": {"Contact radius": "contact_radius", "Stick radius": "stick_radius", "Scar radius": "scar_radius"},
    "forces": {"Normal force": "normal_force", "Tangential force amplitude": "tangential_force"},
    "depths": {"Indentation depth": "indentation_depth", "Amplitude at the contact": "amplitude"},
    "energy": {"Energy per cycle": "energy_per_cycle"},
    "dissipated": {"Dissipated energy": "dissipated_energy"},
}


def expected_profile(profiles, name):
    """The named curves of a profile at the last output cycle."""
    radius = profiles["radius"]
    at = f"N = {profiles['cycles'][-1]:,.0f}".replace(",", "\u202f" if profiles["cycles"][-1] >= 1000 else "")
    expected = {at: (radius, profiles[name][-1]), "Unworn": (radius, profiles["initial"] if name == "worn" else profiles[name][0])}
    if profiles["limiting"] and name in ("worn", "wear"):
        wear = [end - start for end, start in zip(profiles["limiting"], profiles["initial"])]
        expected["Limit"] = (radius, profiles["limiting"] if name == "worn" else wear)
    return expected


def expected_history(result, columns):
    """The named curves of a history: a single column has the name of its run."""
    history, rule = result["history"], (result.get("comparison") or {}).get("history")
    method = {"exact": "Exact method", "simplified": "Simplified rule"}[result["scenario"]["model"]["method"]]
    named = {method if rule and len(columns) == 1 else word: (history["cycles"], history[column]) for word, column in columns.items()}
    if rule:
        word, column = next(iter(columns.items()))
        named["Simplified rule" if len(columns) == 1 else f"Simplified rule: {word}"] = (rule["cycles"], rule[column])
    return named


def every_plot(page, base, key, scales=("x", "", "xy")):
    """Draws each quantity on each kind of axes. The readout shows the values of the server."""
    result = ask(base, f"/v1/results/{key}")
    profiles, loops = result["profiles"], result["loops"]
    page.goto(f"{base}/#/result/{key}")
    page.wait_for_selector("#headline dd")
    pictures = set()
    for name in PROFILES:
        page.select_option("#choose-plot", name)
        read_plot(page, "Profiles", "Radius", expected_profile(profiles, name))
        pictures.add(str(curves(page, "Profiles")))
    for name, columns in HISTORIES.items():
        page.select_option("#choose-history", name)
        expected = expected_history(result, columns)
        for axes in scales:
            page.select_option("#choose-log", axes)
            shown = expected
            if "y" in axes:
                # A logarithmic axis shows positive values only.
                shown = {word: (xs, [y if y > 0 else None for y in ys]) for word, (xs, ys) in expected.items()}
                shown = {word: columns for word, columns in shown.items() if any(columns[1])}
            read_plot(page, "History", "Cycles", shown)
            pictures.add(str(curves(page, "History")))
    assert len(pictures) == len(PROFILES) + len(scales) * len(HISTORIES), len(pictures)
    ratios = re.findall(r"=\xa0([^,]+)", page.locator("#ratios").text_content())
    names = ("energy_ratio", "slip_ratio", "free_ratio", "actuator_energy_ratio", "actuator_slip_ratio")
    for shown, ratio in zip(ratios, [loops[name] for name in names if name in loops], strict=True):
        close(shown, ratio[-1], 5e-3)
    moved, force = loops["displacement"][-1], loops["tangential_force"][-1]
    turn = moved.index(min(moved))
    read_plot(page, LOOP, "Displacement at the contact", {"Unloading": (moved[:turn + 1], force[:turn + 1])})
    read_plot(page, LOOP, "Displacement at the contact", {"Loading": (moved[turn:], force[turn:])})


def every_loop(page, base, key):
    """Each loop is split into branches that are functions of the displacement and together have all of its points."""
    loops = ask(base, f"/v1/results/{key}/loops")["loops"]
    split = "async ([x, y]) => (await import('/assets/figure/curves.js')).branches(x, y)"
    for moved, force in zip(loops["displacement"], loops["tangential_force"], strict=True):
        if None in moved:
            # A line contact without a reference has no displacement.
            assert set(moved) == {None}, (key, moved)
            continue
        branches = page.evaluate(split, [moved, force])
        assert all(own["x"] == sorted(own["x"]) for own in branches), (key, moved)
        points = {point for own in branches for point in zip(own["x"], own["y"], strict=True)}
        assert points == set(zip(moved, force)), (key, moved)
        assert len(branches) >= 2 or min(moved) == max(moved), (key, moved)
