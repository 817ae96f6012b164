"""Which run a file is of: what every file in a run's folder says, so that two runs do not mix.

``scenario.toml`` says it in a comment, its first line; the trace in the metadata of its schema;
``summary.json`` in its key ``run``.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import Annotated

import msgspec

from dualbend.errors import InputError, refusing
from dualbend.scenario.scenario import Scenario

_COMMENT = "# run {id}, seed {seed}, scenario sha256 {scenario_sha256}"
_PATTERN = re.compile(
    _COMMENT.format(id=r"(?P<id>.*?)", seed=r"(?P<seed>\d{1,19})", scenario_sha256=r"(?P<sha>.*?)")
)


class RunIdentity(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A run: its own random number, in hexadecimal; the seed; SHA-256 of the resolved scenario."""

    id: Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{32}\Z")]
    seed: Annotated[int, msgspec.Meta(ge=0)]
    scenario_sha256: Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{64}\Z")]

    @classmethod
    def of(cls, scenario: Scenario, id: str) -> RunIdentity:
        """Return the identity of a run of a scenario; ``id`` is e.g. ``uuid.uuid4().hex``."""
        return cls(id=id, seed=scenario.seed, scenario_sha256=sha256(scenario.to_toml()))

    def __str__(self) -> str:
        """Return the identity in words: what a picture and a recording say."""
        return f"run {self.id}, seed {self.seed}, scenario sha256 {self.scenario_sha256}"

    def to_toml(self, scenario_toml: str) -> str:
        """Return the text of ``scenario.toml``: the comment, then the resolved scenario."""
        return f"# {self}\n{scenario_toml}"

    def to_metadata(self) -> dict[str, str]:
        """Return what the metadata of a trace say, as texts."""
        return {
            "run_id": self.id,
            "seed": str(self.seed),
            "scenario_sha256": self.scenario_sha256,
        }


def sha256(scenario_toml: str) -> str:
    """Return the SHA-256 of a resolved scenario's text."""
    return hashlib.sha256(scenario_toml.encode()).hexdigest()


def identity_of_toml(text: str) -> RunIdentity | None:
    """Return what the first line of ``scenario.toml`` says; None where it speaks of no run.

    Raises InputError where it is garbled, or the scenario below it is another.
    """
    comment, _, scenario_toml = text.partition("\n")
    if not comment.startswith("# run"):
        return None
    found = _PATTERN.fullmatch(comment)
    if found is None:
        raise InputError(f"line 1 says {comment[:200]!r}; it should say {_COMMENT!r}")
    identity = _converted("line 1", found["id"], found["seed"], found["sha"])
    if sha256(scenario_toml) != identity.scenario_sha256:
        raise InputError(
            f"the scenario was changed after the run: its SHA-256 is {sha256(scenario_toml)}, "
            f"line 1 says {identity.scenario_sha256}"
        )
    return identity


def identity_of_metadata(metadata: Mapping[str, str]) -> RunIdentity | None:
    """Return what the metadata of a trace say; None where they name no run.

    Raises InputError where they are garbled.
    """
    if "run_id" not in metadata:
        return None
    keys = ("run_id", "seed", "scenario_sha256")
    return _converted("its metadata", *(metadata.get(key, "") for key in keys))


def _converted(said: str, run_id: str, seed: str, scenario_sha256: str) -> RunIdentity:
    given = {"id": run_id, "seed": seed, "scenario_sha256": scenario_sha256}
    with refusing(f"{said} name no run", msgspec.ValidationError):
        return msgspec.convert(given, RunIdentity, strict=False)


def one_identity(named: Mapping[str, RunIdentity | None]) -> RunIdentity | None:
    """Return the run that all files name, by file; None where none names one (version 0.1.0).

    Raises InputError where they name different ones, or only some do: it says which names which.
    """
    identities = set(named.values())
    if len(identities) > 1:
        said = "; ".join(f"{file} of {_in_words(identity)}" for file, identity in named.items())
        raise InputError(f"the files are of different runs: {said}")
    return identities.pop()


def _in_words(identity: RunIdentity | None) -> str:
    if identity is None:
        return "a run that it does not name"
    return f"run {identity.id} (seed {identity.seed}, scenario {identity.scenario_sha256[:12]})"
