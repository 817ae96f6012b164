"""From the keys of ``[sheet]`` to the sheet: named material, layers, numbers that win over both."""

from __future__ import annotations

import functools
from typing import Annotated, Any

import msgspec

from dualbend.beam import plastic
from dualbend.beam.laminate import Laminate, Layer
from dualbend.beam.material import Material, find_material, library
from dualbend.beam.rigidity import Rigidity
from dualbend.beam.sheet import Anisotropy, Sheet, mean_thickness, refuse_profile
from dualbend.errors import InputError, brief, refusing
from dualbend.scene.sheet.shell import ShellConfig
from dualbend.scene.sheet.strips import StripConfig
from dualbend.types import Config, said

_PROPERTIES = ("young_pa", "poisson_ratio", "density_kg_per_m3")
NUMBERS = (*_PROPERTIES, "yield_pa", "tangent_pa")
"""Keys of a material's numbers, which win over those of its name."""


def check_sheet(config: SheetConfig) -> None:
    """Raise InputError where the keys contradict, or make no thin sheet that stays flat."""
    _refuse_contradictions(config)
    sheet = make_sheet(config)
    thickness = max((t for _, t in sheet.profile), default=sheet.thickness_m)
    _refuse_shell(config)
    if thickness > 0.05 * min(config.length_m, config.width_m):
        raise InputError(
            f"thickness_m = {thickness:g} is no thin sheet: at most a twentieth "
            f"of length_m = {config.length_m} and width_m = {config.width_m}; all are in metres"
        )


def _refuse_shell(config: SheetConfig) -> None:
    if not isinstance(config.model, ShellConfig):
        return
    for key in ("profile", "rest_curvature_per_m"):
        if getattr(config, key):
            raise InputError(
                f'{key}: a shell is of one thickness and flat at rest; use model = "strips"'
            )
    if config.plastic:
        raise InputError('plastic = true: a shell stays elastic; use model = "strips"')
    if make_sheet(config).anisotropy is not None:
        raise InputError(
            'model = "shell" is of one material that is alike in all directions; a laminate or an '
            'orthotropic sheet needs model = "strips"'
        )


def _refuse_contradictions(config: SheetConfig) -> None:
    names = [each.name for each in config.materials or ()]
    for i, name in enumerate(names):
        if name in library() or name in names[:i]:
            which = "the library" if name in library() else "another one"
            raise InputError(f"materials[{i}].name = {brief(name)}: {which} has this name")
        if ".toml" in name:
            raise InputError(f"materials[{i}].name = {brief(name)}: would be read as a file's")
    if config.profile is not None:
        _refuse_profile(config, config.profile)
    if config.layers is None:
        needed = [*(_PROPERTIES if config.material is None else ())]
        if config.profile is None:
            needed.insert(0, "thickness_m")
        missing = [key for key in needed if getattr(config, key) is None]
        if missing:
            other = "layers" if missing == ["thickness_m"] else "a material or layers"
            raise InputError(f"{', '.join(missing)}: missing; give a number, or {other}")
        return
    both = [k for k in ("material", *NUMBERS) if getattr(config, k) is not None]
    if both:
        raise InputError(f"{both[0]}: the layers say it already; give one of the two")
    total = sum(layer.thickness_m for layer in config.layers)
    given = config.thickness_m
    if given is not None and abs(given - total) > 1e-6 * total:
        raise InputError(
            f"thickness_m = {given:g}: the layers are {total:g} together; leave it out"
        )


def _refuse_profile(config: SheetConfig, profile: tuple[ThicknessConfig, ...]) -> None:
    for key in ("thickness_m", "layers"):
        if getattr(config, key) is not None:
            raise InputError(
                f'{key}: the profile says the thickness already; profile = "none" takes it back'
            )
    if config.plastic:
        raise InputError("plastic = true: a sheet of a profile stays elastic; not both")
    refuse_profile(tuple((row.at_m, row.thickness_m) for row in profile), config.length_m)


def make_sheet(config: SheetConfig) -> Sheet:
    """Return the sheet of a scenario's keys; InputError where a material or laminate is none."""
    whole = substance(config)
    material = whole.layers[0].material
    young, poisson, anisotropy = material.young_pa, material.poisson_ratio, None
    if len(whole.layers) > 1 or material.shear_pa is not None:
        D, t = whole.D, whole.thickness_m
        young = 12.0 * whole.bending_per_width_nm / t**3
        poisson = float(D[0, 1] / (D[0, 0] * D[1, 1]) ** 0.5)
        anisotropy = Anisotropy(
            shear=float(12.0 * D[2, 2] / t**3) / young,
            stretch=whole.stretch_per_width_n_per_m / t / young,
            across=float(D[1, 1] / D[0, 0]),
        )
    profile = tuple((row.at_m, row.thickness_m) for row in config.profile or ())
    return Sheet(
        length_m=config.length_m,
        width_m=config.width_m,
        thickness_m=whole.thickness_m,
        young_pa=young,
        poisson_ratio=poisson,
        density_kg_per_m3=whole.density_kg_per_m3,
        # A shell is a plate: what theory says of it must be of one, too.
        rigidity="plate" if isinstance(config.model, ShellConfig) else config.rigidity,
        curvature_per_m=config.curvature_per_m or 0.0,
        anisotropy=anisotropy,
        plasticity=_plasticity(whole) if config.plastic else None,
        rest_curvature_per_m=config.rest_curvature_per_m or 0.0,
        profile=profile,
    )


@functools.lru_cache(maxsize=64)
def substance(config: SheetConfig) -> Laminate:
    """Return the sheet as a laminate, of one layer where it is of one material.

    Raises InputError where a material is not in the library, or the laminate would curl.
    """
    if config.layers is None:
        thickness = config.thickness_m
        if config.profile is not None:
            thickness = mean_thickness(tuple((row.at_m, row.thickness_m) for row in config.profile))
        assert thickness is not None
        return Laminate((Layer(material=_material(config), thickness_m=thickness),))
    laminate = Laminate(
        tuple(
            Layer(
                material=_named(config, layer.material, f"layers[{i}].material"),
                thickness_m=layer.thickness_m,
            )
            for i, layer in enumerate(config.layers)
        )
    )
    with refusing("layers"):
        laminate.refuse_curl()
    return laminate


def _material(config: SheetConfig) -> Material:
    """Return the named material with what is given in the place of its own numbers."""
    given = {key: getattr(config, key) for key in NUMBERS if getattr(config, key) is not None}
    if config.material is None:
        return Material(name="its material", **given)
    named = named_material(config)
    if not given:
        return named
    own = {key: getattr(named, key) for key in named.__dataclass_fields__}
    if "young_pa" in given:
        # The library's other moduli belong to its own modulus along; beyond yield the ratio stays.
        own["transverse_young_pa"] = own["shear_pa"] = None
        own["tangent_pa"] = named.tangent_pa * given["young_pa"] / named.young_pa
    return Material(**{**own, **given})


def with_true_numbers(config: SheetConfig, true: Sheet) -> SheetConfig:
    """Return a sheet's keys with the thickness, wherever it is, and modulus of the true sheet."""
    if config.profile is None:
        return msgspec.structs.replace(config, thickness_m=true.thickness_m, young_pa=true.young_pa)
    profile = tuple(ThicknessConfig(at_m=s, thickness_m=t) for s, t in true.profile)
    return msgspec.structs.replace(config, profile=profile, young_pa=true.young_pa)


def _plasticity(whole: Laminate) -> plastic.Plasticity:
    try:
        if len(whole.layers) == 1:
            return plastic.of_material(whole.layers[0].material)
        return plastic.of_laminate(whole)
    except InputError as error:
        raise InputError(
            f"plastic = true: {error}; give yield_pa or a material that has one"
        ) from error


def named_material(config: SheetConfig) -> Material:
    """Return the material that is named, with its own numbers; InputError where there is none."""
    assert config.material is not None
    return _named(config, config.material, "material")


def _named(config: SheetConfig, name: str, key: str) -> Material:
    own = {each.name: each.material() for each in config.materials or ()}
    with refusing(f"{key} = {brief(name)}"):
        return find_material(name, own)


class MaterialConfig(Config):
    """A material of one's own: what `sheet.material = "own.toml"` put into the scenario."""

    name: Annotated[str, said("by which material and layers call it", min_length=1, max_length=100)]
    title: Annotated[str, said("what it is", max_length=1000)] = ""
    source: Annotated[str, said("of its numbers", max_length=10_000)] = ""
    young_pa: Annotated[float, said("Young's modulus along the sheet", ge=1e8, le=1e12)]
    poisson_ratio: Annotated[float, said("contraction across per stretch along", ge=0, lt=0.5)]
    density_kg_per_m3: Annotated[float, said("mass density", ge=100, le=25000)]
    transverse_young_pa: (
        Annotated[float, said("Young's modulus across; none: as along", ge=1e7, le=1e12)] | None
    ) = None
    shear_pa: Annotated[float, said("in the plane; none: isotropic", ge=1e6, le=1e12)] | None = None
    yield_pa: (
        Annotated[float, said("0.2 % yield strength; none: not known", gt=0, le=1e11)] | None
    ) = None
    tangent_pa: Annotated[float, said("slope of the stress beyond yield", ge=0, le=1e12)] = 0.0
    strain_at_failure: (
        Annotated[float, said("at the surface in bending; none: not known", gt=0, le=1)] | None
    ) = None

    def material(self) -> Material:
        """Return the material; InputError where its numbers contradict."""
        numbers = {key: getattr(self, key) for key in _OWN_NUMBERS}
        return Material(name=self.name, title=self.title, **numbers)


_OWN_NUMBERS = (*NUMBERS, "transverse_young_pa", "shear_pa", "strain_at_failure")


def own_material(material: Material) -> dict[str, Any]:
    """Return what a scenario keeps of a material: its numbers, and the sources as a text."""
    numbers = {key: getattr(material, key) for key in _OWN_NUMBERS}
    source = "; ".join(f"{key}: {said.source}" for key, said in material.evidence.items())
    given = {key: value for key, value in numbers.items() if value is not None}
    return {"name": material.name, "title": material.title, "source": source, **given}


class ThicknessConfig(Config):
    """The thickness at one place of a sheet."""

    at_m: Annotated[float, said("arc length from the left grip", ge=0, le=3.0)]
    thickness_m: Annotated[float, said("there; straight to the next place", ge=1e-5, le=0.01)]


class LayerConfig(Config):
    """One layer of a laminate, from the sheet's lower face to its upper one."""

    material: Annotated[
        str, said("from `dualbend materials`, or a file of your own", max_length=1000)
    ]
    thickness_m: Annotated[float, said("of this layer", ge=1e-6, le=0.01)]


class SheetConfig(Config):
    """Size, material and division of the sheet; the length is the free one between the grips.

    The material is one of the library (`dualbend materials`), or numbers, or both: a number that
    is given wins. A laminate's layers say thickness and all properties.
    """

    length_m: Annotated[float, said("free length between the grips", ge=0.05, le=3.0)]
    width_m: Annotated[float, said("along the bending axis", ge=0.005, le=3.0)]
    thickness_m: (
        Annotated[
            float,
            said(
                "at most a twentieth of length and width; none: of the layers or the profile",
                ge=1e-5,
                le=0.01,
            ),
        ]
        | None
    ) = None
    profile: (
        Annotated[
            tuple[ThicknessConfig, ...],
            said(
                "a thickness that varies from the left grip to the right one; one place twice is "
                "a step",
                min_length=2,
                max_length=50,
                extra={"replaces": ("thickness_m", "layers")},
            ),
        ]
        | None
    ) = None
    material: (
        Annotated[
            str,
            said(
                "from `dualbend materials`, or a file of your own; gives what is none below",
                max_length=1000,
                extra={"replaces": ("layers", "materials", *NUMBERS)},
            ),
        ]
        | None
    ) = None
    materials: (
        Annotated[
            tuple[MaterialConfig, ...],
            said(
                "your own, as the file of `material` or of a layer has them",
                max_length=50,
                extra={"replaces": ()},
            ),
        ]
        | None
    ) = None
    layers: (
        Annotated[
            tuple[LayerConfig, ...],
            said(
                "a laminate from its lower to its upper face, symmetric",
                min_length=1,
                max_length=50,
                extra={"replaces": ("material", "materials", "thickness_m", *NUMBERS)},
            ),
        ]
        | None
    ) = None
    young_pa: Annotated[float, said("Young's modulus", ge=1e8, le=1e12)] | None = None
    poisson_ratio: (
        Annotated[float, said("enters the twist and a plate's rigidity", ge=0, lt=0.5)] | None
    ) = None
    density_kg_per_m3: Annotated[float, said("mass density", ge=100, le=25000)] | None = None
    yield_pa: (
        Annotated[float, said("0.2 % yield strength; none: not known", gt=0, le=1e11)] | None
    ) = None
    tangent_pa: Annotated[float, said("slope of the stress beyond yield", ge=0, le=1e12)] | None = (
        None
    )
    rigidity: Annotated[
        Rigidity,
        said(
            "bends as a beam (EI), as a plate (EI / (1 - nu²)), or between them by its width; a "
            "shell is a plate"
        ),
    ] = "width"
    curvature_per_m: (
        Annotated[
            float,
            said(
                'at which rigidity = "width" is taken; none: largest of the path [1/m]',
                ge=0,
                le=1e3,
            ),
        ]
        | None
    ) = None
    rest_curvature_per_m: (
        Annotated[
            float,
            said("of the free sheet, positive as the path bends it; none: flat", ge=-5, le=5),
        ]
        | None
    ) = None
    plastic: Annotated[bool, said("it yields and springs back; false: it stays elastic")] = False
    model: StripConfig | ShellConfig = StripConfig()

    def __post_init__(self) -> None:
        """Refuse what is no thin sheet, no known material, and a laminate that would curl."""
        check_sheet(self)

    @property
    def limit_strain(self) -> float | None:
        """Surface strain κ t/2 at which the sheet yields or breaks; None: not known."""
        return substance(self).surface_limit()

    @property
    def strips(self) -> StripConfig:
        """The chain of strips; InputError where the sheet is a shell."""
        if isinstance(self.model, StripConfig):
            return self.model
        raise InputError(f'sheet.model = "{self.model.kind}": this needs "strips"')

    def sheet(self) -> Sheet:
        """Return the sheet that the beam mathematics speaks of."""
        return make_sheet(self)
