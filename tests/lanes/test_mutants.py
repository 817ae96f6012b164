"""The faults of the mutation lane: which are made, which are not, and how a draw is told."""

import ast
from pathlib import Path

import pytest
from mutants import mutants, mutated
from mutation import wilson

SOURCE = '''
"""A module of 3 lines."""
from typing import Annotated
__all__ = ["f" + "g"]
LIMIT: Annotated[float, said("at least 2", ge=2)] = 0.5


class Box(Base, frozen=True):
    """Holds 2."""

    size: int = 3

    @cached(4)
    def f(self, a: int = 7) -> int | None:
        """Return 1."""
        if a < 1 and not self.size:
            raise ValueError(f"a = {a + 1}: need {LIMIT * 2}")
        for each in zip(a, strict=True):
            self.size -= each.T @ a
            break
        self.note()
        return -a
'''


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "box.py"
    path.write_text(SOURCE, encoding="utf-8")
    return path


def test_every_fault_is_made_once_and_nothing_that_is_only_said(file: Path) -> None:
    # Exact: written down by hand from the rules in the docstring of the module.
    made = [(m.operator, m.before, m.after) for m in mutants("box", file)]
    assert sorted(made) == sorted(
        [
            ("constant", "0.5", "1.0"),
            ("constant", "3", "4"),
            ("constant", "3", "2"),
            ("constant", "7", "8"),
            ("constant", "7", "6"),
            ("boolean", "a < 1 and (not self.size)", "a < 1 or not self.size"),
            ("comparison", "a < 1", "a <= 1"),
            ("comparison", "a < 1", "a >= 1"),
            ("constant", "1", "2"),
            ("constant", "1", "0"),
            ("unary", "not self.size", "self.size"),
            ("statement", "raise ValueError(f'a = {a + 1}: need {LIMIT * 2}')", "pass"),
            ("loop", "zip(a, strict=True)", "()"),
            ("arithmetic", "self.size -= each.T @ a", "self.size += each.T @ a"),
            ("statement", "self.size -= each.T @ a", "pass"),
            ("transpose", "each.T", "each"),
            ("loop", "break", "continue"),
            ("statement", "self.note()", "pass"),
            ("return", "return -a", "return None"),
            ("unary", "-a", "a"),
        ]
    )


def test_each_is_one_change_of_the_text(file: Path) -> None:
    plain = ast.unparse(ast.parse(SOURCE)).splitlines()
    for number, mutant in enumerate(mutants("box", file)):
        changed = ast.unparse(mutated(file, number)).splitlines()
        assert len(changed) == len(plain)
        differing = [pair for pair in zip(plain, changed, strict=True) if pair[0] != pair[1]]
        assert len(differing) == 1, mutant


def test_an_edit_of_another_function_moves_no_mutant_in_a_draw(file: Path) -> None:
    before = {m.key: m.rank(1) for m in mutants("box", file)}
    file.write_text("def other(x: int) -> int:\n    return x + 1\n" + SOURCE, encoding="utf-8")
    after = {m.key: m.rank(1) for m in mutants("box", file)}
    assert before.items() <= after.items()
    assert all(mutant.rank(2) != before[mutant.key] for mutant in mutants("box", file)[4:])


def test_the_interval_is_wilsons() -> None:
    # Golden: Newcombe (1998), Statistics in Medicine 17, 857, table I: 81 of 263.
    low, high = wilson(81, 263)
    assert (round(low, 4), round(high, 4)) == (0.2553, 0.3662)
