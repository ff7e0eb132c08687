"""A helper of tests that look at limits."""


def broken(metrics, beyond=0.0):
    """Return the metrics of the limits that a run exceeds by more than ``beyond``.

    Not of the jerk between held velocities, which only a law that bounds the jerk keeps.
    """
    names = {name for name in metrics if "_violation_max_" in name and name[:5] != "held_"}
    taken = {name: metrics[name] for name in names}
    assert taken
    return {name: value for name, value in taken.items() if value > beyond}
