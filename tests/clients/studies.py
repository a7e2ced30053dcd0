"""Tests the pages of studies: the table, the figures, the runs of points, distributions, a canceled and a deleted study, and
the library.
"""

import csv
import math
import re
import statistics

from playwright.sync_api import expect

from browser import ask, close, column, downloaded, item, key_of, near, readout, value

ROWS = 200
PARTS = {"figure": "section[aria-label=Figure]", "distribution": "section[aria-label=Distribution]"}


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


def sample(base, *distributions, samples, outputs):
    """The body of a random sample of the steel ball by the simplified rule."""
    body = sweep(base, outputs=outputs)
    vary = [{"pointer": pointer, "distribution": distribution} for pointer, distribution in distributions]
    body["sweep"].update(design="latin_hypercube", seed=3, samples=samples, vary=vary)
    return body


def plot(page):
    """The visible figure of the study, which the arrow keys read."""
    return page.locator("section[aria-label=Figure] [role=slider]:visible")


def read(page, part="figure"):
    """The values of the marked point by their names."""
    return dict(page.locator(f"{PARTS[part]} .values:visible li:has(.name)").evaluate_all(
        "rows => rows.map(row => [row.querySelector('.name').textContent, row.querySelector('.value').textContent])"))


def long_table(page, base):
    """The page shows the first rows and adds more. A heading sorts all of them."""
    count = ROWS + 100
    key = computed(base, sweep(base, ("/friction", 0.5, 0.8, count)))
    open_study(page, base, key)
    expect(page.locator("#counts")).to_contain_text(f"{count} points")
    rows = page.locator("#study tbody tr")
    expect(rows).to_have_count(ROWS)
    page.get_by_role("button", name="Show more rows").click()
    expect(rows).to_have_count(count)
    table = ask(base, f"/v1/results/{key}")["table"]
    greatest = max(range(count), key=lambda row: table["wear_volume"][row])
    assert table["/friction"][greatest] in (0.5, 0.8), table["/friction"][greatest]
    end = "lower" if table["/friction"][greatest] == 0.5 else "upper"
    expect(page.locator("[data-verdict=wear_volume]")).to_contain_text(re.compile(f"at friction coefficient .*, the {end} end of the range"))
    near(page.locator("[data-verdict=wear_volume]").inner_text().split(": ")[1].split(" at ")[0], table["wear_volume"][greatest], 1e-3)
    for order in (sorted(table["wear_volume"]), sorted(table["wear_volume"], reverse=True), table["wear_volume"]):
        page.locator("#study [data-column=wear_volume]").click()
        shown = column(page, "Wear volume V")
        assert all(math.isclose(one, other, rel_tol=6e-4) for one, other in zip(shown, order, strict=True))
    expect(page.locator("#study [aria-sort]")).to_have_count(0)
    page.get_by_label("Differences from point 1 in %").check()
    expect(page.locator("#in-percent")).to_be_focused()
    volumes = table["wear_volume"]
    cell = rows.last.locator("td").nth(1)
    share = float(re.search(r" \(([+-][\d.]+)\u00a0%\)", cell.inner_text().replace("−", "-").replace("+-", "-"))[1])
    assert abs(share - 100 * (volumes[-1] / volumes[0] - 1)) < 0.1, (share, cell.inner_text())
    page.uncheck("#in-percent")
    assert "/" not in "".join(page.locator("#study thead").inner_text().split("(")[0]), "a heading is a pointer"


def curves(page, base):
    """The page draws curves, whose values can be read. The address keeps the choices, and equal axes are exchanged."""
    note = page.locator("section[aria-label=Figure] [role=status]")
    key = computed(base, sweep(base, ("/friction", 0.5, 0.8, 9), ("/load/normal_force", "50 N", "150 N", 9)))
    open_study(page, base, key)
    choices = {"kind": "curves", "output": "wear_depth", "over": "/friction", "by": "/load/normal_force"}
    for name, choice in choices.items():
        page.select_option(f"#figure-{name}", choice)
    title = "Largest wear depth over friction coefficient μ"
    expect(plot(page)).to_have_attribute("aria-label", title)
    page.reload()
    expect(plot(page)).to_have_attribute("aria-label", title)
    for name, choice in choices.items():
        expect(page.locator(f"#figure-{name}")).to_have_value(choice)
    expect(note).to_have_text("8 of 9 values of normal force F are drawn.")
    plot(page).focus()
    page.keyboard.press("Home")
    table = ask(base, f"/v1/results/{key}")["table"]
    row = next(i for i, pair in enumerate(zip(table["/friction"], table["/load/normal_force"])) if pair == (0.5, 50))
    near(readout(page, "Figure")["F\u00a0=\u00a050\u00a0N"], table["wear_depth"][row], 1e-3)
    page.select_option("#figure-over", "/load/normal_force")
    expect(page.locator("#figure-by")).to_have_value("/friction")
    expect(plot(page)).to_have_attribute("aria-label", "Largest wear depth over normal force F")
    expect(page.locator("main img, svg.drawn")).to_have_count(0)
    return key


def errors(page, base):
    """The numerical error of an output stands beside its value."""
    body = sweep(base, ("/friction", 0.6, 0.8, 3), outputs=("wear_volume", "wear_volume_error"))
    body["sweep"]["scenario"]["model"] = {"method": "exact", "points": 64}
    key = computed(base, body)
    open_study(page, base, key)
    table = ask(base, f"/v1/results/{key}")["table"]
    expect(page.locator("#study thead th")).to_have_count(3)
    for row, error in enumerate(table["wear_volume_error"]):
        shown = page.locator("#study tbody tr").nth(row).locator("td").last.inner_text()
        assert abs(float(re.search(r" ± ([\d.]+)\u00a0%$", shown)[1]) / (100 * error) - 1) < 0.06, (shown, error)


def warned(page, base):
    """A sweep says which warnings its points have, and where. Large numerical errors of points have a sign."""
    body = sweep(base, ("/motion/amplitude", 2e-6, 2.5e-4, 3), outputs=("wear_volume", "wear_volume_error"))
    body["sweep"]["scenario"].update(model={"method": "simplified", "points": 16}, cycles=[10, 1000])
    key = computed(base, body)
    open_study(page, base, key)
    card = page.locator("section[aria-label=Warnings]")
    expect(card).to_contain_text(re.compile("For example at U\u00a0=\u00a0250\u00a0µm.*The amplitude at the contact, 250\u00a0µm, is larger than the contact radius"))
    # An error is no output whose greatest value matters.
    expect(page.locator("#verdicts li")).to_have_count(1)
    large = [error > 0.02 for error in ask(base, f"/v1/results/{key}")["table"]["wear_volume_error"]]
    assert [cell.endswith("⚠") for cell in page.locator("#study tbody td:last-child").all_inner_texts()] == large and any(large), large
    open_study(page, base, computed(base, sweep(base, ("/friction", 0.6, 0.8, 3))))
    expect(card).to_be_hidden()


def opened_run(page, row, study):
    """The page has opened the run of a row: its scenario has the numbers of the row, and its volume is that of the row."""
    page.wait_for_selector("#headline dd")
    base = page.url.split("/#")[0]
    result = ask(base, f"/v1/results/{key_of(page)}")
    assert result["scenario"]["friction"] == study["table"]["/friction"][row]
    if "/load/normal_force" in study["table"]:
        # The canonical scenario of a run that holds the depth has the depth of the force.
        assert math.isclose(result["scales"]["normal_force"], study["table"]["/load/normal_force"][row], rel_tol=1e-9)
    assert math.isclose(result["history"]["wear_volume"][-1], study["table"]["wear_volume"][row], rel_tol=1e-9)
    assert result["profiles"]["wear"], "the run has profiles"


def points(page, base, key):
    """A point of a curve and of a heat map, and a row of the table open their runs, by pointer and by keyboard."""
    study = ask(base, f"/v1/results/{key}")
    table = study["table"]
    pairs = list(zip(table["/friction"], table["/load/normal_force"]))
    # A curve, with the keyboard: its cursor offers the runs of all curves.
    open_study(page, base, key, "?kind=curves&over=/friction&by=/load/normal_force")
    plot(page).focus()
    page.keyboard.press("End")
    page.get_by_role("button", name="Open the run with F\u00a0=\u00a0150\u00a0N").press("Enter")
    opened_run(page, pairs.index((0.8, 150)), study)
    expect(page.locator("#result-label")).to_contain_text("μ = 0.8, F = 150 N")
    # The heat map, with the keyboard.
    open_study(page, base, key, "?kind=heat&over=/friction&by=/load/normal_force")
    plot(page).focus()
    for pressed in ("Home", "ArrowRight", "ArrowUp"):
        page.keyboard.press(pressed)
    row = 9 + 1
    near(read(page)["V"], table["wear_volume"][row], 1e-3)
    near(read(page)["F"], table["/load/normal_force"][row], 1e-3)
    page.keyboard.press("Enter")
    opened_run(page, row, study)
    # The heat map, with the pointer: the cell in the middle.
    open_study(page, base, key, "?kind=heat&over=/friction&by=/load/normal_force")
    cells = page.locator("section[aria-label=Figure] [shape-rendering]").evaluate_all(
        "paths => paths.map(path => path.getBoundingClientRect()).map(({left, top, right, bottom}) => [left, top, right, bottom])")
    left, top, right, bottom = (pick(edges) for pick, edges in zip((min, min, max, max), zip(*cells)))
    page.mouse.move((left + right) / 2, (top + bottom) / 2)
    near(read(page)["V"], table["wear_volume"][40], 1e-3)
    page.mouse.click((left + right) / 2, (top + bottom) / 2)
    opened_run(page, 40, study)
    # The table.
    open_study(page, base, key)
    page.get_by_role("button", name="Open the run of point 3", exact=True).click()
    opened_run(page, 2, study)


def three_numbers(page, base):
    """A figure of three numbers shows the points at one value of the third."""
    key = computed(base, sweep(base, ("/friction", 0.5, 0.8, 5), ("/load/normal_force", "50 N", "150 N", 5), ("/profile/radius", "9 mm", "11 mm", 3)))
    table = ask(base, f"/v1/results/{key}")["table"]
    open_study(page, base, key, "?kind=heat&over=/friction&by=/load/normal_force")
    for radius in (0.01, 0.011):
        page.select_option("#figure-at-2", str(radius))
        plot(page).focus()
        page.keyboard.press("Home")
        row = next(i for i, found in enumerate(zip(table["/friction"], table["/load/normal_force"], table["/profile/radius"])) if found == (0.5, 50, radius))
        near(read(page)["V"], table["wear_volume"][row], 1e-3)


def bars(page, base):
    """The bars of a sensitivity study begin with the strongest number, and have the values of the API."""
    body = sample(base, ("/friction", {"uniform": {"low": 0.6, "high": 0.8}}), ("/wear/coefficient", {"uniform": {"low": 1e-14, "high": 5e-14}}),
        samples=32, outputs=["unworn.wear_coefficient", "wear_volume"])["sweep"]
    del body["design"]
    key = computed(base, {"sensitivity": {**body, "method": "sobol"}})
    open_study(page, base, key)
    plot(page).focus()
    page.keyboard.press("Home")
    table = ask(base, f"/v1/results/{key}")["table"]
    assert (table["output"][1], table["member"][1]) == ("unworn.wear_coefficient", "/wear/coefficient")
    # The output is the wear coefficient itself, so no other number matters.
    assert list(read(page)) == ["Wear coefficient k_w", "total"], read(page)
    close(read(page)["total"], table["total"][1], 1e-2)
    verdict = page.locator("[data-verdict='unworn.wear_coefficient']")
    expect(verdict).to_contain_text("the wear coefficient matters most: alone and together with others it causes")
    expect(verdict).to_contain_text("Without a visible effect: the friction coefficient.")
    page.select_option("#figure-kind", "scatter")
    plot(page).focus()
    page.keyboard.press("Home")
    near(read(page)["μ"], min(ask(base, f"/v1/results/{key}")["samples"]["/friction"]), 1e-3)
    return key


def fretting_map(page, base):
    """A map has the amplitude across and the force up, with the scenario and measured points on it."""
    scenario = {**sweep(base)["sweep"]["scenario"], "motion": {"amplitude": "2 um"}, "load": {"normal_force": "100 N", "held": "depth"}}
    axes = {"normal_force": {"from": "10 N", "to": "1 kN", "count": 12, "spacing": "log"},
        "amplitude": {"from": "0.2 um", "to": "20 um", "count": 10, "spacing": "log"}}
    key = computed(base, {"map": {"scenario": scenario, **axes, "outputs": ["wear_volume"]}})
    open_study(page, base, key)
    expect(page.locator("#figure-over")).to_have_value("/motion/amplitude")
    expect(page.locator("#figure-by")).to_have_value("/load/normal_force")
    figure = page.locator(PARTS["figure"])
    expect(figure).to_contain_text("◆ Scenario of the study: Amplitude U = 2\u00a0µm, Normal force F = 100\u00a0N")

    def centre(place):
        box = place.bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    # The scenario is in the middle of both logarithmic axes.
    for boundary in (".boundary", ".later"):
        expect(figure.locator(boundary)).to_be_visible()
    page.get_by_text("Measured points").click()
    page.fill("#points", "2; 100; same\n0.2 um; 0.01 kN; corner\nnonsense")
    marks = figure.locator(".measured.point")
    expect(marks).to_have_count(2)
    expect(page.locator("#points-fault")).to_contain_text("1 line is not understood")
    own, same, corner = centre(figure.locator(".own.point")), centre(marks.nth(0)), centre(marks.nth(1))
    assert math.dist(own, same) < 1.5, (own, same)
    # Amplitude grows to the right, force upwards.
    assert corner[0] < own[0] - 50 and corner[1] > own[1] + 50, (own, corner)
    page.reload()
    expect(figure.locator(".measured.point")).to_have_count(2)
    # The point of the map in the corner.
    plot(page).focus()
    page.keyboard.press("Home")
    near(read(page)["U"], 2e-7)
    near(read(page)["F"], 10)
    expect(figure).to_contain_text(re.compile("Regime.*Partial slip"))
    page.keyboard.press("End")
    near(read(page)["U"], 2e-5)
    page.select_option("#figure-kind", "heat")
    expect(figure.locator(".contour").first).to_be_attached()
    assert figure.locator(".level").count() > 1
    # The table has the unit of the axis.
    expect(page.locator("#study thead")).to_contain_text("(N)")
    expect(figure).to_contain_text("(N)")
    expect(figure.locator(".own.point")).to_have_count(1)
    return key


def distribution(page, base):
    """A random sample shows percentiles of known distributions within their sampling error. The form sets the distributions."""
    count = 2000
    page.goto(base + "/#/queue")
    page.goto(base + "/#/new?example=steel-ball-simplified")
    page.click("#wear-coefficient-vary")
    page.click("#load-normal_force-vary")
    page.check("#design-random")
    page.select_option("#wear-coefficient-spacing", "lognormal")
    page.fill("#wear-coefficient-median", "3e-5")
    page.fill("#wear-coefficient-factor", "1.5")
    page.select_option("#load-normal_force-spacing", "normal")
    page.fill("#load-normal_force-mean", "100")
    page.fill("#load-normal_force-standard_deviation", "5")
    page.fill("#samples", str(count))
    for name in ("wear_volume", "wear_depth"):
        page.uncheck(f"#output-{name}")
    for name in ("unworn.wear_coefficient", "scales.indentation_depth"):
        page.select_option("#more-output", name)
        page.click("#more-add")
    # The address keeps the distributions.
    page.reload()
    expect(page.locator("#load-normal_force-standard_deviation")).to_have_value("5")
    expect(page.locator("#wear-coefficient-factor")).to_have_value("1.5")
    page.click("button.primary")
    page.wait_for_selector("#study")
    expect(page.locator("#varied")).to_contain_text("Normal force F: normal, 100\u00a0N ± 5\u00a0N")
    key = key_of(page)
    normal = statistics.NormalDist()
    depth = ask(base, "/v1/evaluate", {"scenario": ask(base, "/v1/examples/steel-ball-simplified")["scenario"], "outputs": ["scales.indentation_depth"]})
    # A depth of a paraboloid grows with F^(2/3), and the output of the wear coefficient is the number itself.
    known = {"unworn.wear_coefficient": lambda z: 3e-14 * 1.5**z,
        "scales.indentation_depth": lambda z: depth["outputs"]["scales.indentation_depth"] * (1 + 0.05 * z) ** (2 / 3)}
    for output, quantile in known.items():
        page.select_option("#statistics-output", output)
        for name, share in (("percentile_5", 0.05), ("percentile_10", 0.1), ("percentile_25", 0.25), ("median", 0.5), ("percentile_75", 0.75), ("percentile_90", 0.9), ("percentile_95", 0.95),
                ("percentile_97_5", 0.975)):
            # Four standard errors of the share of the points below a percentile.
            error = 4 * math.sqrt(share * (1 - share) / count)
            low, high = (quantile(normal.inv_cdf(share + sign * error)) for sign in (-1, 1))
            shown = value(page.locator(f"[data-statistic={name}]").inner_text())
            assert low < shown < high, (output, name, low, shown, high)
        expect(page.locator("#ninety")).to_contain_text(re.compile("90\u00a0% of the points of the sample lie between .* and .*, and 95\u00a0% between .* and"))
        below = [page.locator(f"[data-statistic=percentile_{share}]").inner_text() for share in (90, 10)]
        expect(page.locator("#ninety")).to_contain_text(f"90\u00a0% stay below {below[0]}, and 10\u00a0% below {below[1]}.")
        for share in ("90", "95"):
            expect(page.locator("#certainty")).to_contain_text(f"the lower end of the {share}\u00a0% is known to lie between")
        expect(page.locator("section[aria-label=Distribution] svg")).to_contain_text("97.5\u00a0%")
        expect(page.locator("#histogram-legend")).to_contain_text("95\u00a0% of the points lie between the outer lines")
    # The bars of the histogram contain all points.
    bars = page.locator("section[aria-label=Distribution] [role=slider]")
    bars.focus()
    page.keyboard.press("Home")
    total = 0
    for _ in range(int(bars.get_attribute("aria-valuemax")) + 1):
        total += int(read(page, "distribution")["Points"].split(" of ")[0])
        page.keyboard.press("ArrowRight")
    assert total == count, total
    # "Edit and run again" shows the distributions.
    page.get_by_role("link", name="Edit and run again").click()
    expect(page.locator("#load-normal_force-spacing")).to_have_value("normal")
    expect(item(page, "cached")).to_have_text("Yes")
    return key


def canceled(page, base):
    """A study that is canceled keeps its rows. Its page shows them while it runs, and later. It is so long that it does not end before."""
    body = sample(base, ("/friction", {"normal": {"mean": 0.6, "standard_deviation": 0.05}}), samples=30_000, outputs=["wear_volume"])
    body["sweep"]["scenario"] = {**ask(base, "/v1/examples/steel-ball")["scenario"], "cycles": [1000, 10000]}
    job = ask(base, "/v1/jobs", body, wait=False)
    page.goto(f"{base}/#/run/{job['id']}")
    page.wait_for_selector("#study tbody tr")
    progress = page.locator("section[aria-label=Progress]")
    share = r"([2-9]|[1-9]\d)\u00a0%"
    expect(progress).to_contain_text(re.compile(share))
    page.click("#cancel")
    expect(page.locator("#state")).to_have_text("canceled")
    for is_loaded_again in (False, True):
        if is_loaded_again:
            page.reload()
        expect(progress).to_contain_text(re.compile(f"at {share}"))
        expect(page.get_by_text(re.compile("This study was canceled. [0-9\u202f]+ of 30\u202f000 points were computed before."))).to_be_visible()
        expect(page.locator("#study tbody tr")).to_have_count(ROWS)
    found = ask(base, f"/v1/jobs/{job['id']}/so-far")
    assert 300 <= found["counts"]["computed"] < 30_000, found["counts"]
    # Its statistics are those of the points that were computed.
    page.click("summary:has-text('over the points so far')")
    volumes = sorted(found["table"]["wear_volume"])
    near(page.locator("[data-statistic=median]").inner_text(), statistics.median(volumes), 1e-3)
    near(page.locator("[data-statistic=standard_deviation]").inner_text(), statistics.stdev(volumes), 1e-3)
    expect(page.locator("section[aria-label=Distribution]")).to_contain_text(f"{len(volumes):,} points".replace(",", "\u202f"))
    saved = list(csv.DictReader(downloaded(page, page.get_by_role("button", name="Points as CSV").click).decode().splitlines()))
    assert [float(row["wear_volume[m^3]"]) for row in saved] == found["table"]["wear_volume"]
    shown = column(page, "Wear volume V")
    assert all(math.isclose(one, other, rel_tol=6e-4) for one, other in zip(shown, found["table"]["wear_volume"][:ROWS], strict=True))
    plot(page).focus()
    page.keyboard.press("Home")
    near(read(page)["μ"], min(found["table"]["/friction"]), 1e-3)
    # The study continues as another job, which may be canceled, too.
    page.get_by_role("button", name="Continue").click()
    page.wait_for_url(lambda address: "#/run/" in address and job["id"] not in address)
    page.click("#cancel")
    expect(page.locator("#state")).to_have_text("canceled")
    page.goto(f"{base}/#/run/{job['id']}")
    page.wait_for_selector("#study tbody tr")
    # While it continues, or when it has its result, its page leads there.
    expect(page.get_by_role("button", name="Continue")).to_be_visible()
    later = ask(base, "/v1/jobs", body, wait=False)
    page.reload()
    page.get_by_role("link", name="Open its continuation").click()
    page.wait_for_url(lambda address: job["id"] not in address)
    ask(base, f"/v1/jobs/{later['id']}/cancel", method="POST", wait=False)
    page.goto(f"{base}/#/run/{job['id']}")
    page.wait_for_selector("#study tbody tr")
    # A point of a study without a result opens its run, too.
    page.get_by_role("button", name="Open the run of point 1", exact=True).click()
    opened_run(page, 0, found)
    return job["id"]


def shared(page, browser, base, key):
    """The reader of a shared link sees the study, and cannot compute runs."""
    token = re.search("link=([^&]+)", ask(base, f"/v1/results/{key}/links", method="POST")["url"])[1]
    open_study(page, base, key, f"?link={token}")
    expect(page.locator("#ninety")).to_be_visible()
    expect(page.locator("#study tbody tr")).to_have_count(ROWS)
    expect(page.locator("#study tbody button")).to_have_count(0)


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
    """Returns the addresses of studies of several kinds."""
    page = browser.page(base)
    long_table(page, base)
    errors(page, base)
    warned(page, base)
    grid = curves(page, base)
    points(page, base, grid)
    three_numbers(page, base)
    sensitivity = bars(page, base)
    regimes = fretting_map(page, base)
    drawn = distribution(page, base)
    shared(page, browser, base, drawn)
    job = canceled(page, base)
    deleted(page, base)
    kinds(page, base)
    page.context.close()
    return {"study": f"/#/result/{grid}?kind=heat", "curves": f"/#/result/{grid}?kind=curves", "sensitivity": f"/#/result/{sensitivity}",
        "map": f"/#/result/{regimes}?points=3%3B80%3Btest", "sample": f"/#/result/{drawn}", "canceled": f"/#/run/{job}"}
