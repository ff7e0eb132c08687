"""What tests of the documentation share."""

from collections.abc import Iterator

import pytest

from drake_rnn import ENVIRONMENTS, LAWS, PATHS


@pytest.fixture
def registries() -> Iterator[None]:
    """What a piece of code adds to the laws, paths and environments is taken away again."""
    known = [(registry, set(registry)) for registry in (ENVIRONMENTS, LAWS, PATHS)]
    yield
    for registry, before in known:
        for added in set(registry) - before:
            del registry[added]
