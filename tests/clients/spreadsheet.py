"""Reads results, tables and lists as CSV by pandas and by LibreOffice, both without options, and compares the numbers.

    python spreadsheet.py http://127.0.0.1:8080
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile
import urllib.request
import xml.etree.ElementTree

import pandas

BASE = sys.argv[1]
ROOT = pathlib.Path(__file__).parents[2]
NAME = "{urn:oasis:names:tc:opendocument:xmlns:"


def submit(example):
    """Computes an example and returns the key of its result."""
    headers = {"Content-Type": "application/json", "Prefer": "wait=60"}
    body = (ROOT / f"examples/{example}.json").read_bytes()
    with urllib.request.urlopen(urllib.request.Request(f"{BASE}/v1/jobs", body, headers)) as answer:
        done = json.load(answer)
    assert done["state"] == "succeeded", done
    return done["key"]


def rows(sheet):
    """The cells of a sheet: numbers, and texts."""
    for row in xml.etree.ElementTree.parse(sheet).getroot().iter(NAME + "table:1.0}table-row"):
        cells = []
        for cell in row.iter(NAME + "table:1.0}table-cell"):
            value = cell.get(NAME + "office:1.0}value")
            repeated = int(cell.get(NAME + "table:1.0}number-columns-repeated", "1"))
            cells += [float(value) if value else "".join(cell.itertext()).strip()] * repeated
        yield cells


def check(sheet, frame):
    header, *lines = rows(sheet)
    assert header[: len(frame.columns)] == list(frame.columns), header
    numbers = 0
    for (_, expected), line in zip(frame.iterrows(), lines[: len(frame)], strict=True):
        for value, cell in zip(expected, line, strict=False):
            if isinstance(value, float | int) and not isinstance(value, bool):
                # LibreOffice writes up to 20 decimals, so small numbers have fewer digits.
                assert cell == "" if math.isnan(value) else math.isclose(cell, value, rel_tol=1e-6), (value, cell)
                numbers += cell != ""
    print(f"{sheet.stem}: {len(frame)} rows, {numbers} numbers", flush=True)
    assert numbers


def main():
    run, study = submit("steel-ball"), submit("studies/sweep")
    parts = {part: f"results/{run}/{part}" for part in ["history", "profiles", "loops"]}
    addresses = parts | {"table": f"results/{study}/table", "results": "results", "jobs": "jobs"}
    with tempfile.TemporaryDirectory() as made:
        path, frames = pathlib.Path(made), {}
        for name, address in addresses.items():
            url = f"{BASE}/v1/{address}?format=csv&comments=none"
            frames[name] = pandas.read_csv(url)
            urllib.request.urlretrieve(url, path / f"{name}.csv")
        office = ["soffice", "--headless", f"-env:UserInstallation={(path / 'office').as_uri()}"]
        files = [path / f"{name}.csv" for name in frames]
        subprocess.run([*office, "--convert-to", "fods", "--outdir", path, *files], check=True, timeout=300, stdout=subprocess.DEVNULL)
        for name, frame in frames.items():
            check(path / f"{name}.fods", frame)
    print("LibreOffice and pandas read the same numbers")


main()
