"""Damaged files: each parser ends in its own error, whatever it is given."""

from __future__ import annotations

import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.rules.test_corpus import PYTHONIC
from tests.support.damage import damaged
from tests.support.parsers import CORPUS, PARSERS

quick = settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
SEEDS = {name: [file.read_bytes() for file in sorted((CORPUS / p.folder).iterdir())] for name, p in PARSERS.items()}


@pytest.mark.matrix
@pytest.mark.parametrize("name", PARSERS)
@quick
@given(dice=st.randoms(use_true_random=False), data=st.binary(max_size=200), from_corpus=st.booleans())
def test_a_parser_ends_in_its_own_error(name: str, dice: random.Random, data: bytes, from_corpus: bool) -> None:
    parser = PARSERS[name]
    text = damaged(dice.choice(SEEDS[name]), dice) if from_corpus else data
    try:
        parser.summary(text)
    except parser.errors as error:
        assert not PYTHONIC.search(str(error)), str(error)
