"""Views of results for notebooks."""

from __future__ import annotations

import base64
import html as escaping
import math
from collections.abc import Mapping, Sequence

from .tables import ENGINEERING


def number(value: float, error: float, unit: str) -> str:
    """A number in engineering units, with two digits of its error: `0.1822 ± 0.0014 mm³`."""
    name, factor = ENGINEERING.get(unit, (unit, 1.0))
    value, error = value * factor, error * factor
    if math.isnan(value):
        return "undetermined"
    suffix = "" if name == "1" else f" {name}"
    if not error or not math.isfinite(error):
        return f"{value:.4g}{suffix}"
    exponent = math.floor(math.log10(abs(value))) if value else 0
    if -3 <= exponent < 5:
        exponent = 0
    scaled, spread = value / 10.0**exponent, error / 10.0**exponent
    digits = max(0, 1 - math.floor(math.log10(spread)))
    both = f"{scaled:.{digits}f} ± {spread:.{digits}f}"
    return f"({both})·10{superscript(exponent)}{suffix}" if exponent else both + suffix


def superscript(exponent: int) -> str:
    """An exponent in superscript digits."""
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def html(title: str, numbers: Mapping[str, str], warnings: Sequence[str], svg: bytes | None) -> str:
    """Title, numbers, warnings and figure. All texts are escaped. A figure in `img` can neither run scripts nor load files."""
    text = escaping.escape
    rows = "".join(
        f'<tr><th style="text-align:left">{text(name)}</th><td style="text-align:left">{text(value)}</td></tr>'
        for name, value in numbers.items()
    )
    notes = "".join(f"<p>Note: {text(warning)}</p>" for warning in warnings)
    figure = ""
    if svg:
        data = base64.b64encode(svg).decode("ascii")
        figure = f'<img alt="{text(title)}" style="background:white" src="data:image/svg+xml;base64,{data}">'
    return f"<div><strong>{text(title)}</strong><table>{rows}</table>{notes}{figure}</div>"
