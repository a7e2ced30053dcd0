"""Results of jobs: arrays with units, numbers with errors, and a view for notebooks."""

from __future__ import annotations

import io
import json
import math
import warnings as warning
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from . import api_types as api
from . import display
from .tables import Array, Table, needed

if TYPE_CHECKING:
    import pandas
    import xarray


# Largest result in bytes. Compressed arrays can be endless.
LARGEST_RESULT = 1 << 30


@dataclass(frozen=True)
class Number:
    """A number in SI units with its absolute error (0 if the server states no error)."""

    value: float
    error: float
    unit: str

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        return display.number(self.value, self.error, self.unit)


@dataclass(frozen=True)
class Result:
    """A stored result. `parts` are its tables by name, and `meta` has all other members of the result, as in the API.

    `about` is the job, or of a result that `get` has read, its entry in the list of results. `said` are the warnings that
    the result itself does not contain.
    """

    about: Mapping[str, Any]
    said: Sequence[api.Warning]
    meta: Mapping[str, Any]
    parts: Mapping[str, Table]
    svg: bytes | None

    @classmethod
    def read(cls, about: Mapping[str, Any], said: Sequence[api.Warning], npz: bytes, svg: bytes | None) -> Self:
        """Reads the arrays of a result (format NPZ)."""
        with zipfile.ZipFile(io.BytesIO(npz)) as file:
            if sum(member.file_size for member in file.infolist()) > LARGEST_RESULT:
                raise ValueError("the arrays are too large")
        with np.load(io.BytesIO(npz), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        meta: dict[str, Any] = json.loads(str(arrays.pop("meta")))
        units: dict[str, str] = meta["units"]
        parts: dict[str, dict[str, Array]] = {}
        for path, array in arrays.items():
            part, name = path.split("/", 1)
            # The names in an archive have no slash at their start, JSON pointers have one.
            parts.setdefault(part, {})["/" + name if "/" + name in units else name] = array
        return cls(about, said, meta, {part: Table(columns, units) for part, columns in parts.items()}, svg)

    @property
    def key(self) -> str:
        """The key of the result on the server."""
        return str(self.about["key"])

    @property
    def job(self) -> api.Job:
        """The job that was submitted. A result that `get` has read has none."""
        if "state" not in self.about:
            raise AttributeError("A result that was read by its key has no job")
        return cast(api.Job, self.about)

    @property
    def warnings(self) -> list[str]:
        """Why the model may be wrong for this contact, and what a study found about its data."""
        return [said["detail"] for said in [*self.said, *self.meta.get("notes", [])]]

    def numbers(self) -> dict[str, str]:
        """The most important numbers as text, by their names."""
        return {name: str(count) for name, count in self.meta["counts"].items()}

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}: {text}" for name, text in self.numbers().items())
        return f"<{type(self).__name__} {self.key[:12]}… {shown}>"

    def _repr_html_(self) -> str:
        return display.html(self.about.get("label") or type(self).__name__, self.numbers(), self.warnings, self.svg)


class Run(Result):
    """The result of one scenario."""

    @property
    def history(self) -> Table:
        """Wear, radii and forces at each output cycle. Entry 0 is the unworn contact."""
        return self.parts["history"]

    @property
    def profiles(self) -> Table:
        """Curves over the radius, of the shape (output cycles, radii)."""
        return self.parts["profiles"]

    @property
    def loops(self) -> Table:
        """Friction loops, of the shape (output cycles, points)."""
        return self.parts["loops"]

    @property
    def wear_volume(self) -> Number:
        """The wear volume of both bodies after the last output cycle, in m³."""
        return self._last("wear_volume")

    @property
    def wear_depth(self) -> Number:
        """The largest depth of the scar after the last output cycle, in m."""
        return self._last("wear_depth")

    def _last(self, name: str) -> Number:
        value = float(self.history[name][-1])
        # The server states relative errors.
        relative = float(self.history[f"{name}_error"][-1]) if f"{name}_error" in self.history else 0.0
        return Number(value, value * relative, self.history.unit(name))

    def numbers(self) -> dict[str, str]:
        """Regime of the unworn contact, cycles, wear volume and wear depth."""
        return {
            "regime, unworn": str(self.meta["regime"]).replace("_", " "),
            "cycles": f"{self.history['cycles'][-1]:g}",
            "wear volume": str(self.wear_volume),
            "wear depth": str(self.wear_depth),
        }


class Study(Result):
    """The result of a sweep, a sensitivity study or a map."""

    @property
    def table(self) -> Table:
        """The columns of the study, of the shape (rows,)."""
        return self.parts["table"]

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a DataFrame in SI units. Needs pandas."""
        return self.table.to_pandas()

    @property
    def frame(self) -> pandas.DataFrame:
        """The name of `to_pandas()` up to version 0.4."""
        warning.warn("`frame` is now called `to_pandas()`", DeprecationWarning, stacklevel=2)
        return self.to_pandas()

    def to_xarray(self) -> xarray.Dataset:
        """A map, or a sweep over a grid, as a Dataset with one dimension for each number. Needs xarray."""
        if "map" not in self.meta and self.meta.get("sweep", {}).get("design") != "grid":
            raise TypeError("Only maps and sweeps with the design `grid` have dimensions. Use to_pandas()")
        needed("xarray")
        varied = [name for name in self.table if name.startswith("/")]
        data = self.to_pandas().set_index(varied).to_xarray()
        for name in self.table:
            data[name].attrs["units"] = self.table.unit(name)
        return data


class Fit(Study):
    """The result of a fit. Its table has a row for each measured point."""

    @property
    def estimates(self) -> dict[str, Number]:
        """The estimated numbers in SI units with their standard errors, by JSON pointer. NaN if the data determine no number.

        A number with one value for each group of tests has the names of the tests, too: `/friction for A1, A2`.
        """
        return {
            name: Number(_or_nan(estimate["estimate"]), _or_nan(estimate["standard_error"]), estimate["unit"])
            for name, estimate in self._parameters()
        }

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """The confidence intervals of the estimates in SI units, by JSON pointer. An open end is NaN."""
        return {
            name: (_or_nan(estimate["interval"][0]), _or_nan(estimate["interval"][1])) for name, estimate in self._parameters()
        }

    def _parameters(self) -> list[tuple[str, api.EstimatedParameter]]:
        # A fit without a minimum has no parameters. Its notes say why.
        parameters: list[api.EstimatedParameter] = self.meta.get("parameters", [])
        return [
            (" for ".join([each["pointer"], *([", ".join(each["for"])] if "for" in each else [])]), each) for each in parameters
        ]

    def numbers(self) -> dict[str, str]:
        """The estimates with their standard errors."""
        return {pointer: str(estimate) for pointer, estimate in self.estimates.items()}


def _or_nan(number: float | None) -> float:
    return math.nan if number is None else number


@dataclass(frozen=True)
class Evaluation:
    """Outputs in SI units. An output without a value is None, and `reasons` says why."""

    outputs: Mapping[str, float | None]
    units: Mapping[str, str]
    reasons: Mapping[str, str]

    def __getitem__(self, name: str) -> float:
        value = self.outputs[name]
        if value is None:
            raise ValueError(f"{name} has no value: {self.reasons[name]}")
        return value
