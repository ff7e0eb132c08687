"""What all tests share."""

from hypothesis import settings

# The same examples in each run, and none refused for the machine being busy.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
