"""One profile for all property tests: the same examples every time, and no stop-watch."""

from hypothesis import settings

# A deadline measures how busy the machine is, not the code.
settings.register_profile("dualbend", derandomize=True, deadline=None)
settings.load_profile("dualbend")
