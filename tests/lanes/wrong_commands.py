"""Command lines, environments and streams that nobody means, one of which a case is made of."""

from __future__ import annotations

import os
import random
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path

SHORT = (
    *("--set", "path.end_rad=0.05", "--set", "motion.speed_rad_per_s=0.5"),
    *("--set", "motion.settle_s=0.1", "--set", "motion.hold_s=0.1"),
)
RUN = ("run", "exact", *SHORT, "--out", "r")
RESULTS = ("r/summary.json", "r/scenario.toml", "r/trace.parquet")


@dataclass(kw_only=True)
class Case:
    """A command in its surroundings.

    ``before``, ``after``: of the shell's line, around the command; ``codes``: the exit codes that
    are right, all documented ones where empty; ``hears``: its messages can be read; ``leaves``:
    files that must be there afterwards.
    """

    arguments: tuple[str, ...]
    before: str = ""
    after: str = ""
    environment: dict[str, str] = field(default_factory=dict)
    codes: frozenset[int] = frozenset()
    hears: bool = True
    leaves: tuple[str, ...] = ()

    def shell(self) -> str:
        """Return the line for bash."""
        given = " ".join(map(shlex.quote, self.arguments))
        return f"{self.before}{shlex.quote(sys.executable)} -m dualbend {given}{self.after}"

    def __str__(self) -> str:
        own = {k: v for k, v in self.environment.items() if os.environ.get(k) != v}
        gone = sorted(os.environ.keys() - self.environment.keys())
        return f"{self.shell()[:300]} with {own}, without {gone}"


def case_of(chance: random.Random, folder: Path) -> Case:
    """Return a case; files that it needs are made in its folder."""
    _make_files(folder)
    if chance.random() < 0.6:
        case = Case(arguments=_wrong_arguments(chance))
    else:
        arguments, leaves = chance.choice(_RIGHT)
        case = Case(arguments=arguments, codes=frozenset({0}), leaves=leaves)
    case.environment = dict(os.environ)
    for _ in range(chance.choice((0, 1, 1, 2))):
        name, value = chance.choice(_ENVIRONMENT)
        if value is None:
            case.environment.pop(name, None)
        else:
            case.environment[name] = value
            if name == "MUJOCO_GL" and case.codes:  # MuJoCo itself refuses to be imported
                case.codes, case.leaves = case.codes | {2}, ()
    if chance.random() < 0.6:
        _streams(chance, case)
    return case


def _make_files(folder: Path) -> None:
    (folder / "folder.toml").mkdir()
    os.mkfifo(folder / "pipe.toml")
    (folder / "empty.toml").write_bytes(b"")
    (folder / "binary.toml").write_bytes(bytes(range(256)))
    (folder / "mark.toml").write_bytes(b'\xef\xbb\xbfextends = "fig6"\n')
    (folder / "mine.toml").write_text('extends = "fig6"\nname = "mine"\n', encoding="utf-8")
    for i in range(300):
        (folder / f"chain{i}.toml").write_text(f'extends = "chain{i + 1}.toml"\n')
    (folder / "sweep.toml").write_text(
        'scenario = "fig8"\nmetrics = ["peak_momnet"]\n[sample]\nkind = "grid"\n'
        "[keys]\nsheet.width_m = { values = [0.05, 0.06] }\n"
    )
    (folder / "results").mkdir()
    (folder / "loop").symlink_to("loop")


_BEAM = ("beam", "--length", "0.4", "--width", "0.06", "--thickness", "0.0005", "--young", "7e10")
_RIGHT: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (
    *((("list",), ()), (("--help",), ()), (("run",), ()), (("materials",), ()), (("arms",), ())),
    *((("materials", "6061-T6"), ()), (("schema",), ()), (("reference",), ())),
    *((("run", "--help"), ()), ((*_BEAM, "--alpha", "1"), ()), (("plan", "pwb"), ())),
    *((("new", "own"), ("own.toml",)), (("--version",), ())),
    *(((*RUN, "--no-record"), RESULTS), (RUN, (*RESULTS, "r/run.rrd"))),
    (("stability", "fig8", "--map", "m.png"), ("m.png",)),
)
"""Commands that succeed, and what they leave."""

_NAMES = (
    *(
        "",
        " ",
        "fig88",
        "FIG8",
        "pipe.toml",
        "folder.toml",
        "empty.toml",
        "binary.toml",
        "mark.toml",
    ),
    *(
        "chain0.toml",
        "loop",
        "/dev/zero",
        "/dev/stdin",
        "/dev/null",
        "..",
        "/",
        "results",
        "none.toml",
    ),
    *("a" * 300, "a" * 100_000, "x\ny", "\udcff.toml", "é", "--", "-", "fig8 ", "*", "~", "$HOME"),
    *("sweep.toml", "/proc/self/mem", "none/none.toml", "loop/x.toml"),
)
_NUMBERS = (
    *(
        "nan",
        "inf",
        "-inf",
        "1e400",
        "-1",
        "0",
        "1e-320",
        "1e300",
        "9" * 5000,
        "",
        " ",
        "x",
        "0x10",
    ),
    *("1,5", "1e", "٣", "--", "1_0", "True", "2**63", str(2**64), "-0.0"),
)
_SETTINGS = (
    *("", "=", "a", "a=", "=1", "sheet", "sheet=", "sheet.width_m", "sheet.width_m=", "a.b.c=1"),
    *("sheet.width_m=nan", "sheet.width_m=57", "sheet=5", "sheet=[]", "sheet.width_m.x=1"),
    *("compliance.sensing=right", "sensor.lever_arm_m=1e9", "name=../x", "name=", "seed=1.5"),
    *("sheet.width_m=" + "9" * 5000, "description=" + "d" * 100_000, "x" * 100_000 + "=1"),
    *("a." * 2000 + "b=1", "path.table=" + "[" * 3000 + "]" * 3000, "seed=0x" + "f" * 9000),
    *("description=\udcff", "sheet.width_m=0.06\nseed=2", 'name="\\u0000"', "task.kind=none"),
    *("cell.home_rad=[0,0,0,0,0,0]", "cell.home_rad=[0,-90,90,0,90,0]", "robot.model=r2d2"),
    *("extends=fig8", "path=none", "robot=none", "expect.outcome=[]", "filter=fir=2", "é=1"),
    *("robot.model=panda", "physics.step_s=1e-5", "sheet.model=shell", "path.end_rad=-1"),
)
_OUTS = (
    "",
    "/proc/none/x",
    "/dev/full",
    "/dev/null/x",
    "mine.toml/x",
    "o" * 5000,
    "loop/x",
    "/",
    ".",
)


def _wrong_arguments(chance: random.Random) -> tuple[str, ...]:
    name, number = chance.choice(_NAMES), chance.choice(_NUMBERS)
    setting, out = chance.choice(_SETTINGS), chance.choice(_OUTS)
    beam = [*_BEAM, "--alpha", "1"]
    beam[chance.choice((2, 4, 6, 8, 10))] = number
    made: tuple[tuple[str, ...], ...] = (
        (chance.choice(("run", "scene", "plan", "view", "stability", "tune", "render")), name,
         "--out", "out.png"),
        ("run", name), ("check", name), ("sweep", name), ("report", name), ("new", name),
        ("new", "x", "--from", name), ("arms", "--for", name), ("materials", name),
        ("compare", name, name), ("robustness", name, "--runs", "1"), (name,), ("--" + name,),
        ("run", "exact", "--set", setting, *SHORT, "--no-record"),
        ("run", "exact", "--set", setting, *SHORT, "--no-record"),
        ("scene", "fig8", "--out", "x.xml", "--set", setting),
        ("plan", "pwb", "--set", setting), ("arms", "--for", "fig6", "--set", setting),
        ("run", "exact", *SHORT, "--out", out), ("scene", "fig6", "--out", out),
        ("render", "exact", *SHORT, "--out", out), ("schema", "--out", out),
        ("stability", "fig8", "--map", out), ("beam", *beam[1:]), tuple(beam),
        *((*beam, option, number) for option in ("--half-distance", "--weight", "--poisson")),
        *(("render", "exact", *SHORT, "--out", "x.png", option, number)
          for option in ("--fps", "--speed", "--width", "--at", "--camera", "--seed")),
        ("run", "exact", *SHORT, "--seed", number), ("benchmark", "exact", "--repeat", number),
        ("robustness", "pwb", "--runs", number),
        ("robustness", "pwb", "--seed", number, "--runs", "0"),
        ("tune", "fig8", "--gain-margin", number, "--seeds", "0"),
        ("tune", "fig6", "--phase-margin", number, "--seeds", "0"),
        ("stability", "fig8", "--map", "m.png", "--map-b", number, "1"),
        ("sweep", "sweep.toml", "--workers", number), ("validate", "--arm", name),
        ("check", "--baseline", name), ("run", "exact", "--view", name, *SHORT),
        ("sweep", "sweep.toml", "--scheduler", name), ("report", "results", "--out", out),
        ("figures", "--out", out, "--set", setting), ("validate", "--shell", "--arm", name),
    )  # fmt: skip
    return tuple(argument.replace("\0", "") for argument in chance.choice(made))


_ENVIRONMENT: tuple[tuple[str, str | None], ...] = (
    *(("MPLBACKEND", "nonsense"), ("MPLBACKEND", "module://matplotlib_inline.backend_inline")),
    *(
        ("MPLBACKEND", "TkAgg"),
        ("MPLCONFIGDIR", "/proc/none"),
        ("HOME", None),
        ("HOME", "/proc/none"),
    ),
    *(
        ("TERM", "dumb"),
        ("TERM", None),
        ("PYTHONIOENCODING", "ascii"),
        ("LANG", "C"),
        ("LC_ALL", "C"),
    ),
    *(("PYTHONUTF8", "0"), ("PYTHONCOERCECLOCALE", "0")),
    *(("COLUMNS", "1"), ("COLUMNS", "-5"), ("COLUMNS", "x"), ("LINES", "0"), ("NO_COLOR", "1")),
    *(("PATH", ""), ("TMPDIR", "/proc/none"), ("DISPLAY", ":99"), ("MUJOCO_GL", "nonsense")),
    *(("OMP_NUM_THREADS", "x"), ("PYTHONUNBUFFERED", "1"), ("PYTHONOPTIMIZE", "2"), ("TZ", "x/y")),
    *(("XDG_CACHE_HOME", "/proc/none"), ("PYTHONHASHSEED", "7"), ("PYTHONDEVMODE", "0")),
)


def _streams(chance: random.Random, case: Case) -> None:
    """Close, fill or break the standard streams, or take the folder away."""
    # Without its output a command that succeeds still does: a full disk alone is told, by 2.
    kinds = {
        "<&-": case.codes,
        ">&-": case.codes,
        "2>&-": case.codes,
        ">&- 2>&- <&-": case.codes,
        "2>/dev/full": case.codes,
        ">/dev/full": case.codes and frozenset({2}),
        ">/dev/full 2>&1": case.codes and frozenset({2}),
        "| head -c 1; exit ${PIPESTATUS[0]}": case.codes,
        "| true; exit ${PIPESTATUS[0]}": case.codes,
        "2>&1 | true; exit ${PIPESTATUS[0]}": case.codes,
    }
    kind = chance.choice(sorted(kinds))
    case.after = f" {kind}"
    # A command that prints nothing cannot notice, and one that writes a file prints where.
    case.codes = kinds[kind]
    case.hears = "2>" not in kind
    if chance.random() < 0.15 and not case.leaves:
        case.before = chance.choice(("cd /proc/self; ", "mkdir gone; cd gone; rmdir ../gone; "))
        case.codes = frozenset()
    elif chance.random() < 0.15:
        case.before = chance.choice(
            ("ulimit -f 0; ", "ulimit -n 12; ", "ulimit -s 512; ", "trap '' HUP; ")
        )
        case.codes, case.leaves = frozenset(), ()
