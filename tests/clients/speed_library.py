"""Measures how fast the library is with 10 000 results: each action from the key to the frame that shows the new rows.

    python speed_library.py http://127.0.0.1:8080
"""

import concurrent.futures
import http.client
import json
import statistics
import sys
import threading
import urllib.parse

from browser import ask, opened

RESULTS = 10_000
REPEATS = 20
ADDRESS = urllib.parse.urlsplit(sys.argv[1]).netloc

# Calls an action, and resolves to the time until the frame has ended in which the table satisfies `isDone`.
MEASURE = """async ([act, isDone]) => {
    const region = document.querySelector(".results"), start = performance.now();
    const done = new Promise((done) => {
        const look = () => {
            if (!isDone()) return requestAnimationFrame(look);
            const { port1, port2 } = new MessageChannel();
            port1.onmessage = () => done(performance.now() - start);
            port2.postMessage(null);
        };
        requestAnimationFrame(look);
    });
    act(region);
    return done;
}"""


def seed(base):
    """Short runs with labels and tags, submitted by four clients."""
    local = threading.local()

    def run(i):
        if not hasattr(local, "connection"):
            local.connection = http.client.HTTPConnection(ADDRESS)
        own = {**scenario, "motion": {"amplitude": f"{2 + i / 1e5} um"}, "load": {"normal_force": f"{100 + i % 90} N", "held": "depth"}}
        body = json.dumps({"scenario": own, "label": f"Rig {i % 10}, sample {i}", "tags": [f"rig-{i % 10}"]})
        local.connection.request("POST", "/v1/jobs", body, {"Content-Type": "application/json", "Prefer": "wait=20"})
        answer = local.connection.getresponse()
        answer.read()
        assert answer.status == 200, answer.status

    scenario = ask(base, "/v1/examples/steel-ball-simplified")["scenario"] | {"cycles": [1000], "model": {"method": "simplified", "points": 16}}
    stored = ask(base, "/v1/results?limit=1&count=true&q=sample")["total"]
    with concurrent.futures.ThreadPoolExecutor(4) as clients:
        list(clients.map(run, range(stored, RESULTS)))


def report(name, took):
    if len(took) == 1:
        print(f"{name}: {took[0]:.0f} ms (once)")
        return
    parts = statistics.quantiles(took, n=20)
    print(f"{name}: median {parts[9]:.0f} ms, 95th percentile {parts[18]:.0f} ms, maximum {max(took):.0f} ms ({len(took)} times)")


def measured(page, name, steps):
    """Prints the time of the actions `steps`: pairs of an action and a condition, in JavaScript."""
    took = []
    for act, is_done in steps:
        took.append(page.evaluate(f"({MEASURE})([{act}, {is_done}])"))
        # A person needs time for the next action, and pictures are loaded then.
        page.wait_for_timeout(200)
    report(name, took)


def sort(page):
    """A click on a heading. The rows have changed when the heading has its order and the first row is another one."""
    names = ["Wear depth", "Wear volume", "Normal force", "Amplitude", "Friction μ", "Cycles N", "Computed"]
    for place in range(REPEATS):
        name = names[place // 2 % len(names)]
        head = f'[...document.querySelectorAll(".sort")].find((own) => own.textContent === "{name}")'
        yield (f'() => {{ window.before = document.querySelector(".entry"); {head}.click(); }}',
            '() => document.querySelector(".entry") && document.querySelector(".entry") !== window.before')


def search(page):
    for place in range(REPEATS):
        words = f"rig sample {place % 10}{place % 7}"
        yield (f'() => {{ window.before = document.querySelector(".entry"); const field = document.getElementById("find-q"); field.value = "{words}"; '
            'field.dispatchEvent(new Event("input")); }', '() => document.querySelector(".entry") && document.querySelector(".entry") !== window.before')


def scroll(page):
    """The key Page Down, again and again. No frame may show a gap instead of rows."""
    is_full = """() => {
        const box = document.querySelector(".results").getBoundingClientRect(), [top, bottom] = [box.y + 50, Math.min(box.bottom, innerHeight) - 10];
        return [top, (top + bottom) / 2, bottom].every((y) => document.elementFromPoint(box.x + 300, y)?.closest(".entry"));
    }"""
    for _ in range(2 * REPEATS):
        yield ('(region) => region.scrollBy({ top: 500, behavior: "instant" })', is_full)


def to_the_end(page):
    """Scrolls over all results as fast as pages arrive, and prints the time of each page."""
    took = []
    while True:
        before = page.evaluate('document.querySelector(".library").offsetHeight')
        if before > 52 * RESULTS * 0.99:
            break
        took.append(page.evaluate(f"""({MEASURE})([(region) => region.scrollTo({{ top: region.scrollHeight, behavior: "instant" }}),
            () => document.querySelector(".library").offsetHeight > {before}])"""))
    report("one more page at the end", took)
    return page.locator(".entry").count()


def main(base):
    seed(base)
    with opened() as browser:
        page = browser.page(base)
        page.goto(base + "/#/library")
        page.wait_for_selector(".entry")
        measured(page, "sort", sort(page))
        measured(page, "scroll by a screen", scroll(page))
        print(f"{to_the_end(page)} of {RESULTS} rows are drawn at the end of the list")
        measured(page, "scroll by a screen at the end", ((act.replace("500", "-500"), is_done) for act, is_done in scroll(page)))
        measured(page, "sort with all rows loaded", list(sort(page))[:1])
        measured(page, "select all loaded rows", [('() => document.querySelector(".library thead input").click()', '() => document.querySelector(".chosen") !== null')])
        measured(page, "search, with the 200 ms after the last key", search(page))
        page.context.close()


main(sys.argv[1])
