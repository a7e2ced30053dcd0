"""All operations against a server with and without keys."""

import asyncio
import pathlib
import sys
from typing import cast

import matplotlib
import numpy as np
import pytest
from conftest import Server, changed

from fretwork_client import AccessDenied, ApiError, AsyncClient, Client, InvalidRequest, Run, Study
from fretwork_client.api_types import FitParameter, MeasuredPoints, Scenario

matplotlib.use("Agg")
EXAMPLES = pathlib.Path(__file__).parents[3] / "examples"


def test_a_run_has_arrays_units_and_errors(client: Client, ball: Scenario) -> None:
    run = client.run(changed(ball, model={"method": "exact", "points": 64}), label="a <b>ball</b>", tags=["test"])
    assert run.history["cycles"].tolist() == [0, 1000, 10000]
    assert run.profiles["wear"].shape == (3, 64)
    assert run.loops["displacement"].shape == run.loops["tangential_force"].shape
    assert run.history.unit("wear_volume") == "m^3"
    assert run.wear_volume.value == run.history["wear_volume"][-1] > 0
    assert 0 < run.wear_depth.error < 0.02 * run.wear_depth.value
    engineering = run.history.engineering()
    assert engineering.unit("wear_depth") == "µm"
    np.testing.assert_allclose(engineering["wear_depth"], run.history["wear_depth"] * 1e6)


def test_a_run_shows_its_numbers_and_an_escaped_picture(client: Client, ball: Scenario) -> None:
    html = client.run(ball, label="a <b>ball</b>")._repr_html_()
    assert "a &lt;b&gt;ball&lt;/b&gt;" in html
    assert "partial slip" in html
    assert "data:image/svg+xml;base64," in html
    assert "<b>" not in html
    assert "<svg" not in html


def test_an_evaluation_agrees_with_a_run(client: Client, ball: Scenario) -> None:
    found = client.evaluate(ball, ["wear_volume", "events.gross_slip"])
    assert found["wear_volume"] == client.run(ball).wear_volume.value
    with pytest.raises(ValueError, match=r"events\.gross_slip has no value"):
        found["events.gross_slip"]


def test_a_sweep_is_a_frame(client: Client, ball: Scenario) -> None:
    study = client.sweep(ball, {"/friction": [0.6, 0.7], "/motion/amplitude": {"from": "1 um", "to": "2 um", "count": 3}},
                         ["wear_volume"])  # fmt: skip
    frame = study.to_pandas()
    with pytest.deprecated_call(match="to_pandas"):
        assert study.frame.equals(frame)
    assert list(frame.columns) == ["/friction", "/motion/amplitude", "wear_volume", "reason"]
    assert len(frame) == 6
    assert frame.attrs["units"]["wear_volume"] == "m^3"
    grid = study.to_xarray()
    assert grid["wear_volume"].shape == (2, 3)
    assert grid["wear_volume"].attrs["units"] == "m^3"


def test_a_sensitivity_study_has_a_row_for_each_number(client: Client, ball: Scenario) -> None:
    local = client.sensitivity(ball, ["/wear/coefficient", "/friction"], ["wear_volume"], method="local")
    assert local.table["member"].tolist() == ["/wear/coefficient", "/friction"]
    sobol = client.sensitivity(ball, {"/friction": {"from": 0.65, "to": 0.75}}, ["wear_volume"], samples=64)
    assert sobol.table["total"][0] == pytest.approx(1, abs=0.1)


def test_a_map_has_regimes(client: Client, ball: Scenario) -> None:
    study = client.map(ball, {"from": "10 N", "to": "1 kN", "count": 4}, {"from": "1 um", "to": "9 um", "count": 5})
    assert set(study.table["regime"]) == {"partial_slip", "gross_slip"}
    assert study.to_xarray()["regime"].shape == (4, 5)


def test_a_fit_finds_the_coefficient(client: Client, ball: Scenario) -> None:
    volume = client.evaluate(ball, ["wear_volume"])["wear_volume"]
    fit = client.fit(
        ball,
        {"/wear/coefficient": {"from": 1e-15, "to": 1e-12, "spacing": "log", "start": 1e-14}},
        [{"name": "A", "data": [{"output": "wear_volume", "x": [10000], "y": [volume], "relative": 0.05}]}],
    )
    assert float(fit.estimates["/wear/coefficient"]) == pytest.approx(3.03e-14, rel=1e-3)
    low, high = fit.intervals["/wear/coefficient"]
    assert low < 3.03e-14 < high


def test_a_fit_says_what_the_data_do_not_determine(client: Client, ball: Scenario) -> None:
    worn = changed(ball, cycles=[10**9])
    volume = client.evaluate(worn, ["wear_volume"])["wear_volume"]
    start: FitParameter = {"pointer": "/wear/coefficient", "from": 1e-15, "to": 1e-12, "spacing": "log", "start": 1e-14}
    fit = client.fit(worn, [start], [{"data": [{"output": "wear_volume", "x": [1e9], "y": [volume], "relative": 0.05}]}])
    assert "undetermined" in fit._repr_html_()
    assert np.isnan(fit.intervals["/wear/coefficient"]).all()
    assert any("wear has stopped" in warning for warning in fit.warnings)


def test_a_result_is_read_by_its_key(client: Client, ball: Scenario) -> None:
    # The result does not contain the bodies, so the warning about them comes with the submission.
    unlike: Scenario = {**ball, "bodies": [ball["bodies"][0], {"youngs_modulus": "70 GPa", "poisson_ratio": 0.1}]}
    run = client.run(unlike, label="a ball")
    assert run.warnings
    found = client.get(run.key)
    assert isinstance(found, Run)
    assert (found.warnings, found.wear_volume) == (run.warnings, run.wear_volume)
    assert "a ball" in found._repr_html_()
    with pytest.raises(AttributeError, match="has no job"):
        _ = found.job
    study = client.get(client.sweep(ball, {"/friction": [0.6, 0.7]}, ["wear_volume"]).key)
    assert isinstance(study, Study)
    assert len(study.to_pandas()) == 2
    with pytest.raises(ApiError) as caught:
        client.get("0" * 64)
    assert caught.value.status == 404


def test_lists_have_what_was_submitted(client: Client, ball: Scenario) -> None:
    run = client.run(ball, label="listed")
    assert client.jobs(limit=1)[0]["id"] == run.job["id"]
    assert run.key in [entry["key"] for entry in client.results(shape="paraboloid", limit=200)]
    assert client.cancel(run.job["id"])["state"] == "succeeded"


def test_derivatives_have_errors(client: Client, ball: Scenario) -> None:
    (found,) = client.derivatives(client.run(ball), ["wear_volume"], ["/friction"])
    assert found["unit"] == "m^3"
    assert abs(found["error"] or 0) < 1e-3 * abs(found["value"] or 0)


def test_a_file_of_measurements_becomes_data_of_a_fit(client: Client, ball: Scenario) -> None:
    measured = client.measurements(EXAMPLES / "measured/volumes.csv", x="cycles", level=False)
    assert measured["prepared"]
    data = cast(MeasuredPoints, {**(measured["prepared"]["data"] or {}), "relative": 0.05})
    fit = client.fit(ball, {"/wear/coefficient": {"from": 1e-15, "to": 1e-12, "spacing": "log"}}, [{"data": [data]}])
    assert float(fit.estimates["/wear/coefficient"]) == pytest.approx(4.2e-14, rel=0.2)


def test_profiles_and_histories_become_datasets_and_frames(client: Client, ball: Scenario) -> None:
    run = client.run(ball)
    assert run.profiles.to_xarray()["worn"].sel(cycles=1000).dims == ("radius",)
    assert run.history.to_xarray()["wear_depth"].dims == ("cycles",)
    assert run.loops.to_xarray()["displacement"].dims == ("cycles", "point")
    assert run.history.to_pandas()["wear_volume"].iloc[-1] == run.wear_volume.value
    with pytest.raises(TypeError, match="to_xarray"):
        run.profiles.to_pandas()
    axes = run.profiles.plot("radius", "wear")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("radius [µm]", "wear [µm]")
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_ydata()), run.profiles["wear"][-1] * 1e6)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, client: Client, ball: Scenario) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        client.run(ball).history.to_pandas()


def test_a_fault_has_its_place_and_says_what_to_change(client: Client, ball: Scenario) -> None:
    with pytest.raises(InvalidRequest) as caught:
        client.run(changed(ball, friction="0.7", frction=1))
    assert {fault.place for fault in caught.value.faults} == {"/scenario/friction", "/scenario/frction"}
    assert "Did you mean `friction`?" in str(caught.value)


def test_a_wrong_key_is_an_error(server: Server, ball: Scenario) -> None:
    if not server.key:
        pytest.skip("a server without keys")
    with Client(server.url, "wrong", trust_env=False) as client, pytest.raises(AccessDenied):
        client.run(ball)


def test_the_asynchronous_client_computes_many_runs_at_once(server: Server, ball: Scenario) -> None:
    async def volumes() -> list[float]:
        async with AsyncClient(server.url, server.key, trust_env=False) as client:
            runs = await asyncio.gather(*(client.run(changed(ball, friction=friction)) for friction in (0.6, 0.7, 0.8)))
            study = await client.sweep(ball, {"/friction": [0.6, 0.7, 0.8]}, ["wear_volume"])
            assert study.table["wear_volume"].tolist() == [run.wear_volume.value for run in runs]
            with pytest.raises(InvalidRequest):
                await client.run(changed(ball, friction=-1))
            return [run.wear_volume.value for run in runs]

    found = asyncio.run(volumes())
    assert found == sorted(found, reverse=True)
