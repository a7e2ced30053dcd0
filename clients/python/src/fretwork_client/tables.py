"""Columns of numbers with their units."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import matplotlib.axes
    import pandas
    import xarray

Array = npt.NDArray[Any]

# For each SI unit: an engineering unit, and the factor from one to the other.
ENGINEERING = {
    "m": ("µm", 1e6),
    "m^3": ("mm³", 1e9),
    "Pa": ("MPa", 1e-6),
    "J": ("mJ", 1e3),
    "1/Pa": ("mm³/(N m)", 1e9),
}


def needed(module: str, install: str = "") -> Any:
    """A module of an optional package. `install` is what pip installs, if it is not the package itself."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        package = module.split(".")[0]
        raise ImportError(f"{package} is missing. Install it with: pip install {install or package}") from error


class Table(Mapping[str, Array]):
    """Arrays by name, such as `table["wear_depth"]`, in SI units. `table.unit(name)` is the unit, "1" for a plain number.

    A history has arrays of the shape (output cycles,). Profiles have `radius` of the shape (radii,) and curves of the shape
    (output cycles, radii). Loops have curves of the shape (output cycles, points); short loops end with NaN.
    """

    def __init__(self, columns: Mapping[str, Array], units: Mapping[str, str]) -> None:
        self._columns = dict(columns)
        self._units = {name: units.get(name, "1") for name in columns}

    def __getitem__(self, name: str) -> Array:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        shown = (f"{name} [{self._units[name]}] {array.shape}" for name, array in self.items())
        return f"Table({', '.join(shown)})"

    def unit(self, name: str) -> str:
        """The unit of a column."""
        return self._units[name]

    def engineering(self) -> Table:
        """The same table in µm, mm³, MPa, mJ and N."""
        columns, units = {}, {}
        for name, array in self.items():
            units[name], factor = ENGINEERING.get(self.unit(name), (self.unit(name), 1.0))
            columns[name] = array * factor if factor != 1.0 else array
        return Table(columns, units)

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame with a row for each entry. `attrs["units"]` has the units. Needs pandas, and columns of one dimension."""
        matrices = [name for name, array in self.items() if array.ndim > 1]
        if matrices:
            raise TypeError(f"{', '.join(matrices)} have two dimensions. Use to_xarray()")
        frame: pandas.DataFrame = needed("pandas").DataFrame(self._columns)
        frame.attrs["units"] = dict(self._units)
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset over `cycles`, and `radius` if the table has profiles. Each variable has its unit. Needs xarray."""
        across = "radius" if "radius" in self else "point"

        def dimensions(name: str, array: Array) -> tuple[str, ...]:
            along_radius = across == "radius" and name in ("radius", "initial", "limiting")
            return ("cycles", across)[: array.ndim] if not along_radius else ("radius",)

        coordinates = [name for name in ("cycles", "radius") if name in self]
        variables = {name: (dimensions(name, array), array, {"units": self.unit(name)}) for name, array in self.items()}
        dataset: xarray.Dataset = needed("xarray").Dataset(variables)
        return dataset.set_coords(coordinates)

    def plot(self, x: str, y: str, axes: matplotlib.axes.Axes | None = None) -> matplotlib.axes.Axes:
        """Draws one column over another, with labels and the engineering unit. Needs Matplotlib."""
        table = self.engineering()
        chosen: matplotlib.axes.Axes = axes or needed("matplotlib.pyplot").subplots()[1]
        chosen.plot(table[x], np.atleast_2d(table[y])[-1] if table[y].ndim > 1 else table[y])
        chosen.set_xlabel(table.label(x))
        chosen.set_ylabel(table.label(y))
        return chosen

    def label(self, name: str) -> str:
        """The name of a column for people, with its unit."""
        unit = self.unit(name)
        return name.replace("_", " ") + ("" if unit == "1" else f" [{unit}]")
