"""Tests the page of a study: its table."""

from playwright.sync_api import expect

from browser import ask

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
    note = page.get_by_text("Download has all")
    for count, is_long in ((ROWS, False), (ROWS + 100, True)):
        key = computed(base, sweep(base, ("/friction", 0.5, 0.8, count)))
        with page.expect_response(lambda response: f"/v1/results/{key}?" in response.url) as loaded:
            open_study(page, base, key)
        table = loaded.value.json()["table"]
        assert len(table["/friction"]) == min(count, ROWS + 1), len(table["/friction"])
        expect(page.locator("#study tbody tr")).to_have_count(ROWS)
        expect(note).to_have_count(1 if is_long else 0)
        expect(page.locator("section[aria-label=Counts]")).to_contain_text(f"{count}")


def studies(browser, base):
    page = browser.page(base)
    long_table(page, base)
    page.context.close()
