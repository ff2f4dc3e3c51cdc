"""Streams: the same for the same key on every machine, unrelated for any other key."""

import itertools

import numpy as np
import pytest

from thesis_lib.foundation.randomness import generator

# First words of one stream, kept so that an edit of the derivation, which would change every result, is noticed.
# NumPy promises never to change these (unlike the numbers drawn with them).
GOLDEN_KEY = (20190906, "ch3_identify", "drops", "split")
GOLDEN = [2267335225644507813, 1424428925654871025]
CORRELATION = 0.05  # five standard errors of the correlation of 10,000 independent pairs


def first(seed: int, *key: str, n: int = 4) -> list[int]:
    return generator(seed, *key).integers(10_000, size=n).tolist()


def test_golden_value():
    assert generator(*GOLDEN_KEY).bit_generator.random_raw(2).tolist() == GOLDEN


def test_equal_arguments_give_equal_streams():
    assert first(3, "a", "b") == first(3, "a", "b")


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ((1, "a"), (2, "a")),
        ((1, "a"), (1, "b")),
        ((1, "a"), (1, "a", "")),
        ((1, "ab", "c"), (1, "a", "bc")),  # joined without a separator these would be one key
        ((1, "a", "b"), (1, "b", "a")),
    ],
)
def test_different_arguments_give_different_streams(one, other):
    assert first(*one, n=8) != first(*other, n=8)


def test_streams_of_different_keys_are_uncorrelated():
    draws = [generator(0, "rule", name).standard_normal(10_000) for name in ("drops", "dice", "impact")]
    draws.append(generator(1, "rule", "drops").standard_normal(10_000))
    for a, b in itertools.combinations(draws, 2):
        assert abs(np.corrcoef(a, b)[0, 1]) < CORRELATION


def test_using_other_streams_changes_nothing():
    """A new rule, or more draws by an old one, leaves every other stream as it is."""
    alone = first(0, "ch3_identify")
    generator(0, "new_rule").standard_normal(1000)
    generator(0, "ch3_identify", "more").standard_normal(1000)
    assert first(0, "ch3_identify") == alone
