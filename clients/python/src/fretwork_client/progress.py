"""Progress of a job: a bar of tqdm, a function of the caller, or nothing."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any, Protocol


class Progress(Protocol):
    """Shows the progress of one job, a number from 0 to 1."""

    def show(self, part: float) -> None: ...

    def close(self) -> None: ...


class Silent:
    """Shows nothing."""

    def show(self, part: float) -> None:
        """Shows nothing."""

    def close(self) -> None:
        """There is nothing to close."""


class Called(Silent):
    """Calls a function of the caller."""

    def __init__(self, function: Callable[[float], None]) -> None:
        self._function = function

    def show(self, part: float) -> None:
        self._function(part)


class Bar:
    """A bar of tqdm, which appears if the job takes longer than a second."""

    def __init__(self) -> None:
        from tqdm.auto import tqdm

        self._bar: Any = tqdm(total=1.0, delay=1.0, leave=False, bar_format="fretwork {percentage:3.0f} % |{bar}| {elapsed}")

    def show(self, part: float) -> None:
        self._bar.update(part - self._bar.n)

    def close(self) -> None:
        self._bar.close()


def chosen(progress: bool | Callable[[float], None]) -> Callable[[], Progress]:
    """What makes a display for each job. With True, it is a bar if tqdm is installed."""
    if callable(progress):
        return lambda: Called(progress)
    return Bar if progress and importlib.util.find_spec("tqdm") else Silent
