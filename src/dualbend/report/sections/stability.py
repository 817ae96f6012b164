"""The section on stability: what is predicted along a run's path, and the map with its gains."""

from __future__ import annotations

import numpy as np

from dualbend.control.compliance.own import OwnComplianceConfig
from dualbend.errors import InputError
from dualbend.report.moment import ANGLE
from dualbend.report.plot import Axis, Colour, Curve, Plot
from dualbend.report.section import Block, Figure, Panels, Section
from dualbend.report.stability_map import stability_panel
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.stability.map import Panel, stability_map
from dualbend.stability.prediction import Prediction, predict

_ALONG: tuple[tuple[str, Axis, float, Colour, str], ...] = (
    (
        *("growth_per_s", Axis("growth rate", "1/s"), 0.0, "orange"),
        "Above 0 an oscillation grows.",
    ),
    ("gain_margin_db", Axis("gain margin", "dB"), 0.0, "blue", "Below 0 the loop is unstable."),
)


def stability_section(run: RunRecord) -> Section:
    """Return the prediction of the sampled loop for a run's scenario; why, where there is none."""
    return Section("Stability of the compliance", _predicted(run))


def _predicted(run: RunRecord) -> list[Block]:
    if run.controller:
        return [
            f"No prediction: the run's compliance was {run.controller}, brought along from "
            "Python, in place of the scenario's; its gains were not used."
        ]
    config = run.scenario.compliance
    if isinstance(config, OwnComplianceConfig):
        return [
            f"No prediction: a report does not run the code of {config.controller}; "
            f"`dualbend stability` does, where the class says its transfer functions."
        ]
    try:
        prediction = predict(run.scenario)
    except InputError as error:
        return [f"No prediction: {error}"]
    spans = ", ".join(f"from {low:.2f} to {high:.2f} rad" for low, high in prediction.unstable_rad)
    verdict = f"Predicted {prediction.verdict}: {prediction.reason}."
    verdict += f" Unstable {spans}." if spans else ""
    if not prediction.rows:
        return [verdict]
    return [verdict, _along(prediction), _map(run.scenario, prediction)]


def _beyond(panel: Panel) -> str:
    """Return what is said where a boundary has no line because it lies outside the map."""
    said = ""
    if all(float(panel.paper.min()) > stiffness for stiffness in panel.stiffness.values()):
        said += " All of this range is stable by (23)."
    if all(float(margin.min()) > 1.0 for margin in panel.sampled.values()):
        said += " All of it is stable as the sampled loop."
    return said


def _along(prediction: Prediction) -> Panels:
    """Return growth rate and gain margin over the bending angle."""
    alpha = np.array([row.alpha_rad for row in prediction.rows])
    figures = []
    for key, axis, level, colour, words in _ALONG:
        values = np.array([getattr(row, key) for row in prediction.rows])
        # An infinite margin has no point.
        shown = np.where(np.isfinite(values), values, np.nan)
        curve = Curve("sampled loop", alpha, shown, colour=colour, width=2.0)
        drawn = Plot(curves=[curve], x=ANGLE, y=axis, levels=[level], height_px=280)
        span = f"{np.nanmin(shown):.3g} to {np.nanmax(shown):.3g} {axis.unit}"
        caption = f"{axis.label.capitalize()} along the path. {words}"
        figures.append(Figure(drawn, caption, f"{axis.label} over bending angle, {span}"))
    return Panels(figures)


def _map(scenario: Scenario, prediction: Prediction) -> Panels | str:
    try:
        panels = stability_map(scenario, prediction)
    except InputError as error:
        return f"No map: {str(error).removeprefix('--map: ')}."
    figures = [
        Figure(
            stability_panel(panel),
            f"Boundary of stability of {panel.axis} alone at some bending angles; star: this run's "
            "gains. Solid: the sampled loop, unstable where shaded; dashed: the paper's (23), "
            f"without delay.{_beyond(panel)}",
            f"Map of {panel.axis}: the run has b = {panel.gains[0]:g} {panel.units[0]}, "
            f"k = {panel.gains[1]:g} {panel.units[1]}",
        )
        for panel in panels
    ]
    return Panels(figures)
