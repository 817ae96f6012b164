"""What a report is put together of: pictures with their alt texts, sections, numbers as texts."""

from __future__ import annotations

from dataclasses import dataclass, field

from dualbend.report.html import Html, element, figure, join
from dualbend.report.plots import Plot


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of the page with its heading."""

    title: str
    body: Html


@dataclass
class Pictures:
    """The plots of a page by the identifiers of their places."""

    plots: dict[str, Plot] = field(default_factory=dict)

    def add(self, plot: Plot, caption: str, alt: str) -> Html:
        """Return the figure in which ``plot`` will be."""
        name = f"plot-{len(self.plots)}"
        self.plots[name] = plot
        return figure(name, caption, alt)


def side_by_side(*figures: Html) -> Html:
    """Return figures beside each other where there is room."""
    return element("div", *figures, class_="panels")


def note(*texts: str) -> Html:
    """Return a paragraph."""
    return element("p", join(texts))


def number(value: object, digits: int = 4) -> str:
    """Return a value as a table shows it; a dash where there is none."""
    if isinstance(value, list):
        return ", ".join(number(item, digits) for item in value)
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{digits}g}" if isinstance(value, int | float) else str(value)
