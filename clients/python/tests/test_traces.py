"""Lines of maps, and what the server makes of them."""

import math
import sys
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from fretwork_client import Client, Trace, read_trace
from fretwork_client.traces import Surface, mean_of_lines

DEPTH, HALF_WIDTH = 5e-6, 300e-6


def scar(distance: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A parabolic scar in a plane."""
    return -DEPTH * np.maximum(0, 1 - (distance / HALF_WIDTH) ** 2)


def surface(shape: str = "groove") -> Surface:
    """A tilted map of 2 mm × 1.6 mm with noise of 20 nm and missing points: a groove along y, or a crater."""
    random = np.random.default_rng(59)
    x, y = np.arange(501) * 4e-6, np.arange(201) * 8e-6
    along_x, along_y = x[:, None] - 1.1e-3, y[None, :] - 0.8e-3
    distance = np.hypot(along_x, along_y) if shape == "crater" else along_x + 0 * along_y
    map_ = scar(distance) + 0.01 * along_x + 0.03 * along_y + random.normal(0, 20e-9, distance.shape)
    return Surface("scar.x3p", x, y, np.ma.array(map_, mask=random.random(map_.shape) < 0.1))


def prepared(client: Client, trace: Trace, **options: Any) -> dict[str, Any]:
    """What the server makes of a trace."""
    found = client.measurements(trace, **options)["prepared"]
    assert found
    return found["trace"]


def assert_near(found: dict[str, float], truth: float) -> None:
    """The number is right within three standard deviations, which are at most 2 %."""
    assert found["error"] < 0.02 * truth
    assert abs(found["value"] - truth) < 3 * found["error"]


def test_a_line_of_a_map_has_the_area_of_the_groove(client: Client) -> None:
    groove = surface()
    for trace in (groove.line("middle", None), groove.line("0.32 mm", None), groove.line(np.int64(-1), None)):
        found = prepared(client, trace)
        assert_near(found["area_removed"], 4 / 3 * HALF_WIDTH * DEPTH)
        assert found["centre"] == pytest.approx(1.1e-3, abs=4e-6)
    assert groove.line("0.32 mm", None).source == "scar.x3p, row 40 at 0.32 mm"


def test_the_mean_of_lines_has_less_noise(client: Client) -> None:
    groove = surface()
    one, mean, some = (prepared(client, groove.line(row, None)) for row in ("middle", "mean", "0.4..0.8mm"))
    assert_near(mean["area_removed"], 4 / 3 * HALF_WIDTH * DEPTH)
    # The noise of a mean of n lines is 1/√n of that of one line. Points of neighbouring lines are independent here.
    assert one["scatter"] / mean["scatter"] == pytest.approx(math.sqrt(0.9 * 201), rel=0.25)
    assert one["scatter"] / some["scatter"] == pytest.approx(math.sqrt(0.9 * 51), rel=0.25)


@pytest.mark.parametrize("direction", ["row", "column"])
def test_a_line_across_a_crater_has_its_volume(client: Client, direction: str) -> None:
    crater = surface("crater")
    trace = crater.line("0.8 mm", None) if direction == "row" else crater.line(None, "1.1 mm")
    assert_near(prepared(client, trace)["volume_removed"], math.pi / 2 * HALF_WIDTH**2 * DEPTH)


def test_options_of_a_trace_reach_the_server(client: Client) -> None:
    line = surface().line("middle", None)
    assert prepared(client, Trace(line["position"], -line["height"], "turned"), up="in")["depth"]["value"] > 0.9 * DEPTH
    columns = client.measurements(line, prepare="points")["columns"]
    assert [column["unit"] for column in columns] == ["m", "m"]
    assert sum(value is None for value in columns[1]["values"]) == np.ma.getmaskarray(line["height"]).sum() > 20
    assert columns[0]["values"] == pytest.approx(line["position"], rel=1e-9)


def test_a_missing_point_of_a_tilted_map_does_not_shift_the_mean() -> None:
    random = np.random.default_rng(7)
    truth, offsets = scar(np.linspace(-1e-3, 1e-3, 300)), np.linspace(0, 50e-6, 80)[:, None]
    # The deep points of low lines are missing.
    gone = (random.random((80, 300)) < 0.2) | ((truth < -2e-6) & (offsets < 15e-6))
    difference = mean_of_lines(np.ma.array(truth + offsets, mask=gone)) - truth
    assert np.ptp(difference) < 1e-11
    gone[:41, 5] = True
    assert np.flatnonzero(np.ma.getmaskarray(mean_of_lines(np.ma.array(truth + offsets, mask=gone)))).tolist() == [5]


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (201, "from 0 to 200"),
        (-202, "from 0 to 200"),
        ("0.4", "a position such as '0.4 mm'"),
        ("top", "'middle', 'mean'"),
        ("2 mm", "from 0 to 1.6 mm, every 0.008 mm"),
        ("-0.1 mm", "from 0 to 1.6 mm"),
        ("0.401..0.403 mm", "every 0.008 mm"),
        (None, "201 rows along x and 501 columns along y"),
    ],
)
def test_a_line_that_a_map_does_not_have_is_refused(row: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        surface().line(row, None)


def test_a_range_contains_the_lines_at_its_ends() -> None:
    assert surface().line("0.16..0.08mm", None).source == "scar.x3p, mean of the rows 10 to 20"
    assert surface().line("8e1..160 um", None).source == "scar.x3p, mean of the rows 10 to 20"


def test_a_line_scan_has_no_rows() -> None:
    scan = Surface("scan.xyz", np.arange(3.0), None, np.ma.masked_invalid([1.0, np.nan, 2.0]))
    trace = scan.line(None, None)
    assert trace.text() == "position [m]\theight [m]\n0\t1\n1\tnan\n2\t2\n"
    assert repr(trace) == "<Trace scan.xyz: 3 points, 1 missing>"
    assert trace.engineering().unit("height") == "µm"
    with pytest.raises(ValueError, match="Remove `row`"):
        scan.line(1, None)


def test_the_optional_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(ImportError, match=r"pip install 'fretwork-client\[instruments\]'"):
        read_trace("scar.sur", row=0)
