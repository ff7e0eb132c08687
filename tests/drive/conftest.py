"""What all tests of drives have in common."""

import gc

import pytest


@pytest.fixture(scope="module", autouse=True)
def few_objects_to_look_through():
    """Let garbage be looked for among new objects alone, as `tests/conftest.py` does.

    Each drive collects garbage before it begins, which takes half a second where other tests have
    left a million objects.
    """
    gc.collect()
    gc.freeze()
