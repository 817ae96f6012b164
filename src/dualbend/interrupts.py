"""Signals that ask a process to end, and what must not be cut off by them."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

ENDING_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Signals that ask a process to end."""


class Interrupted(KeyboardInterrupt):
    """A signal asks the program to end as soon as what was computed is kept.

    ``signal``: its number, also of an interrupt from the keyboard.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.signal = number


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let signals that ask for an end wait: what took long to compute is written in a second or so.

    A process that is started meanwhile has them blocked, where the system can do that.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    # What is ignored stays ignored; None: set by no Python program, and not to be set again.
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    before = {k: v for k, v in before.items() if v not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, lambda number, _: came.append(number))
    blocked = hasattr(signal, "pthread_sigmask")
    if blocked:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, before)
    try:
        yield
    finally:
        if blocked:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in before.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])
