"""Tests the dashboard in a real browser on other servers: a new one, one with a limit, one that is lost, one with
many results, and one that is killed.

    python servers.py target/debug/fretwork

Writes screenshots to target/screens.
"""

import functools
import json
import pathlib
import re
import sys
import tempfile

from playwright.sync_api import expect

from browser import LONG, LOOKS, Clock, Server, ask, blocks, curves, ended, item, opened, until
from vary import beyond_a_limit

server = functools.partial(Server, sys.argv[1])
# Whether a row of the library is in view.
IS_VISIBLE = """(link) => {
    const [own, around] = [link, link.closest(".results")].map((element) => element.getBoundingClientRect());
    return own.top >= around.top && own.bottom <= Math.min(around.bottom, innerHeight);
}"""


def first_plot(browser, data):
    """On a new server, the printed address and one click on Run lead to the first plot."""
    with server(data) as own:
        page = browser.page(own.base, before="addEventListener('click', () => window.clicks = (window.clicks ?? 0) + 1, true)")
        page.goto(own.page)
        page.click("button.primary")
        page.wait_for_url("**/#/result/*")
        page.wait_for_selector("#headline dd")
        page.wait_for_selector("section[aria-label='Profiles'] .curve", state="attached")
        assert max(map(len, curves(page, "Profiles"))) > 500 and page.evaluate("window.clicks") == 1
        page.context.close()


def library(browser, base):
    """Pages follow while the user scrolls. Only rows near the view are drawn, and pictures of rows in view."""
    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"]
    scenario["model"] = {"method": "simplified", "points": 16}
    for i in range(250):
        ask(base, "/v1/jobs", {"scenario": {**scenario, "friction": 0.5 + i / 1000}, "label": f"Friction {500 + i}"})
    page = browser.page(base, width=390)
    page.goto(base + "/#/library")
    expect(page.locator("#total")).to_have_text("250 results")
    entries, region = page.locator(".entry"), page.get_by_role("region", name="Results")
    names = page.locator(".entry th a")
    expect(names.first).to_have_text("Friction 749")
    expect(entries.first.locator("path.worn")).to_have_attribute("d", re.compile(r"^M0\.0,.*L96\.0,"))
    assert page.locator("path.worn").count() < 40
    # The last row is reached by the keyboard.
    region.focus()

    def reaches(key, place, name):
        """Whether the key has led to this row. Rows that are drawn meanwhile move the end, so the key is pressed again."""
        page.keyboard.press(key)
        page.wait_for_timeout(200)
        return place.inner_text() == name and place.evaluate(IS_VISIBLE)

    until(page, lambda: reaches("End", names.last, "Friction 500"))
    expect(names.last).to_be_in_viewport()
    expect(entries.last.locator("path.worn")).to_have_count(1)
    assert entries.count() < 250
    until(page, lambda: reaches("Home", names.first, "Friction 749"))
    expect(names.first).to_be_in_viewport()
    expect(entries.first.locator("path.worn")).to_have_count(1)
    page.context.close()


def interrupt(browser, data):
    """The server is killed during a run and restarted. The view resumes after the last event it received."""
    with server(data, "--workers", "1") as own:
        page = browser.page(own.base)
        streams = []
        page.on("request", lambda request: "/events" in request.url and streams.append(request.headers))

        def submit(scenario):
            page.goto(own.base + "/#/queue")
            page.goto(f"{own.base}/#/new?scenario={json.dumps(scenario)}&label=Interrupted run")
            page.click("button.primary")
            expect(page.locator("#state")).to_have_text("running")

        def interrupted():
            own.kill()
            expect(page.locator("#banner")).to_be_visible()
            own.start()
            expect(page.locator("#banner")).to_be_hidden()

        submit(blocks(20_000, count=400))
        # Progress after the first view comes from the event stream.
        progress = "document.querySelector('progress').value"
        page.wait_for_function(f"before => {progress} > before", arg=page.evaluate(progress))
        interrupted()
        expect(page.locator("[data-item=attempt]")).to_contain_text("2")
        assert "last-event-id" not in streams[0] and int(streams[-1]["last-event-id"]) >= 1, streams
        page.wait_for_url("**/#/result/*")
        page.wait_for_selector("section[aria-label=History] .curve")

        # After three lost attempts the server gives up.
        submit(LONG)
        failed = page.url
        for attempt in (2, 3):
            interrupted()
            expect(page.locator("[data-item=attempt]")).to_contain_text(str(attempt))
            expect(page.locator("#state")).to_have_text("running")
        interrupted()
        expect(page.locator("#state")).to_have_text("failed")
        expect(page.locator(".error")).to_contain_text("crashed repeatedly")
        expect(page.get_by_role("link", name="How to fix this")).to_have_attribute("href", "/problems/worker-lost")
        expect(page.get_by_role("link", name="Edit and run again")).to_be_visible()

        frictions = iter(range(300, 700))

        def long_run():
            """Submits another long run, and returns the address of its view."""
            friction = next(frictions) / 1000
            label = f"A load spectrum of a thousand blocks, µ = {friction}"
            body = {"scenario": {**LONG, "friction": friction}, "label": label, "tags": ["long"]}
            return f"/#/run/{ask(own.base, '/v1/jobs', body, wait=False)['id']}"

        def cancel():
            ask(own.base, "/v1/jobs/cancel?tag=long", method="POST")

        def running():
            cancel()
            return long_run()

        # The view waits until the time left is shown.
        browser.check_views(own.base, {
            "run-failed": (failed[len(own.base):], ".error"),
            "run-running": (running, "[data-item=left]:text-matches('[0-9]')"),
        })
        canceled = long_run()
        cancel()
        views = [long_run() for _ in range(10)]
        browser.check_views(own.base, {
            "run-queued": (views[-1], "[data-item=regime] >> visible=true"),
            "run-canceled": (canceled, "[data-item=regime] >> visible=true"),
            "queue-busy": ("/#/queue", ".state.running"),
        })
        cancel()
        for _ in range(5):
            long_run()
        from_the_queue(page, own.base)
        page.context.close()


def edit(page, base, key, submitted):
    """"Edit and run again" opens the form with the submitted scenario, each value in its field."""
    expect(page.locator(".sketch svg")).to_be_visible()
    page.get_by_role("link", name="Edit and run again").click()
    expect(item(page, "regime")).to_be_visible()
    scenario = json.loads(page.input_value("#json"))
    if submitted:
        assert scenario == submitted, (scenario, submitted)
    assert ask(base, "/v1/scenarios", {"scenario": scenario})["key"] == key
    fields = page.locator("[data-pointer]").evaluate_all("fields => fields.map(({dataset, value}) => [dataset.pointer, value])")
    assert len(fields) > 8, fields
    for pointer, shown in fields:
        value = scenario
        for name in pointer.split("/")[2:]:
            value = value[int(name)] if isinstance(value, list) else (value or {}).get(name)
        # An omitted value is an empty field. A list is separated by commas. Fields have the signs of printed units, and wear
        # coefficients are volumes per force and path.
        written = re.sub(r"µ(?=[mNJ])", "u", shown).replace("³", "^3").replace("²", "^2")
        if str(value).endswith(" 1/Pa"):
            volume, _, unit = written.partition(" ")
            assert unit == "mm^3/(N m)", (pointer, shown)
            written = f"{float(volume) * 1e-9:.12g} 1/Pa"
            value = f"{float(value.split()[0]):.12g} 1/Pa"
        read = [] if shown == "" else [number_or_text(text) for text in written.split(", ")]
        assert read == (value if isinstance(value, list) else [] if value is None else [value]), (pointer, shown, value)


def number_or_text(text):
    try:
        return float(text)
    except ValueError:
        return {"true": True}.get(text, text)


def from_the_queue(page, base):
    """From the queue, each run in each state opens its scenario and goes back to the form."""
    def edit_run(row, state, submitted=None):
        page.goto(base + "/#/queue")
        link = row.first.get_by_role("link")
        label = link.inner_text()
        link.click()
        page.wait_for_url("**/#/run/*")
        assert "scenario" not in page.url
        expect(page.locator("#state")).to_have_text(state)
        edit(page, base, ask(base, f"/v1/jobs/{re.search('run/([^?]+)', page.url)[1]}")["key"], submitted)
        expect(page.locator("#label")).to_have_value(label)

    for state in ("running", "queued", "canceled", "failed"):
        edit_run(page.locator(f"tr:has(.state.{state})"), state)
    examples = [example["body"] for example in ask(base, "/v1/examples")]
    jobs = [ask(base, "/v1/jobs", body, wait=False) for body in examples]
    # Below, the form opens each of them from its result.
    edit_run(page.locator("tr", has=page.get_by_role("link", name=examples[0]["label"], exact=True)), "queued", examples[0]["scenario"])
    ask(base, "/v1/jobs/cancel?tag=long", method="POST")
    for body, job in zip(examples, jobs):
        assert ended(base, job["id"])["state"] == "succeeded", job
        page.goto(base + "/#/queue")
        page.get_by_role("link", name=job["label"], exact=True).click()
        page.wait_for_url("**/#/result/*")
        edit(page, base, job["key"], body["scenario"])


def lose_the_server(browser, data):
    with server(data) as own:
        pages = [(looks, browser.page(own.base, *reversed(looks[0]))) for looks in LOOKS]
        for _, page in pages:
            page.goto(own.base + "/")
            expect(item(page, "regime")).to_have_text("Partial slip")
        own.kill()
        for looks, page in reversed(pages):
            page.fill("#friction", "0.5")
            expect(page.locator("#banner")).to_be_visible()
            browser.check_looks(page, "lost", looks)
        own.start()
        expect(page.locator("#banner")).to_be_hidden()
        # The form checks the input that was typed while the server was not running.
        expect(item(page, "regime")).to_have_text("Gross slip")
        page.click("nav >> text=Runs")
        expect(page.locator(".empty")).to_contain_text("No runs")
        page.click("nav >> text=Library")
        expect(page.locator(".empty")).to_contain_text("No results yet")
        page.goto(f"{own.base}/#/result/{'0' * 64}")
        expect(page.locator(".error")).to_be_visible()
        browser.check_views(own.base, {"queue-empty": ("/#/queue", ".empty a"), "library-empty": ("/#/library", ".empty a"),
            "not-found": (f"/#/result/{'0' * 64}", ".error")})
        # The page of a deleted result offers to compute it again.
        done = ask(own.base, "/v1/jobs", ask(own.base, "/v1/examples/steel-ball"))
        address = f"{own.base}/#/result/{done['key']}"
        page.goto(address)
        page.wait_for_selector("#headline dd")
        ask(own.base, f"/v1/results/{done['key']}", method="DELETE")
        page.goto(own.base + "/#/queue")
        page.goto(address)
        page.get_by_role("link", name="Compute again").click()
        expect(page.locator("#canonical")).to_be_visible()
        expect(item(page, "cached")).to_have_text("No")
        page.click("button.primary")
        page.wait_for_url("**/#/result/*")
        page.wait_for_selector("#headline dd")


def main():
    clock = Clock()
    with opened() as browser, tempfile.TemporaryDirectory() as data:
        directory = lambda name: str(pathlib.Path(data) / name)
        first_plot(browser, directory("first-plot"))
        clock.passed("a new server")
        with server(directory("limits"), "--study-points", "50") as own:
            beyond_a_limit(browser, own.base)
        lose_the_server(browser, directory("lost"))
        clock.passed("a lost server")
        with server(directory("library")) as own:
            library(browser, own.base)
        clock.passed("many results")
        interrupt(browser, directory("interrupted"))
        clock.passed("a server that is killed")
    print("the dashboard passes its tests on other servers")


main()
