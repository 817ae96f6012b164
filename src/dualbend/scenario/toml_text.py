"""Values as a person would write them in TOML, on one line; reading them back gives the same."""

from __future__ import annotations

import msgspec


def number(value: float) -> str:
    """Return a number as TOML reads it, in powers of a thousand where that is shorter."""
    text = repr(value)
    if isinstance(value, int) or not value or 1e-4 <= abs(value) < 1e5:
        return text
    for exponent in range(-15, 16, 3):
        mantissa = float(f"{value / 10.0**exponent:.12g}")
        short = f"{mantissa:g}e{exponent}"
        if 1.0 <= abs(mantissa) < 1e3 and float(short) == value:
            return short
    return text


def toml(value: object) -> str:
    """Return a value as TOML has it on one line; a key that is absent is ``"none"``.

    In a table of a list it is left out: what stands there extends nothing.
    """
    if isinstance(value, msgspec.Struct):
        value = {k: v for k, v in msgspec.structs.asdict(value).items() if v is not None}
    if value is None:
        return '"none"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return number(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_basic_string(k)} = {toml(v)}' for k, v in value.items())}}}"
    return _basic_string(str(value))


def _basic_string(text: str) -> str:
    """Quote text: TOML's escapes are JSON's, but for DEL, which JSON leaves as it is."""
    return msgspec.json.encode(text).decode().replace("\x7f", "\\u007f")
