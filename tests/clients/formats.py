"""Reads one result in every format with common libraries, and compares the formats: each must contain
the same numbers, the key and the units.

    python formats.py http://127.0.0.1:8080
"""

import gzip
import io
import json
import sys
import urllib.error
import urllib.request
from pathlib import Path

import numpy
import pandas
import polars
import pyarrow
import pyarrow.feather
import pyarrow.ipc

BASE = sys.argv[1]
ROOT = Path(__file__).resolve().parents[2]

# A cone: its pressure is infinite at the apex.
JOB = {
    "scenario": {
        "profile": {"shape": "cone", "slope_angle": "2 deg"},
        "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3e-5 mm^3/(N m)"},
        "load": {"indentation_depth": "3 um"},
        "motion": {"stick_ratio": 0.5},
        "cycles": {"normalized": [1, 4, 16]},
        "model": {"method": "simplified", "points": 64},
    }
}

# For each SI unit: the engineering unit, and the factor and the divisor of the conversion.
ENGINEERING = {
    "m": ("um", 1e6, 1.0),
    "m^3": ("mm^3", 1e9, 1.0),
    "Pa": ("MPa", 1.0, 1e6),
    "J": ("mJ", 1e3, 1.0),
    "1/Pa": ("mm^3/(N m)", 1e9, 1.0),
}


def get(path, **headers):
    """Sends a GET request. Returns the status, the headers and the body."""
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    request = urllib.request.Request(BASE + path, headers=names)
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read()


def body(path, **headers):
    status, _, content = get(path, **headers)
    assert status == 200, (path, status, content[:500])
    return content


def submit(job):
    """Computes a job and returns the key of its result."""
    headers = {"Content-Type": "application/json", "Prefer": "wait=60"}
    request = urllib.request.Request(f"{BASE}/v1/jobs", json.dumps(job).encode(), headers)
    with urllib.request.urlopen(request) as answer:
        done = json.load(answer)
    assert done["state"] == "succeeded", done
    return done["key"]


def numbers(column):
    """A column of JSON as an array; null is NaN."""
    return numpy.array(column, dtype=float)


def same(found, expected, what):
    """Asserts that two arrays are equal in every bit. NaN equals NaN."""
    found, expected = numpy.asarray(found), numpy.asarray(expected)
    assert found.shape == expected.shape, (what, found.shape, expected.shape)
    assert numpy.array_equal(found, expected, equal_nan=True), what


def tidy(part, table):
    """Expands a JSON table to rows, as the CSV has them. Returns the columns."""
    table = {name: column for name, column in table.items() if name != "limiting" or column}
    if part == "history":
        return {name: numbers(column) for name, column in table.items()}
    matrix = next(column for column in table.values() if isinstance(column[0], list))
    widths = [len(row) for row in matrix]
    columns = {}
    for name, column in table.items():
        if isinstance(column[0], list):
            columns[name] = numpy.concatenate([numbers(row) for row in column])
        elif part == "profiles" and name != "cycles":
            columns[name] = numpy.tile(numbers(column), len(widths))
        else:
            columns[name] = numpy.repeat(numbers(column), widths)
    return columns


def header(name, units):
    unit = units.get(name, "1")
    return name if unit == "1" else f"{name}[{unit}]"


def check_part(key, part, query=""):
    """Compares one table in all formats."""
    address = f"/v1/results/{key}/{part}?{query}"
    columns = json.loads(body(f"{address}&format=json"))
    units, table = columns["units"], columns[part]
    expected = tidy(part, table)
    headers = {name: header(name, units) for name in expected}
    assert columns["key"] == key

    # The request of Grafana's Infinity data source (backend parser, root selector `records`).
    grafana = {
        "User_Agent": "Grafana/12.2.0",
        "Accept": "application/json;q=0.9,text/plain",
        "Accept_Encoding": "gzip",
    }
    status, told, content = get(f"{address}&layout=records", **grafana)
    assert status == 200 and told["Content-Type"] == "application/json"
    if told["Content-Encoding"] == "gzip":
        content = gzip.decompress(content)
    rows = json.loads(content)
    assert (rows["key"], rows["engine"], rows["units"]) == (key, columns["engine"], units)
    frame = pandas.DataFrame.from_records(rows["records"])
    for name, column in expected.items():
        same(frame[name].astype(float), column, ("records", part, name))

    lines = body(f"{address}&format=ndjson")
    engine = "{name}/{numerics}".format(**columns["engine"])
    by_pandas = pandas.read_json(io.BytesIO(lines), lines=True, precise_float=True)
    by_polars = polars.read_ndjson(io.BytesIO(lines))
    assert set(by_pandas["key"]) == {key} and set(by_pandas["engine"]) == {engine}
    assert by_polars["key"].unique().to_list() == [key]
    for name, column in expected.items():
        found = by_pandas[headers[name]].to_numpy(dtype=float)
        # The CSV reader rounds the last digit. The exact text is compared with the JSON below.
        numpy.testing.assert_allclose(found, column, rtol=4e-16, atol=0, err_msg=name)
        same(by_polars[headers[name]].cast(float).fill_null(numpy.nan), column, ("polars", name))
    for line, row in zip(lines.splitlines(), rows["records"], strict=True):
        line = json.loads(line)
        assert all(line[header(name, units)] == value for name, value in row.items())

    csv = body(f"{address}&format=csv").decode()
    assert f"# key: {key}\n" in csv and '"name":"fretwork"' in csv
    frame = pandas.read_csv(io.StringIO(csv), comment="#")
    for name, column in expected.items():
        same(frame[headers[name]], column, ("csv", part, name))
    assert frame.equals(pandas.read_csv(f"{BASE}{address}&format=csv&comments=none")), part

    arrow = body(f"{address}&format=arrow")
    found = pyarrow.ipc.open_file(arrow).read_all()
    about = {name.decode(): value.decode() for name, value in found.schema.metadata.items()}
    assert about["key"] == key and about["part"] == part
    assert json.loads(about["units"]) == units
    assert json.loads(about["engine"]) == columns["engine"]
    by_polars = polars.read_ipc(io.BytesIO(arrow))
    by_feather = pyarrow.feather.read_table(io.BytesIO(arrow))
    assert by_feather.equals(found)
    for name, column in expected.items():
        assert found.schema.field(name).metadata[b"unit"].decode() == units.get(name, "1")
        assert found.column(name).null_count == numpy.isnan(column).sum()
        same(found.column(name).to_pandas(), column, ("arrow", part, name))
        same(by_polars[name].fill_null(numpy.nan), column, ("polars", part, name))

    with numpy.load(io.BytesIO(body(f"{address}&format=npz")), allow_pickle=False) as arrays:
        about = json.loads(str(arrays["meta"]))
        assert (about["key"], about["engine"], about["units"]) == (key, columns["engine"], units)
        check_arrays(arrays, "", table)
    return columns


def check_arrays(arrays, prefix, table):
    """Asserts that the NPZ arrays of a table have the shape of its JSON columns."""
    for name, column in table.items():
        found = arrays[prefix + name]
        assert found.dtype == numpy.float64, name
        if column is None:
            assert numpy.isnan(found).all(), name
        elif isinstance(column[0], list):
            for row, shown in zip(column, found, strict=True):
                same(shown[: len(row)], numbers(row), name)
                assert numpy.isnan(shown[len(row) :]).all(), name
        else:
            same(found, numbers(column), name)


def check_whole(key):
    whole = json.loads(body(f"/v1/results/{key}"))
    content = body(f"/v1/results/{key}", Accept="application/x-npz")
    with numpy.load(io.BytesIO(content), allow_pickle=False) as arrays:
        for part in ["history", "profiles", "loops"]:
            check_arrays(arrays, f"{part}/", whole[part])
        about = json.loads(str(arrays["meta"]))
    assert about == {name: whole[name] for name in about}
    assert set(whole) - set(about) == {"history", "profiles", "loops"}
    return whole


def check_units(key, whole):
    """Asserts that each quantity in engineering units is its SI value times a factor, with 12 digits."""
    told = json.loads(body(f"/v1/results/{key}?units=engineering"))
    assert told["scenario"] == whole["scenario"]
    seen = set()

    def compare(name, si, shown):
        if isinstance(si, dict):
            for member in si:
                compare(member, si[member], shown[member])
        elif isinstance(si, list):
            for one, other in zip(si, shown, strict=True):
                compare(name, one, other)
        elif isinstance(si, float):
            unit = whole["units"].get(name, "1")
            expected, factor, divisor = ENGINEERING.get(unit, (unit, 1.0, 1.0))
            assert shown == (si if unit == expected else float(f"{si * factor / divisor:.11e}")), name
            assert told["units"].get(name, "1") == expected, name
            seen.add(unit)
        else:
            assert si == shown, name

    for member in ["scales", "unworn", "limit", "history", "profiles", "loops", "accuracy"]:
        compare(member, whole[member], told[member])
    assert seen >= set(ENGINEERING) | {"N", "1"}, seen


def check_digits(key, whole):
    for digits in [3, 7, 12]:
        table = json.loads(body(f"/v1/results/{key}/profiles?digits={digits}"))["profiles"]
        exact = numbers(whole["profiles"]["wear"]).ravel()
        expected = [float(f"{number:.{digits - 1}e}") for number in exact]
        same(numbers(table["wear"]).ravel(), expected, digits)
        path = f"/v1/results/{key}/profiles?digits={digits}"
        kind = numpy.float32 if digits <= 7 else numpy.float64
        with numpy.load(io.BytesIO(body(f"{path}&format=npz"))) as arrays:
            assert arrays["wear"].dtype == kind
            same(arrays["wear"].ravel(), numpy.array(expected, dtype=kind), digits)
        arrow = pyarrow.ipc.open_file(body(f"{path}&format=arrow")).read_all()
        same(arrow["wear"].to_numpy(), numpy.array(expected, dtype=kind), digits)


def check_held(key):
    """A request with the ETag of a previous answer gets 304, with and without compression."""
    tags = set()
    csv, arrow = "/history?format=csv", "/profiles?format=arrow"
    for path in ["", csv, "/profiles?digits=3", arrow, "?format=npz"]:
        path = f"/v1/results/{key}{path}"
        plain = body(path)
        for coding in ["identity", "gzip", "zstd"]:
            status, headers, content = get(path, Accept_Encoding=coding)
            used = headers.get("Content-Encoding", "identity")
            if used != "identity":
                content = pyarrow.input_stream(pyarrow.py_buffer(content), compression=used).read()
            assert (status, content) == (200, plain), (path, coding)
            assert used == ("identity" if "npz" in path else coding), (path, coding, used)
            tag = headers["ETag"]
            assert tag.startswith("W/") == (used != "identity"), tag
            assert "accept-encoding" in headers["Vary"]
            held = get(path, Accept_Encoding=coding, If_None_Match=f'"other", {tag}')
            assert (held[0], held[1]["ETag"], held[2]) == (304, tag, b""), held
            tags.add(tag.removeprefix("W/"))
    assert len(tags) == 5, tags


def check_arrow():
    """Arrow files with words and nulls, of several batches, and without rows have what JSON has."""
    def read(key, part):
        file = pyarrow.ipc.open_file(body(f"/v1/results/{key}/{part}?format=arrow"))
        table = file.read_all()
        table.validate(full=True)
        # Readers of streams skip the first eight bytes.
        assert pyarrow.ipc.open_stream(body(f"/v1/results/{key}/{part}?format=arrow")[8:]).read_all().equals(table)
        return file.num_record_batches, table

    key = submit(json.loads((ROOT / "examples/studies/map.json").read_text()))
    table = json.loads(body(f"/v1/results/{key}/table"))["table"]
    batches, found = read(key, "table")
    assert found.to_pydict() == table and batches == 1
    assert any(type(column[0]) is str for column in table.values()) and any(None in column for column in table.values())

    many = {**JOB["scenario"], "cycles": {"normalized": {"from": 0.1, "to": 16, "count": 1000}}, "profiles_at": "all"}
    many["model"] = {**many["model"], "points": 100}
    key = submit({"scenario": many})
    expected = tidy("profiles", json.loads(body(f"/v1/results/{key}/profiles"))["profiles"])
    batches, found = read(key, "profiles")
    assert batches > 1 and found.num_rows > 65536
    for name, column in expected.items():
        same(found.column(name).to_pandas(), column, ("arrow", name))

    key = submit({"scenario": {**JOB["scenario"], "profiles_at": "none"}})
    batches, found = read(key, "profiles")
    assert found.num_rows == 0 and "pressure" in found.column_names


def main():
    key = submit(JOB)
    whole = check_whole(key)
    for part in ["history", "profiles", "loops"]:
        assert check_part(key, part)[part] == whole[part]
        check_part(key, part, "units=engineering&digits=12")
    check_part(key, "profiles", "fields=pressure,slip&points=9&cycles=0")
    check_units(key, whole)
    check_digits(key, whole)
    check_held(key)
    check_arrow()
    print("every form holds the same numbers")


main()
