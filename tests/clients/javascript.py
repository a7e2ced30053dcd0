"""Tests the module of clients/javascript: its types, in Node.js, and in a page of another origin in Chromium, with a key, cut
streams, and a server that is killed.

    python javascript.py target/debug/fretwork
"""

import functools
import http.server
import json
import os
import pathlib
import re
import shutil
import ssl
import subprocess
import sys
import tempfile
import threading
import urllib.request

from playwright.sync_api import sync_playwright

from browser import CHROMIUM, PATIENCE, ROOT, Server, blocks, programs

MODULE = ROOT / "clients/javascript"
NODE = ROOT / "target/clients/node/node_modules/.bin"
KEY = "fretwork_" + "0123456789abcdef" * 3
RULES = ["--target", "es2023", "--lib", "es2023,dom,dom.iterable,dom.asynciterable", "--module", "esnext",
         "--moduleResolution", "bundler", "--strict"]  # fmt: skip
# The steel ball of the documents.
SHORT = {
    "profile": {"shape": "paraboloid", "radius": "10 mm"},
    "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
    "friction": 0.7,
    "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
    "load": {"normal_force": "100 N"},
    "motion": {"amplitude": "2 um"},
    "cycles": [1000, 10000],
}


def run(*command, **options):
    subprocess.run([str(word) for word in command], check=True, timeout=programs.PATIENCE, **options)


def types(directory):
    for file in (MODULE / "fretwork.d.ts", ROOT / "tests/clients/types.mts"):
        shutil.copy(file, directory)
    run(NODE / "openapi-typescript", ROOT / "openapi/openapi.json", "--output", directory / "api.d.ts", stdout=subprocess.DEVNULL)
    run(NODE / "tsc", directory / "types.mts", "--noEmit", *RULES)
    print("the types of the module are those of the API", flush=True)


def names():
    """What fretwork.d.ts says that the module exports, and the methods of `Client`."""
    text = (MODULE / "fretwork.d.ts").read_text()
    client = text[text.index("export class Client") :]
    methods = re.findall(r"^  (\w+)\(", client[: client.index("\n}")], re.M)
    return sorted(re.findall(r"^export (?:class|function) (\w+)", text, re.M)) + sorted(methods)


def node(own, jobs):
    """From an empty directory, with the module as the server gives it."""
    with tempfile.TemporaryDirectory() as empty:
        module = pathlib.Path(empty, "fretwork.js")
        with urllib.request.urlopen(f"{own.base}/assets/fretwork.js") as answer:
            module.write_bytes(answer.read())
        assert module.read_bytes() == (MODULE / "fretwork.js").read_bytes()
        # Without a package.json, only the suffix says that this is a module.
        module = module.rename(module.with_suffix(".mjs"))
        command = ["node", ROOT / "tests/clients/javascript.mjs", module, json.dumps({"base": own.base, "key": KEY, **jobs})]
        with subprocess.Popen(command, cwd=empty, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
            for line in program.stdout:
                assert line == "restart\n", line
                own.kill()
                own.start()
                program.stdin.write("done\n")
                program.stdin.flush()
        assert program.returncode == 0, program.returncode
    print("the module works in Node.js", flush=True)


class Files(http.server.SimpleHTTPRequestHandler):
    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".mjs": "text/javascript"}

    def log_message(self, *_):
        pass


def certificates():
    """In Node.js, the error names an unknown certificate and the variable, which makes the same certificate known."""
    with tempfile.TemporaryDirectory() as made:
        file = pathlib.Path(made, "certificate.pem")
        words = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=test -addext subjectAltName=DNS:localhost"
        run("openssl", *words.split(), "-keyout", file, "-out", file, stderr=subprocess.DEVNULL)
        pathlib.Path(made, "thing.json").write_text("{}")
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(file)
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, directory=made)) as server:
            server.socket = context.wrap_socket(server.socket, server_side=True)
            threading.Thread(target=server.serve_forever, daemon=True).start()
            script = f"""
                const {{ Client }} = await import({json.dumps(str(MODULE / "fretwork.js"))});
                const answer = new Client("https://localhost:{server.server_address[1]}").request("/thing.json");
                console.log(await answer.then(JSON.stringify, (error) => error.message));"""
            ask = lambda **known: subprocess.run(
                ["node", "--input-type=module", "--eval", script], env=os.environ | known, capture_output=True, text=True, check=True).stdout
            refused = ask()
            assert "certificate" in refused and refused.endswith("in NODE_EXTRA_CA_CERTS.\n"), refused
            assert ask(NODE_EXTRA_CA_CERTS=file) == "{}\n"
            server.shutdown()
    print("the module names an unknown certificate", flush=True)


def chromium(own, pages, jobs):
    def restart():
        own.kill()
        own.start()

    with sync_playwright() as play:
        page = play.chromium.launch(executable_path=shutil.which(CHROMIUM), args=["--no-sandbox"]).new_page()
        page.expose_function("restart", restart)
        page.goto(f"{pages}/page.html")
        page.evaluate("""async ([base, options]) => {
            const { test } = await import("/javascript.mjs");
            await test(await import(`${base}/assets/fretwork.js`), options, restart);
        }""", [own.base, {"base": own.base, "key": KEY, **jobs}])
    print("the module works in a page of another origin", flush=True)


def main(program):
    with tempfile.TemporaryDirectory() as made:
        directory = pathlib.Path(made)
        types(directory)
        certificates()
        shutil.copy(ROOT / "tests/clients/javascript.mjs", directory)
        (directory / "page.html").write_text("<!doctype html><title>A page</title>")
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, directory=directory)) as files:
            threading.Thread(target=files.serve_forever, daemon=True).start()
            pages = f"http://localhost:{files.server_address[1]}"
            jobs = {"short": {"scenario": SHORT}, "long": {"scenario": blocks(20_000, count=200)}}
            jobs |= {"nowhere": "http://127.0.0.1:9", "patience": PATIENCE, "names": names()}
            with Server(program, f"{made}/data", "--cors-origin", pages, FRETWORK_ADMIN_KEY=KEY) as own:
                node(own, jobs)
            with Server(program, f"{made}/other", "--cors-origin", pages, FRETWORK_ADMIN_KEY=KEY) as own:
                chromium(own, pages, jobs)
            files.shutdown()


main(sys.argv[1])
