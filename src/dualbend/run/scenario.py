"""The scenario: one TOML file, typed and strict, that says everything about a run.

A file may say ``extends = "fig6"`` and give only what differs. Every error is an
:class:`~dualbend.errors.InputError` with the file, the key, the value and what would be right.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import tomli_w

from dualbend.beam import elastica
from dualbend.beam.rigidity import Rigidity
from dualbend.beam.sheet import Sheet
from dualbend.control.admittance import AdmittanceConfig
from dualbend.control.alter import AlterConfig, steps_per_cycle
from dualbend.control.command_response import CommandResponseConfig
from dualbend.control.filters import LowPassConfig
from dualbend.control.force_torque import ForceTorqueConfig
from dualbend.control.servo import JointServoConfig
from dualbend.errors import InputError
from dualbend.resources import scenarios_dir
from dualbend.run.arm_change import without_other_arms
from dualbend.run.guard import GuardConfig
from dualbend.run.sheet_material import MATERIAL_KEYS, check_sheet, make_sheet, substance
from dualbend.scene.arm_catalog import JOINT_COUNT, ArmName
from dualbend.scene.cell import SIDES, CellConfig, GraspConfig, Side
from dualbend.scene.sheet import StripConfig
from dualbend.scene.shell import ShellConfig
from dualbend.task.assembly_config import DEFAULT_YIELD_PA, AssemblyConfig
from dualbend.task.bending import MotionConfig, PathConfig, make_path, make_time_law
from dualbend.task.misalignment import SHORTEST_SETTLE_S, MisalignmentConfig

_ALTERNATIVES = ("interval_rad", "pieces")
"""Keys of a path that say the same thing: giving one takes the other back."""

_REPLACES = (("sheet", "material"), ("sheet", "layers"))
"""Keys that take back what the section had, as any ``kind`` and all of the arms do."""

Outcome = Literal["completed", "aborted", "protective_stop", "failed"]

LONGEST_RUN_S = 3600.0
"""A run of an hour holds some 10⁵ cycles in memory."""

UNSET = "none"
"""Value that takes an optional key or section back which the extended scenario has."""

_SMALLEST, _LARGEST = 1e-15, 1e15


class LayerConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One layer of a laminate, from the sheet's lower face to its upper one."""

    material: Annotated[str, msgspec.Meta(description="from `dualbend materials`")]
    thickness_m: Annotated[float, msgspec.Meta(ge=1e-6, le=0.01, description="of this layer")]


class SheetConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Size, material and division of the sheet; the length is the free one between the grips.

    The material is one of the library (`dualbend materials`), or numbers, or both: a number that
    is given wins. A laminate's layers say thickness and all properties.
    """

    length_m: Annotated[
        float, msgspec.Meta(ge=0.05, le=3.0, description="free length between the grips")
    ]
    width_m: Annotated[float, msgspec.Meta(ge=0.005, le=3.0, description="along the bending axis")]
    thickness_m: (
        Annotated[
            float,
            msgspec.Meta(
                ge=1e-5,
                le=0.01,
                description="at most a twentieth of length and width; none: that of the layers",
            ),
        ]
        | None
    ) = None
    material: (
        Annotated[
            str, msgspec.Meta(description="from `dualbend materials`; gives what is none below")
        ]
        | None
    ) = None
    layers: (
        Annotated[
            tuple[LayerConfig, ...],
            msgspec.Meta(
                min_length=1,
                max_length=50,
                description="a laminate from its lower to its upper face, symmetric",
            ),
        ]
        | None
    ) = None
    young_pa: (
        Annotated[float, msgspec.Meta(ge=1e8, le=1e12, description="Young's modulus")] | None
    ) = None
    poisson_ratio: (
        Annotated[
            float, msgspec.Meta(ge=0, lt=0.5, description="enters the twist and a plate's rigidity")
        ]
        | None
    ) = None
    density_kg_per_m3: (
        Annotated[float, msgspec.Meta(ge=100, le=25000, description="mass density")] | None
    ) = None
    yield_pa: (
        Annotated[float, msgspec.Meta(gt=0, description="0.2 % yield strength; none: not known")]
        | None
    ) = None
    tangent_pa: (
        Annotated[float, msgspec.Meta(ge=0, description="slope of the stress beyond yield")] | None
    ) = None
    rigidity: Annotated[
        Rigidity,
        msgspec.Meta(
            description="bends as a beam (EI), as a plate (EI / (1 - nu²)), or between them by its "
            "width"
        ),
    ] = "beam"
    curvature_per_m: (
        Annotated[
            float,
            msgspec.Meta(
                ge=0,
                description='at which rigidity = "width" is taken; none: largest of the path [1/m]',
            ),
        ]
        | None
    ) = None
    plastic: Annotated[
        bool, msgspec.Meta(description="it yields and springs back; false: it stays elastic")
    ] = False
    model: Annotated[
        Literal["strips", "shell"],
        msgspec.Meta(
            description="strips: a chain, as stiff as rigidity says; shell: a plate, at many times "
            "the cost"
        ),
    ] = "strips"
    strips: StripConfig = StripConfig()
    shell: ShellConfig = ShellConfig()

    def __post_init__(self) -> None:
        """Refuse what is no thin sheet, no known material, and a laminate that would curl."""
        check_sheet(self)

    @property
    def limit_strain(self) -> float | None:
        """Surface strain κ t/2 at which the sheet yields or breaks; None: not known."""
        return substance(self).surface_limit()

    @property
    def sections(self) -> int:
        """Number of places along the sheet at which it bends."""
        return self.strips.hinges if self.model == "strips" else self.shell.cells_along

    def sheet(self) -> Sheet:
        """Return the sheet that the beam mathematics speaks of."""
        return make_sheet(self)


class ArmsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which arms carry a force/torque sensor and which comply.

    A complying arm without a sensor mirrors the deviation of the arm that has one.
    """

    sensing: Annotated[
        tuple[Side, ...],
        msgspec.Meta(min_length=1, max_length=2, description="arms with a force/torque sensor"),
    ] = ("left",)
    complying: Annotated[
        tuple[Side, ...], msgspec.Meta(max_length=2, description="arms that the compliance moves")
    ] = ("left",)

    def __post_init__(self) -> None:
        """Refuse an arm that is named twice."""
        for name, sides in (("sensing", self.sensing), ("complying", self.complying)):
            if len(set(sides)) != len(sides):
                raise ValueError(f"{name} names an arm twice: {list(sides)}")


class ArmConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which arms: the PUMA 560, or one of those that the package example-robot-data describes."""

    model: Annotated[ArmName, msgspec.Meta(description="kind of both arms")] = "puma560"
    left: (
        Annotated[ArmName, msgspec.Meta(description="kind of the left arm, if another")] | None
    ) = None
    right: (
        Annotated[ArmName, msgspec.Meta(description="kind of the right arm, if another")] | None
    ) = None

    def of(self, side: Side) -> ArmName:
        """Return the name of one side's arm."""
        return (self.left if side == "left" else self.right) or self.model


class PhysicsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The physics step."""

    step_s: Annotated[
        float,
        msgspec.Meta(
            ge=1e-5, le=0.028, description="of the integrator; divides the command period of 28 ms"
        ),
    ] = 0.00175

    def __post_init__(self) -> None:
        """Refuse a step that does not divide the command period."""
        steps_per_cycle(self.step_s)


class ExpectConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Outcomes that are no failure of the command: exit code 0."""

    outcome: Annotated[
        tuple[Outcome, ...], msgspec.Meta(min_length=1, description="how the run may end")
    ] = ("completed",)


class Scenario(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything about a run."""

    name: Annotated[
        str,
        msgspec.Meta(
            min_length=1,
            max_length=100,
            pattern=r"^[A-Za-z0-9][\w.+-]*\Z",
            description="letters, digits and . _ + -; names the folder of the results",
        ),
    ]
    description: Annotated[
        str, msgspec.Meta(description="what the scenario shows, in one line")
    ] = ""
    seed: Annotated[int, msgspec.Meta(ge=0, description="of the sensor's noise")] = 1
    sheet: SheetConfig
    path: PathConfig
    motion: MotionConfig = MotionConfig()
    cell: CellConfig = CellConfig()
    grasp: GraspConfig = GraspConfig()
    arm: ArmConfig = ArmConfig()
    arms: ArmsConfig = ArmsConfig()
    response: CommandResponseConfig = CommandResponseConfig()
    servo: JointServoConfig = JointServoConfig()
    alter: AlterConfig = AlterConfig()
    sensor: ForceTorqueConfig = ForceTorqueConfig()
    filter: LowPassConfig = LowPassConfig()
    compliance: AdmittanceConfig = AdmittanceConfig()
    assembly: AssemblyConfig | None = None
    misalignment: MisalignmentConfig | None = None
    guard: GuardConfig = GuardConfig()
    physics: PhysicsConfig = PhysicsConfig()
    expect: ExpectConfig = ExpectConfig()

    def __post_init__(self) -> None:
        """Refuse a run too long to be meant, joints that no arm has, yielding that must not be."""
        self._refuse_joint_counts()
        self._refuse_what_no_assembly_has()
        self._refuse_unfit_table()
        self._resolve_curvature()
        law = make_time_law(self.path, self.motion)
        total = self.motion.settle_s + law.duration_s + self.motion.hold_s
        if self.motion.return_rad is not None:
            if not self.path.start_rad <= self.motion.return_rad < self.path.end_rad:
                raise ValueError(
                    f"motion.return_rad = {self.motion.return_rad} must lie between "
                    f"path.start_rad = {self.path.start_rad} and path.end_rad = {self.path.end_rad}"
                )
            back = make_time_law(self.path, self.motion, back=True)
            total += back.duration_s + self.motion.hold_s
        if not total <= LONGEST_RUN_S:
            raise ValueError(
                f"motion.speed_rad_per_s = {self.motion.speed_rad_per_s} with "
                f"motion.acceleration_rad_per_s2 = {self.motion.acceleration_rad_per_s2} makes a "
                f"run of {total:.4g} s; the longest is {LONGEST_RUN_S:.0f} s"
            )
        if self.misalignment is not None and self.motion.settle_s < SHORTEST_SETTLE_S:
            raise ValueError(
                f"motion.settle_s = {self.motion.settle_s}: misalignment comes in while the arms "
                f"settle and needs at least {SHORTEST_SETTLE_S} s"
            )

    def _refuse_what_no_assembly_has(self) -> None:
        if self.assembly is None:
            return
        if self.sheet.plastic:
            raise ValueError(
                "sheet.plastic = true: an assembly ends where the sheet would yield; not both"
            )
        if self.sheet.model == "shell":
            raise ValueError(
                'sheet.model = "shell" has no holes and no contact: an assembly needs "strips"'
            )
        if self.misalignment is not None:
            raise ValueError(
                "misalignment is for a sheet that is bent between two grips; "
                "an assembly has assembly.errors"
            )
        if self.motion.return_rad is not None:
            raise ValueError(
                f"motion.return_rad = {self.motion.return_rad} is for a sheet that is bent between "
                "two grips; an assembly lays it and does not go back"
            )

    def _refuse_unfit_table(self) -> None:
        """Only a table can be at odds with the sheet: the other paths are made of its length."""
        if self.path.kind != "table":
            return
        try:
            make_path(self.path, self.sheet.length_m)
        except InputError as error:
            raise ValueError(str(error)) from error

    def _refuse_joint_counts(self) -> None:
        for side in SIDES:
            name, stand = self.arm.of(side), getattr(self.cell, side) or self.cell
            for key, values in (
                ("servo.stiffness_n_m_per_rad", self.servo.stiffness_n_m_per_rad),
                ("cell.home_rad", self.cell.home_rad),
                (f"cell.{side}.home_rad", stand.home_rad),
            ):
                if values is not None and len(values) != JOINT_COUNT[name]:
                    raise ValueError(
                        f"{key} has {len(values)} values, the {side} arm {name!r} has "
                        f"{JOINT_COUNT[name]} joints"
                    )

    def _resolve_curvature(self) -> None:
        """Take the width's rigidity at the path's largest curvature, (4 K/L) sin(α/2)."""
        sheet = self.sheet
        if sheet.rigidity == "width" and sheet.curvature_per_m is None:
            largest = elastica.curvature_max(self.path.end_rad, sheet.length_m)
            msgspec.structs.force_setattr(
                self, "sheet", msgspec.structs.replace(sheet, curvature_per_m=largest)
            )

    @property
    def limit_strain(self) -> float | None:
        """Surface strain at which the sheet yields or breaks; None: not known."""
        known, sheet = self.sheet.limit_strain, self.sheet.sheet()
        if self.assembly is None:
            return known
        given = self.assembly.limits.yield_pa
        if given is None and known is not None:
            return known
        return (DEFAULT_YIELD_PA if given is None else given) / sheet.young_pa

    def to_toml(self) -> str:
        """Return the resolved scenario: loading it again gives an equal object."""
        return tomli_w.dumps(_without_none(msgspec.to_builtins(self)))


def list_scenarios() -> dict[str, Path]:
    """Return the shipped scenarios, by name."""
    return {path.stem: path for path in sorted(scenarios_dir().glob("*.toml"))}


def load_scenario(
    name_or_file: str, settings: Sequence[str] = (), seed: int | None = None
) -> Scenario:
    """Load a shipped scenario by name, or a file, with ``path.to.key=value`` settings applied."""
    path = _find(name_or_file)
    source = f"{path.name} with --set" if settings else path.name
    return resolve_scenario(_read(path, seen=()), source, settings, seed)


def read_scenario(name_or_file: str) -> dict[str, Any]:
    """Return the tables of a shipped scenario or a file, those that it extends merged in."""
    return _read(_find(name_or_file), seen=())


def resolve_scenario(
    tables: Mapping[str, Any], source: str, settings: Sequence[str] = (), seed: int | None = None
) -> Scenario:
    """Return the scenario of tables with settings applied; ``source`` is named in messages."""
    data = dict(tables)
    # A new kind, material or arm takes back what the one before had: it comes first, the others
    # stay, in the order given.
    given = [(setting, *_split(_table_of(setting))) for setting in settings]
    for setting, table in [
        *((setting, early) for setting, early, _ in given),
        *((setting, late) for setting, _, late in given),
    ]:
        if table:
            _refuse_values_as_sections(data, setting)
            data = _merge(data, table)
    if seed is not None:
        data["seed"] = seed
    return _convert(data, source)


def _split(
    table: Mapping[str, Any], path: tuple[str, ...] = ()
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what of a setting takes back what a section had, and the rest."""
    early: dict[str, Any] = {}
    late: dict[str, Any] = {}
    for key, value in table.items():
        where = (*path, key)
        if path and (key == "kind" or path[0] == "arm" or where in _REPLACES):
            early[key] = value
        elif isinstance(value, dict) and value:
            for part, inner in zip((early, late), _split(value, where), strict=True):
                if inner:
                    part[key] = inner
        else:
            late[key] = value
    return early, late


def parse_scenario(text: str, source: str) -> Scenario:
    """Return the scenario that a resolved TOML text is; ``source`` is named in an error.

    Raises
    ------
    InputError
        It is no TOML, or no scenario.
    """
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: no valid TOML: {error}") from error
    return _convert(data, source)


def _find(name_or_file: str) -> Path:
    path = Path(name_or_file)
    try:
        is_file = path.is_file()
    except (OSError, ValueError) as error:  # too long, or with a NUL
        raise InputError(f"{name_or_file!r}: no such file: {error}") from error
    if path.suffix == ".toml" or is_file:
        if not is_file:
            raise InputError(f"{name_or_file}: no such file")
        return path
    shipped = list_scenarios()
    if name_or_file not in shipped:
        close = difflib.get_close_matches(name_or_file, shipped, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise InputError(
            f"scenario {name_or_file!r}: {hint}shipped are {', '.join(shipped)}; "
            "or give the path of a .toml file"
        )
    return shipped[name_or_file]


def _read(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """Return the file's table merged over the one it extends."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except (ValueError, RecursionError) as error:  # also thousands of digits or brackets
        raise InputError(f"{path.name}: no valid TOML: {error}") from error
    base = data.pop("extends", None)
    # Here, so that the message names the file which holds the key.
    refuse_absurd(data, path.name, ())
    refuse_unknown(data, Scenario, path.name, ())
    if base is None:
        return data
    if not isinstance(base, str):
        raise InputError(f"{path.name}: extends = {base!r}: needs a scenario's name or file")
    if "\0" in base:
        raise InputError(f"{path.name}: extends = {base!r}: no file's name")
    try:
        base_path = path.parent / base if base.endswith(".toml") else _find(base)
    except InputError as error:
        raise InputError(f"{path.name}: extends = {base!r}: {error}") from error
    if base_path.resolve() in seen or base_path.resolve() == path.resolve():
        raise InputError(
            f"{path.name}: extends = {base!r}: the files extend each other in a circle"
        )
    parent = _read(base_path, (*seen, path.resolve()))
    parent.pop("description", None)
    return _merge(parent, data)


def _merge(
    base: dict[str, Any], over: Mapping[str, Any], kind: object = Scenario
) -> dict[str, Any]:
    """Return ``over`` laid upon ``base``; a section of another ``kind`` replaces it whole."""
    fields = _fields_of(kind)
    # A base that does not say its kind has the default one.
    default = fields["kind"].default if "kind" in fields else None
    if "kind" in over and over["kind"] != base.get("kind", default):
        base = {}
    merged = dict(base) if kind is not Scenario else without_other_arms(base, over)
    for key, value in over.items():
        if value == UNSET and key in fields and fields[key].default is None:
            merged.pop(key, None)
        elif isinstance(value, dict):
            # Also where the base has no such section: UNSET in it says nothing.
            below = merged.get(key)
            kind_below = fields[key].type if key in fields else None
            merged[key] = _merge(below if isinstance(below, dict) else {}, value, kind_below)
        else:
            merged[key] = value
    if kind is SheetConfig and any(over.get(k, UNSET) != UNSET for k in ("material", "layers")):
        # Another material: the numbers of the one before are none of its own.
        whole = MATERIAL_KEYS if "layers" not in over else (*MATERIAL_KEYS, "thickness_m")
        for key in set(whole) - over.keys():
            merged.pop(key, None)
    for given, other in (_ALTERNATIVES, _ALTERNATIVES[::-1]):
        if given in fields and given in over and other not in over:
            merged.pop(other, None)
    return merged


def _table_of(setting: str) -> dict[str, Any]:
    """Return the tables that ``path.to.key=value`` stands for."""
    names = _names_of(setting)
    _, equals, text = setting.partition("=")
    if not equals or not all(names) or len(names) > 10:
        raise InputError(f"--set {setting}: needs path.to.key=value, e.g. alter.delay_cycles=2")
    value: Any
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = _number_or_text(text.strip())
    for name in reversed(names[1:]):
        value = {name: value}
    return {names[0]: value}


def _names_of(setting: str) -> list[str]:
    return setting.partition("=")[0].strip().split(".")


def _refuse_values_as_sections(data: Mapping[str, Any], setting: str) -> None:
    table: object = data
    for name in _names_of(setting)[:-1]:
        table = table.get(name, {}) if isinstance(table, dict) else None
        if not isinstance(table, dict):
            raise InputError(f"--set {setting}: {name!r} is a value, not a section")


def _number_or_text(text: str) -> float | str:
    """Read what a shell user writes without TOML's strictness: .5 and bare words."""
    try:
        return float(text)
    except ValueError:
        return text


def _convert(data: dict[str, Any], source: str) -> Scenario:
    data = _merge({}, data)
    refuse_absurd(data, source, ())
    refuse_unknown(data, Scenario, source, ())
    try:
        return msgspec.convert(data, Scenario)
    except msgspec.ValidationError as error:
        raise InputError(f"{source}: {explain(data, str(error))}") from error


def refuse_absurd(value: object, source: str, keys: tuple[str, ...]) -> None:
    """Refuse what is no number, and sizes that no quantity has but that overflow a product."""
    if isinstance(value, dict):
        for key, item in value.items():
            refuse_absurd(item, source, (*keys, key))
    elif isinstance(value, list):
        for item in value:
            refuse_absurd(item, source, keys)
    elif isinstance(value, int | float) and keys != ("seed",):
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{source}: {'.'.join(keys)} = {value}: must be a finite number")
        if value and not _SMALLEST <= abs(value) <= _LARGEST:
            raise InputError(
                f"{source}: {'.'.join(keys)} = {value}: must be 0 or between {_SMALLEST:g} and "
                f"{_LARGEST:g} in size"
            )


def refuse_unknown(data: object, kind: object, source: str, keys: tuple[str, ...]) -> None:
    """Name an unknown key with its nearest valid ones, which msgspec's own message lacks."""
    fields = {name: field.type for name, field in _fields_of(kind).items()}
    if fields and isinstance(data, list):
        for i, item in enumerate(data):
            refuse_unknown(item, kind, source, (*keys[:-1], f"{keys[-1]}[{i}]"))
        return
    if not fields or not isinstance(data, dict):
        return
    for key, value in data.items():
        if key not in fields:
            close = difflib.get_close_matches(key, fields, n=2, cutoff=0.5)
            hint = f"did you mean {' or '.join(close)}? " if close else ""
            shown = "{...}" if isinstance(value, dict) else repr(value)
            raise InputError(
                f"{source}: {'.'.join((*keys, key))} = {shown}: unknown key; {hint}"
                f"valid here: {', '.join(fields)}"
            )
        refuse_unknown(value, fields[key], source, (*keys, key))


@functools.cache
def _fields_of(kind: object) -> dict[str, msgspec.structs.FieldInfo]:
    """Return the fields of a section's type; none of a value's."""
    struct = None if kind is None else _struct_of(kind)
    return {} if struct is None else {f.encode_name: f for f in msgspec.structs.fields(struct)}


def _struct_of(kind: object) -> type[msgspec.Struct] | None:
    info = msgspec.inspect.type_info(kind)
    options = info.types if isinstance(info, msgspec.inspect.UnionType) else (info,)
    for choice in options:
        bare = choice.type if isinstance(choice, msgspec.inspect.Metadata) else choice
        option = bare.item_type if isinstance(bare, msgspec.inspect.VarTupleType) else bare
        if isinstance(option, msgspec.inspect.StructType):
            return option.cls
    return None


def explain(data: Mapping[str, Any], message: str, kind: object = Scenario) -> str:
    """Put msgspec's message as key, value and what would be right."""
    match = re.search(r" - at `\$\.?(.*)`$", message)
    if match is None:
        return message
    keys, text = match.group(1), message[: match.start()]
    value: Any = data
    for part in re.findall(r"[^.\[\]]+", keys):
        fields = _fields_of(kind)
        kind = fields[part].type if part in fields else kind
        if isinstance(value, dict):
            value = value.get(part)
        elif isinstance(value, list) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
    if text.startswith("Invalid enum value"):
        text = f"must be one of {', '.join(_choices(msgspec.inspect.type_info(kind)))}"
    elif "matching regex" in text:
        text = "must begin with a letter or digit and hold only letters, digits and . _ + -"
    elif value == UNSET and text.startswith("Expected `object"):
        below = ", ".join(_fields_of(kind))
        text = f"this section is always there: leave it out, or give its keys: {below}"
    shown = "" if isinstance(value, dict) or value is None else f" = {value!r}"
    return f"{keys}{shown}: {text}"


def _choices(info: msgspec.inspect.Type) -> list[str]:
    """Return the words that a type allows, also inside a tuple or beside None."""
    if isinstance(info, msgspec.inspect.LiteralType):
        return [repr(word) for word in info.values]
    if isinstance(info, msgspec.inspect.Metadata):
        return _choices(info.type)
    if isinstance(info, msgspec.inspect.VarTupleType):
        return _choices(info.item_type)
    if isinstance(info, msgspec.inspect.UnionType):
        return [word for option in info.types for word in _choices(option)]
    return []


def _without_none(value: Any) -> Any:  # noqa: ANN401 - a tree of TOML values
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_without_none(item) for item in value]
    return value
