"""Traces across a scar, from the files of instruments that the package SurfaceTopography opens."""

from __future__ import annotations

import operator
import os
import pathlib
import re
from dataclasses import dataclass
from typing import Any, SupportsIndex

import numpy as np

from .errors import FretworkError
from .tables import Array, Table, needed

# A line of a map.
Line = str | SupportsIndex
# The lengths of a line scan or of a map.
Size = float | tuple[float, float]

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9}
NUMBER = r"[+-]?\d*\.?\d+(?:[eE][+-]?\d+)?"
POSITIONS = re.compile(rf"\s*({NUMBER})(?:\.\.({NUMBER}))?\s*({'|'.join(LENGTHS)})\s*")
LINES = "an index, 'middle', 'mean', a position such as '0.4 mm', or a range such as '0.3..0.5 mm'"
# A mean of lines has converged if it changes by less than this length in m.
CONVERGED = 1e-12
ROUNDS = 100


class Trace(Table):
    """The columns `position` and `height` in m. Missing heights are masked. `source` says where the trace is from."""

    def __init__(self, position: Array, height: Array, source: str) -> None:
        super().__init__({"position": position, "height": np.ma.masked_invalid(height)}, {"position": "m", "height": "m"})
        self.source = source

    def __repr__(self) -> str:
        return f"<Trace {self.source}: {len(self['height'])} points, {np.ma.getmaskarray(self['height']).sum()} missing>"

    def text(self) -> str:
        """The trace as a file for `POST /v1/measurements`."""
        heights = np.ma.filled(self["height"], np.nan)
        rows = (f"{x:.10g}\t{z:.10g}" for x, z in zip(self["position"], heights, strict=True))
        return "\n".join(["position [m]\theight [m]", *rows, ""])


@dataclass(frozen=True)
class Surface:
    """The heights of a file in m: of a line scan over `x`, or of a map over `x` and `y`."""

    name: str
    x: Array
    y: Array | None
    heights: Array

    def line(self, row: Line | None, column: Line | None) -> Trace:
        """A line scan as it is, or a line of a map."""
        if self.y is None:
            if row is not None or column is not None:
                raise ValueError(f"{self.name} is a line scan. Remove `row` and `column`")
            return Trace(self.x, self.heights, self.name)
        if row is not None and column is None:
            return self._along(self.x, self.heights.T, Choice("row", row, self.y))
        if column is not None and row is None:
            return self._along(self.y, self.heights, Choice("column", column, self.x))
        counts = f"{len(self.y)} rows along x and {len(self.x)} columns along y"
        raise ValueError(f"{self.name} is a map of {counts}. Choose either `row` or `column`, such as row='middle'")

    def _along(self, position: Array, lines: Array, choice: Choice) -> Trace:
        found = choice.indices()
        return Trace(position, mean_of_lines(lines[found]), f"{self.name}, {choice.said(found)}")


@dataclass(frozen=True)
class Choice:
    """Which lines of a map are wanted: rows or columns, at the positions `where`."""

    kind: str
    wanted: Line
    where: Array

    def indices(self) -> Array:
        """The indices of the lines."""
        every = np.arange(len(self.where))
        if self.wanted == "mean":
            return every
        if self.wanted == "middle":
            return every[[len(every) // 2]]
        if isinstance(self.wanted, str):
            return self._at(*self._range(self.wanted))
        at = operator.index(self.wanted)
        if not -len(every) <= at < len(every):
            raise ValueError(f"{self.kind}={at} is outside of the map. Enter an index from 0 to {len(every) - 1}")
        return every[[at]]

    def _range(self, wanted: str) -> tuple[float, float]:
        found = POSITIONS.fullmatch(wanted)
        if not found:
            raise ValueError(f"{self.kind}={wanted!r} is no line. Enter {LINES}")
        low, high = sorted(float(number) * LENGTHS[found[3]] for number in (found[1], found[2] or found[1]))
        return low, high

    def _at(self, low: float, high: float) -> Array:
        """The line that is nearest to a position, or all between two positions."""
        step, last = self.where[1], self.where[-1]
        distance = np.abs(self.where - (low + high) / 2)
        found = np.flatnonzero(distance <= (high - low) / 2 + 1e-6 * step) if low < high else np.array([distance.argmin()])
        if len(found) == 0 or not -step <= low <= high <= last + step:
            place = f"from 0 to {last * 1e3:.6g} mm, every {step * 1e3:.6g} mm"
            raise ValueError(f"{self.kind}={self.wanted!r} is no {self.kind} of the map. Its {self.kind}s lie {place}")
        return found

    def said(self, found: Array) -> str:
        """The lines in words."""
        if len(found) > 1:
            return f"mean of the {self.kind}s {found[0]} to {found[-1]}"
        return f"{self.kind} {found[0]} at {self.where[found[0]] * 1e3:.6g} mm"


def mean_of_lines(lines: Array) -> Array:
    """The mean of lines, masked where fewer than half of them have a point.

    Each line may lie higher or lower than the others, as on a tilted map. So that a missing point does not shift the mean,
    it is the least-squares solution of height = mean + offset of the line.
    """
    mean = lines.mean(axis=0)
    for _ in range(ROUNDS if np.ma.is_masked(lines) else 0):
        offsets = (lines - mean).mean(axis=1, keepdims=True)
        last, mean = mean, (lines - np.ma.filled(offsets, 0.0)).mean(axis=0)
        if np.ma.filled(abs(mean - last), 0.0).max() < CONVERGED:
            break
    return np.ma.array(mean, mask=2 * np.ma.count(lines, axis=0) < len(lines))


def read_trace(
    path: str | os.PathLike[str],
    *,
    row: Line | None = None,
    column: Line | None = None,
    channel: str | None = None,
    unit: str | None = None,
    size: Size | None = None,
) -> Trace:
    """Reads a file of an instrument (.sur, .x3p, .opdx, .al3d and others). Needs `pip install 'fretwork-client[instruments]'`.

    Of a map, choose one line: `row` is a line along x, and `column` a line along y. It is an index from 0, a position such as
    `"0.4 mm"` from the first line, or `"middle"` (of the map, not of the scar). `"mean"`, or a range such as
    `"0.3..0.5 mm"`, is the mean of lines, for a scar that is straight across them. `channel` is the name of a channel of
    heights. If the file does not state them, `unit` is the unit of all lengths, and `size` the number of points times their
    spacing in this unit: `(along_x, along_y)` of a map.
    """
    return _surface(pathlib.Path(path), channel, unit, size).line(row, column)


def _surface(path: pathlib.Path, channel: str | None, unit: str | None, size: Size | None) -> Surface:
    files = needed("SurfaceTopography.IO", "'fretwork-client[instruments]'")
    try:
        with files.open_topography(os.fspath(path)) as reader:
            found = _channel(reader, path.name, channel)
            return _measured(found, path.name, _stated(found, path.name, unit, size))
    except (OSError, ValueError):
        raise
    # Its readers of damaged files raise more than its own errors.
    except Exception as error:
        other = "Save the file in another format, such as .x3p, or as text for `measurements`"
        raise FretworkError(f"SurfaceTopography cannot read {path.name}. {other}") from error


def _channel(reader: Any, name: str, wanted: str | None) -> Any:
    """The wanted channel, or the first one that has heights."""
    heights = [reader.default_channel, *reader.channels]
    heights = [each for each in heights if each.is_height_channel]
    for each in heights:
        if wanted in (None, each.channel_id):
            return each
    known = ", ".join(sorted({repr(each.channel_id) for each in heights})) or "none"
    raise ValueError(f"{name} does not have the wanted heights: channel={wanted!r}. Its channels of heights: {known}")


def _stated(channel: Any, name: str, unit: str | None, size: Size | None) -> dict[str, Any]:
    """What the file does not state."""
    if unit is not None and unit not in LENGTHS:
        raise ValueError(f"unit={unit!r} is no unit of length. Enter m, mm, um or nm")
    if size is not None and np.size(size) != channel.dim:
        raise ValueError(f"size={size!r} must have {channel.dim} length(s), because {name} has {channel.dim} dimension(s)")
    example = "size=(1200, 800)" if channel.dim == 2 else "size=1200"
    wanted = [
        ("unit", channel.unit, unit, "unit='um' (of all lengths)"),
        ("size", channel.physical_sizes, size, f"{example} (number of points times spacing, in this unit)"),
    ]
    for word, stated, given, _ in wanted:
        if stated is not None and given is not None:
            raise ValueError(f"{name} states its {word}: {stated}. Remove `{word}`")
    missing = [(word, add) for word, stated, given, add in wanted if stated is None and given is None]
    if missing:
        words, adds = zip(*missing, strict=True)
        hint = "" if channel.dim == 2 else ". If it is a text, `measurements` reads the units in its names"
        raise ValueError(f"{name} does not state its {' and '.join(words)}. Add {' and '.join(adds)}{hint}")
    both = {"unit": unit and unit.replace("μ", "µ"), "physical_sizes": size}
    return {word: value for word, value in both.items() if value is not None}


def _measured(channel: Any, name: str, stated: dict[str, Any]) -> Surface:
    topography = channel.topography(**stated).to_unit("m")
    heights = np.ma.masked_invalid(topography.heights())
    if topography.dim == 1:
        return Surface(name, np.array(topography.positions()), None, heights)
    x, y = (np.arange(count) * length / count for count, length in zip(heights.shape, topography.physical_sizes, strict=True))
    if 1 in heights.shape:
        return Surface(name, x if len(y) == 1 else y, None, heights.ravel())
    return Surface(name, x, y, heights)
