"""What can go wrong, as one family of exceptions."""


class DualbendError(Exception):
    """Base of every error that dualbend raises on purpose."""


class InputError(DualbendError, ValueError):
    """The user gave something that cannot be used; the message says what would be right."""
