"""Tests the page of a run: zoom, saved figures, names at curves, playing, the section, explanations, warnings, print, and
the curves of a run that is still computed.
"""

import csv
import itertools
import re
import statistics
import struct
import subprocess

from playwright.sync_api import expect

from browser import ask, blocks, curves, downloaded, readout, smoothed, value


def figure_of(page, figure):
    return page.locator(f"section[aria-label='{figure}']")


def open_result(page, base, key, words=""):
    page.goto(base + "/#/queue")
    page.goto(f"{base}/#/result/{key}{words}")
    page.wait_for_selector("#headline dd")


def zoom(page, base, key):
    """Keys zoom a figure, the address keeps the part that is shown, and a button shows all."""
    open_result(page, base, key)
    profiles, reset = figure_of(page, "Profiles"), figure_of(page, "Profiles").get_by_role("button", name="Reset")
    whole = curves(page, "Profiles")
    expect(reset).to_be_disabled()
    expect(profiles).to_contain_text("press + − to zoom")
    profiles.get_by_role("slider").focus()
    for keys in ("+", "+", "Shift+ArrowLeft"):
        page.keyboard.press(keys)
    zoomed = curves(page, "Profiles")
    assert zoomed != whole and re.search(r"zoom-profile=[\de.-]+", page.url), page.url
    # A value that is read is inside the part that is shown.
    page.keyboard.press("Home")
    low, high = map(float, re.search(r"zoom-profile=([\de.-]+?)\.\.([\de.-]+)", page.url).groups())
    assert low * 0.999 <= value(readout(page, "Profiles")["Radius"]) <= high
    page.reload()
    page.wait_for_selector("#headline dd")
    assert curves(page, "Profiles") == zoomed
    reset.click()
    assert curves(page, "Profiles") == whole and "zoom-profile" not in page.url
    # The same with the pointer, and back with a key.
    plot = figure_of(page, "History").get_by_role("slider")
    plot.scroll_into_view_if_needed()
    whole, box = curves(page, "History"), plot.bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.4 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], middle, steps=4)
    page.mouse.up()
    assert curves(page, "History") != whole and "zoom-history" in page.url, page.url
    plot.press("0")
    assert curves(page, "History") == whole


def saved(page, figure, kind):
    """The bytes of a saved figure. Its width is 85 mm."""
    menu = figure_of(page, figure).locator("details.save")
    menu.locator("summary").click()
    # The driver of Firefox adds to a number instead of filling it.
    menu.get_by_label("Width in mm").press("Control+a")
    page.keyboard.type("85")
    content = downloaded(page, menu.get_by_role("button", name=f"as {kind}").click)
    expect(menu).not_to_have_attribute("open", "")
    return content


def save(page, base, key):
    """A saved figure has its size in mm and light colours. The CSV has the values of the server."""
    open_result(page, base, key)
    drawing = saved(page, "Profiles", "SVG").decode()
    assert 'width="85mm" height="60mm"' in drawing and "Radius" in drawing, drawing[:300]
    assert "var(" not in drawing and 'stroke="#0072b2"' in drawing, drawing[:300]
    picture = saved(page, "Profiles", "PNG")
    assert picture[:8] == b"\x89PNG\r\n\x1a\n" and picture[37:41] == b"pHYs", picture[:60]
    # 300 dots per inch: 1004 dots in 85 mm, 11811 in a metre.
    assert struct.unpack(">II", picture[16:24]) == (1004, 709), picture[:60]
    assert struct.unpack(">IIB", picture[41:50]) == (11811, 11811, 1), picture[:60]
    head, *rows = csv.reader(saved(page, "Profiles", "CSV").decode().splitlines())
    profiles = ask(base, f"/v1/results/{key}")["profiles"]
    assert len(head) == len(set(head)) > 5, head
    place = head.index("N = 100\u202f000 (µm)")
    assert head[0] == "Radius (µm)" and head[place].endswith("(µm)"), head
    for row, radius, height in zip(rows, profiles["radius"], profiles["worn"][-1], strict=True):
        assert abs(float(row[0]) - 1e6 * radius) < 1e-6 and abs(float(row[place]) - 1e6 * height) < 1e-6, row
    assert b"Body 2" in saved(page, "Section", "SVG")
    menu = figure_of(page, "History").locator("details.save")
    for close in (lambda: page.keyboard.press("Escape"), lambda: page.locator("h1").click()):
        menu.locator("summary").click()
        expect(menu).to_have_attribute("open", "")
        close()
        expect(menu).not_to_have_attribute("open", "")


def type_into(page, field, text):
    """Types a text, as a person does: in Firefox, a filled field does not say that it has changed."""
    field.press("Control+a")
    page.keyboard.type(text)
    page.keyboard.press("Tab")


def column_of(content, name):
    """A column of a saved CSV."""
    head, *rows = csv.reader(content.decode().splitlines())
    place = head.index(name)
    return [float(row[place]) for row in rows]


def near(found, expected):
    assert len(found) == len(expected) and all(abs(a - b) <= 1e-9 * max(map(abs, expected)) for a, b in zip(found, expected, strict=True)), (found[:4], expected[:4])


def papers(browser, base):
    """A figure for a paper: chosen cycles in units of the unworn contact, the rule with a ξ of one's own beside them, own names, as PDF."""
    body = ask(base, "/v1/examples/steel-ball")
    page = browser.page(base, before="window.print = () => {}")
    key = ask(base, "/v1/jobs", body)["key"]
    open_result(page, base, key)
    profiles = figure_of(page, "Profiles")
    page.locator("#profile-menu summary").click()
    for cycles in ("1\u202f000", "10\u202f000", "100\u202f000"):
        page.get_by_label(f"N = {cycles}", exact=True).check()
    page.get_by_label("Simplified rule beside").check()
    type_into(page, page.get_by_label("ξ of the simplified rule"), "0.9")
    expect(profiles.locator(".curve[stroke-dasharray='2 3']")).to_have_count(3)
    browser.check_accessibility(page, "profile menu")
    page.keyboard.press("Escape")
    page.select_option("#choose-scale", "ratio")
    result, rule = ask(base, f"/v1/results/{key}"), ask(base, "/v1/evaluate", {"scenario": {
        **body["scenario"], "model": {"method": "simplified", "xi": 0.9}}, "parts": ["profiles", "history"]})
    # The legend shows the line of the rule, and the figure says its wear beside that of the exact method.
    expect(profiles.locator(".values li", has_text="Simplified rule, ξ\u00a0=\u00a00.9").locator(".sample.dotted")).to_have_count(1)
    words = page.locator("#outside").inner_text()
    for name, pattern in (("wear_volume", "wear volume"), ("wear_depth", "largest wear depth")):
        shown, change, sense = re.search(f"{pattern} (.*?), ([0-9.]+)\u00a0% (less|more)", words).groups()
        own = rule["history"][name][-1]
        assert abs(value(shown) / own - 1) < 5e-3, (words, own)
        expected = 100 * (own / result["history"][name][-1] - 1)
        assert abs(float(change) * (-1 if sense == "less" else 1) - expected) < 0.1 + 0.05 * abs(expected), (words, expected)
    rule = rule["profiles"]
    content = saved(page, "Profiles", "CSV")
    own, scales = result["profiles"], result["scales"]
    for cycles in (1000, 100_000):
        text = f"N/N₀ = {cycles / scales['cycles']:.3g}"
        near(column_of(content, f"{text} (1)"), [height / scales["indentation_depth"] for height in own["worn"][own["cycles"].index(cycles)]])
        near(column_of(content, f"{text}, Simplified rule, ξ = 0.9 (1)"), [height / scales["indentation_depth"] for height in rule["worn"][rule["cycles"].index(cycles)]])
    near(column_of(content, "Radius (1)"), [radius / scales["contact_radius"] for radius in own["radius"]])
    # Names and order, which the address keeps.
    menu = profiles.locator("details.save")
    menu.locator("summary").click()
    middle = f"N/N₀ = {10_000 / scales['cycles']:.3g}"
    type_into(page, menu.get_by_label(f"Name of {middle}", exact=True), "after a day")
    names = "inputs => inputs.map(({value}) => value)"
    before = menu.locator(".names input").evaluate_all(names)
    menu.get_by_role("button", name=f"Move {middle} up", exact=True).click()
    after = menu.locator(".names input").evaluate_all(names)
    place = before.index("after a day")
    assert after.index("after a day") == place - 1 and sorted(after) == sorted(before), (before, after)
    page.reload()
    page.wait_for_selector("#headline dd")
    expect(profiles.locator(".curve[stroke-dasharray='2 3']")).to_have_count(3)
    assert "after a day" in saved(page, "Profiles", "SVG").decode()
    # The page of the PDF has the size of the figure.
    menu.locator("summary").click()
    menu.get_by_role("button", name="as PDF").click()
    pdf = page.pdf(prefer_css_page_size=True)
    # At 10 dots per inch.
    sizes = re.findall(rb"P5\n(?:#.*\n)?(\d+) (\d+)\n", ghostscript(pdf, "pgmraw"))
    assert len(sizes) == 1 and all(abs(int(size) - mm * 10 / 25.4) <= 1 for size, mm in zip(sizes[0], (85, 60), strict=True)), sizes
    words = " ".join(ghostscript(pdf, "txtwrite").decode().replace("\u00a0", " ").split())
    assert "after a day" in words and "Largest wear depth" not in words, words
    expect(page.locator(".figure-page")).to_have_count(0)
    page.context.close()


def same_cycle(page, base, key):
    """The cycle that is read in one figure is marked in the others."""
    open_result(page, base, key)
    profiles, history = figure_of(page, "Profiles"), figure_of(page, "History")
    history.get_by_role("slider").focus()
    page.keyboard.press("End")
    page.keyboard.press("ArrowLeft")
    read = readout(page, "History")["Cycles"]
    expect(profiles.locator(".curve.lit")).to_have_count(1)
    expect(profiles.locator(".marked")).to_have_text(f"Marked: N\u00a0=\u00a0{read}")
    loops = figure_of(page, "Fretting loop").locator(".caption")
    expect(loops).to_have_text(f"Fretting loop after {read} cycles")
    page.keyboard.press("Escape")
    expect(profiles.locator(".curve.lit")).to_have_count(0)
    expect(loops).to_have_text("Fretting loop after 100\u202f000 cycles")
    # The pointer on a curve of another cycle marks that cycle in the history.
    d = profiles.locator(".curve").first.get_attribute("d")
    x, y = map(float, re.match(r"M([\d.]+) ([\d.]+)", d).groups())
    canvas = profiles.locator(".canvas")
    canvas.hover(position={"x": x + 2, "y": y})
    first = ask(base, f"/v1/results/{key}")["profiles"]["cycles"][1]
    assert value(readout(page, "History")["Cycles"]) == first, readout(page, "History")
    page.mouse.move(0, 0)


def smooth(browser, base):
    """A history of five outputs is drawn through more points of the same run. The outputs are marked, and the names stand in a saved figure."""
    page = browser.page(base)
    open_result(page, base, ask(base, "/v1/jobs", ask(base, "/v1/examples/steel-ball"))["key"])
    history = figure_of(page, "History")
    smoothed(page)
    assert [path.count("L") > 30 for path in curves(page, "History")] == [True, True], curves(page, "History")
    assert history.locator("circle").count() == 10
    drawing = saved(page, "History", "SVG").decode()
    assert "Exact method" in drawing and "Simplified rule" in drawing, drawing[:300]
    # The value at the cursor stays where it is.
    history.get_by_role("slider").press("Home")
    history.get_by_role("slider").press("ArrowRight")
    before = history.locator(".cursor").get_attribute("x1")
    history.get_by_role("slider").press("+")
    assert abs(float(before) - float(history.locator(".cursor").get_attribute("x1"))) < 1, before
    page.context.close()


def names(page, base, key):
    """The names at the curves neither overlap nor leave the figure. The limit is drawn above the profile that it may cover."""
    boxes = """figure => {
        const own = figure.querySelector(".drawing").getBoundingClientRect();
        return [...figure.querySelectorAll("text[font-weight='600']")].map((text) => {
            const { left, right, top, bottom } = text.getBoundingClientRect();
            return [text.textContent, left - own.left, right - own.left, top - own.top, bottom - own.top, own.width];
        });
    }"""
    seen = 0
    for figure, choice in (("Profiles", "plot"), ("History", "history")):
        for option in page.locator(f"#choose-{choice} option").evaluate_all("all => all.map(({value}) => value)"):
            page.select_option(f"#choose-{choice}", option)
            found = figure_of(page, figure).evaluate(boxes)
            seen += len(found)
            for name, left, right, *_, width in found:
                assert left >= 0 and right <= width + 1, (option, name, left, right, width)
            for (one, *a, _), (other, *b, _) in itertools.combinations(found, 2):
                # Letters are less than 12 px high. Browsers add different room above and below.
                assert a[1] <= b[0] or b[1] <= a[0] or abs(sum(a[2:]) - sum(b[2:])) / 2 >= 12, (option, one, other, a, b)
    assert seen > 8, seen
    page.select_option("#choose-plot", "worn")
    dashes = figure_of(page, "Profiles").locator(".curve").evaluate_all("paths => paths.map(path => path.getAttribute('stroke-dasharray'))")
    assert dashes[-2:] == [None, "9 3 2 3 2 3"], dashes


def play(page):
    """The button moves the slider from the unworn contact to the last output cycle."""
    page.get_by_role("button", name="Play").click()
    expect(page.locator("#at")).to_have_text("N = 0")
    expect(figure_of(page, "Profiles").locator(".caption")).to_have_text("Unworn profile")
    # The axis stays while the profiles change.
    axis = "figure => [...figure.querySelectorAll('text[text-anchor=end]')].map(({textContent}) => textContent).join()"
    ticks = figure_of(page, "Profiles").evaluate(axis)
    last = page.locator("#output").get_attribute("max")
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    assert page.input_value("#output") == last and figure_of(page, "Profiles").evaluate(axis) == ticks


def loop(page):
    """Loading and unloading differ, and arrows show their direction."""
    loops = figure_of(page, "Fretting loop")
    assert loops.locator(".curve").evaluate_all("paths => paths.map(path => path.getAttribute('stroke-dasharray'))") == ["7 4", None]
    assert loops.locator("path[transform]").count() == 2
    expect(loops.locator(".drawing")).to_contain_text("Loading")
    expect(loops.locator(".drawing")).to_contain_text("Unloading")


def section(page):
    """The section says how much its heights are exaggerated."""
    expect(page.locator("#section-words")).to_contain_text(re.compile(r"exaggerated \d+×"))
    page.select_option("#choose-section", "true")
    expect(page.locator("#section-words")).to_contain_text("True to scale")


def explanations(page):
    """The meaning of a quantity appears at the focus. Escape hides it."""
    term = page.locator("#headline .term").first
    told = page.locator("#headline [role=tooltip]").first
    expect(told).to_be_hidden()
    term.focus()
    expect(told).to_have_text("Largest depth of the wear scar. It is the wear of both bodies together.")
    expect(told).to_be_visible()
    page.keyboard.press("Escape")
    expect(told).to_be_hidden()


def on_screen(browser, page):
    """Neither an explanation nor the menu that saves a figure leaves the screen. Both are accessible."""
    wide = page.evaluate("document.documentElement.clientWidth")
    terms = page.locator(".term").all()
    assert len(terms) > 10, terms
    page.locator("#output").focus()
    for term in terms:
        term.focus()
        box = page.locator(".explained:focus-within [role=tooltip]").bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= wide, (term.inner_text(), box)
    browser.check_accessibility(page, "explanation")
    menu = figure_of(page, "Profiles").locator("details.save")
    menu.locator("summary").click()
    box = menu.locator(".sheet").bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= wide, box
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    browser.check_accessibility(page, "save")


def warnings(page, base):
    """A warning stands at the number that it concerns."""
    scenario = {**ask(base, "/v1/examples/steel-ball")["scenario"], "load": {"normal_force": "100 kN"}, "cycles": [1000]}
    open_result(page, base, ask(base, "/v1/jobs", {"scenario": scenario})["key"])
    page.locator("#readout div", has_text="Contact radius").get_by_role("link", name="Has a warning").click()
    expect(page.locator("#warning-contact_radius")).to_be_focused()
    expect(page.locator("#warning-contact_radius")).to_contain_text("Contact radius: The surface of the indenter has the slope 0.19")
    expect(page.locator("section.output #warning-normal_force")).to_contain_text("The peak pressure of the unworn contact is 13.5\u00a0GPa.")


def ghostscript(pdf, device):
    """What a device of Ghostscript makes of a PDF."""
    command = ["gs", "-q", f"-sDEVICE={device}", "-r10", "-o", "-", "-"]
    return subprocess.run(command, input=pdf, capture_output=True, check=True).stdout


def printed(browser, base, key):
    """A result fits on one printed page, in light colours and without buttons."""
    page = browser.page(base, scheme="dark")
    open_result(page, base, key)
    pdf = page.pdf(prefer_css_page_size=True)
    pages = ghostscript(pdf, "pgmraw")
    assert pages.count(b"P5\n") == 1 and statistics.median(pages[100:]) > 240, pages[:100]
    words = " ".join(ghostscript(pdf, "txtwrite").decode().replace("\u00a0", " ").split())
    for name in ("Units", "Play", "Share link", "Reset"):
        assert name not in words, words
    for part in ("Largest wear depth", "205 GPa", "Poisson's", "k_w", f"from {base}"):
        assert part in words, (part, words)
    page.context.close()


def live(page, base):
    """The page of a run shows its curves before its end. A canceled run says how far it came. It has a name in the queue."""
    job = ask(base, "/v1/jobs", {"scenario": blocks(150_000, points=1024)}, wait=False)
    page.goto(f"{base}/#/run/{job['id']}")
    expect(page.locator("h1")).to_have_text("Paraboloid, R\u00a0=\u00a010\u00a0mm; F\u00a0=\u00a0100\u00a0N, μ\u00a0=\u00a00.7")
    figures = figure_of(page, "Results so far")
    expect(figures.locator(".curve").first).to_be_attached()
    expect(page.locator("#state")).to_have_text("running")
    figures.get_by_role("slider").first.focus()
    page.keyboard.press("End")
    # Both cursors move.
    expect(figures.locator(".values").last).to_contain_text(re.compile("Largest wear depth"))
    expect(page.locator("section[aria-label=Progress] p span")).to_have_text(re.compile("^[1-9]"))
    page.click("#cancel")
    expect(page.locator("section[aria-label=Progress] p").first).to_have_text(re.compile(r"canceledat \d+\u00a0%"))
    page.click("nav >> text=Runs")
    expect(page.locator("tbody tr").first).to_contain_text("Paraboloid, R\u00a0=\u00a010\u00a0mm")


HELD = """async () => {
    const { Figure } = await import("/assets/figure/figure.js");
    const figure = new Figure({ name: "test" });
    document.querySelector("main").append(figure.element);
    const ends = (height) => {
        figure.show([{ name: "", x: [0, 1e-4], y: [0, height], ink: 1 }], { x: { title: "Radius", unit: "m" }, y: { title: "Height", unit: "m" } });
        return figure.plan.vertical.ends[1];
    };
    const before = ends(8e-6);
    figure.hold(true);
    const held = [ends(2e-6), ends(2e-5), ends(8e-6)];
    figure.hold(false);
    const after = ends(2e-6);
    figure.element.remove();
    return [before, ...held, after];
}"""


def hold(page):
    """While a slider moves, the axes only grow."""
    before, smaller, larger, again, after = page.evaluate(HELD)
    assert before == smaller >= 8e-6 and larger == again >= 2e-5 and 2e-6 <= after < 4e-6, (before, smaller, larger, again, after)


def views(browser, base):
    key = ask(base, "/v1/jobs", ask(base, "/v1/examples/steel-ball-simplified"))["key"]
    page = browser.page(base)
    zoom(page, base, key)
    save(page, base, key)
    names(page, base, key)
    play(page)
    loop(page)
    section(page)
    explanations(page)
    on_screen(browser, page)
    hold(page)
    same_cycle(page, base, key)
    warnings(page, base)
    live(page, base)
    page.context.close()
    narrow = browser.page(base, width=390)
    open_result(narrow, base, key)
    names(narrow, base, key)
    on_screen(browser, narrow)
    narrow.context.close()
    printed(browser, base, key)
    papers(browser, base)
    smooth(browser, base)
