"""What can go wrong, as one family of exceptions."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path


class DualbendError(Exception):
    """Base of every error that dualbend raises on purpose."""


class InputError(DualbendError, ValueError):
    """The user gave something that cannot be used; the message says what would be right."""


class Interrupted(KeyboardInterrupt):
    """A signal asks the program to end as soon as what was computed is kept.

    ``signal``: its number, also of an interrupt from the keyboard.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.signal = number


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
