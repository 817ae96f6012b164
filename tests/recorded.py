"""Values that the baseline does not hold, recorded once and compared: ``python tests/recorded.py``.

Bending on every shipped arm, every shipped bending scenario to full precision, the predictions of
the loop's stability and the plan of the assembly, all through the command line, so that nothing
inside the package can move unseen. ``--record`` writes ``recorded.json``, from which the values of
version 0.1.0 come; without it every number is compared within 1e-8 relative and the exit code is 1
where one moved. Words after the command choose cases: ``recorded.py fig8 plan``.
"""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

FILE = Path(__file__).with_name("recorded.json")
RELATIVE = 1e-8
ABSOLUTE = {"ik_residual_max": 1e-6, "ik_rotation_residual_max": 1e-6}
"""Where the solver stops, not where the arm is."""
MACHINE = ("wall_time", "realtime_factor")
WORDS = {
    r"^alone$": "single",
    r" (Hz) dies out by (\S+) /s,": r" \1, decay rate \2 1/s,",
    r" (Hz) grows by (\S+) /s,": r" \1, growth rate \2 1/s,",
}
"""Words of the recorded values that have other names today; the numbers in them are compared."""
MODEL, RIGHT = "robot.model", "robot.right.model"

BENDING = (
    *("fig6", "fig8", "fig9", "exact", "tuned", "tuned-exact", "springback"),
    *("learned", "learned-fast"),
)
ARMS = ("ur3", "ur5", "ur10", "panda", "xarm7", "z1")
CASES: dict[str, tuple[str, ...]] = {
    **{f"run {name}": ("run", name) for name in BENDING},
    **{
        f"run {name} on {arm}": ("run", name, "--set", f"{MODEL}={arm}")
        for name in ("fig6", "fig8")
        for arm in ARMS
    },
    "run fig6, right arm ur5": ("run", "fig6", "--set", f"{RIGHT}=ur5"),
    **{f"stability {name}": ("stability", name, "--json") for name in BENDING},
    **{
        f"stability fig8 on {arm}": ("stability", "fig8", "--json", "--set", f"{MODEL}={arm}")
        for arm in ARMS
    },
    **{
        f"stability fig8, {axis}": ("stability", "fig8", "--json", "--axis", axis)
        for axis in ("x", "rotation")
    },
    "plan pwb": ("plan", "pwb", "--json"),
    "plan pwb-tight": ("plan", "pwb-tight", "--json"),
}


def measure(arguments: tuple[str, ...]) -> dict[str, Any]:
    """Return exit code and numbers of one command of the package."""
    command = [sys.executable, "-c", "from dualbend.cli import main; main()", *arguments]
    with tempfile.TemporaryDirectory() as folder:
        runs = arguments[0] == "run"
        if runs:
            command += ["--no-record", "--out", folder]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 2:
            return {"exit": 2}
        if not runs:
            return {"exit": done.returncode, "found": json.loads(done.stdout)}
        summary = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
        metrics = {k: v["value"] for k, v in summary["metrics"].items() if k not in MACHINE}
        ended = {key: summary[key] for key in ("outcome", "reason")}
        return {"exit": done.returncode, **ended, "found": metrics}


def differences(old: object, new: object, where: str = "") -> Iterator[str]:
    """Yield each place at which two trees of values differ by more than rounding."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in old.keys() | new.keys():
            if key not in old or key not in new:
                yield f"{where}.{key}: only in the {'new' if key in new else 'old'} values"
            else:
                yield from differences(old[key], new[key], f"{where}.{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from differences(a, b, f"{where}[{i}]")
    elif isinstance(old, float) and isinstance(new, float):
        absolute = ABSOLUTE.get(where.rpartition(".")[2], 1e-12)
        if not math.isclose(old, new, rel_tol=RELATIVE, abs_tol=absolute):
            yield f"{where}: {old!r} became {new!r}"
    elif today(old) != new:
        yield f"{where}: {old!r} became {new!r}"


def today(value: object) -> object:
    """Return a recorded value with the words that it would have now."""
    if isinstance(value, str):
        for old, new in WORDS.items():
            value = re.sub(old, new, value)
    return value


def main() -> int:
    """Record the values, or compare them with the recorded ones."""
    words = [word for word in sys.argv[1:] if word != "--record"]
    cases = {k: v for k, v in CASES.items() if not words or any(word in k for word in words)}
    with ThreadPoolExecutor(2) as pool:
        measured = dict(zip(cases, pool.map(measure, cases.values()), strict=True))
    recorded = json.loads(FILE.read_text(encoding="utf-8"))
    if "--record" in sys.argv:
        text = json.dumps({**recorded, **measured}, indent=1, sort_keys=True)
        FILE.write_text(text + "\n", encoding="utf-8")
        return 0
    moved = sorted(differences({case: recorded[case] for case in cases}, measured))
    print("\n".join(moved))
    print(f"{len(moved)} values of {len(cases)} cases moved")
    return bool(moved)


if __name__ == "__main__":
    sys.exit(main())
