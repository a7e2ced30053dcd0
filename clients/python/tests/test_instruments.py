"""Files that SurfaceTopography opens, made by its writers or by the public layout of a format. tests/all runs this file."""

import pathlib
import re
import struct
from typing import Any

import numpy as np
import pytest
from conftest import Server
from test_traces import DEPTH, HALF_WIDTH, assert_near, prepared, surface

import fretwork_client
from fretwork_client import Client, FretworkError, Trace, read_trace

topographies: Any = pytest.importorskip("SurfaceTopography")
# A reader that refuses what a file does not state leaves this file open until it is collected.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
HERE = pathlib.Path(__file__).parents[1]
AREA = 4 / 3 * HALF_WIDTH * DEPTH


def write_sur(path: pathlib.Path, heights: Any, spacing: tuple[float, float]) -> None:
    """A map in µm in the layout of Digital Surf: 512 bytes, then whole numbers row by row. A missing point is zmin - 2."""
    step = 1e-4
    numbers = np.ma.filled(np.round(heights / step), -(2**31)).astype("<i4")
    low, high = numbers[numbers > -(2**31)].min(), numbers.max()
    numbers[numbers == -(2**31)] = low - 2
    columns, rows = heights.shape
    units = b"".join(text.encode("latin-1").ljust(16) for text in ["X", "Y", "Z", *["µm"] * 6])
    header = struct.pack("<12s4H30s30s5H2IH", b"DIGITAL SURF", 0, 1, 1, 2, b"scar".ljust(30), b"", 0, 0, 0, 1, 0, 0, 0, 32)
    header += struct.pack("<4iI3f", low, high, columns, rows, columns * rows, *spacing, step) + units
    header += struct.pack("<3f3H", 1, 1, 1, 0, 0, 0)
    path.write_bytes(header.ljust(512, b"\0") + numbers.T.tobytes())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """The same groove in many formats, in µm and in m, with missing points where the format can have them."""
    folder, scar = tmp_path_factory.mktemp("files"), surface()
    microns: Any = scar.heights * 1e6
    map_ = topographies.Topography(microns, (2004.0, 1608.0), unit="µm")
    map_.to_x3p(folder / "scar.x3p")
    map_.to_x3p(folder / "whole-numbers.x3p", dtype="L")
    map_.to_gwy(str(folder / "scar.gwy"))
    map_.to_netcdf(str(folder / "scar.nc"))
    map_.to_matrix(str(folder / "scar.txt"))
    write_sur(folder / "scar.sur", microns, (4, 8))
    write_sur(folder / "line.sur", microns[:, 100:101], (4, 8))
    topographies.Topography(scar.heights, (2.004e-3, 1.608e-3), unit="m").to_netcdf(str(folder / "metres.nc"))
    np.save(folder / "scar.npy", microns.filled(np.nan))
    rows = zip(scar.x * 1e6, microns[:, 100], strict=True)
    (folder / "scan.xyz").write_text("".join(f"{x:.6f} {z:.6f}\n" for x, z in rows if z is not np.ma.masked))
    return folder


def measured_heights(trace: Trace) -> Any:
    """The heights without missing points."""
    heights: Any = trace["height"]
    return heights.compressed()


MAPS = ["scar.x3p", "whole-numbers.x3p", "scar.gwy", "scar.nc", "metres.nc", "scar.txt", "scar.sur"]


@pytest.mark.parametrize("name", MAPS)
def test_each_format_gives_the_same_lines(folder: pathlib.Path, name: str) -> None:
    scar = surface()
    for row, column in (("middle", None), ("0.32 mm", None), (None, 250), ("mean", None)):
        found, expected = read_trace(folder / name, row=row, column=column), scar.line(row, column)
        np.testing.assert_allclose(found["position"], expected["position"], rtol=1e-6, atol=1e-12)
        difference = np.ma.filled(found["height"] - expected["height"], 0.0)
        assert np.abs(difference - difference.mean()).max() < 2e-10
        assert (np.ma.getmaskarray(found["height"]) == np.ma.getmaskarray(expected["height"])).all()
        assert found.source == expected.source.replace("scar.x3p", name)


@pytest.mark.parametrize("name", ["scar.sur", "scar.x3p", "metres.nc"])
def test_the_server_finds_the_area_of_the_groove_in_a_file(client: Client, folder: pathlib.Path, name: str) -> None:
    for row in ("middle", "mean"):
        assert_near(prepared(client, read_trace(folder / name, row=row))["area_removed"], AREA)


def test_a_line_scan_is_taken_as_it_is(client: Client, folder: pathlib.Path) -> None:
    scan = read_trace(folder / "scan.xyz", unit="um")
    assert_near(prepared(client, scan)["area_removed"], AREA)
    line, alone = surface().line(100, None), read_trace(folder / "line.sur")
    expected = measured_heights(line)
    np.testing.assert_allclose(measured_heights(scan), expected, atol=1e-11)
    np.testing.assert_allclose(measured_heights(alone), expected, atol=1e-10)
    assert alone.source == "line.sur"


def test_a_file_without_units_is_asked_for_them(client: Client, folder: pathlib.Path) -> None:
    with pytest.raises(ValueError, match=r"scar.npy does not state its unit and size. Add unit='um' .* size=\(1200, 800\)"):
        read_trace(folder / "scar.npy", row="middle")
    found = read_trace(folder / "scar.npy", row="middle", unit="um", size=(2004, 1608))
    assert_near(prepared(client, found)["area_removed"], AREA)
    with pytest.raises(ValueError, match=r"scan.xyz does not state its unit. Add unit='um' .* `measurements` reads"):
        read_trace(folder / "scan.xyz")


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("scar.x3p", {"unit": "um"}, "states its unit: m. Remove `unit`"),
        ("scar.x3p", {"size": (1, 1)}, "states its size: .* Remove `size`"),
        ("scar.npy", {"unit": "um", "size": 2004}, "must have 2 length"),
        ("scar.npy", {"unit": "inch", "size": (2004, 1608)}, "Enter m, mm, um or nm"),
        ("scar.gwy", {"channel": "Phase"}, "Its channels of heights: 'Topography'"),
        ("scar.x3p", {"row": None}, "Choose either `row` or `column`"),
        ("scar.x3p", {"column": "mean"}, "Choose either `row` or `column`"),
    ],
)
def test_an_argument_that_does_not_fit_the_file_is_refused(
    folder: pathlib.Path, name: str, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        read_trace(folder / name, **{"row": "middle", **options})


def test_a_file_of_no_instrument_is_refused(tmp_path: pathlib.Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_trace(tmp_path / "none.sur")
    for name, content in (("notes.txt", b"no numbers"), ("damaged.sur", b"DIGITAL SURF" + bytes(90))):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FretworkError, match=f"cannot read {name}. Save the file in another format"):
            read_trace(tmp_path / name)


def test_an_error_inside_a_reader_names_the_file(folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("SurfaceTopography.IO.open_topography", lambda _: [][0])
    with pytest.raises(FretworkError, match=r"cannot read scar\.sur"):
        read_trace(folder / "scar.sur")


def test_the_examples_of_the_documents_run(server: Server, folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    for document in (HERE / "README.md", HERE.parents[1] / "docs/calibration.md"):
        [example] = re.findall(r"```pycon\n(.*?)```", document.read_text(encoding="utf-8"), re.S)
        names: dict[str, Any] = {"fretwork_client": fretwork_client}
        with server.client() as names["client"]:
            exec(example.replace(">>> ", ""), names)
        assert "row 100" in names["trace"].source
