"""A controller of the user's own, named in the scenario: ``kind = "module:Class"`` and its options.

The class is called ``Class(scenario, **options)``; what it makes is a controller as
:class:`dualbend.control.controller.Controller` has it, which may also return the deviation of the
one arm that complies alone.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable
from types import SimpleNamespace
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import inspect as mi
from numpy.typing import ArrayLike

from dualbend.control.clock import TransferFunction
from dualbend.control.compliance.base import ComplianceBase
from dualbend.control.controller import NEVER, Controller, Observation, as_numbers
from dualbend.errors import InputError, brief, refusing
from dualbend.registry import beside, own_class, raised_at
from dualbend.types import SIDES, Mask, Vector, said


class OwnComplianceConfig(ComplianceBase, tag="own"):
    """A class of yours controls: `kind = "module:Class"` is short for this kind with `controller`.

    It is called with the scenario and the options. To run the scenario is to run its module, which
    is found beside the file or on the import path (docs/your-controller.md).
    """

    controller: Annotated[
        str,
        said(
            "module:Class, or the name of an entry point of dualbend.compliances",
            min_length=1,
            max_length=200,
        ),
    ]
    folder: (
        Annotated[
            str,
            said(
                "where the module is looked for first; else it is the file's own", max_length=1000
            ),
        ]
        | None
    ) = None
    options: Annotated[dict[str, Any], said("what the class is called with, by name")] = (
        msgspec.field(default_factory=dict)
    )

    def __hash__(self) -> int:
        """Return a hash; options are a dictionary, which has none."""
        return hash((self.sensing, self.complying, self.controller, self.folder))

    def made_by(self) -> Callable[..., Any]:
        """Return the class; InputError where there is none."""
        return own_class(self.controller, self.folder)

    @property
    def in_space(self) -> bool:
        """Nobody knows what it does but itself: a trace has all six directions."""
        return True

    @property
    def beyond(self) -> str:
        """Whatever it is, it need not be b and k."""
        return f"compliance.kind = {brief(self.controller)} is a class of your own"

    @property
    def gains(self) -> tuple[str, ...]:
        """Options that a search may multiply, as the class says in its attribute ``gains``.

        Raises InputError where one is no positive number.
        """
        found = tuple(getattr(self.made_by(), "gains", ()))
        for name in found:
            value = self.options.get(name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
                raise InputError(
                    f"compliance.options.{name} = {brief(value)}: {self.controller} calls it a "
                    "gain, which must be a number above 0"
                )
        return found


class OwnController:
    """A user's controller, called once per cycle; ``complying`` are the indices of arms it moves.

    Raises InputError where the class cannot be made.
    """

    def __init__(self, config: OwnComplianceConfig, scenario: object) -> None:
        self._complying = [i for i, side in enumerate(SIDES) if side in config.complying]
        self._held = [i for i in range(len(SIDES)) if i not in self._complying]
        self._named = f"compliance.kind = {brief(config.controller)}"
        with refusing(self._named):
            made = config.made_by()
            options = _arguments(made, config.options)
            try:
                with beside(config.folder):
                    self.controller: Controller = made(scenario, **options)
            except (Exception, SystemExit) as error:
                raise InputError(f"{type(error).__name__}: {error}{raised_at(error)}") from error
            if not callable(self.controller):
                name = type(self.controller).__name__
                raise InputError(f"makes a {name}, which cannot be called with an observation")

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation of both arms (..., 2, 6), also of a controller that gives one arm's.

        Raises ValueError where it moves an arm that does not comply.
        """
        given = as_numbers(self.controller(observation))
        shape = observation.filtered.components.shape
        if given.shape == (*shape[:-2], 6) and len(self._complying) == 1:
            deviation = np.zeros(shape)
            deviation[..., self._complying[0], :] = given
            return deviation
        if given.shape == shape and np.count_nonzero(given[..., self._held, :]):
            moved = " and ".join(SIDES[i] for i in self._held)
            raise ValueError(f"its deviation moves the {moved} arm, which is not in complying")
        return given

    def transfer_functions(self, alpha_rad: float) -> tuple[TransferFunction | None, ...]:
        """Return what makes δx of the force x and δα of the moment at a bending angle, z⁻¹ rising.

        ``(numerator, denominator)`` of each, as :mod:`dualbend.control.clock` has them; None of one
        that does not act. They are what the class's ``transfer_functions(alpha_rad)`` returns.

        Raises InputError where it has no such method, or that returns something else.
        """
        asked = getattr(self.controller, "transfer_functions", None)
        if asked is None:
            raise InputError(
                f"{self._named} has no method transfer_functions(alpha_rad): its loop is not "
                "predicted (docs/your-controller.md)"
            )
        try:
            x, rotation = (None if given is None else monic(*given) for given in asked(alpha_rad))
        except Exception as error:
            raise InputError(
                f"{self._named}: transfer_functions({alpha_rad:.3g}): needs two, of x and of the "
                f"rotation, each (numerator, denominator) or None: {type(error).__name__}: {error}"
            ) from error
        return x, rotation

    @property
    def saturated(self) -> Mask:
        """Which bounds of its own it has met, as it says."""
        return np.asarray(getattr(self.controller, "saturated", NEVER))


def monic(numerator: ArrayLike, denominator: ArrayLike) -> TransferFunction:
    """Return a transfer function with its denominator monic; ValueError where it is none."""
    above, below = (
        np.atleast_1d(np.asarray(p, dtype=np.float64)) for p in (numerator, denominator)
    )
    if above.ndim != 1 or below.ndim != 1 or not (np.isfinite(above).all() and below[0]):
        raise ValueError("numerator and denominator must be lists of numbers, denominator[0] not 0")
    return above / below[0], below / below[0]


_VARIOUS = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)


def option_struct(made: Callable[..., Any]) -> type[msgspec.Struct]:
    """Return a struct of the options that a class is called with, open where it takes any others.

    Their types and bounds are those of its annotations, as far as a scenario can hold them.

    Raises InputError where it does not take the scenario first.
    """
    name = getattr(made, "__name__", type(made).__name__)
    try:
        scenario, *options = inspect.signature(made).parameters.values()
    except (TypeError, ValueError) as error:
        raise InputError(f"needs {name}(scenario, **options)") from error
    if scenario.kind not in (scenario.POSITIONAL_ONLY, scenario.POSITIONAL_OR_KEYWORD):
        raise InputError(f"needs {name}(scenario, **options)")
    fields = [_field(made, option) for option in options if option.kind not in _VARIOUS]
    closed = not any(option.kind == option.VAR_KEYWORD for option in options)
    return msgspec.defstruct(name, fields, kw_only=True, frozen=True, forbid_unknown_fields=closed)


def _field(made: Callable[..., Any], option: inspect.Parameter) -> tuple[str, Any, Any]:
    default = option.default
    if default is option.empty:
        return option.name, _type_of(made, option), msgspec.NODEFAULT
    return option.name, _type_of(made, option), msgspec.field(default_factory=lambda: default)


def _type_of(made: Callable[..., Any], option: inspect.Parameter) -> Any:  # noqa: ANN401
    """Return the annotated type of an option; any where there is none that a scenario can hold."""
    if option.annotation is option.empty:
        return Any
    function = inspect.unwrap(getattr(made, "__init__", made) if inspect.isclass(made) else made)
    alone = SimpleNamespace(__annotations__={option.name: option.annotation})
    try:
        names = getattr(function, "__globals__", {})
        hint = typing.get_type_hints(alone, globalns=names, include_extras=True)[option.name]
        known = _is_of_a_file(mi.type_info(hint))
    except (NameError, TypeError):
        return Any
    return hint if known else Any


def _is_of_a_file(info: mi.Type) -> bool:
    """Tell whether a scenario can hold values of a type, and say what is wrong with others."""
    if isinstance(info, mi.Metadata):
        return _is_of_a_file(info.type)
    if isinstance(info, mi.UnionType):
        options = [option for option in info.types if not isinstance(option, mi.NoneType)]
        return len(options) == 1 and _is_of_a_file(options[0])
    if isinstance(info, mi.VarTupleType | mi.ListType):
        return _is_of_a_file(info.item_type)
    return isinstance(
        info, mi.FloatType | mi.IntType | mi.BoolType | mi.StrType | mi.LiteralType | mi.AnyType
    )


def _arguments(made: Callable[..., Any], options: dict[str, Any]) -> dict[str, Any]:
    """Return options in the types of a class; InputError where they do not suit it."""
    struct = option_struct(made)
    with refusing("options", msgspec.ValidationError):
        found = msgspec.convert(checked_options(struct, options), struct)
    return {**options, **msgspec.structs.asdict(found)}


def checked_options(struct: type[msgspec.Struct], options: dict[str, Any]) -> dict[str, Any]:
    """Return the options that a struct checks: all, or those it names where others may be given."""
    if struct.__struct_config__.forbid_unknown_fields:
        return options
    return {name: value for name, value in options.items() if name in struct.__struct_fields__}
