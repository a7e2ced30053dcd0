"""Numbers of NumPy and quantities of pint where the API takes numbers."""

import itertools
from decimal import Decimal
from typing import Any

import numpy as np
import pint
import pytest
from conftest import changed

from fretwork_client import Client, InvalidRequest
from fretwork_client.api_types import Scenario
from fretwork_client.values import plain

units: Any = pint.UnitRegistry()
cgs: Any = pint.UnitRegistry(system="cgs")


def places(client: Client, scenario: Any) -> list[str]:
    """The places of the faults of a scenario."""
    with pytest.raises(InvalidRequest) as caught:
        client.run(scenario)
    return [fault.place for fault in caught.value.faults]


def test_quantities_give_the_result_of_plain_numbers(client: Client, ball: Scenario) -> None:
    plain_numbers: Any = changed(
        ball,
        bodies=[{"youngs_modulus": 2.05e11, "poisson_ratio": 0.3}] * 2,
        wear={"coefficient": 3.03e-14},
        load={"normal_force": 100, "held": "depth"},
        motion={"amplitude": 2.256e-6},
        profile={"shape": "cone", "slope_angle": np.pi / 90},
    )
    key = client.run(plain_numbers).key
    for registry in (units, cgs):
        steel = {"youngs_modulus": registry.Quantity(205, "GPa"), "poisson_ratio": registry.Quantity(30, "percent")}
        quantities = {
            **plain_numbers,
            "bodies": [steel, steel],
            "friction": registry.Quantity(0.7),
            "wear": {"coefficient": registry.Quantity(3.03e-5, "mm^3/(N*m)")},
            "load": {"normal_force": registry.Quantity(0.1, "kN"), "held": "depth"},
            "motion": {"amplitude": registry.Quantity(2.256, "um")},
            "profile": {"shape": "cone", "slope_angle": registry.Quantity(2, "deg")},
        }
        assert client.run(quantities).key == key


def test_each_dimension_of_a_scenario_has_a_unit_that_the_server_knows(client: Client) -> None:
    line = {
        "profile": {"shape": "cylinder", "radius": units("6 mm"), "length": units("10 mm")},
        "moduli": {"normal": units("113 GPa"), "tangential": units("1.3e7 psi")},
        "friction": 0.7,
        "wear": {"energy_coefficient": units("2e-5 mm^3/J")},
        "load": {"normal_force": units("18.5 N/mm")},
        "motion": {"amplitude": units("25 um"), "loop_stiffness": units("20 N/um")},
        "cycles": {"dissipated_energy": [1, 2] * units.joule},
        "until": {"wear_volume": units("1 mm^3")},
    }
    texts = {
        **line,
        "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"},
        "moduli": {"normal": "113 GPa", "tangential": "1.3e7 psi"},
        "wear": {"energy_coefficient": "2e-5 mm^3/J"},
        "load": {"normal_force": "18.5 N/mm"},
        "motion": {"amplitude": "25 um", "loop_stiffness": "20 N/um"},
        "cycles": {"dissipated_energy": ["1 J", "2 J"]},
        "until": {"wear_volume": "1 mm^3"},
    }
    assert client.run(line).key == client.run(texts).key


def test_a_wrong_dimension_is_a_fault_with_its_place(client: Client, ball: Scenario) -> None:
    wrong = changed(
        ball,
        load={"normal_force": units("100 kg")},
        motion={"amplitude": units("2 N")},
        friction=units("0.7 m"),
        wear={"coefficient": units("2e-5 mm^3/J")},
    )
    expected = ["/scenario/friction", "/scenario/load/normal_force", "/scenario/motion/amplitude", "/scenario/wear/coefficient"]
    assert sorted(places(client, wrong)) == expected
    with pytest.raises(InvalidRequest, match=r'/scenario/motion/amplitude: "N" is the unit of a force, but a length is needed'):
        client.run(changed(ball, motion={"amplitude": units("2 N")}))
    with pytest.raises(InvalidRequest, match=r'/scenario/load/normal_force: unknown unit "kilogram". Accepted units: N, '):
        client.run(changed(ball, load={"normal_force": units("100 kg")}))


def test_numbers_and_arrays_of_numpy_give_the_result_of_plain_numbers(client: Client, ball: Scenario) -> None:
    numbers = changed(
        ball,
        friction=np.float64(0.7),
        cycles=np.array([1000, 10000]),
        load={"normal_force": np.array(100), "held": "depth"},
        model={"method": "simplified", "points": np.int32(64)},
    )
    key = client.run(ball).key
    assert client.run(numbers).key == key
    assert client.run(changed(ball, cycles=np.ma.array([1e3, 1e4]))).key == key
    assert client.run(changed(ball, cycles=(np.uint16(1000), 10000.0))).key == key
    assert plain({"kept": np.bool_(True), "none": None, "names": np.array(["a"])}) == {
        "kept": True,
        "none": None,
        "names": ["a"],
    }


def test_studies_and_fits_take_arrays_and_quantities(client: Client, ball: Scenario) -> None:
    study = client.sweep(
        ball, {"/motion/amplitude": [1.0, 2.0] * units.um, "/friction": np.linspace(0.6, 0.7, 2)}, ["wear_volume"]
    )
    assert study.table["/motion/amplitude"].tolist() == [1e-6, 1e-6, 2e-6, 2e-6]
    assert study.table["/friction"].tolist() == [0.6, 0.7, 0.6, 0.7]
    cycles = np.array([3000, 10000])
    volumes = np.array([client.evaluate(changed(ball, cycles=[n]), ["wear_volume"])["wear_volume"] for n in cycles])
    start: Any = {"from": units("1e-6 mm^3/(N m)"), "to": 1e-12, "spacing": "log"}
    for y in (volumes, volumes * 1e9 * units.mm**3):
        data: Any = {"output": "wear_volume", "x": cycles, "y": y, "relative": np.float32(0.05)}
        fit = client.fit(ball, {"/wear/coefficient": start}, [{"data": [data]}])
        assert float(fit.estimates["/wear/coefficient"]) == pytest.approx(3.03e-14, rel=1e-3)


def test_a_missing_number_is_a_fault_with_its_place(client: Client, ball: Scenario) -> None:
    table = {"shape": "table", "radius": [0, np.nan, 2e-4], "height": np.ma.array([0, 1e-7, 4e-7], mask=[False, False, True])}
    amplitude = np.array([1, np.inf]) * units.um
    wrong = {**ball, "profile": table, "friction": np.ma.masked, "motion": {"blocks": amplitude}, "cycles": float("nan")}
    assert places(client, wrong) == [
        "/scenario/profile/radius/1",
        "/scenario/profile/height/2",
        "/scenario/friction",
        "/scenario/motion/blocks/1",
        "/scenario/cycles",
    ]


class Foreign:
    """A number with a unit of another package: an array that forgets its unit."""

    unit = "um"

    def __array__(self) -> Any:
        return np.array(2.0)


@pytest.mark.parametrize("value", [np.ones((2, 2)), Foreign(), 1j, np.complex128(1j), {1, 2}, b"2 um", Decimal(2), object()])
def test_a_value_that_is_no_number_is_a_fault_with_its_place(client: Client, ball: Scenario, value: Any) -> None:
    assert places(client, changed(ball, friction=value)) == ["/scenario/friction"]
    with pytest.raises(InvalidRequest, match=r"/sweep/vary/0/values/1: .* Enter "):
        client.sweep(ball, {"/friction": [0.7, value]}, ["wear_volume"])


def test_names_in_places_are_escaped() -> None:
    with pytest.raises(InvalidRequest) as caught:
        plain({"changes": {"/motion/a~b": float("nan")}})
    assert [fault.place for fault in caught.value.faults] == ["/changes/~1motion~1a~0b"]


def test_what_json_has_stays_as_it_is() -> None:
    values: list[Any] = [None, True, 3, 0.1, 10**400, "2 um", "", -0.0, [], {}]
    for one, other in itertools.product(values, repeat=2):
        body = {"a": one, "b": [other, {"c": one}]}
        assert plain(body) == body
