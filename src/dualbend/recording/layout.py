"""The layout in which the viewer opens a recording: scene, phases and texts beside the plots."""

from __future__ import annotations

import rerun.blueprint as rrb

from dualbend.recording.layers import Layers, layers_of
from dualbend.recording.log import TIMELINE
from dualbend.run.record import RunRecord

_SIDE_BY_SIDE = 3
"""Plots that are seen at once; the others share a place as tabs."""


def layout(result: RunRecord) -> rrb.Blueprint:
    """Return the viewer's layout for the run: its views, shares, legends and time panel."""
    reading = rrb.TextDocumentView(origin="guide", name="How to read this")
    results = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome and metrics"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    layers = layers_of(result)
    views, plots = layers.views(result), _plots(result, layers)
    texts = rrb.Horizontal(views.near, reading, results, column_shares=[1.0, 0.8, 0.9])
    scenes = [rrb.Horizontal(*views.top, column_shares=[1.4, 1.0]), texts, views.lane]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*scenes, row_shares=list(views.shares)),
            rrb.Vertical(*plots[:_SIDE_BY_SIDE], rrb.Tabs(*plots[_SIDE_BY_SIDE:])),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )


def _plots(result: RunRecord, layers: Layers) -> list[rrb.TimeSeriesView]:
    # What ended a run is at the right of its plots; what a completed one shows is at the left.
    done = result.outcome == "completed"
    corner = rrb.Corner2D.RightTop if done else rrb.Corner2D.LeftTop
    return [
        rrb.TimeSeriesView(
            origin=origin,
            name=title,
            plot_legend=corner,
            axis_y=rrb.ScalarAxis(range=near) if (near := layers.ranges.get(origin)) else None,
        )
        for origin, title in layers.titles.items()
    ]
