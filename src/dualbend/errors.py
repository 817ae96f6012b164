"""What can go wrong, as one family of exceptions."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class DualbendError(Exception):
    """Base of every error that dualbend raises on purpose."""


class InputError(DualbendError, ValueError):
    """The user gave something that cannot be used; the message says what would be right."""


@contextmanager
def writing(path: Path, option: str = "", *, also: type[Exception] = OSError) -> Iterator[None]:
    """Turn an OSError, or an error that the writer raises ``also``, into an InputError.

    The message names the ``option`` that gave the path, if there is one, and the path.
    """
    try:
        yield
    except (OSError, also) as error:
        place = f"{option} {path}".lstrip()
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{place}: cannot be written: {reason}") from error
