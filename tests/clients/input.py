"""Tests what the form does with input: nothing typed is lost, doubtful sizes are asked, wear coefficients have the unit in which people
write them, and dropped files are opened. Each from the first click to the number.

    python input.py http://127.0.0.1:8080
"""

import functools
import json
import pathlib
import re
import sys
import tempfile

from playwright.sync_api import expect

from browser import FIREFOX, ask, drag, drop, key_of, number, opened

BASE = sys.argv[1]
get = functools.partial(ask, BASE)
DEPTH = "#headline [data-value=wear_depth]"
KEPT = "#kept-input"


def form(page, address="/"):
    """Opens the form anew, and waits for its numbers."""
    page.goto(BASE + address)
    page.wait_for_selector(DEPTH)
    return page


def visit(page, link):
    """Follows a link of the top of the page."""
    page.get_by_role("navigation").get_by_role("link", name=link).click()
    expect(page.locator("nav [aria-current=page]")).to_have_text(link)
    page.wait_for_selector(DEPTH if link == "New run" else "h1")


def scenario(page):
    return json.loads(page.input_value("#json"))


def shows(page, **values):
    """The fields have these values, and the wear depth is that of the scenario."""
    for field, text in values.items():
        expect(page.locator(f"#{field.replace('__', '-')}")).to_have_value(text)
    expected = get("/v1/evaluate", {"scenario": scenario(page), "outputs": ["wear_depth"]})["outputs"]["wear_depth"] * 1e6
    page.wait_for_function("""([place, expected]) => Math.abs(parseFloat(document.querySelector(place)?.textContent) / expected - 1) < 0.01""", arg=[DEPTH, expected])


def leave_and_return(browser):
    """The library and a reload lose nothing. Undo goes on where it was, and brings back what was discarded."""
    page = form(browser.page(BASE))
    expect(page.locator(KEPT)).to_be_hidden()
    page.fill("#friction", "0,5")
    page.fill("#load-normal_force", "80")
    page.fill("#label", "Half typed")
    typed = {"friction": "0.5", "load__normal_force": "80 N", "label": "Half typed"}
    visit(page, "Library")
    visit(page, "New run")
    shows(page, **typed)
    expect(page.locator(KEPT)).to_contain_text("Your input is back: Half typed, ")
    page.reload()
    shows(page, **typed)
    browser.check_view(page, "input-back")
    page.focus("#label")
    for steps, changed in enumerate(({"label": ""}, {"load__normal_force": "100 N"}, {"friction": "0.7"})):
        page.keyboard.press("Control+z")
        for field, text in changed.items():
            if field != "label":
                expect(page.locator(f"#{field.replace('__', '-')}")).to_have_value(text)
        assert page.input_value("#label") != "Half typed", steps
    for _ in range(3):
        page.keyboard.press("Control+y")
    shows(page, **typed)
    page.get_by_role("button", name="Discard it").click()
    shows(page, friction="0.7", load__normal_force="100 N")
    expect(page.locator(KEPT)).to_be_hidden()
    visit(page, "Library")
    visit(page, "New run")
    shows(page, friction="0.7")
    expect(page.locator(KEPT)).to_be_hidden()
    # The same key as in the form, with the focus where the page has put it.
    page.focus("#undo")
    page.keyboard.press("Control+z")
    shows(page, **typed)
    # A kept run is no input that waits.
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    visit(page, "New run")
    shows(page, friction="0.7")
    expect(page.locator(KEPT)).to_be_hidden()
    page.context.close()


def two_tabs(browser):
    """Each tab has its own input. That of a closed tab is offered, and opening it loses nothing either."""
    first = form(browser.page(BASE))
    first.fill("#friction", "0.51")
    second = form(first.context.new_page())
    expect(second.locator("#friction")).to_have_value("0.7")
    expect(second.locator(KEPT)).to_be_hidden()
    second.fill("#friction", "0.52")
    for page, text in ((first, "0.51"), (second, "0.52")):
        page.reload()
        shows(page, friction=text)
    second.close(run_before_unload=True)
    first.wait_for_function("() => localStorage.getItem('fretwork-left-inputs')?.includes('0.52')")
    third = form(first.context.new_page())
    expect(third.locator("#friction")).to_have_value("0.7")
    expect(third.locator(KEPT)).to_contain_text("Earlier input is kept: ")
    third.fill("#friction", "0.53")
    third.get_by_role("button", name="Open it").click()
    shows(third, friction="0.52")
    expect(third.locator(KEPT)).to_contain_text("Your input is back: ")
    third.get_by_role("button", name="Discard it").click()
    shows(third, friction="0.7")
    # Now the one that was typed before is offered.
    third.get_by_role("button", name="Open it").click()
    shows(third, friction="0.53")
    third.get_by_role("button", name="Discard it").click()
    expect(third.locator(KEPT)).to_be_hidden()
    shows(first, friction="0.51")
    first.context.close()


def edit_another(browser):
    """A run that is edited does not replace the input of the form."""
    body = {"scenario": {**get("/v1/examples/steel-ball")["scenario"], "friction": 0.66}, "label": "Stored"}
    key = get("/v1/jobs", body)["key"]
    page = form(browser.page(BASE))
    page.fill("#friction", "0.54")
    page.goto(f"{BASE}/#/result/{key}")
    page.get_by_role("link", name="Edit and run again").click()
    expect(page.locator("#friction")).to_have_value("0.66")
    expect(page.locator(KEPT)).to_contain_text("Earlier input is kept: ")
    page.fill("#friction", "0.67")
    page.click("button.primary:enabled")
    page.wait_for_url(lambda address: "/#/result/" in address and key not in address)
    visit(page, "New run")
    expect(page.locator("#friction")).to_have_value("0.7")
    page.get_by_role("button", name="Open it").click()
    shows(page, friction="0.54")
    page.context.close()


def half_a_json(browser):
    """Text that is not yet JSON, and a study, are kept as they are typed."""
    page = form(browser.page(BASE))
    page.click("#friction-vary")
    page.fill("#friction-from", "0.31")
    page.fill("#friction-count", "")
    visit(page, "Library")
    page.get_by_role("link", name="New run").click()
    expect(page.locator("#friction-from")).to_have_value("0.31")
    expect(page.locator("#friction-count")).to_have_value("")
    page.click("#friction-vary")
    page.click("summary:has-text('as JSON')")
    page.fill("#json", '{ "friction": 0.6,')
    visit(page, "Library")
    page.get_by_role("link", name="New run").click()
    expect(page.locator("#json")).to_have_value('{ "friction": 0.6,')
    expect(page.locator("#json-fault")).to_contain_text("Invalid JSON: ")
    expect(page.locator("button.primary")).to_be_disabled()
    # JSON that the form cannot show is no error of the page, and changes no field.
    page.fill("#json", '{"motion": {"blocks": [null]}}')
    expect(page.locator("#json-fault")).to_contain_text("The form cannot show this.")
    expect(page.locator("#friction")).to_have_value("0.7")
    page.click("#undo")
    expect(page.locator("#json")).to_have_value('{ "friction": 0.6,')
    page.click("#undo")
    expect(page.locator("#json-fault")).to_have_text("")
    page.context.close()


def wear_coefficients(browser):
    """No example, no question and no fault has a wear coefficient in 1/Pa, unless the page shows SI units."""
    page = form(browser.page(BASE))
    fields = page.locator("input[id$=coefficient]")
    for name, shown in (("cylinder-on-flat", ["1.9e-5 mm³/(N m)", "2.9e-5 mm³/(N m)"]), ("measured-friction", ["2e-5 mm³/(N m)"])):
        page.select_option("#example", name)
        expect(page.locator("#json")).to_have_value(re.compile("1/Pa"))
        assert fields.evaluate_all("all => all.map((field) => field.value)") == shown, fields.evaluate_all("all => all.map((field) => field.value)")
    page.select_option("#units", "si")
    expect(page.locator("#wear-coefficient")).to_have_value("2e-14 1/Pa")
    page.select_option("#units", "engineering")
    page.click("#wear-coefficient-vary")
    expect(page.locator("#wear-coefficient-from")).to_have_value("1.6e-5")
    expect(page.locator(".range")).to_contain_text("mm³/(N m)")
    page.click("#wear-coefficient-vary")
    page.fill("#wear-coefficient", "3e-14 1/Pa")
    expect(page.locator("#wear-coefficient-note")).to_have_text("Read as 3e−5 mm³/(N m).")
    page.fill("#wear-coefficient", "-1e-5")
    expect(page.locator("#wear-coefficient-fault")).to_have_text("must be greater than 0, not −10⁻⁵ mm³/(N m).")
    page.context.close()


def doubts(browser):
    """A doubtful size blocks Save until it is answered, and the question is in sight."""
    page = form(browser.page(BASE, width=1280))
    question = "Wear coefficient k_w: 2e−14 mm³/(N m). Did you mean 2e−5 mm³/(N m) (2e−14 m³/(N m))?"
    keep, link = page.locator("button.primary"), page.get_by_role("button", name=question)
    page.fill("#wear-coefficient", "2e-14")
    page.locator("#friction").focus()
    expect(link).to_be_in_viewport()
    expect(page.locator(".estimate")).not_to_have_attribute("aria-busy", "true")
    expect(keep).to_be_disabled()
    browser.check_view(page, "input-doubt")
    # Neither the keyboard nor a return to the form passes the question by.
    page.keyboard.press("Control+Enter")
    expect(page.locator("#wear-coefficient")).to_be_focused()
    visit(page, "Library")
    visit(page, "New run")
    expect(keep).to_be_disabled()
    link.click()
    expect(page.locator("#wear-coefficient")).to_be_focused()
    page.get_by_role("button", name="2e−14 mm³/(N m) is right", exact=True).click()
    expect(keep).to_be_enabled()
    expect(link).to_have_count(0)
    page.fill("#wear-coefficient", "3e-14")
    expect(keep).to_be_disabled()
    page.get_by_role("button", name="Use 3e−5 mm³/(N m)", exact=True).click()
    expect(keep).to_be_enabled()
    shows(page, wear__coefficient="3e−5 mm³/(N m)")
    # Rows ask alike, and a field that disappears asks no more.
    page.select_option("#motion", "blocks")
    page.fill("#motion-blocks-1-amplitude", "2 m")
    expect(keep).to_be_disabled()
    page.get_by_role("button", name="Amplitude U, row 2: 2 m. Did you mean 2 µm?").click()
    expect(page.locator("#motion-blocks-1-amplitude")).to_be_focused()
    page.select_option("#motion", "amplitude")
    expect(keep).to_be_enabled()
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    assert abs(get(f"/v1/results/{key_of(page)}")["scenario"]["wear"]["coefficient"] / 3e-14 - 1) < 1e-9
    page.context.close()
    # On a phone the question stands above Save.
    page = form(browser.page(BASE, width=390))
    page.fill("#motion-amplitude", "2 m")
    expect(page.locator("#doubts button")).to_be_in_viewport()
    page.wait_for_function("""([field, line]) => document.querySelector(field).getBoundingClientRect().bottom <= document.querySelector(line).getBoundingClientRect().top""",
        arg=["#motion-amplitude-note", "#doubts"])
    browser.check_view(page, "input-doubt-phone")
    page.context.close()


def all_doubts(browser):
    """Every doubtful spelling and size blocks Save until it is answered, and no example is doubtful."""
    page = form(browser.page(BASE))
    keep, questions = page.locator("button.primary"), page.locator("#doubts button")
    for example in get("/v1/examples"):
        page.select_option("#example", example["name"])
        expect(keep).to_be_enabled()
        assert questions.count() == 0, (example["name"], questions.all_inner_texts())
    page.select_option("#example", "steel-ball")
    for field, text, question in (
        ("profile-radius", "10000", "10000 mm. Did you mean 10 mm (10000 µm)?"), ("profile-radius", "1,000", "Read as 1000 mm. Did you mean 1 mm?"),
        ("load-normal_force", "1.000", "Read as 1 N. Did you mean 1000 N?"), ("bodies-0-youngs_modulus", "205 MPa", "205 MPa. Did you mean 205 GPa?"),
        ("friction", "70", "70. Did you mean 0.7 (70 %)?"), ("motion-amplitude", "1,234", "Read as 1.234 µm. Did you mean 1234 µm?"),
        ("cycles", "1.000", "Read as 1. Did you mean 1000?"), ("cycles", "1,5", "Read as 1, 5. Did you mean 1.5?"),
    ):
        before = page.input_value(f"#{field}")
        page.fill(f"#{field}", text)
        expect(questions).to_have_count(1)
        expect(questions).to_contain_text(question)
        expect(keep).to_be_disabled()
        # Neither other fields that are drawn again, nor a reload, nor the way through the library passes the question by.
        page.select_option("#load-held", "depth")
        page.select_option("#friction-kind", "run_in")
        page.select_option("#friction-kind", "number")
        page.reload()
        visit(page, "Library")
        visit(page, "New run")
        expect(page.locator(f"#{field}")).to_have_value(text)
        expect(questions).to_contain_text(question)
        expect(keep).to_be_disabled()
        page.get_by_role("button", name=re.compile("is right$")).click()
        expect(keep).to_be_enabled()
        # An answer holds while the fields are drawn again.
        page.select_option("#friction-kind", "run_in")
        page.select_option("#friction-kind", "number")
        expect(questions).to_have_count(0)
        page.fill(f"#{field}", before)
        expect(keep).to_be_enabled()
    page.fill("#motion-amplitude", "1,235")
    page.get_by_role("button", name="Use 1235 µm", exact=True).click()
    shows(page, motion__amplitude="1235 µm")
    page.fill("#motion-amplitude", "2.256")
    # The ends of a range, but not those that the form suggests.
    page.click("#load-normal_force-vary")
    page.click("#motion-amplitude-vary")
    expect(page.locator("#motion-amplitude-from")).to_have_value("1.805")
    expect(keep).to_be_enabled()
    page.fill("#load-normal_force-to", "1.200")
    expect(questions).to_contain_text("Normal force F: to in N: Read as 1.2 N. Did you mean 1200 N?")
    expect(keep).to_be_disabled()
    page.fill("#load-normal_force-to", "120")
    expect(keep).to_be_enabled()
    page.context.close()


def dropped_scenario(browser):
    """A scenario, a job or a result that is dropped on the form fills it, and undo takes it back."""
    page = form(browser.page(BASE))
    page.fill("#friction", "0.55")
    own = {**get("/v1/examples/steel-ball")["scenario"], "friction": 0.33}
    drop(page, "form", ("mine.json", json.dumps(own)))
    shows(page, friction="0.33")
    expect(page.locator("#status")).to_have_text("The form shows mine.json. Undo brings back what it showed before.")
    page.focus("#friction")
    page.keyboard.press("Control+z")
    shows(page, friction="0.55")
    sweep = {"sweep": {"scenario": own, "vary": [{"pointer": "/friction", "from": 0.2, "to": 0.4, "count": 7}]}, "label": "Seven"}
    drop(page, "form", ("job.json", json.dumps(sweep)))
    expect(page.locator("#friction-count")).to_have_value("7")
    expect(page.locator("button.primary")).to_have_text("Compute 7 runs")
    expect(page.locator("#label")).to_have_value("Seven")
    drop(page, "form", ("broken.json", '{"friction": '))
    expect(page.locator("#json-fault")).to_contain_text("Invalid JSON: ")
    expect(page.locator("#json")).to_be_visible()
    page.context.close()


def dropped_measurements(browser):
    """Two measurements that are dropped on the form are asked one after the other, and the run that is kept shows both."""
    page = form(browser.page(BASE))
    files = [(f"{name}.csv", "N;V [um^3]\n" + "".join(f"{n};{rate * n:.6g}\n" for n in (1000, 10_000, 100_000))) for name, rate in (("rig 1", 4), ("rig 2", 5))]
    drop(page, ".maker", *files)
    for name in ("rig 1", "rig 2"):
        expect(page.locator("#set-name")).to_have_value(name)
        page.click("#add-set:enabled")
    expect(page.locator("#status")).to_have_text("The run that you save will show rig 2.")
    page.fill("#friction", "0.57")
    page.click("button.primary:enabled")
    page.wait_for_url("**/#/result/*")
    expect(page.locator("[data-set]")).to_have_count(2)
    page.locator(".measurements details:has(#differences)").evaluate("details => details.open = true")
    body = page.locator("#differences tbody", has=page.locator("strong:text('rig 2')"))
    expect(body.locator("tr")).to_have_count(4)
    volume = get(f"/v1/results/{key_of(page)}/history")["history"]["wear_volume"][-1]
    relative = body.locator("tr").last.locator("td").last.inner_text()
    assert abs(number(relative.replace("+", "")) - 100 * (5e-13 / volume - 1)) < 0.1, (relative, volume)
    # The next run of the form has none of them, unless the user wants it.
    visit(page, "New run")
    page.fill("#friction", "0.58")
    page.click("button.primary:enabled")
    page.wait_for_url("**/#/result/*")
    expect(page.locator("#other-sets")).to_contain_text("Measured for other runs: rig 1, rig 2.")
    page.context.close()


def menus(browser):
    """A menu that is changed and changed back gives back all numbers, choices and ranges of the fields that it hid."""
    page = form(browser.page(BASE))

    def there_and_back(menu, *others):
        before, option = scenario(page), page.input_value(f"#{menu}")
        for other in (*others, option):
            page.select_option(f"#{menu}", other)
        assert scenario(page) == before, (menu, before, scenario(page))

    for field, text in {"profile-radius": "12", "bodies-0-youngs_modulus": "69", "bodies-1-yield_strength": "800", "friction": "0.55",
                        "wear-coefficient": "2e-5", "wear-share": "0.4", "motion-amplitude": "3.5", "motion-rig_stiffness": "25", "model-points": "99",
                        "model-tolerance": "0.005"}.items():
        page.fill(f"#{field}", text)
    page.select_option("#load-held", "depth")
    there_and_back("shape", "cone", "punch")
    there_and_back("shape", "table")
    there_and_back("elasticity", "moduli")
    for wear in ("run_in", "hardness", "changing", "energy", "bodies"):
        there_and_back("wear", wear)
    there_and_back("friction-kind", "run_in", "changing")
    there_and_back("cycles-kind", "range")
    there_and_back("method", "simplified")
    for motion in ("stick_ratio", "tangential_force", "blocks", "reversals"):
        there_and_back("motion", motion)
    # What another menu had to leave comes back with it.
    page.select_option("#load", "indentation_depth")
    page.fill("#load-indentation_depth", "2.9")
    page.select_option("#method", "simplified")
    page.fill("#model-xi", "0.9")
    there_and_back("shape", "cylinder")
    there_and_back("load", "normal_force")
    expect(page.locator("#load-normal_force")).to_have_count(0)
    page.select_option("#wear", "bodies")
    page.select_option("#layers-1", "3")
    page.fill("#wear-bodies-0-layers-2-thickness", "7")
    there_and_back("layers-1", "1")
    there_and_back("wear", "coefficient")
    # A number that both options have is not an earlier one.
    page.select_option("#shape", "sphere")
    page.fill("#profile-radius", "13")
    page.select_option("#shape", "paraboloid")
    expect(page.locator("#profile-radius")).to_have_value("13 mm")
    # A range, and all of it after a reload.
    page.select_option("#load", "normal_force")
    page.click("#load-normal_force-vary")
    page.fill("#load-normal_force-from", "61")
    page.select_option("#load", "indentation_depth")
    page.reload()
    page.select_option("#load", "normal_force")
    expect(page.locator("#load-normal_force-from")).to_have_value("61")
    page.select_option("#example", "measured-friction")
    page.select_option("#friction-kind", "number")
    expect(page.locator("#friction")).to_have_value("0.7")
    page.context.close()


def drops(browser):
    """Files, a folder, a text and a link lead away from no view, replace nothing in silence, and go into the dialog that is open."""
    if FIREFOX:
        return
    page = form(browser.page(BASE))
    link = {"uri_list": "http://127.0.0.1:1/", "plain": "http://127.0.0.1:1/"}
    status, note = page.locator("#status"), page.locator("#note")
    with tempfile.TemporaryDirectory() as made:
        made = pathlib.Path(made)
        table, other, folder, mine = made / "rig.csv", made / "rig 2.csv", made / "folder", made / "mine.json"
        for path in (table, other):
            path.write_text("N;V [um^3]\n1000;4\n10000;40\n")
        mine.write_text(json.dumps({**get("/v1/examples/steel-ball")["scenario"], "friction": 0.33}))
        folder.mkdir()

        def stays(place, *drags):
            before = page.url.split("?")[0]
            for paths, texts in drags:
                drag(page, place, *paths, **texts)
                page.wait_for_timeout(100)
                assert page.url.split("?")[0] == before and len(page.context.pages) == 1, (place, paths, texts)

        page.fill("#friction", "0.56")
        stays("h1", ([folder], {}), ([], link), ([], {"plain": "42"}))
        expect(status).to_have_text("“folder” is a folder. Drop files.")
        stays("#label", ([], {"plain": "Dropped"}))
        expect(page.locator("#label")).to_have_value(re.compile("Dropped"))
        shows(page, friction="0.56")
        page.select_option("#motion", "blocks")
        stays(".rows", ([table, other], {}))
        expect(status).to_have_text("Drop one file here.")
        expect(page.locator("#motion-blocks-1-amplitude")).to_have_value("1 µm")
        page.select_option("#motion", "amplitude")
        # The dialog takes what is dropped on it, also a scenario, which is no measurement. The form behind it stays as it is.
        stays("h1", ([table], {}))
        expect(page.locator("#set-name")).to_have_value("rig")
        stays("dialog", ([table, other], {}))
        expect(page.locator("#file-fault")).to_have_text("Drop one file here.")
        stays("dialog", ([folder], {}))
        expect(page.locator("#file-fault")).to_have_text("“folder” is a folder. Drop files.")
        stays("dialog", ([mine], {}))
        expect(page.locator("#file-fault")).to_contain_text("This file cannot be read.")
        stays("dialog", ([table], {}))
        page.click("#add-set:enabled")
        expect(status).to_have_text("The run that you save will show rig.")
        shows(page, friction="0.56")
        page.click("button.primary:enabled")
        page.wait_for_url("**/#/result/*")
        page.click("summary:has-text('Download')")
        page.get_by_role("button", name="Note").click()
        note.fill("Half a sentence")
        stays("dialog label", ([table], {}), ([folder], {}), ([], link))
        expect(page.locator("dialog")).to_have_count(1)
        expect(note).to_have_value("Half a sentence")
        stays("#note", ([], {"plain": " and more"}), ([table], {}))
        expect(note).to_have_value(re.compile("and more"))
        page.get_by_role("button", name="Cancel").click()
        for name in ("Library", "Runs"):
            page.get_by_role("navigation").get_by_role("link", name=name).click()
            expect(page.locator("h1")).to_have_text(name)
            stays("h1", ([table], {}), ([table, other], {}), ([folder], {}), ([], {"plain": "42"}), ([], link))
            expect(status).to_have_text("Drop files on the form of a new run, or on a result.")
    page.context.close()


ALL = [leave_and_return, two_tabs, edit_another, half_a_json, menus, wear_coefficients, doubts, all_doubts, dropped_scenario, dropped_measurements, drops]


def main():
    with opened() as browser:
        # With names, only these.
        for test in [test for test in ALL if test.__name__ in sys.argv[2:]] or ALL:
            test(browser)
    print("the form keeps and questions its input as it should")


main()
