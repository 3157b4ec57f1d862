"""How figures are made and saved: formats, width, fonts, and how policies look in them.

Every figure begins with `saved_figure` or `saved_panels`. The style is `figures.mplstyle` over the defaults of
matplotlib: no file of the user or of the current folder has a say, and nothing of it stays. The same numbers and
versions give the same bytes. Needs matplotlib (the optional extra "plots"), which is imported when something is drawn.
"""

import math
import re
import textwrap
import warnings
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.files import check_file, replacing
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.types import FloatArray

Figure: TypeAlias = Any
"""A `Figure` of matplotlib, whose types leave too much open for strict checking."""
Panel: TypeAlias = Any
"""An `Axes` of matplotlib."""

_UNDATED: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
FORMATS = tuple(_UNDATED)
"""Endings of files that can be written."""
NO_MATPLOTLIB = f"No picture without matplotlib: {install_command('plots')}."

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
"""Okabe-Ito palette: told apart by readers with any colour vision. The last one is hard to see on white."""
MARKERS = "osD^vPX*"
"""One per colour, so that lines differ without their colours, too."""
POLICY_NAMES = {"crw": "CRW", "dpo": "DPO", "stochm": "STOCHM", "stochx": "STOCHX"}
"""Names of the paper; their order is that of their colours."""
_POLICY_WORD = re.compile(rf"(?<![\w./\\:=-])({'|'.join(POLICY_NAMES)})(?![\w./\\:=-])")
"""One of them as a word of its own, no part of a file's name."""
_PLACES_OF_OTHERS = (6, 4, 5, 0, 1, 2, 3, 7)
"""Colours of other policies: black stands out beside the paper's."""
PANELS_PER_ROW = 4
_NARROWEST_PANEL = 0.25
"""Inches per point of the font: with less, the numbers along an axis run into each other."""
_FEW_DECADES = 100.0
"""Over less than two decades, powers of ten alone are too few numbers along an axis."""
_FLATTEST = 0.8
"""Height of a figure that is made narrower, as a share of its width: words need as much height as before."""
_LETTER, _LINE = 0.55, 1.3
"""Width of a letter and height of a line as shares of the height of the font, roughly."""
_NARROWEST_FIGURE_IN = 5.2
"""Unless a style says otherwise: room for a headline."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FigureStyle:
    """What differs between a screen and a paper."""

    width_in: float | None = None
    """Width in inches, exactly; default what the panels want. Heights follow, and long words are wrapped."""
    font_size: float = 9.0
    """Size of texts in points."""
    title: bool = True
    """Whether figures have a headline; in a paper, the caption says it."""

    def __post_init__(self) -> None:
        """Refuse what no page has.

        Raises:
            ConfigError: see above.
        """
        if self.width_in is not None:
            number("width_in", self.width_in, at_least=2.0, at_most=100.0)
        number("font_size", self.font_size, at_least=4.0, at_most=40.0)

    def columns(self, n_panels: int) -> int:
        """Return how many panels stand side by side: two can be read on a phone, many would be a tower.

        Full rows of three stand before rows of four of which the last has gaps.
        """
        most = PANELS_PER_ROW - (n_panels % PANELS_PER_ROW != 0 and n_panels % (PANELS_PER_ROW - 1) == 0)
        wanted = min(n_panels, 2 if n_panels <= 2 * PANELS_PER_ROW else most)
        if self.width_in is None:
            return wanted
        return max(1, min(wanted, int(self.width_in / (_NARROWEST_PANEL * self.font_size))))


SCREEN = FigureStyle()


def check_picture(path: Path) -> None:
    """Refuse a picture that could not be saved, before the work whose result it shows.

    Raises:
        ConfigError: an ending that is none of `FORMATS`.
        OSError: the file cannot be written.
    """
    picture_ending(path)
    check_file(path)


def picture_ending(path: Path) -> str:
    """Return the ending of a picture file in small letters; raises ConfigError if it is none of `FORMATS`."""
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise ConfigError(f"Expected a picture file that ends in {', '.join(FORMATS)}, got {str(path)!r}.")
    return ending


@contextmanager
def saved_figure(
    paths: str | Path | Sequence[Path], size_in: tuple[float, float], *, title: str = "", style: FigureStyle = SCREEN
) -> Generator[Figure]:
    """Give an empty figure to draw into; it is written when that went well, each file whole or not at all.

    Args:
        paths: One file or several; their endings choose the formats.
        size_in: Width and height in inches, where the style has no width.
        title: Headline.
        style: Of the figure.

    Raises:
        ConfigError: an ending that is none of `FORMATS`.
        ImportError: matplotlib is not installed.
        OSError: a file cannot be written.
    """
    files = [Path(path) for path in ((paths,) if isinstance(paths, str | Path) else paths)]
    endings = [picture_ending(file) for file in files]
    try:
        from matplotlib import style as styles
        from matplotlib.figure import Figure as Drawing  # not pyplot: no global state, no window system
    except ImportError as error:
        raise ImportError(NO_MATPLOTLIB) from error
    file_of_style = resources.files("swarm_forage_env.rendering").joinpath("figures.mplstyle")
    width, height = size_in
    if style.width_in is not None:
        flattest = min(height, _FLATTEST * style.width_in)
        width, height = style.width_in, max(height * style.width_in / width, flattest)
    with styles.context(["default", str(file_of_style), {"font.size": style.font_size}]):
        figure = Drawing(figsize=(width, height))
        if title and style.title:
            most = int(width * 72.0 / (_LETTER * style.font_size))
            wrapped = (textwrap.wrap(line, max(20, most), break_long_words=False) for line in title.splitlines())
            lines = [*chain.from_iterable(wrapped)]
            figure.suptitle("\n".join(lines))
            if style.width_in is not None:  # the height was made for one line and a wider page
                _grow(figure, len(lines) * _LINE * style.font_size)
        yield figure
        _fit_words(figure, style)
        _turn_numbers(figure)
        for file, ending in zip(files, endings, strict=True):
            with replacing(file, ending=ending) as draft:
                figure.savefig(draft, metadata=_UNDATED[ending])


def _grow(figure: Figure, points: float) -> None:
    """Make a figure higher by the room that words need, so that panels keep theirs."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + points / 72.0)


def _fit_words(figure: Figure, style: FigureStyle) -> None:
    """Wrap titles and labels that are longer than their panel: they would reach into the next one, or be cut.

    Raises:
        ConfigError: the style has a width in which words leave no room for panels.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "constrained_layout not applied")
            figure.draw_without_rendering()
    except UserWarning:
        if style.width_in is None:
            return  # nobody chose this size, and a crowded picture is better than none
        width, height = figure.get_size_inches()
        raise ConfigError(
            f"Expected a style that leaves room for the panels, got {width:g} x {height:.3g} inches, which words fill; "
            "take a larger width_in or a smaller font_size."
        ) from None
    for panel in figure.axes:
        box = panel.get_window_extent()
        for words, room in ((panel.title, box.width), (panel.xaxis.label, box.width), (panel.yaxis.label, box.height)):
            extent = words.get_window_extent()
            lines = words.get_text().splitlines()
            share = room / max(extent.width, extent.height, 1.0)
            if lines and share < 1.0:
                most = max(12, int(share * max(map(len, lines))))
                words.set_text("\n".join(textwrap.fill(line, most, break_long_words=False) for line in lines))


def _turn_numbers(figure: Figure) -> None:
    """Turn words of levels along x that would run into each other."""
    figure.draw_without_rendering()
    for panel in figure.axes:
        words = [label.get_window_extent() for label in panel.get_xticklabels() if label.get_text()]
        if any(one.x1 > other.x0 > one.x0 for one, other in pairwise(words)):
            panel.tick_params(axis="x", labelrotation=45)


@contextmanager
def saved_panels(
    paths: str | Path | Sequence[Path],
    n_panels: int,
    panel_in: tuple[float, float],
    *,
    sharey: bool = False,
    title: str = "",
    style: FigureStyle = SCREEN,
) -> Generator[list[Panel]]:
    """Give panels of one size in rows, with one legend below; arguments and errors are those of `saved_figure`.

    Args:
        paths: See there.
        n_panels: How many.
        panel_in: Width and height of one.
        sharey: Whether all have one y axis.
        title: See there.
        style: See there.
    """
    n_columns = style.columns(n_panels)
    n_rows = math.ceil(n_panels / n_columns)
    size_in = max(_NARROWEST_FIGURE_IN, panel_in[0] * n_columns + 0.6), panel_in[1] * n_rows + 0.9
    with saved_figure(paths, size_in, title=title, style=style) as figure:
        panels: list[Panel] = figure.subplots(n_rows, n_columns, squeeze=False, sharey=sharey).ravel().tolist()
        for panel in panels[n_panels:]:
            panel.set_axis_off()
        yield panels[:n_panels]
        n_lines = legend_below(figure)
        if style.width_in is not None:
            _grow(figure, n_lines * _LINE * style.font_size)


def legend_below(figure: Figure) -> int:
    """Explain everything with a label once, below all panels, in as few rows as the width has room for; return these.

    The paper's policies stand first, in its order.
    """
    shown: dict[str, Any] = {}
    for panel in figure.axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            shown.setdefault(label, handle)
    order = [*POLICY_NAMES.values()]
    shown = dict(sorted(shown.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))
    labels = [*shown]
    for n_columns in range(len(labels), 0, -1):
        by_column = [label for column in range(n_columns) for label in labels[column::n_columns]]  # read row by row
        handles = [shown[label] for label in by_column]
        legend = figure.legend(handles, by_column, loc="outside lower center", ncols=n_columns)
        if n_columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return math.ceil(len(shown) / n_columns)
        legend.remove()
    return 0


def size_axis(panel: Panel, sizes: Iterable[float]) -> None:
    """Make x an axis of swarm sizes: doublings are equally far apart, and each size has its number."""
    marks = sorted({*sizes})
    panel.set_xscale("log", base=2)
    panel.set_xticks(marks, [f"{size:g}" for size in marks])
    panel.minorticks_off()
    panel.set_xlabel("robots N")


def log_height(panel: Panel) -> None:
    """Make y an axis on which factors are equally far apart, with plain numbers; matplotlib's are formulas."""

    def between(value: float, _: int) -> str:
        low, high = panel.get_ylim()
        digit = value / 10.0 ** math.floor(math.log10(value))
        return f"{value:g}" if high / low < _FEW_DECADES and round(digit) in (2, 5) else ""

    panel.set_yscale("log", nonpositive="clip")
    panel.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    panel.yaxis.set_minor_formatter(between)


def shade(panel: Panel, x: Any, low: Any, high: Any, colour: str) -> None:
    """Draw a band, behind all lines."""
    panel.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0.0, zorder=1.9)


def heat_map(
    panel: Panel, values: FloatArray, words: Callable[[float], str], *, colours: Sequence[str] = (), **options: Any
) -> Any:
    """Draw a table of numbers as colours with the numbers in them; returns the image.

    Args:
        panel: Where.
        values: (rows, columns), from above unless `origin` says otherwise.
        words: Says a number.
        colours: From the lowest number to the highest; default those of the style.
        options: Of `imshow`.
    """
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("shades", colours) if colours else None
    image = panel.imshow(values, aspect="auto", cmap=shades, **options)
    for (row, column), value in np.ndenumerate(values):
        red, green, blue, alpha = image.cmap(image.norm(value))  # what is no number lets the page through
        is_dark = alpha * (0.3 * red + 0.6 * green + 0.1 * blue) + 1.0 - alpha < 0.45
        colour = "white" if is_dark else "black"
        panel.text(column, row, words(float(value)), ha="center", va="center", fontsize="x-small", color=colour)
    panel.grid(visible=False)
    return image


@dataclass(frozen=True, slots=True)
class Look:
    """How a policy is told from others in one figure."""

    name: str
    """As shown."""
    colour: str
    marker: str


def policy_words(text: str) -> str:
    """Return a text with the names that the paper has for its controllers; others stay as they are called."""
    return _POLICY_WORD.sub(lambda found: POLICY_NAMES[found[0]], text)


def places_of(policies: Iterable[str]) -> list[int]:
    """Return the places of policies in `COLOURS`: the paper's always have their own, others what is free."""
    called = [*policies]
    own = {policy: place for place, policy in enumerate(POLICY_NAMES)}
    free = [place for place in _PLACES_OF_OTHERS if place not in {own.get(policy) for policy in called}]
    others = [policy for policy in dict.fromkeys(called) if policy not in own]
    places = own | dict(zip(others, free * len(others), strict=False))
    return [places[policy] for policy in called]


def looks(policies: Iterable[str]) -> list[Look]:
    """Return the looks of policies, in their order, each with the colour and marker of its place."""
    called = [*policies]
    return [
        Look(policy_words(policy), COLOURS[place], MARKERS[place])
        for policy, place in zip(called, places_of(called), strict=True)
    ]
