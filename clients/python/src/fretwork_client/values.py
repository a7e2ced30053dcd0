"""Values of Python as the JSON of the API: numbers of NumPy, and quantities of pint.

A quantity without a dimension is a plain number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .errors import Fault, InvalidRequest

# A unit of SI for each dimension that a scenario has. The server knows which dimension a member needs.
UNITS = ("m", "N", "N/m^2", "N/m", "m^3", "J", "1/Pa")


def plain(body: Mapping[str, Any]) -> dict[str, Any]:
    """A request without objects of NumPy and pint. Raises `InvalidRequest` with all values that are neither number nor text."""
    reader = Reader()
    read: dict[str, Any] = reader.read(body, "")
    if reader.faults:
        raise InvalidRequest(0, "The request has values that cannot be sent:", reader.faults)
    return read


class Reader:
    """Reads values, and collects faults. Places are JSON pointers, as in the faults that the server finds."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def read(self, value: Any, place: str) -> Any:
        """The value as JSON."""
        if value is None or isinstance(value, (str, bool, int)):
            return value
        if isinstance(value, float):
            return self._number(value, place)
        if isinstance(value, Mapping):
            return {name: self.read(member, f"{place}/{_escaped(name)}") for name, member in value.items()}
        if hasattr(value, "to_base_units"):
            return self._quantity(value, place)
        if hasattr(value, "unit") or hasattr(value, "units"):
            return self._refuse(place, 'has a unit that only its package knows. Enter a text such as "2 um", or a number in SI')
        if hasattr(value, "__array__"):
            return self._array(np.ma.asanyarray(value), place)
        if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray)):
            return [self.read(entry, f"{place}/{at}") for at, entry in enumerate(value)]
        return self._refuse(place, f'is a {type(value).__name__}. Enter a number, or a text with a unit such as "2 um"')

    def _number(self, value: float, place: str) -> Any:
        if math.isfinite(value):
            return float(value)
        return self._refuse(place, "is NaN, infinite or masked. Enter a number, or leave this point out")

    def _array(self, array: Any, place: str) -> Any:
        if array.ndim > 1:
            return self._refuse(place, f"is an array of {array.ndim} dimensions. Enter an array of one dimension")
        return self.read(array.astype(object).filled(math.nan).tolist(), place)

    def _quantity(self, value: Any, place: str) -> Any:
        """The numbers in SI, as texts with the unit, so that the server compares the dimension."""
        unit = _unit(value)
        numbers = self.read(value.to(unit).magnitude, place)
        if unit == "dimensionless":
            return numbers
        return [f"{number!r} {unit}" for number in numbers] if isinstance(numbers, list) else f"{numbers!r} {unit}"

    def _refuse(self, place: str, detail: str) -> Any:
        self.faults.append(Fault(place, detail))


def _unit(quantity: Any) -> str:
    """The unit in which a quantity is sent. The server refuses a unit of a dimension that no scenario has."""
    if quantity.dimensionless:
        return "rad" if "radian" in str(quantity.to_base_units().units) else "dimensionless"
    unit = next((unit for unit in UNITS if quantity.is_compatible_with(unit)), str(quantity.units))
    # A wear coefficient per energy has the dimension of one per load and distance. The server tells them apart by their units.
    return "m^3/J" if unit == "1/Pa" and "joule" in str(quantity.units) else unit


def _escaped(name: object) -> str:
    """A name in a JSON pointer."""
    return str(name).replace("~", "~0").replace("/", "~1")
