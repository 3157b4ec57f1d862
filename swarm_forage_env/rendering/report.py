"""The report page: one HTML file about studies, out of a template, a style sheet, a script and plain values.

Its parts lie in `report_page`. Nothing is loaded from elsewhere; the page itself forbids that. Needs Jinja2 (the
optional extra "plots"), which is imported when a page is built.
"""

import base64
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any


def build_report(values: Mapping[str, Any]) -> str:
    """Return the page as text.

    Args:
        values: What `report_page/report.html` names; a name that is missing is an error, and all texts are escaped.

    Raises:
        ImportError: Jinja2 is not installed.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    pages = Environment(
        loader=FunctionLoader(_part), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    pages.filters["shown"] = shown
    return pages.get_template("report.html").render(values) + "\n"


def shown(cell: Any) -> str:
    """Return a cell of a table as readers see it: about four digits, no exponent where digits do, a dash for nothing.

    shown(1492.625), shown(0.0128571)  # ("1,493", "0.01286")
    """
    if cell is None:
        return "-"
    if not isinstance(cell, float):
        return f"{cell:,}" if isinstance(cell, int) and not isinstance(cell, bool) else str(cell)
    return f"{cell:,.0f}" if 1e3 <= abs(cell) < 1e7 else f"{cell:.4g}"


def picture_address(content: bytes, kind: str = "image/svg+xml") -> str:
    """Return a picture as an address that holds all of it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


@cache
def _part(name: str) -> str:
    return resources.files("swarm_forage_env.rendering").joinpath("report_page", name).read_text(encoding="utf-8")
