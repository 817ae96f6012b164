"""What every package stands on: one way to refuse, one way to declare a section."""

from pathlib import Path
from typing import Annotated

import msgspec
import pytest

from dualbend.errors import InputError, refusing, writing
from dualbend.types import Config, said


class Span(Config):
    """A section as a scenario has them."""

    length_m: Annotated[float, said("free length", gt=0, le=3)] = 1.0
    name: str


def test_a_section_is_frozen_and_given_by_name() -> None:
    span = Span(name="a")
    with pytest.raises(AttributeError):
        span.name = "b"  # type: ignore[misc]
    with pytest.raises(TypeError):
        Span(1.0, "a")  # type: ignore[misc]
    assert span == Span(name="a", length_m=1.0)
    assert len({span, Span(name="a")}) == 1


@pytest.mark.parametrize("wrong", [{"lenght_m": 1.0}, {"length_m": 0.0}, {"length_m": 3.1}])
def test_a_section_refuses_unknown_keys_and_values_out_of_bounds(wrong: dict[str, float]) -> None:
    with pytest.raises(msgspec.ValidationError, match=r"unknown field|float"):
        msgspec.convert({"name": "a", **wrong}, Span)


def test_a_bound_that_msgspec_does_not_know_is_refused() -> None:
    with pytest.raises(TypeError):
        said("free length", atleast=0)


def test_an_error_gets_its_place_and_no_other_error_does() -> None:
    with pytest.raises(InputError, match=r"^layers: it would curl$"), refusing("layers"):
        raise InputError("it would curl")
    with pytest.raises(InputError, match=r"^a: b$"), refusing("a", KeyError, RuntimeError):
        raise RuntimeError("b")
    with pytest.raises(ZeroDivisionError), refusing("a", KeyError):
        raise ZeroDivisionError
    with pytest.raises(InputError, match=r"^of another$"), refusing("a", KeyError):
        raise InputError("of another")


@pytest.mark.parametrize(("option", "start"), [("--out", "--out "), ("", "")])
def test_what_cannot_be_written_names_option_and_path(option: str, start: str) -> None:
    path = Path("/proc/none/x")
    with pytest.raises(InputError) as caught, writing(path, option):
        path.write_text("", encoding="utf-8")
    assert str(caught.value) == f"{start}/proc/none/x: cannot be written: No such file or directory"
