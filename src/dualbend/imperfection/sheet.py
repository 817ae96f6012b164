"""What the sheet is not as everybody in the cell believes."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.imperfection.draws import stream
from dualbend.types import Config, said

_CUT = 3.0
"""Standard deviations beyond which nothing is drawn."""


class SheetErrors(Config):
    """What the sheet is not as everybody in the cell believes.

    Path, compliance and prediction are those of the believed sheet, the physics is that of the
    true one.
    """

    thickness_ratio: Annotated[
        float, said("true thickness over the believed one", ge=0.5, le=2)
    ] = 1.0
    thickness_spread: Annotated[
        float, said("standard deviation of that ratio, relative [-]", ge=0, le=0.2)
    ] = 0.0
    modulus_ratio: Annotated[
        float, said("true Young's modulus over the believed one", ge=0.2, le=5)
    ] = 1.0
    modulus_spread: Annotated[
        float, said("standard deviation of that ratio, relative [-]", ge=0, le=0.2)
    ] = 0.0
    curvature_per_m: Annotated[
        float, said("of the free sheet over the believed one's, as the path bends it", ge=-5, le=5)
    ] = 0.0
    curvature_spread_per_m: Annotated[
        float, said("standard deviation of that curvature", ge=0, le=1)
    ] = 0.0


def true_sheet(sheet: Sheet, errors: SheetErrors, seed: int) -> Sheet:
    """Return the sheet as it is, of the one that is believed.

    t' = t r (1 + s z), E' alike, κ' = κ + s z; z normal, drawn from the seed, cut at 3. A sheet
    that yields does so at the strain of the believed one.
    """
    if errors == SheetErrors():
        return sheet
    z = np.clip(stream(seed, "sheet").standard_normal(3), -_CUT, _CUT).tolist()
    curvature = errors.curvature_per_m + errors.curvature_spread_per_m * z[2]
    thicker = sheet.thicker(errors.thickness_ratio).thicker(1.0 + errors.thickness_spread * z[0])
    return replace(
        thicker,
        young_pa=sheet.young_pa * errors.modulus_ratio * (1.0 + errors.modulus_spread * z[1]),
        rest_curvature_per_m=sheet.rest_curvature_per_m + curvature,
    )
