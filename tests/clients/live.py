"""Tests the live form: each from the first click to the number or the picture at the end.

    python live.py http://127.0.0.1:8080 [--short]
"""

import functools
import json
import re
import sys

from playwright.sync_api import expect

from browser import ask, blocks, ended, item, key_of, number, opened, value

BASE = sys.argv[1]
get = functools.partial(ask, BASE)
DEPTH = "#headline [data-value=wear_depth]"


def first_page(browser, width=1440):
    page = browser.page(BASE, width=width)
    page.goto(BASE + "/")
    page.wait_for_selector(DEPTH)
    settled(page)
    return page


def settled(page):
    """Waits until the form has been checked and shows what it says."""
    expect(page.locator(".estimate")).not_to_have_attribute("aria-busy", "true")
    expect(page.locator("#computing")).to_have_text("")


def scenario(page):
    return json.loads(page.input_value("#json"))


def curve(page, figure="Profiles"):
    """The drawn curves of a figure."""
    return page.locator(f".preview section[aria-label='{figure}'] svg.drawing").inner_html()


def evaluated(page, **changed):
    """The wear depth in micrometres that the server computes for the scenario of the form."""
    body = {"scenario": {**scenario(page), **changed}, "outputs": ["wear_depth"]}
    return get("/v1/evaluate", body)["outputs"]["wear_depth"] * 1e6


def shows(page, expected, unit="µm"):
    """The page shows a wear depth to three digits. The figures have other output cycles than the job, so the last may differ."""
    page.wait_for_function("""([place, expected]) => {
        const shown = parseFloat(document.querySelector(place)?.textContent.replace("\\u202f", ""));
        return Math.abs(shown / expected - 1) < 0.01;
    }""", arg=[DEPTH, expected])
    assert page.locator(DEPTH).inner_text().endswith(unit), page.locator(DEPTH).inner_text()


def first_load(browser):
    """The first load is at most 250 kB, from this server only, under a strict policy."""
    page = browser.page(BASE)
    responses = []
    page.on("response", lambda response: responses.append(response))
    page.goto(BASE + "/")
    page.wait_for_load_state("networkidle")
    total = sum(int(response.headers.get("content-length", 0)) for response in responses)
    assert len(responses) > 10 and total < 250_000, total
    policy = responses[0].headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy, policy
    page.context.close()


def spoken_depth(browser):
    """A screen reader is told the depth when it stays."""
    page = first_page(browser)
    page.fill("#friction", "0.5")
    depth = evaluated(page)
    page.wait_for_function("""depth => {
        const [words, shown] = document.querySelector("#spoken").textContent.split(": ");
        return words.startsWith("Largest wear depth") && Math.abs(parseFloat(shown) / depth - 1) < 0.01;
    }""", arg=depth)
    page.context.close()


def type_a_radius(browser):
    """The curve changes without a click. Everything stands above the fold of a small screen, and Save is near."""
    page = first_page(browser)
    page.set_viewport_size({"width": 1280, "height": 720})
    page.wait_for_function("[...document.querySelectorAll('.figures .card')].every(card => card.getBoundingClientRect().bottom <= innerHeight)")
    expect(page.locator(".figures .card >> visible=true")).to_have_count(5)
    assert scenario(page)["load"] == {"normal_force": "100 N", "held": "force"}
    before = curve(page)
    page.fill("#profile-radius", "20")
    shows(page, evaluated(page))
    assert curve(page) != before and scenario(page)["profile"]["radius"] == "20 mm"
    expect(page.locator("button.primary")).to_have_count(1)
    page.context.close()


def units(browser):
    """A number has the unit of its field. What is doubtful is asked, and one click takes the answer."""
    page = first_page(browser)
    page.fill("#motion-amplitude", "2")
    expect(page.locator("#motion-amplitude-note")).to_have_text("Read as 2 µm.")
    assert scenario(page)["motion"]["amplitude"] == "2 um"
    shows(page, evaluated(page, motion={"amplitude": 2e-6}))
    page.fill("#motion-amplitude", "2 m")
    expect(page.locator("#motion-amplitude-note")).to_contain_text("2 m. Did you mean 2 µm?")
    browser.check_accessibility(page, "doubt")
    page.get_by_role("button", name="Use 2 µm").click()
    expect(page.locator("#motion-amplitude")).to_have_value("2 µm")
    shows(page, evaluated(page, motion={"amplitude": 2e-6}))
    page.fill("#friction", "0,7")
    assert scenario(page)["friction"] == 0.7
    page.fill("#wear-coefficient", "3.03×10⁻⁵ mm³/Nm")
    shows(page, evaluated(page, wear={"coefficient": 3.03e-14}))
    page.fill("#cycles", "1 000, 100 000")
    assert scenario(page)["cycles"] == [1000, 100000]
    page.fill("#load-normal_force", "1,000")
    expect(page.locator("#load-normal_force-note")).to_contain_text("Read as 1000 N. Did you mean 1 N?")
    # A scenario of the API is in SI. The fields show their own units.
    page.goto(BASE + "/#/queue")
    page.goto(f"{BASE}/#/new?scenario={json.dumps({**get('/v1/examples/steel-ball')['scenario'], 'motion': {'amplitude': 2e-6}})}")
    expect(page.locator("#motion-amplitude")).to_have_value("2 µm")
    assert scenario(page)["motion"]["amplitude"] == 2e-6
    # A number without a unit follows the units that the page shows.
    page.select_option("#units", "si")
    page.fill("#profile-radius", "0.02")
    expect(page.locator("#profile-radius-note")).to_have_text("Read as 0.02 m.")
    assert scenario(page)["profile"]["radius"] == "0.02 m"
    page.select_option("#units", "engineering")
    shows(page, evaluated(page, profile={"shape": "paraboloid", "radius": 0.02}))
    page.context.close()


def drag_friction(browser):
    """The slider of the friction moves the curves while it is dragged."""
    page = first_page(browser)
    slide = page.locator(".value:has(#friction) .slide")
    slide.scroll_into_view_if_needed()
    box = slide.bounding_box()
    middle, left = box["y"] + box["height"] / 2, box["x"] + 8
    page.mouse.move(left, middle)
    page.mouse.down()
    seen = set()
    for step in range(1, 9):
        before = curve(page)
        page.mouse.move(left + step * (box["width"] - 16) / 8, middle)
        page.wait_for_function("([place, before]) => document.querySelector(place).innerHTML !== before",
            arg=[".preview section[aria-label=Profiles] svg.drawing", before])
        seen.add(page.input_value("#friction"))
    page.mouse.up()
    assert len(seen) == 8 and max(map(float, seen)) == 1.5, seen
    shows(page, evaluated(page))
    # One undo takes the whole drag back.
    page.keyboard.press("Control+z")
    expect(page.locator("#friction")).to_have_value("0.7")
    shows(page, evaluated(page))
    page.context.close()


def slider_follows_typing(browser):
    """After a number is typed digit by digit, the handle stands in the middle of a range around it."""
    page = first_page(browser)
    page.focus("#load-normal_force")
    page.keyboard.press("Control+a")
    page.keyboard.type("120")
    page.wait_for_function("() => Math.abs(document.querySelector('.value:has(#load-normal_force) .slide').value - 200) <= 1")
    page.keyboard.press("ArrowUp")
    assert 120 < number(page.input_value("#load-normal_force")) < 130, page.input_value("#load-normal_force")
    page.context.close()


TRACE = "x [mm];z [µm]\n" + "\n".join(f"{x / 100 + 1.234:.3f};{x * x / 200 + x / 2:.3f}".replace(".", ",") for x in range(-40, 41))


def paste_a_trace(browser):
    """A two-sided trace with decimal commas, off the middle and tilted, is pasted. It is a ball of 10 mm."""
    page = first_page(browser)
    ball = evaluated(page)
    page.select_option("#shape", "table")
    page.evaluate("text => navigator.clipboard.writeText(text)", TRACE)
    page.focus("#trace")
    page.keyboard.press("Control+v")
    for said in ("81 points", "800 µm wide", "A tilt of 2.9 deg was removed", "R = 10 mm"):
        expect(page.locator("#trace-says")).to_contain_text(said)
    shows(page, evaluated(page))
    profile = scenario(page)["profile"]
    assert abs(profile["radius"][-1] - 0.4e-3) < 2e-5 and abs(profile["height"][-1] / profile["radius"][-1] ** 2 * 0.02 - 1) < 0.01, profile
    assert abs(evaluated(page) / ball - 1) < 0.02, (evaluated(page), ball)
    # With a given axis, too, each side alone is that ball.
    page.select_option("#trace-axis", "middle")
    page.select_option("#trace-sides", "left")
    expect(page.locator("#trace-says")).to_contain_text("A tilt of 2.9 deg was removed. The best ball has R = 10 mm.")
    page.fill("#trace", "no numbers")
    expect(page.locator("#trace-says")).to_contain_text("The form still uses the trace that was read before.")
    settled(page)
    browser.check_accessibility(page, "trace")
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    assert get(f"/v1/results/{key_of(page)}")["scenario"]["profile"]["shape"] == "table"
    page.context.close()


def edit_rows(browser):
    """Blocks are pasted from a spreadsheet, typed, added and removed. One undo takes a paste back."""
    page = first_page(browser)
    page.select_option("#motion", "blocks")
    page.fill("#motion-blocks-1-amplitude", "2,5")
    assert scenario(page)["motion"]["blocks"][1] == {"amplitude": "2.5 um", "cycles": 50000}
    before = scenario(page)
    page.evaluate("text => navigator.clipboard.writeText(text)", "1,5\t40 000\n2\t50000\n2,2 µm\t30000\n")
    page.focus("#motion-blocks-0-amplitude")
    page.keyboard.press("Control+v")
    expect(page.locator("#motion-blocks-2-amplitude")).to_have_value("2.2 µm")
    assert [block["cycles"] for block in scenario(page)["motion"]["blocks"]] == [40000, 50000, 30000]
    shows(page, evaluated(page))
    page.keyboard.press("Control+z")
    expect(page.locator("#motion-blocks-2-amplitude")).to_have_count(0)
    assert scenario(page) == before
    page.fill("#motion-blocks-0-cycles", "many")
    expect(page.locator("#motion-blocks-0-cycles-fault")).to_have_text("Enter a number.")
    expect(page.locator("button.primary")).to_be_disabled()
    page.click("#undo")
    page.get_by_role("button", name="Remove row 1").click()
    assert len(scenario(page)["motion"]["blocks"]) == 1
    page.select_option("#motion", "amplitude")
    page.select_option("#friction-kind", "changing")
    page.fill("#friction-values-1", "0,8")
    assert scenario(page)["friction"] == {"over": "cycles", "at": [0, 10000], "values": [0.3, 0.8]}
    shows(page, evaluated(page))
    browser.check_accessibility(page, "rows")
    page.context.close()


def long_run(browser):
    """What takes too long for an evaluation runs as a job by itself. Its curves appear before its end."""
    page = first_page(browser)
    page.click("summary:has-text('as JSON')")
    page.fill("#json", json.dumps({**blocks(20_000), "friction": 0.71}))
    expect(page.locator("#computing")).to_contain_text("Computing as a job")
    page.wait_for_selector(".figures.rows section[aria-label=Depth] svg.drawing path")
    depth = page.locator(DEPTH)
    page.wait_for_function("place => parseFloat(document.querySelector(place)?.textContent) > 1", arg=DEPTH)
    expect(page.locator("#computing")).to_contain_text("Computing as a job")
    assert number(depth.inner_text()) > 1
    drafts = get("/v1/jobs?tag=draft&state=running")["jobs"]
    assert len(drafts) == 1, drafts
    queue = page.context.new_page()
    queue.goto(BASE + "/#/queue")
    expect(queue.locator(f"tr:has([data-name='{drafts[0]['id']}'])")).to_contain_text("draft")
    queue.close()
    # The job of a form that has changed is canceled.
    page.fill("#json", json.dumps(get("/v1/examples/steel-ball")["scenario"]))
    shows(page, evaluated(page))
    assert ended(BASE, drafts[0]["id"])["state"] == "canceled"
    page.context.close()


def keep_and_reopen(browser):
    """A kept job opens in the form with nothing else changed, alone and changed, and from the shared address."""
    page = first_page(browser)
    page.fill("#motion-amplitude", "1,9")
    page.fill("#label", "Kept & reopened")
    settled(page)
    typed = scenario(page)
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    expect(page.locator("#result-label")).to_have_text("Kept & reopened")
    key = key_of(page)
    page.get_by_role("link", name="Edit and run again").click()
    page.wait_for_selector(DEPTH)
    settled(page)
    assert scenario(page) == typed
    expect(page.locator("#label")).to_have_value("Kept & reopened")
    expect(page.locator("#motion-amplitude")).to_have_value("1.9 µm")
    expect(item(page, "cached")).to_have_text("Yes")
    page.fill("#friction", "0.61")
    assert scenario(page) == {**typed, "friction": 0.61}
    settled(page)
    other = browser.page(BASE)
    other.goto(page.url)
    other.wait_for_selector(DEPTH)
    assert scenario(other) == {**typed, "friction": 0.61} and other.input_value("#label") == "Kept & reopened"
    other.context.close()
    page.click("button.primary")
    page.wait_for_url(lambda address: "result" in address and key not in address)
    page.context.close()


def faults(browser):
    """Faults say what to do at their fields. Invalid JSON disables Save and says where the fault is."""
    page = first_page(browser)
    for field, name, text, said in (("profile-radius", "Radius R", "", "Enter the radius."),
            ("cycles", "Cycles, separated by commas", "1, 0", "Cycles must increase: 0 comes after 1."),
            ("motion-amplitude", "Amplitude U", "plenty", "does not begin with a number"),
            # The amplitude is mistyped, not the cycles.
            ("motion-amplitude", "Amplitude U", "2 m", "would make the scar wider")):
        page.fill(f"#{field}", text)
        expect(page.locator(f"#{field}-fault")).to_contain_text(said)
        expect(page.locator(".estimate h2")).to_have_text(f"1 field needs correction: {name}")
        page.focus("#label")
        # A later answer of the server would replace the button.
        expect(page.locator(".estimate")).not_to_have_attribute("aria-busy", "true")
        expect(page.locator("#computing")).to_contain_text("The numbers belong to the last valid input")
        page.locator("#computing").get_by_role("button", name=name).click()
        expect(page.locator(f"#{field}")).to_be_focused()
        expect(page.locator("button.primary")).to_be_disabled()
        page.keyboard.press("Control+z")
        expect(page.locator(f"#{field}-fault")).to_have_text("")
    # The numbers of a refused input belong to the input before it.
    page.fill("#load-normal_force", "2")
    shows(page, evaluated(page))
    page.fill("#load-normal_force", "2 apples")
    expect(page.locator("#computing")).to_contain_text("last valid input: Normal force F = 2\u00a0N.")
    page.keyboard.press("Control+z")
    settled(page)
    page.click("summary:has-text('as JSON')")
    page.fill("#json", '{\n  "friction": 0.6,\n  "wear" 3\n}')
    expect(page.locator("#json-fault")).to_contain_text(re.compile("line 3", re.I))
    expect(page.locator("button.primary")).to_be_disabled()
    page.context.close()


def slips_in_all_cycles(page):
    """The form finds the least amplitude at which the contact slips in all cycles: a little below it, some cycle has a stick zone."""
    page.get_by_role("button", name="Find the amplitude that slips in all cycles").click()
    expect(page.locator("#slips")).to_contain_text("cycles slip from", timeout=60_000)
    found = value(page.locator("#slips").inner_text().split("slip from")[1].strip())
    for share, sticks in ((0.99, True), (1.01, False)):
        asked = {**scenario(page), "cycles": {"from": 100, "to": 100_000, "count": 60, "spacing": "log"}, "motion": {"amplitude": found * share}, "profiles_at": "none"}
        radii = get("/v1/evaluate", {"scenario": asked, "parts": ["history"]})["history"]["stick_radius"]
        assert any(radius > 0 for radius in radii) == sticks, (found, share)
    # Another amplitude has another scar, and the same answer must be asked for again.
    page.fill("#motion-amplitude", "4.1")
    expect(page.locator("#slips")).to_have_text("")
    page.fill("#motion-amplitude", "4")
    settled(page)


def errors_and_warnings(browser):
    """The error of a number says what it contains and what changes it. A warning leads to the field that it is about."""
    page = first_page(browser)
    volume = page.locator("#headline > div", has_text="Wear volume")
    expect(volume.locator(".errors .term")).to_have_text(re.compile("^numerical error [0-9.]+\u00a0%; errors of the theory are not included$"))
    page.locator("#friction").focus()
    volume.locator(".errors .term").focus()
    expect(volume.locator(".errors [role=tooltip]")).to_be_visible()
    expect(volume.locator(".errors [role=tooltip]")).to_contain_text("A smaller tolerance makes it smaller.")
    before = volume.locator("[data-error]").inner_text()
    volume.locator(".errors .term").press("Enter")
    expect(page.locator("#model-tolerance")).to_be_focused()
    page.keyboard.type("0.0003")
    expect(volume.locator("[data-error]")).not_to_have_text(before)
    # The regime is that of the output cycle, and both thresholds stand beside it: of the unworn and of the worn contact.
    expect(page.locator("#headline [data-value=regime]")).to_have_text("Partial slip")
    threshold = get("/v1/scenarios", {"scenario": scenario(page)})["unworn"]["gross_slip_amplitude"] * 1e6
    expect(page.locator("#headline > :last-child")).to_contain_text(f"= {threshold:.3g}\u00a0µm unworn")
    page.fill("#model-tolerance", "")
    for amplitude, regime in (("2.9", "Partial slip"), ("3.2", "Partial slip"), ("4", "Gross slip")):
        page.fill("#motion-amplitude", amplitude)
        shows(page, evaluated(page))
        settled(page)
        expect(page.locator("#headline [data-value=regime]")).to_have_text(regime)
        now = number(page.locator("#headline [data-value=threshold]").inner_text())
        assert (now > float(amplitude)) == (regime == "Partial slip"), (amplitude, now)
    expect(page.locator("#headline > :last-child")).to_contain_text("with this scar")
    slips_in_all_cycles(page)
    page.fill("#load-normal_force", "20 kN")
    warning = page.locator("#warning-normal_force")
    expect(warning).to_contain_text("A body with a yield strength below 4.93\u00a0GPa yields")
    browser.check_accessibility(page, "warning")
    warning.get_by_role("button", name="Body 1: yield strength").click()
    expect(page.locator("#bodies-0-yield_strength")).to_be_focused()
    page.keyboard.type("500")
    expect(warning).to_contain_text("exceeds the yield strength of the first body (500 MPa)")
    # It says how far the numbers may be wrong, and does not ask for another load.
    expect(warning).to_contain_text(re.compile("the unworn contact is larger than computed, its area at most by a factor of about [0-9.]+\\."))
    page.fill("#bodies-1-yield_strength", "500")
    expect(warning.get_by_role("button")).to_have_count(0)
    page.fill("#load-normal_force", "100 kN")
    expect(page.locator("#warning-contact_radius")).to_contain_text("has the slope 0.19 at the edge of contact")
    expect(page.locator("#warning-contact_radius")).to_contain_text("the square of the slope, 4\u00a0%")
    # Neither names of the API nor powers of ten stand in a warning.
    page.fill("#load-normal_force", "100 N")
    page.fill("#cycles", "100")
    page.fill("#motion-amplitude", "200 µm")
    sliding = page.locator("#warning-regime")
    expect(sliding).to_contain_text(re.compile("The amplitude at the contact, 200\u00a0µm, is larger than the contact radius, [0-9.]+\u00a0µm.*By how much is not known"))
    page.context.close()


def published_test(browser):
    """No number of a test that finite elements confirm has a warning: what they do not confirm stands at the bodies. Early cycles have one."""
    page = first_page(browser)
    page.select_option("#example", "cylinder-on-flat")
    shows(page, evaluated(page))
    settled(page)
    expect(page.locator(".mark, .warning >> visible=true")).to_have_count(0)
    page.fill("#cycles", "20, 18000")
    expect(page.locator(".estimate .warning")).to_contain_text(re.compile("in about 43 cycles.*about one cycle: 5\u00a0% after 20 cycles"))
    page.fill("#cycles", "1000, 5000, 10000, 18000")
    settled(page)
    page.click("button.primary:enabled")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("#headline dd")
    expect(page.locator(".mark, .warning >> visible=true")).to_have_count(0)
    bodies = page.locator(".cards section", has_text="Wear of each body")
    expect(bodies).to_contain_text("up to 26\u00a0% longer than the contact")
    expect(bodies).to_contain_text("The wear of both bodies together is not concerned.")
    page.context.close()


def figure_3(browser):
    """The example of Figure 3 says why its stick ratio is not the printed one, and opens the printed one."""
    page = first_page(browser)
    page.select_option("#example", "paper-figure-3")
    about = page.locator("#about-example")
    expect(about).to_contain_text("The paper prints c\u00a0=\u00a00.455\u00a0a₀")
    browser.check_view(page, "figure-3")
    about.get_by_role("button", name="Open the printed values").click()
    expect(page.locator("#motion-stick_ratio")).to_have_value("0.455")
    expect(about).to_contain_text("would give 0.605 and 0.220\u00a0a₀")
    assert scenario(page)["cycles"]["normalized"] == [2, 8, 18, 32, 72]
    about.get_by_role("button", name="Open c").click()
    expect(page.locator("#motion-stick_ratio")).to_have_value("0.545")
    page.fill("#motion-stick_ratio", "0.5")
    expect(about).to_be_empty()
    # One click saves both, and shows their profiles in one figure.
    page.select_option("#example", "paper-figure-3")
    about.get_by_role("button", name="Compare both").click()
    expect(page.locator("#compared")).to_contain_text("Stick ratio")
    assert page.locator("#compared .group + tr td").all_inner_texts()[:2] == ["0.545", "0.455"]
    expect(page.locator("section[aria-label=Profiles] .curve")).to_have_count(2)
    page.locator("#compared .name").first.click()
    expect(page.locator("#about-example")).to_contain_text("counts a slip path of U")
    profiles = page.locator("section[aria-label=Profiles] .drawing")
    expect(profiles).to_contain_text("Limit")
    page.click("#profile-menu summary")
    page.get_by_label("Limit", exact=True).uncheck()
    expect(profiles).not_to_contain_text("Limit")
    page.context.close()


def meanings(browser):
    """A dialog says what each number of the form is, in the words of the form."""
    page = first_page(browser)
    page.get_by_role("button", name="What these numbers mean").click()
    dialog = page.locator("dialog")
    expect(dialog.locator("dt", has_text="Amplitude U")).to_be_visible()
    expect(dialog).to_contain_text("half of the peak-to-peak stroke")
    expect(dialog).to_contain_text("The numbers of cycles after which the result has numbers and curves.")
    assert not re.search(r"curl|`|_[a-z]{3}", dialog.inner_text()), dialog.inner_text()
    browser.check_accessibility(page, "meanings")
    dialog.get_by_role("button", name="Close").click()
    expect(dialog).to_have_count(0)
    page.context.close()


def phone(browser):
    """The numbers and the profile stay above the field that is typed, and Save covers no field that has the focus."""
    page = first_page(browser, width=390)
    for field in ("#friction", "#model-points"):
        page.focus(field)
        # The browser scrolls smoothly.
        page.wait_for_function("""places => {
            const [depth, profile, field, keep] = places.map((place) => document.querySelector(place).getBoundingClientRect());
            return depth.top > 0 && depth.bottom < profile.bottom && profile.bottom < field.top && field.bottom < keep.top;
        }""", arg=[DEPTH, ".profile svg.drawing", field, "button.primary"])
    page.context.close()


def groups(browser):
    """A group of fields can be closed, stays so, and opens for a field that needs correction."""
    page = first_page(browser)
    group = page.locator("details.group[aria-label='Load and motion']")
    group.locator("summary").press("Enter")
    expect(page.locator("#motion-amplitude")).to_be_hidden()
    page.select_option("#shape", "cone")
    page.select_option("#shape", "paraboloid")
    expect(page.locator("#motion-amplitude")).to_be_hidden()
    group.locator("summary").press("Enter")
    page.fill("#motion-amplitude", "-1")
    expect(page.locator("#motion-amplitude-fault")).to_contain_text("greater than 0")
    group.locator("summary").press("Enter")
    page.locator("#computing").get_by_role("button", name="Amplitude U").click()
    expect(page.locator("#motion-amplitude")).to_be_focused()
    browser.check_accessibility(page, "groups")
    page.context.close()


def enlarged(browser):
    """At 200 % zoom, the depth stays in sight of the field that has the focus, and covers none."""
    page = first_page(browser, width=720)
    page.emulate_media(reduced_motion="reduce")
    page.focus("#shape")
    for _ in range(30):
        page.keyboard.press("Tab")
        field, top, depth = page.evaluate("""() => {
            const box = (element) => element.getBoundingClientRect();
            return [document.activeElement.id, box(document.activeElement).top, box(document.querySelector("#headline dd"))].map((part) => part.bottom ?? part);
        }""")
        assert 0 < depth <= top, (field, depth, top)
    page.context.close()


def keyboard(browser):
    """Without a mouse: reach Save in less than 15 steps, change numbers, undo, name, save."""
    page = first_page(browser)
    page.focus("body")
    for steps in range(1, 15):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.matches('button.primary')"):
            break
    assert page.evaluate("document.activeElement.matches('button.primary')") and steps < 15, steps
    # A link skips the bar, and Escape ends the zoom of a figure.
    page.get_by_role("link", name="Skip to the fields").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#shape")).to_be_focused()
    reset = page.locator("section[aria-label=Depth]").get_by_role("button", name="Reset", include_hidden=True)
    page.locator("section[aria-label=Depth] .canvas").focus()
    page.keyboard.press("+")
    expect(reset).to_be_enabled()
    page.keyboard.press("Escape")
    expect(reset).to_be_disabled()
    page.focus("#friction")
    before = curve(page)
    for _ in range(3):
        page.keyboard.press("ArrowUp")
    assert float(page.input_value("#friction")) > 0.7, page.input_value("#friction")
    shows(page, evaluated(page))
    assert curve(page) != before
    page.keyboard.press("Control+z")
    expect(page.locator("#friction")).to_have_value("0.7")
    page.keyboard.press("Control+a")
    page.keyboard.type("0,62")
    settled(page)
    # Enter in a field does not keep the run.
    page.keyboard.press("Enter")
    settled(page)
    assert "#/new" in page.url, page.url
    # Ctrl+Enter keeps it, also if no field has the focus.
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Control+Enter")
    page.wait_for_url("**/#/result/*")
    assert get(f"/v1/results/{key_of(page)}")["scenario"]["friction"] == 0.62
    page.context.close()


# What differs most between browsers: events of the keyboard and of the pointer, the clipboard, and the storage of a page.
SHORT = [type_a_radius, drag_friction, keep_and_reopen, keyboard]
ALL = [first_load, spoken_depth, type_a_radius, units, drag_friction, slider_follows_typing, paste_a_trace, edit_rows, long_run, keep_and_reopen, faults,
    errors_and_warnings, published_test, figure_3, meanings, phone, groups, enlarged, keyboard]


def main():
    with opened() as browser:
        for test in SHORT if "--short" in sys.argv else ALL:
            test(browser)
    print("the live form passes its tests")


main()
