"""One profile for all property tests: the same examples every time, and no stop-watch."""

import signal

from hypothesis import settings

# A shell ignores interrupts in what it runs in the background; tests send them to their processes.
signal.signal(signal.SIGINT, signal.default_int_handler)

# A deadline measures how busy the machine is, not the code.
settings.register_profile("dualbend", derandomize=True, deadline=None)
settings.load_profile("dualbend")
