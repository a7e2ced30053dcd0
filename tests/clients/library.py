"""Tests the library and the list of runs: search, order, columns, keyboard, and the actions on selected rows."""

import csv
import re
import urllib.parse

from playwright.sync_api import expect

from browser import LOOKS, ask, downloaded, value

TAG = "shelf"


def names(page):
    return page.locator(".entry th a")


def listed(base, **words):
    return ask(base, "/v1/results?" + urllib.parse.urlencode({"limit": 1000, **words}))["results"]


def fill_shelf(base):
    """Runs with labels and a tag, and a study."""
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    scenario["model"] = {"method": "simplified", "points": 16}
    for i in range(12):
        own = {**scenario, "motion": {"amplitude": f"{2 + i / 7:.3f} um"}, "friction": 0.71 + (5 * i % 12) / 1000}
        ask(base, "/v1/jobs", {"scenario": own, "label": f"Sample {i}, {'Zebra' if i == 7 else 'horse'}", "tags": [TAG]})
    study = {"sweep": {"scenario": scenario, "vary": [{"pointer": "/friction", "from": 0.71, "to": 0.72}], "design": "latin_hypercube", "samples": 4, "outputs": ["wear_depth"]}}
    ask(base, "/v1/jobs", {**study, "label": "Study of horses", "tags": [TAG]})


def pictures(page, base):
    """A run has a picture of its profiles, and a study one of its points."""
    page.goto(f"{base}/#/library?q={TAG}")
    study = page.locator(".entry", has_text="Study of horses")
    expect(study.locator(".thumbnail path").last).to_have_attribute("d", re.compile("^(M[^M]+h0){4}$"))
    expect(page.locator(".entry", has_text="Sample 11,").locator(".thumbnail path")).to_have_count(2)


def same_names(page, base):
    """Automatic names contain what differs, if they would be equal."""
    scenario = {**ask(base, "/v1/examples/steel-ball-simplified")["scenario"], "friction": 0.7317}
    for number in ("2e-5", "4e-5"):
        ask(base, "/v1/jobs", {"scenario": {**scenario, "wear": {"coefficient": f"{number} mm^3/(N m)"}}, "tags": ["twins"]})
    page.goto(f"{base}/#/library?q=twins")
    ends = [re.compile(f"^Paraboloid.* μ\u00a0=\u00a00.7317, k_w\u00a0=\u00a0{number}×10⁻⁵\u00a0mm³/\\(N\u00a0m\\)$") for number in (4, 2)]
    expect(names(page)).to_have_text(ends)


def search(page, base):
    """A run is found by words of its label and tag, in any case. The address keeps the words."""
    page.goto(base + "/#/library")
    page.fill("#find-q", "SHELF zebra")
    expect(names(page)).to_have_text(["Sample 7, Zebra"])
    expect(page.locator("#total")).to_have_text("1 result")
    page.reload()
    expect(names(page)).to_have_text(["Sample 7, Zebra"])
    page.fill("#find-q", "shelf giraffe")
    expect(page.locator(".empty")).to_contain_text("No match")
    page.click("#clear-filters")
    expect(page.locator("#find-q")).to_have_value("")
    expect(page.locator("#clear-filters")).to_be_hidden()
    page.fill("#find-q", "shelf")
    expect(page.locator("#total")).to_have_text("13 results")
    # The address of earlier versions opens the list of runs, which has the same search.
    page.goto(base + "/#/queue?q=zebra+shelf")
    expect(page.locator("h1")).to_have_text("Runs")
    expect(page.locator("nav [aria-current=page]")).to_have_text("Runs")
    expect(page.locator(".jobs tbody tr")).to_have_count(1)
    # The CSV has the runs that are shown.
    page.fill("#find-runs", TAG)
    expect(page.locator(".jobs tbody tr")).to_have_count(13)
    shown = page.locator(".jobs tbody th a").all_inner_texts()
    rows = csv.DictReader(downloaded(page, page.get_by_role("button", name="CSV of all found").click).decode().splitlines())
    assert [row["label"] for row in rows] == shown, shown
    page.get_by_label("Of all users").uncheck()
    expect(page.locator(".jobs tbody tr")).to_have_count(13)
    units = {text.split("\u00a0")[1] for text in page.locator(".jobs td:nth-child(5)").all_inner_texts() if "\u00a0" in text}
    assert len(units) == 1, units
    page.get_by_role("link", name="Sample 7, Zebra").click()
    page.wait_for_selector("#headline dd")


def sort(page, base):
    """A click on a heading sorts by this number, and the next click turns the order. The address keeps it."""
    page.goto(base + f"/#/library?q={TAG}&kind=run")
    expect(names(page)).to_have_count(12)
    heading = page.get_by_role("columnheader", name="Wear depth")
    for order, words in (("descending", "-wear_depth"), ("ascending", "wear_depth")):
        heading.get_by_role("button").press("Enter")
        expect(heading).to_have_attribute("aria-sort", order)
        expected = [entry["label"] for entry in listed(base, q=TAG, kind="run", sort=words)]
        expect(names(page)).to_have_text(expected)
        assert f"sort={words}" in page.url, page.url
        place = page.locator(".library thead :is(th, td)").all_inner_texts().index("Wear depth")
        depths = [value(text) for text in page.locator(f".entry > :nth-child({place + 1})").all_inner_texts()]
        assert depths == sorted(depths, reverse=order == "descending"), depths
        # The heading keeps the focus.
        assert page.evaluate("document.activeElement.dataset.sort") == "wear_depth"
    page.reload()
    expect(names(page)).to_have_text(expected)


def whole_texts(page, base):
    """No number of the usual columns is cut, nor a tag or a date, and all columns fit on a usual screen."""
    page.set_viewport_size({"width": 1280, "height": 720})
    page.goto(base + "/#/library")
    expect(names(page).first).to_be_visible()
    # A wide date, whatever today is.
    page.locator(".library tbody time").evaluate_all("times => times.forEach((time) => { time.textContent = 'May 28, 2026, 10:28 AM'; })")
    cut = page.locator(".library tbody td:is(.number, .tags, .created)").evaluate_all("cells => cells.filter((cell) => cell.scrollWidth > cell.clientWidth).map((cell) => cell.innerText)")
    assert not cut, cut
    assert page.evaluate("(({ scrollWidth, clientWidth }) => scrollWidth <= clientWidth)(document.querySelector('.results'))")
    page.set_viewport_size({"width": 1440, "height": 900})
    page.click("summary:has-text('Filters')")
    assert "Sweep or random sample" in page.locator("#find-kind").inner_text()


def columns(page):
    """Columns are chosen in a menu. The address and the next visit keep them."""
    expect(page.get_by_role("columnheader", name="Scar radius")).to_have_count(0)
    page.click("summary:has-text('Columns')")
    page.get_by_label("Scar radius").check()
    page.get_by_role("checkbox", name="Computed", exact=True).uncheck()
    page.keyboard.press("Escape")
    for visit in ("first", "second"):
        expect(page.get_by_role("columnheader", name="Scar radius")).to_have_count(1)
        expect(page.get_by_role("columnheader", name="Computed")).to_have_count(0)
        assert value(page.locator(".entry", has_text="Sample 1,").locator("td").last.inner_text()) > 1e-5
        if visit == "first":
            page.goto(page.url.split("#")[0] + f"#/library?q={TAG}")
            page.reload()
            expect(names(page)).to_have_count(13)
    page.evaluate("localStorage.clear()")


def whole_menu(page, base):
    """The menu of columns is on the screen, however wide this is and whether rows are selected or not."""
    page.goto(base + f"/#/library?q={TAG}")
    expect(names(page)).to_have_count(13)
    size = page.viewport_size
    for choice in ("check", "uncheck"):
        getattr(page.get_by_label("Select all loaded results"), choice)()
        page.click("summary:has-text('Columns')")
        for width in (1920, 1440, 1280, 1024, 860, 720, 560, 390, 320):
            page.set_viewport_size({"width": width, "height": size["height"]})
            box = page.locator(".columns").bounding_box()
            assert 0 <= box["x"] and box["x"] + box["width"] <= width, (choice, width, box)
        page.keyboard.press("Escape")
    page.set_viewport_size(size)


def choose(page, *labels):
    for label in labels:
        page.get_by_role("checkbox", name=f"Select {label}", exact=True).check()


def keyboard(page, base):
    """The arrow keys move between rows, Space selects, and the first selected run is the baseline of a comparison."""
    page.goto(base + "/#/library")
    page.goto(base + f"/#/library?q={TAG}&kind=run&sort=wear_depth")
    expect(names(page)).to_have_count(12)
    first, _, third = listed(base, q=TAG, kind="run", sort="wear_depth")[:3]
    page.locator(".entry input").nth(2).focus()
    page.keyboard.press("Space")
    expect(page.get_by_role("link", name="Select 1 more to compare")).to_have_count(0)
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Space")
    expect(page.locator("#total")).to_have_text("12 results, 2 selected")
    expect(page.get_by_role("link", name="Compare 2 results")).to_have_attribute("href", f"#/compare?keys={third['key']},{first['key']}")
    # A click with Shift selects a range.
    page.locator(".entry input").nth(5).click(modifiers=["Shift"])
    expect(page.locator("#total")).to_contain_text("6 selected")
    page.get_by_role("button", name="Clear selection").click()
    page.get_by_label("Select all loaded results").check()
    expect(page.locator("#total")).to_contain_text("12 selected")
    page.get_by_label("Select all loaded results").uncheck()
    expect(page.locator("#total")).to_have_text("12 results")


def rename(page, base):
    """The label and the tags of a result change in the table and on the server."""
    page.goto(base + f"/#/library?q={TAG}")
    expect(names(page)).to_have_count(13)
    choose(page, "Sample 3, horse")
    page.get_by_role("button", name="Rename").click()
    expect(page.get_by_label("Label", exact=True)).to_have_value("Sample 3, horse")
    expect(page.get_by_role("dialog")).to_contain_text("All users see labels and tags")
    page.get_by_label("Label", exact=True).fill("Okapi")
    page.keyboard.press("Enter")
    expect(page.locator("#status")).to_have_text("Renamed 1 result.")
    expect(names(page).filter(has_text="Okapi")).to_have_count(1)
    assert [entry["label"] for entry in listed(base, q="okapi shelf")] == ["Okapi"]
    # The study cannot be compared, but it can be tagged.
    expect(page.locator(".entry", has_text="Study of horses")).to_contain_text("Random sample")
    choose(page, "Study of horses")
    expect(page.get_by_text("Compare runs only")).to_have_attribute("aria-disabled", "true")
    page.get_by_role("button", name="Tag").click()
    page.get_by_label("Add tags").fill("quick, rig 7")
    page.keyboard.press("Enter")
    expect(page.locator("#status")).to_have_text("Changed the tags of 2 results.")
    expect(page.locator(".entry", has_text="Okapi").locator(".tag")).to_have_text([TAG, "quick", "rig 7"])
    assert {entry["label"] for entry in listed(base, tag="rig 7")} == {"Okapi", "Study of horses"}
    page.get_by_role("button", name="Tag").click()
    page.get_by_label("Remove tags").fill("quick")
    page.keyboard.press("Enter")
    expect(page.locator(".entry", has_text="Okapi").locator(".tag")).to_have_text([TAG, "rig 7"])
    assert not listed(base, tag="quick")
    page.get_by_role("button", name="Tag").click()
    page.get_by_label("Remove tags").fill("quick")
    page.keyboard.press("Enter")
    expect(page.locator("#status")).to_have_text("No tag has changed.")


def table(page, base):
    """The CSV has all found results, or the selected ones, in the order of the table."""
    page.get_by_role("button", name="Clear selection").click()
    page.get_by_role("columnheader", name="Wear depth").get_by_role("button").click()
    rows = list(csv.DictReader(downloaded(page, page.get_by_role("button", name="CSV of all found").click).decode().splitlines()))
    found = listed(base, q=TAG, sort="-wear_depth")
    assert [row["key"] for row in rows] == [entry["key"] for entry in found]
    depths = [float(row["wear_depth[m]"]) if row["wear_depth[m]"] else None for row in rows]
    assert depths == [entry["values"]["wear_depth"] for entry in found], depths
    choose(page, "Okapi", "Sample 7, Zebra")
    rows = list(csv.DictReader(downloaded(page, page.get_by_role("button", name="CSV of selection").click).decode().splitlines()))
    assert [row["label"] for row in rows] == [entry["label"] for entry in found if entry["label"] in ("Okapi", "Sample 7, Zebra")], rows


def delete(page, base):
    """Selected results are deleted, except pinned ones. The page says what to do."""
    pinned = next(entry["key"] for entry in listed(base, q="okapi"))
    ask(base, f"/v1/results/{pinned}/pin", method="PUT")
    page.get_by_role("button", name="Delete").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("Delete 2 results?")
    dialog.get_by_role("button", name="Cancel").click()
    expect(page.locator("#total")).to_contain_text("13 results")
    page.get_by_role("button", name="Delete").click()
    dialog.get_by_role("button", name="Delete").click()
    expect(page.locator("#status")).to_have_text(re.compile("Deleted 1 result. 1 result failed: The result is pinned. Send DELETE"))
    expect(page.locator("#total")).to_have_text("12 results")
    expect(names(page).filter(has_text="Zebra")).to_have_count(0)
    ask(base, f"/v1/results/{pinned}/pin", method="DELETE")


def leave(page, base):
    """A view that writes its state into the address just after the user has followed a link does not call the user back."""
    page.goto(base + f"/#/library?q={TAG}")
    expect(names(page).first).to_be_visible()
    page.evaluate("location.hash = '#/runs'; document.querySelector('[data-sort=wear_depth]').click()")
    expect(page.locator("h1")).to_have_text("Runs")


def accessibility(browser, base):
    """Selected rows, the menu of columns and the dialogs are accessible."""
    for looks in LOOKS:
        page = browser.page(base, *reversed(looks[0]))
        page.goto(base + f"/#/library?q={TAG}&tag=rig+7")
        page.get_by_label("Select all loaded results").check()
        page.click("summary:has-text('Columns')")
        browser.check_looks(page, "library-chosen", looks)
        page.keyboard.press("Escape")
        page.get_by_role("button", name="Tag").click()
        browser.check_looks(page, "library-tag", looks)
        page.context.close()


def library(browser, base):
    fill_shelf(base)
    page = browser.page(base)
    pictures(page, base)
    same_names(page, base)
    search(page, base)
    sort(page, base)
    columns(page)
    whole_texts(page, base)
    whole_menu(page, base)
    keyboard(page, base)
    rename(page, base)
    table(page, base)
    delete(page, base)
    leave(page, base)
    page.context.close()
    accessibility(browser, base)
