"""Objects of single worlds joined to one of many, and random numbers drawn ahead for all."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dualbend.types import Vector

BLOCK = 128
"""Cycles for which random numbers are drawn at once; they are those of as many single draws."""

Draw = Callable[[], ArrayLike]
"""Gives what one stream draws in the next BLOCK cycles, (BLOCK, *size)."""


def drawn(draws: Sequence[Draw | None], shape: tuple[int, ...], *size: int) -> Vector:
    """Return what streams draw ahead (BLOCK, *shape, *size); 0 where an element has no stream."""
    found = np.zeros((BLOCK, len(draws), *size))
    for i, draw in enumerate(draws):
        if draw is not None:
            found[:, i] = draw()
    return found.reshape(BLOCK, *shape, *size)


T = TypeVar("T")


def stacked(many: Sequence[T], *names: str) -> T:
    """Return a copy of the first of many objects that has the named arrays of all of them.

    The arrays get one more axis, the first. For what may differ in more than its arrays, such as
    the gains of a config that is only reported.
    """
    joined = copy.copy(many[0])
    for name in names:
        setattr(joined, name, np.stack([getattr(one, name) for one in many]))
    return joined


class Stackable:
    """What joins to one object of many worlds.

    Of its attributes arrays begin with the leading shape, lists have one element for each of it in
    C order, and all else is the same in all worlds.
    """

    @classmethod
    def stacked(cls, many: Sequence[Self]) -> Self:
        """Join freshly made objects of single worlds: one more leading axis, worlds first.

        Raises
        ------
        ValueError
            They differ in their class, in the shape of an array or in what is the same in all.
        """
        for each in many:
            if type(each) is not type(many[0]):
                raise ValueError(
                    f"{type(each).__name__} and {type(many[0]).__name__} cannot be one"
                )
        one = copy.copy(many[0])
        for name in vars(one):
            values = [vars(each)[name] for each in many]
            vars(one)[name] = _joined(values, f"{type(one).__name__}.{name}")
        return one


def _joined(values: Sequence[Any], name: str) -> Any:  # noqa: ANN401 - any attribute
    first = values[0]
    if isinstance(first, Stackable):
        return first.stacked(values)
    if isinstance(first, np.ndarray):
        for value in values:
            if value.shape != first.shape:
                raise ValueError(f"{name} is of shape {value.shape} and {first.shape}")
        return np.stack(values)
    if isinstance(first, list):
        return [element for value in values for element in value]
    for value in values:
        if value != first:
            raise ValueError(f"{name} is {value!r} and {first!r}")
    return first
