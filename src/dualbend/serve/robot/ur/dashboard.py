"""UR's dashboard server: a line asks, a line answers."""

from __future__ import annotations

from dualbend.serve.robot.ur.program import Program
from dualbend.serve.robot.ur.variables import CONTROLLER
from dualbend.serve.tcp import Client

GREETING = b"Connected: Universal Robots Dashboard Server\n"
_PROGRAM = "rtde_control.urp"
_LONGEST_LINE = 1024


def take_lines(client: Client, program: Program) -> None:
    """Answer each whole line that came."""
    while (end := client.data.find(b"\n")) >= 0:
        line = bytes(client.data[:end]).decode("ascii", "replace").strip()
        del client.data[: end + 1]
        client.send(f"{_answer(line, program)}\n".encode())
        if line.lower() == "quit":
            client.open = False
    if len(client.data) > _LONGEST_LINE:
        client.open = False


def _answer(line: str, program: Program) -> str:
    running, known = program.running, line.lower()
    if known == "play":
        program.play()
        return "Starting program"
    if known == "stop":
        program.stop()
        return "Stopped"
    answers = {
        "polyscopeversion": "URSoftware {}.{}.{}.{} (dualbend)".format(*CONTROLLER),
        "get serial number": "0",
        "is in remote control": "true",
        "running": f"Program running: {str(running).lower()}",
        "programstate": f"{'PLAYING' if running else 'STOPPED'} {_PROGRAM}",
        "get loaded program": f"Loaded program: /programs/{_PROGRAM}",
        "robotmode": "Robotmode: RUNNING",
        "safetymode": "Safetymode: NORMAL",
        "safetystatus": "Safetystatus: NORMAL",
        "quit": "Disconnected",
    }
    return answers.get(known, f"could not understand: '{line[:80]}'")
