"""Tests line contacts, layers and run-ins in the dashboard."""

import jsonschema
from playwright.sync_api import expect

from browser import ask, item, key_of, near


def run(page):
    """Submits the form, and returns its result."""
    expect(page.locator("button.primary")).to_be_enabled()
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("#readout dd")
    base = page.url.split("/#")[0]
    result = ask(base, f"/v1/results/{key_of(page)}")
    jsonschema.validate(result["scenario"], ask(base, "/v1/schema/scenario"))
    return result


def edit(page):
    page.get_by_role("link", name="Edit and run again").click()
    expect(item(page, "regime")).to_be_visible()


def cylinder(browser, page, base):
    """A cylinder has a length, a force per length and a half-width. What needs a round contact is not offered."""
    page.goto(base + "/#/queue")
    page.goto(base + "/#/new?example=steel-ball")
    expect(item(page, "regime")).to_be_visible()
    page.select_option("#load", "indentation_depth")
    page.select_option("#shape", "cylinder")
    for choice, reason in (("load", "holds the force"), ("method", "needs a round contact")):
        expect(page.locator(f"#{choice} option:checked")).not_to_contain_text("JSON")
        expect(page.locator(f"#{choice}-hint")).to_contain_text(reason)
    expect(page.locator("#load-held, #model-compare, #motion-held")).to_have_count(0)
    expect(page.locator("#profile-radius")).to_have_value("10 mm")
    page.fill("#load-normal_force", "10 N/mm")
    # Half-width 2√(FR/(πE*)) at 10 N/mm, with R = 10 mm and E* = 205 GPa/1.82.
    expect(item(page, "contact-radius")).to_have_text("33.62\u00a0µm")
    expect(item(page, "normal-force")).to_have_text("100 N")
    page.select_option("#motion", "tangential_force")
    browser.check_accessibility(page, "form-cylinder")
    result = run(page)
    history = result["history"]
    near(page.locator("[data-value=contact_radius]").inner_text(), history["contact_radius"][-1], 5e-3)
    expect(page.locator("#readout")).to_contain_text("Contact half-width")
    expect(page.locator("section[aria-label=Profiles] .drawing")).to_contain_text("Distance x from the middle (µm)")
    # Displacements need a reference.
    assert history["amplitude"] == [None] * len(history["cycles"]), history["amplitude"]
    page.select_option("#choose-history", "depths")
    expect(page.locator("#missing")).to_contain_text("Amplitude at the reference. A line contact needs a reference distance")
    expect(page.locator("section[aria-label=History] .drawing")).to_be_hidden()
    expect(page.locator("#ratios")).to_contain_text("Not drawn: Fretting loop")
    page.select_option("#choose-history", "radii")
    expect(page.locator("section[aria-label=History]")).to_contain_text("Stick half-width")
    edit(page)
    page.fill("#motion-reference_distance", "5 mm")
    run(page)
    expect(page.locator("section[aria-label='Fretting loop'] .drawing")).to_be_visible()
    page.select_option("#choose-history", "depths")
    expect(page.locator("#missing")).to_have_text("")
    expect(page.locator("section[aria-label=History] .drawing")).to_be_visible()


def layers(page):
    """A coating is worn through. "Edit and run again" opens the same coating."""
    edit(page)
    page.select_option("#motion", "sliding_amplitude")
    page.fill("#motion-sliding_amplitude", "25 um")
    page.select_option("#wear", "bodies")
    page.fill("#wear-bodies-1-layers-0-thickness", "0.5 um")
    page.fill("#wear-bodies-0-coefficient", "0")
    page.select_option("#layers-2", "2")
    page.fill("#wear-bodies-1-layers-1-coefficient", "2e-5 mm^3/(N m)")
    [first, *_] = run(page)["events"]
    assert (first["kind"], first["body"], first["layer"]) == ("layer_worn_through", 1, 0), first
    shown = f"{round(first['cycles']):,}".replace(",", "\u202f")
    expect(page.locator("#events li").first).to_contain_text("Layer 1 of body 2 worn through")
    expect(page.locator("#events li").first).to_contain_text(f"at N = {shown}")
    edit(page)
    expect(page.locator("#shape")).to_have_value("cylinder")
    expect(page.locator("#layers-1")).to_have_value("0")
    expect(page.locator("#layers-2")).to_have_value("2")
    expect(page.locator("#wear-bodies-1-layers-1-coefficient")).to_have_value("2e-5 mm³/(N m)")
    expect(item(page, "cached")).to_have_text("Yes")


def run_in(page):
    """A friction coefficient that changes, of a wedge."""
    page.select_option("#wear", "coefficient")
    page.select_option("#shape", "wedge")
    page.select_option("#friction-kind", "run_in")
    page.fill("#friction-run_in-cycles", "500")
    page.fill("#cycles", "200, 1000")
    result = run(page)
    assert result["scenario"]["friction"] == {"over": "cycles", "at": [0, 500], "values": [0.2, 0.7]}, result["scenario"]
    # The whole contact slides, so Q = μF.
    force = result["scenario"]["load"]["normal_force"]
    for row, friction in ((0, 0.2), (-1, 0.7)):
        assert abs(result["history"]["tangential_force"][row] / (friction * force) - 1) < 1e-6, result["history"]
    expect(page.locator("h1")).to_contain_text("μ\u00a0=\u00a00.2…0.7")


def every_shape(page, base):
    """The form shows the suggested values of each shape with each of its motions. `every_default` tests that the server accepts them."""
    page.goto(base + "/#/queue")
    page.goto(base + "/#/new?example=steel-ball-simplified")
    expect(item(page, "regime")).to_be_visible()
    options = "field => [...field.options].map(({value}) => value)"
    shapes = page.locator("#shape").evaluate(options)
    assert {"cylinder", "wedge", "punch", "power_line", "crossed_cylinders"} < set(shapes), shapes
    for shape in shapes:
        page.select_option("#shape", shape)
        for motion in page.locator("#motion").evaluate(options):
            page.select_option("#motion", motion)
            assert "Not in the form" not in page.locator("details:has(#json)").text_content(), (shape, motion)
            expect(page.locator("option:checked", has_text="(JSON)")).to_have_count(0)


# Chooses a shape, a motion and one option more in the two examples of a steel ball. Returns the number of scenarios, and
# the choices and faults of those that the server refuses.
DEFAULTS = """async () => {
    const {choicesOf, chooseOption, optionsOf, withoutField} = await import("/assets/form/field-list.js");
    const answerTo = async (path, options) => (await fetch(path, options)).json();
    const after = ([words, scenario], isMeant) => choicesOf(scenario).filter(({id}) => isMeant(id)).flatMap((choice) =>
        Object.keys(optionsOf(choice, scenario)[0]).map((option) => {
            const changed = structuredClone(scenario);
            chooseOption(choice, {scenario: changed, study: {ranges: {}}, hidden: {}}, option);
            return [`${words} ${choice.id}=${option}`, changed];
        }));
    const examples = (await answerTo("/v1/examples")).filter(({name}) => name.startsWith("steel-ball"));
    const ends = examples.map(({name, body}) => [name, body.scenario]).flatMap((it) => after(it, (id) => id === "shape"))
        .flatMap((it) => after(it, (id) => id === "motion")).flatMap((it) => after(it, (id) => id !== "shape" && id !== "motion"));
    const distinct = [...new Map(ends.map(([words, scenario]) => [JSON.stringify({scenario}), [words, scenario]]))];
    const refused = [];
    const next = async () => {
        for (let one = distinct.pop(); one; one = distinct.pop()) {
            const [body, [words, scenario]] = one;
            const {key, errors} = await answerTo("/v1/scenarios", {method: "POST", body, headers: {"Content-Type": "application/json"}});
            if (!key || withoutField(scenario).length) refused.push([words, withoutField(scenario), errors]);
        }
    };
    const count = distinct.length;
    await Promise.all([next(), next(), next(), next()]);
    return [count, refused];
}"""


def every_default(page):
    """The server accepts the suggested values of each option, with each shape and motion."""
    count, refused = page.evaluate(DEFAULTS)
    assert count > 500 and not refused, (count, refused[:5])


def lines(browser, base):
    """Returns the key of a coated cylinder."""
    page = browser.page(base)
    cylinder(browser, page, base)
    layers(page)
    page.go_back()
    page.wait_for_selector("#events")
    coated = key_of(page)
    page.go_forward()
    expect(item(page, "regime")).to_be_visible()
    run_in(page)
    every_shape(page, base)
    every_default(page)
    page.context.close()
    return coated
