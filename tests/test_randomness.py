"""Streams: the same for the same key on every machine, unrelated for any other key."""

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
