"""JAX where it is not installed."""

import sys

import pytest

from drake_rnn import InvalidInputError, require_jax


def test_without_jax_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(InvalidInputError) as caught:
        require_jax()
    assert str(caught.value) == (
        "compilation: needs jax, which is not installed: pip install 'jax>=0.4.30'"
    )
