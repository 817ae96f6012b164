"""What can go wrong, as one family of exceptions."""

import reprlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from operator import index
from pathlib import Path
from typing import SupportsIndex

_LONGEST_VALUE, _LONGEST_MESSAGE = 80, 500
"""Characters of a value in a message, and of a message."""


class DualbendError(Exception):
    """Base of every error that dualbend raises on purpose."""


class InputError(DualbendError, ValueError):
    """The user gave something that cannot be used; the message says what would be right."""


def shortened(text: str, most: int = _LONGEST_MESSAGE) -> str:
    """Return a text on one line, the middle left out of one of more than ``most`` characters."""
    line = " ".join(text[: 10 * most].splitlines() + text[10 * most :][-most:].splitlines())
    return line if len(line) <= most else f"{line[: 2 * most // 3]} ... {line[-(most // 3) :]}"


def brief(value: object) -> str:
    """Return a user's value as Python writes it, short whatever it is: for a message."""
    try:
        return shortened(_REPR.repr(value), _LONGEST_VALUE)
    except (ValueError, RecursionError):  # more digits than Python writes
        return f"a {type(value).__name__} too large to show"


_REPR = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _REPR.maxlong = _LONGEST_VALUE


def refuse_below_one(**numbers: object) -> None:
    """Raise InputError, with its name, for the first that is no whole number from 1 on."""
    for name, number in numbers.items():
        if not isinstance(number, SupportsIndex) or isinstance(number, bool) or index(number) < 1:
            raise InputError(f"{name} = {brief(number)}: must be a whole number, at least 1")


@contextmanager
def refusing(said: str, *errors: type[Exception]) -> Iterator[None]:
    """Turn errors, of these types or InputError, into an InputError that begins with ``said``."""
    refused = errors or (InputError,)
    try:
        yield
    except refused as error:
        reason = getattr(error, "strerror", None) or error
        # Arrow's messages have several lines.
        raise InputError(f"{said}: {' '.join(str(reason).splitlines())}") from error


def writing(
    path: Path, option: str = "", *, also: type[Exception] = OSError
) -> AbstractContextManager[None]:
    """Refuse a path, with the ``option`` that gave it, where an OSError says it is not writable.

    ``also``: another error that the writer raises, e.g. of a format that it does not know.
    """
    return refusing(f"{option} {path}: cannot be written".lstrip(), OSError, also)
