"""The section on stability: what is predicted along a run's path, and the map with its gains."""

from __future__ import annotations

import numpy as np

from dualbend.errors import InputError
from dualbend.report.bending import ANGLE
from dualbend.report.html import Html, join
from dualbend.report.parts import Pictures, Section, note, side_by_side
from dualbend.report.plots import BLUE, ORANGE, Axis, Curve, Plot, stability_panel
from dualbend.scenario.scenario import Scenario
from dualbend.stability.map import Panel, stability_map
from dualbend.stability.prediction import Prediction, predict

_TITLE = "Stability of the compliance"


def stability_section(scenario: Scenario, pictures: Pictures) -> Section:
    """Return the prediction of the sampled loop for a run's scenario; why, where there is none."""
    try:
        prediction = predict(scenario)
    except InputError as error:
        return Section(title=_TITLE, body=note(f"No prediction: {error}"))
    verdict = note(f"Predicted {prediction.verdict}: {prediction.reason}.{_ranges(prediction)}")
    if not prediction.rows:
        return Section(title=_TITLE, body=verdict)
    return Section(
        title=_TITLE,
        body=join([verdict, _along(prediction, pictures), _map(scenario, prediction, pictures)]),
    )


def own_compliance_section(controller: str) -> Section:
    """Return why nothing is predicted for a run whose compliance was not the scenario's."""
    words = (
        f"No prediction: the run's compliance was {controller}, brought along from Python, in "
        "place of the scenario's; its gains were not used."
    )
    return Section(title=_TITLE, body=note(words))


def _ranges(prediction: Prediction) -> str:
    parts = [f"from {low:.2f} to {high:.2f} rad" for low, high in prediction.unstable_rad]
    return f" Unstable {', '.join(parts)}." if parts else ""


def _beyond(panel: Panel) -> str:
    """Return what is said where a boundary has no line because it lies outside the map."""
    said = ""
    if all(float(panel.paper.min()) > stiffness for stiffness in panel.stiffness.values()):
        said += " All of this range is stable by (23)."
    if all(float(margin.min()) > 1.0 for margin in panel.sampled.values()):
        said += " All of it is stable as the sampled loop."
    return said


def _along(prediction: Prediction, pictures: Pictures) -> Html:
    """Return growth rate and gain margin over the bending angle."""
    alpha = np.array([row.alpha_rad for row in prediction.rows])
    growth = np.array([row.growth_per_s for row in prediction.rows])
    margin = np.array([row.gain_margin for row in prediction.rows])
    figures = []
    for name, unit, values, level, colour, words in (
        ("growth rate", "1/s", growth, 0.0, ORANGE, "Above 0 an oscillation grows."),
        ("gain margin", "1", margin, 1.0, BLUE, "Below 1 the loop is unstable."),
    ):
        # An infinite margin has no point.
        shown = np.where(np.isfinite(values), values, np.nan)
        axis = Axis(label=name, unit=unit, scale="linear")
        curve = Curve(name="sampled loop", x=alpha, y=shown, colour=colour, width=2.0)
        drawn = Plot(curves=[curve], x=ANGLE, y=axis, levels=[level], height_px=280)
        alt = f"{name} over bending angle, {np.nanmin(shown):.3g} to {np.nanmax(shown):.3g} {unit}"
        figures.append(pictures.add(drawn, f"{name.capitalize()} along the path. {words}", alt))
    return side_by_side(*figures)


def _map(scenario: Scenario, prediction: Prediction, pictures: Pictures) -> Html:
    try:
        panels = stability_map(scenario, prediction)
    except InputError as error:
        return note(f"No map: {str(error).removeprefix('--map: ')}.")
    figures = [
        pictures.add(
            stability_panel(panel),
            f"Boundary of stability of {panel.axis} alone at some bending angles; star: this run's "
            "gains. Solid: the sampled loop, unstable where shaded; dashed: the paper's (23), "
            f"without delay.{_beyond(panel)}",
            f"Map of {panel.axis}: the run has b = {panel.gains[0]:g} {panel.units[0]}, "
            f"k = {panel.gains[1]:g} {panel.units[1]}",
        )
        for panel in panels
    ]
    return side_by_side(*figures)
