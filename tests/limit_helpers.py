"""A helper of tests that look at limits."""


def broken(metrics, beyond=0.0):
    """Return the metrics of the limits that a run exceeds by more than ``beyond``."""
    taken = {name: value for name, value in metrics.items() if "_violation_max_" in name}
    assert taken
    return {name: value for name, value in taken.items() if value > beyond}
