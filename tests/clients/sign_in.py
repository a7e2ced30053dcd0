"""Tests in a browser who may do what: one sign-in for all tabs, roles, the page of the access keys, shared links, names of
colleagues, and users of a sign-on proxy.

    python sign_in.py target/debug/fretwork

Writes screenshots to target/screens.
"""

import functools
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import expect

from browser import FIREFOX, LONG, LOOKS, Server, ask, curves, item, key_of, opened, smoothed, until

MASTER = "fretwork_" + "0123456789abcdef" * 3
SECRET = "the-secret-of-the-proxy"
server = functools.partial(Server, sys.argv[1])
# The controls that only some users have.
CONTROLS = ["Save", "Pin", "Note", "Share link", "Add measurement", "Fit", "Cancel"]


def keys(own, *arguments):
    """What a command for access keys prints."""
    command = [sys.argv[1], "keys", *arguments, "--data-dir", own.data]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def made(own, name, role):
    """A new key."""
    return re.search("fretwork_[0-9a-f_]+", keys(own, "add", name, "--role", role))[0]


def enter(page, key):
    """Enters a key in the dialog."""
    page.fill("#key", key)
    page.locator("dialog").get_by_role("button", name="Sign in").click()


def signed_in(browser, own, key, **view):
    """A page in a fresh profile that has signed in."""
    page = browser.page(own.base, **view)
    reply = page.context.request.post(own.base + "/v1/session", headers={"Authorization": f"Bearer {key}"})
    assert reply.status == 204, reply.text()
    return page


def open_menu(page):
    page.locator("#user summary").click()


def sign_out(page):
    open_menu(page)
    page.get_by_role("button", name="Sign out").click()


def refused(page, base):
    """Waits until the server refuses the session of a page."""
    until(page, lambda: page.context.request.get(base + "/v1/me").status != 200)


def one_sign_in(browser, own):
    """A user signs in once for all tabs, and out of all tabs."""
    page = browser.page(own.base)
    page.goto(own.base + "/")
    enter(page, "nonsense")
    expect(page.locator("#key-reason")).to_contain_text("rejected this key")
    enter(page, MASTER)
    expect(item(page, "regime")).to_have_text("Partial slip")
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("#headline dd")
    tab = page.context.new_page()
    tab.on("pageerror", lambda error: browser.errors.append(str(error)))
    tab.goto(own.base + "/#/library")
    expect(tab.locator(".entry")).to_have_count(1)
    for place in (tab, page):
        place.reload()
        expect(place.locator("#user summary")).to_have_text("admin")
        expect(place.locator("#key")).to_have_count(0)
    # No script can read the session, and the page keeps no key.
    kept = "document.cookie + JSON.stringify(sessionStorage) + JSON.stringify(localStorage)"
    assert page.evaluate(kept).startswith("{}") and "fretwork_" not in page.evaluate(kept) + page.content()
    [cookie] = page.context.cookies()
    assert cookie["httpOnly"] and cookie["sameSite"] == "Lax" and cookie["expires"] == -1, cookie
    # What is typed stays in the browser until the user signs out.
    page.goto(own.base + "/#/new")
    page.fill("#friction", "0.517")
    page.reload()
    expect(page.locator("#kept-input")).to_contain_text("Your input is back")
    tab.goto(own.base + "/#/new")
    tab.fill("#friction", "0.518")
    tab.reload()
    expect(tab.locator("#friction")).to_have_value("0.518")
    tab.goto(own.base + "/#/library")
    expect(tab.locator(".entry")).to_have_count(1)
    # Not without a question, in any tab.
    dialog = page.locator("dialog")
    for place, field in ((page, "0.517"), (tab, "0.518")):
        sign_out(place)
        expect(place.locator("dialog")).to_contain_text("What you have typed in forms of this browser and not saved as a run will be deleted.")
        browser.check_view(place, "sign-out")
        place.get_by_role("button", name="Cancel").click()
        place.reload()
        expect(place.locator("#user summary")).to_have_text("admin")
        place.goto(own.base + "/#/new")
        expect(place.locator("#friction")).to_have_value(field)
    # The input of one tab is a question in the other one, whose own was discarded.
    page.get_by_role("button", name="Discard it").click()
    # A request of the other tab that the server refuses during the sign-out asks why no longer.
    held = []
    tab.route("**/v1/results*", lambda route: held.append(route))
    tab.goto(own.base + "/#/library")
    sign_out(page)
    until(tab, lambda: held)
    ended = {"type": "/problems/session-ended", "status": 401, "detail": "The session has ended. Sign in again."}
    held[0].fulfill(status=401, content_type="application/problem+json", json=ended)
    expect(tab.locator("#key-reason")).to_have_text(ended["detail"])
    tab.unroute("**/v1/results*")
    dialog.get_by_role("button", name="Sign out and delete it").click()
    for place in (page, tab):
        place.wait_for_function(f"() => !/0.51[78]/.test({kept})")
        expect(place.locator("#key-reason")).to_have_text("You are signed out.")
        expect(place.locator("#user")).to_have_text("Sign in")
        expect(place.locator("nav")).to_be_hidden()
        # Nothing of what the user has read stays on the screen.
        expect(place.locator("main")).to_have_text("")
    assert page.context.cookies() == []
    # A sign-in in one tab is enough for the tabs that ask.
    enter(tab, MASTER)
    expect(tab.locator(".entry")).to_have_count(1)
    expect(page.locator("#key")).to_have_count(0)
    expect(page.locator("#headline dd").first).to_be_visible()
    page.context.close()


def revoked(browser, own):
    """A session ends with its key, also while the page only follows a run. The user can go on with another key."""
    anna = made(own, "anna", "submit")
    page = signed_in(browser, own, anna)
    page.goto(own.base + "/")
    expect(item(page, "regime")).to_have_text("Partial slip")
    reply = page.context.request.post(own.base + "/v1/jobs", headers={"Authorization": f"Bearer {anna}"}, data={"scenario": LONG})
    page.goto(f"{own.base}/#/run/{reply.json()['id']}")
    expect(page.locator("#state")).to_have_text("running")
    expect(page.locator("#cancel")).to_be_visible()
    keys(own, "revoke", "anna")
    expect(page.locator("#key-reason")).to_contain_text(re.compile(r"^The key [0-9a-f]{8} was revoked on .*20\d\d.* Sign in with another key\.$"))
    expect(page.locator("#key-reason time")).to_be_visible()
    enter(page, anna)
    expect(page.locator("#key-reason")).to_contain_text("rejected this key")
    # Without another key, nothing of the session stays on the screen, and the page does not ask again by itself.
    page.locator("dialog").get_by_role("button", name="Cancel").click()
    expect(page.locator("main h1")).to_have_text("Sign in")
    expect(page.locator("main")).to_contain_text("was revoked on")
    browser.check_view(page, "signed-out")
    page.get_by_role("button", name="Enter an access key").click()
    enter(page, MASTER)
    expect(page.locator("#user summary")).to_have_text("admin")
    page.click("#cancel")
    expect(page.locator("#state")).to_have_text("canceled")
    page.context.close()


def roles(browser, own, key):
    """Each role has only the controls that the server allows. `key` is a stored result."""
    running = ask_as(own, MASTER, "/v1/jobs", {"scenario": LONG, "label": "Long"})["id"]
    for role, expected in [("read", []), ("submit", CONTROLS[:-1]), ("admin", CONTROLS)]:
        page = signed_in(browser, own, made(own, f"one-{role}", role))
        denied = []
        page.on("response", lambda reply: reply.status in (401, 403) and denied.append(reply.url))
        shown = set()

        def look(address, ready):
            page.goto(own.base + address)
            page.locator(ready).first.wait_for(state="attached")
            open_actions(page)
            shown.update(name for name in CONTROLS if page.get_by_role("button", name=re.compile(f"^{name}")).count())

        look("/#/new", "#limited" if role == "read" else "#headline dd")
        expect(page.locator("nav a").first).to_have_text("Estimate" if role == "read" else "New run")
        expect(item(page, "regime")).to_have_text("Partial slip")
        page.fill("#friction", "0.5")
        expect(item(page, "regime")).to_have_text("Gross slip")
        page.press("#friction", "Control+Enter") if role == "read" else None
        look("/#/library?submitted_by=", ".entry")
        # The place of the note comes with the last buttons.
        look(f"/#/result/{key}", ".actions .note")
        look("/#/queue", "main h1")
        if role == "admin":
            look(f"/#/run/{running}", "#state")
        assert shown == set(expected) and not denied, (role, shown, denied)
        open_menu(page)
        expect(page.get_by_role("link", name="Access keys")).to_have_count(1 if role == "admin" else 0)
        page.goto(own.base + "/#/keys")
        if role != "admin":
            expect(page.locator("main .card")).to_have_text("Only administrators may see and change keys.")
        page.context.close()
    ask_as(own, MASTER, f"/v1/jobs/{running}/cancel", {})


def ask_as(own, key, path, body):
    """The JSON answer to a POST with a key."""
    return ask(own.base, path, body, wait=False, headers={"Authorization": f"Bearer {key}"})


def keys_page(browser, own):
    """An administrator makes a key, somebody uses it, and the administrator revokes it."""
    page = signed_in(browser, own, made(own, "chief", "admin"))
    page.goto(own.base + "/")
    open_menu(page)
    page.get_by_role("link", name="Access keys").click()
    # Until this view is drawn, the form of a new run is there, which has a name too.
    page.get_by_role("form", name="New key").get_by_label("Name").fill("carl")
    page.get_by_label("Role").select_option("read")
    page.get_by_label("Expires").select_option("30d")
    page.get_by_label("Requests", exact=True).select_option("own")
    page.get_by_label("Requests per minute").fill("120")
    page.get_by_role("button", name="Make a key").click()
    key = page.locator("#new-key").input_value()
    assert re.fullmatch("fretwork_[0-9a-f]{8}_[0-9a-f]{40}", key), key
    page.get_by_role("button", name="Copy key").click()
    assert page.evaluate("navigator.clipboard.readText()") == key
    row = page.locator(f"[data-key='{key.split('_')[1]}']")
    expect(row).to_contain_text(re.compile("carl.*readValid until .*120 per minute.*Never"))
    expect(page.locator("tr", has_text="chief")).to_contain_text("(your key)")
    browser.check_view(page, "key-made")
    # It works, and the list says when.
    carl = signed_in(browser, own, key)
    carl.goto(own.base + "/#/library")
    expect(carl.locator("#user summary")).to_have_text("carl")
    page.reload()
    expect(page.locator("#new-key")).to_have_count(0)
    expect(row).not_to_contain_text("Never")
    row.get_by_role("button", name="Revoke").click()
    expect(page.locator("dialog h2")).to_have_text(f"Revoke the key {key.split('_')[1]} of carl?")
    browser.check_view(page, "key-revoke")
    page.get_by_role("button", name="Cancel").click()
    expect(row.get_by_role("button")).to_have_count(1)
    row.get_by_role("button", name="Revoke").click()
    page.locator("dialog").get_by_role("button", name="Revoke").click()
    expect(row).to_contain_text("Revoked")
    expect(row.get_by_role("button")).to_have_count(0)
    refused(carl, own.base)
    carl.locator("nav >> text=Runs").click()
    expect(carl.locator("#key-reason")).to_contain_text("was revoked on")
    # A fault of the server is shown, and the form keeps its values.
    page.get_by_label("Name").fill("me")
    page.get_by_role("button", name="Make a key").click()
    expect(page.locator(".error")).to_contain_text("/name")
    assert page.get_by_label("Name").input_value() == "me"
    for each in (carl, page):
        each.context.close()
    for looks in LOOKS:
        width, scheme = looks[0]
        page = signed_in(browser, own, MASTER, scheme=scheme, width=width)
        page.goto(own.base + "/#/keys")
        page.wait_for_selector("[data-key]")
        browser.check_looks(page, "keys", looks)
        page.context.close()


def colleagues(browser, own):
    """A colleague finds a run by a word of its label, its tag and its note, and tags it. A private one is not found. Two users who change one
    note are told so."""
    key = made(own, "anne", "submit")
    anna, ben = signed_in(browser, own, key), signed_in(browser, own, made(own, "ben", "submit"))
    anna.goto(own.base + "/")
    for name, is_private in (("Gear box", False), ("Gear rim", True)):
        expect(item(anna, "regime")).to_have_text("Partial slip")
        anna.fill("#friction", "0.71" if is_private else "0.72")
        anna.fill("#label", name)
        anna.get_by_label("Only I see the name").set_checked(is_private)
        anna.locator("button.primary:enabled").click()
        anna.wait_for_url("**/#/result/*")
        expect(anna.locator("#result-label")).to_have_text(f"{name} (private name)" if is_private else name)
        if not is_private:
            result = anna.url
            note(anna, "Agrees with the shaft.")
            anna.goto(own.base + "/#/new")
    job = re.search("job=([0-9a-f-]+)", result)[1]
    ask(own.base, f"/v1/jobs/{job}", {"tags": ["pinion"]}, method="PATCH", wait=False, headers={"Authorization": f"Bearer {key}"})
    # Each user begins with her own results, and one click shows those of all.
    anna.goto(own.base + "/#/library?q=gear")
    expect(anna.locator(".entry")).to_have_count(2)
    ben.goto(own.base + "/#/library?q=gear")
    expect(ben.locator(".empty")).to_contain_text("No match")
    ben.get_by_role("button", name="Show those of all users").click()
    for words in ("gear", "PINION gear", "shaft"):
        ben.fill("#find-q", words)
        expect(ben.locator(".entry")).to_have_count(1)
        expect(ben.locator(".entry th")).to_contain_text(re.compile("Gear box.*anne", re.DOTALL))
    ben.fill("#find-q", "rim")
    expect(ben.locator(".empty")).to_contain_text("No match")
    ben.fill("#find-q", "gear")
    browser.check_view(ben, "library-of-all")
    ben.locator(".entry input").check()
    expect(ben.get_by_role("button", name="Rename")).to_have_count(0)
    ben.get_by_role("button", name="Tag").click()
    ben.get_by_label("Add tags").fill("ben-1")
    ben.get_by_role("button", name="Change tags").click()
    expect(ben.locator(".entry")).to_contain_text("ben-1")
    ben.reload()
    expect(ben.locator(".entry")).to_contain_text("ben-1")
    ben.goto(own.base + "/#/runs")
    expect(ben.locator(".empty")).to_contain_text("None of yours.")
    ben.get_by_role("button", name="Show those of all users").click()
    expect(ben.locator(".jobs tbody tr", has_text="Gear box")).to_contain_text("anne")
    expect(ben.locator(".jobs tbody")).not_to_contain_text("Gear rim")
    # Both have read the same note.
    for page in (anna, ben):
        page.goto(result)
        expect(page.locator(".actions .note")).to_contain_text("Agrees with the shaft.")
    expect(ben.locator("#result-label")).to_contain_text(re.compile("Gear box.*anne"))
    expect(ben.locator("#tags .tag")).to_have_text(["pinion", "ben-1"])
    expect(ben.locator("#hidden-inputs")).to_contain_text("Only the owner sees what was typed.")
    note(ben, "Ben agrees.")
    note(anna, "Anne agrees.")
    expect(anna.locator("dialog .warning")).to_contain_text("ben has changed the note: “Ben agrees.”")
    expect(anna.locator("#note")).to_have_value("Anne agrees.")
    browser.check_view(anna, "note-changed")
    anna.fill("#note", "Both agree.")
    anna.locator("dialog").get_by_role("button", name="Save").click()
    expect(anna.locator(".actions .note")).to_have_text("“Both agree.” (anne)")
    # A link shows guests no private name.
    anna.goto(own.base + "/#/library?q=rim")
    anna.locator(".entry th a").click()
    expect(anna.locator("#result-label")).to_have_text("Gear rim (private name)")
    anna.wait_for_selector("#headline dd")
    assert "label=" not in share(anna)
    for page in (anna, ben):
        page.context.close()


def note(page, text):
    """Types a note of the result that a page shows."""
    page.locator(".actions .note").wait_for(state="attached")
    open_actions(page)
    page.get_by_role("button", name="Note", exact=True).click()
    page.fill("#note", text)
    page.locator("dialog").get_by_role("button", name="Save").click()


def open_actions(page):
    """Opens the menu of a result, if the page has one."""
    page.evaluate("document.querySelectorAll('.actions details.menu').forEach((menu) => { menu.open = true; })")


def share(page):
    """The link that the button copies to the clipboard."""
    page.evaluate("navigator.clipboard.writeText('')")
    open_actions(page)
    page.get_by_role("button", name="Share link").click()
    return page.evaluate("""async () => {
        for (;;) {
            const text = await navigator.clipboard.readText();
            if (text) return text;
            await new Promise((done) => setTimeout(done, 50));
        }
    }""")


def shared(browser, own):
    """A guest without a key reads a shared result. Nothing on the page asks for a key, unless the guest wants to sign in."""
    dora = made(own, "dora", "submit")
    page = signed_in(browser, own, dora)
    page.goto(own.base + "/")
    expect(item(page, "regime")).to_have_text("Partial slip")
    page.fill("#label", "Shown to a guest")
    page.click("button.primary")
    page.wait_for_url("**/#/result/*")
    page.wait_for_selector("#headline dd")
    open_actions(page)
    page.select_option("#link-lifetime", label="for a day")
    link = share(page)
    assert 23 < (int(re.search(r"link=(\d+)", link)[1]) - time.time()) / 3600 <= 24, link
    key = key_of(page)
    guest = browser.page(own.base)
    denied = []
    guest.on("response", lambda reply: reply.status in (401, 403) and denied.append(reply.url))
    guest.goto(link)
    guest.wait_for_selector("#headline dd")
    expect(guest.locator("#result-label")).to_have_text("Shown to a guest")
    expect(guest.locator("#link-end")).to_contain_text(re.compile(r"^This link is valid until .*20\d\d"))
    assert guest.locator("#readout").inner_text() == page.locator("#readout").inner_text()
    # The lines are as smooth as those of its maker.
    smoothed(page)
    smoothed(guest)
    assert curves(guest, "History") == curves(page, "History") and curves(guest, "History")[0].count("L") > 30
    assert not any(guest.get_by_role("button", name=name).count() for name in CONTROLS)
    expect(guest.locator("nav")).to_be_hidden()
    browser.check_view(guest, "shared")
    guest.get_by_role("link", name="Open in the form").click()
    # What was typed, and not the effective modulus.
    expect(guest.locator("#bodies-0-youngs_modulus")).to_have_value("205 GPa")
    expect(guest.locator("#canonical")).to_be_hidden()
    assert guest.locator(".vary:visible").count() == 0
    expect(guest.locator("#limited")).to_contain_text("To compute and save a run with them, sign in with an access key.")
    expect(guest.locator("#label")).to_have_value("Shown to a guest")
    guest.fill("#friction", "0.5")
    guest.press("#friction", "Control+Enter")
    guest.reload()
    expect(guest.locator("#friction")).to_have_value("0.5")
    browser.check_view(guest, "shared-form")
    assert guest.locator("dialog").count() == 0 and set(denied) == {own.base + "/v1/me"}, denied
    # The guest has a key after all.
    guest.get_by_role("button", name="Sign in").first.click()
    enter(guest, dora)
    expect(item(guest, "regime")).to_have_text("Gross slip")
    expect(guest.get_by_role("button", name="Save")).to_be_enabled()
    # The link of a comparison opens both results, with their names.
    scenario = {**page.context.request.get(own.base + "/v1/examples/steel-ball").json()["scenario"], "friction": 0.6}
    second = ask(own.base, "/v1/jobs", {"scenario": scenario, "label": "Other"}, headers={"Authorization": f"Bearer {dora}"})["key"]
    page.goto(f"{own.base}/#/compare?keys={key},{second}")
    page.wait_for_selector("#compared")
    other = browser.page(own.base)
    other.goto(share(page))
    other.wait_for_selector("#compared")
    assert other.locator("#compared").inner_text() == page.locator("#compared").inner_text()
    expect(other.locator("#link-end")).to_contain_text("This link is valid until")
    # A link ends with the key of its maker.
    keys(own, "revoke", "dora")
    refused(page, own.base)
    other.goto(link)
    expect(other.locator(".error")).to_contain_text("no longer valid")
    assert other.locator("dialog").count() == 0 and other.get_by_role("link", name="How to fix this").count() == 0
    for each in (page, guest, other):
        each.context.close()
    return key


def sign_on(browser, data):
    """A user of a sign-on proxy has signed in already, and the proxy ends the session."""
    options = ["--auth-header", "X-Remote-User", "--auth-role", "submit", "--trusted-proxy", "127.0.0.1"]
    with server(data, *options, FRETWORK_AUTH_SECRET=SECRET) as own:
        page = browser.page(own.base)
        page.context.set_extra_http_headers({"X-Remote-User": "ben", "X-Fretwork-Proxy-Secret": SECRET})
        page.goto(own.base + "/")
        expect(item(page, "regime")).to_have_text("Partial slip")
        expect(page.locator("#user")).to_have_text("benRole: submit")
        assert page.get_by_role("button", name="Sign out").count() == 0
        page.click("button.primary")
        page.wait_for_url("**/#/result/*")
        page.wait_for_selector("#headline dd")
        # A link needs the key of its maker.
        open_actions(page)
        expect(page.get_by_role("button", name="Pin")).to_be_visible()
        assert page.get_by_role("button", name="Share link").count() == 0
        page.context.set_extra_http_headers({})
        page.click("nav >> text=Library")
        expect(page.locator(".error")).to_contain_text("Reload the page to sign on again.")
        assert page.locator("dialog").count() == 0
        page.context.close()


def main():
    with opened() as browser, tempfile.TemporaryDirectory() as data:
        directory = lambda name: str(pathlib.Path(data) / name)
        with server(directory("keys"), "--workers", "1", FRETWORK_ADMIN_KEY=MASTER) as own:
            own.data = directory("keys")
            browser.check_views(own.base, {"sign-in": ("/", "#key")})
            one_sign_in(browser, own)
            revoked(browser, own)
            roles(browser, own, shared(browser, own))
            keys_page(browser, own)
            colleagues(browser, own)
        sign_on(browser, directory("sign-on"))
    print(f"sign-in, roles, keys and shared links pass their tests in {'Firefox' if FIREFOX else 'Chromium'}")


main()
