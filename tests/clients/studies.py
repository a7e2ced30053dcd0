"""Tests the pages of studies: the table, the figure, a deleted study, and the library."""

import re

from playwright.sync_api import expect

from browser import ask, near, readout

ROWS = 200


def sweep(base, *numbers, outputs=("wear_volume", "wear_depth")):
    """The body of a sweep of the steel ball by the simplified rule. A number is its pointer, its ends and its count."""
    vary = [dict(zip(("pointer", "from", "to", "count"), number)) for number in numbers]
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    return {"sweep": {"scenario": scenario, "vary": vary, "outputs": list(outputs)}}


def computed(base, body):
    """The key of the result of a body."""
    job = ask(base, "/v1/jobs", body)
    assert job["state"] == "succeeded", job
    return job["key"]


def open_study(page, base, key, words=""):
    page.goto(base + "/#/queue")
    page.goto(f"{base}/#/result/{key}{words}")
    page.wait_for_selector("#study")


def long_table(page, base):
    """The page loads the rows that it shows, and says if there are more."""
    note = page.get_by_text("The download contains all rows")
    for count, is_long in ((ROWS, False), (ROWS + 100, True)):
        key = computed(base, sweep(base, ("/friction", 0.5, 0.8, count)))
        with page.expect_response(lambda response: f"/v1/results/{key}?" in response.url) as head, \
                page.expect_response(lambda response: f"/v1/results/{key}/table?" in response.url) as rows:
            open_study(page, base, key)
        assert head.value.json()["table"]["/friction"] == []
        assert len(rows.value.json()["table"]["/friction"]) == min(count, ROWS + 1)
        expect(page.locator("#study tbody tr")).to_have_count(ROWS)
        expect(note).to_have_count(1 if is_long else 0)
        expect(page.locator("section[aria-label=Counts]")).to_contain_text(f"{count}")


def figure(page, base):
    """The address has the choices of the figure. The values of curves can be read. A refused choice shows no figure."""
    image = page.locator("section[aria-label=Figure] svg.drawn")
    plot = page.locator("section[aria-label=Figure] [role=slider]")
    fault = page.locator("section[aria-label=Figure] [role=status]")
    key = computed(base, sweep(base, ("/friction", 0.5, 0.8, 9), ("/load/normal_force", "50 N", "150 N", 9)))
    open_study(page, base, key)
    expect(image.locator("desc")).to_have_text(re.compile("Wear volume"))
    choices = {"kind": "curves", "output": "wear_depth", "over": "/friction", "by": "/load/normal_force"}
    for name, choice in choices.items():
        page.select_option(f"#figure-{name}", choice)
    expect(plot).to_have_attribute("aria-label", "Largest wear depth over friction")
    expect(image).to_be_hidden()
    page.reload()
    expect(plot).to_have_attribute("aria-label", "Largest wear depth over friction")
    for name, choice in choices.items():
        expect(page.locator(f"#figure-{name}")).to_have_value(choice)
    expect(fault).to_have_text("8 of 9 values of normal force are drawn.")
    plot.focus()
    page.keyboard.press("Home")
    table = ask(base, f"/v1/results/{key}")["table"]
    row = next(i for i, pair in enumerate(zip(table["/friction"], table["/load/normal_force"])) if pair == (0.5, 50))
    near(readout(page, "Figure")["normal force = 50\u00a0N"], table["wear_depth"][row], 1e-3)
    page.select_option("#figure-by", "/friction")
    expect(fault).to_contain_text("cannot be drawn: by ")
    expect(image).to_be_hidden()
    expect(plot).to_be_hidden()
    page.select_option("#figure-by", "")
    expect(plot).to_be_visible()
    assert "by=" not in page.url and "kind=curves" in page.url, page.url
    return key


def deleted(page, base):
    """The page of a deleted study offers to compute it again: in the form, or at once if the form cannot show it."""
    in_form = sweep(base, ("/friction", 0.4, 0.6, 3))
    listed = sweep(base, ("/friction", 0.4, 0.6, 3))
    listed["sweep"]["vary"] = [{"pointer": "/friction", "values": [0.41, 0.5, 0.6]}]
    for body, has_form in ((in_form, True), (listed, False)):
        key = computed(base, body)
        ask(base, f"/v1/results/{key}", method="DELETE")
        page.goto(base + "/#/queue")
        page.goto(f"{base}/#/result/{key}")
        expect(page.locator(".error")).to_contain_text("deleted by")
        if has_form:
            page.get_by_role("link", name="Compute again").click()
            expect(page.locator("[data-item=cached]")).to_have_text("No")
            expect(page.locator("#friction-from")).to_have_value("0.4")
            page.click("button.primary")
        else:
            page.get_by_role("button", name="Compute again").click()
        page.wait_for_url(f"**/#/result/{key}?*")
        expect(page.locator("#study tbody tr")).to_have_count(3)


def kinds(page, base):
    """The library finds runs and studies by their kind. The address keeps the kind."""
    study = computed(base, sweep(base, ("/friction", 0.4123, 0.6, 3)))
    run = computed(base, {"scenario": {**sweep(base)["sweep"]["scenario"], "friction": 0.4123}})
    entry = lambda key: page.locator(f".entry a[href='#/result/{key}']")
    page.goto(base + "/#/library")
    page.click("summary:has-text('Filters')")
    expect(entry(study)).to_be_visible()
    expect(entry(run)).to_be_visible()
    for kind, own, other in (("sweep", study, run), ("run", run, study)):
        page.select_option("#find-kind", kind)
        expect(entry(other)).to_have_count(0)
        expect(entry(own)).to_be_visible()
        page.reload()
        expect(page.locator("#find-kind")).to_have_value(kind)
        expect(entry(own)).to_be_visible()
        expect(entry(other)).to_have_count(0)


def studies(browser, base):
    """Returns the key of a study with two numbers."""
    page = browser.page(base)
    long_table(page, base)
    key = figure(page, base)
    deleted(page, base)
    kinds(page, base)
    page.context.close()
    return key
