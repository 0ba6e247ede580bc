"""Named random streams."""

import numpy as np

from sim.rng import stream


def test_stream_of_the_same_name_repeats_and_of_another_does_not():
    first = stream(3, 7, "gyro").standard_normal(8)
    np.testing.assert_array_equal(first, stream(3, 7, "gyro").standard_normal(8))
    for other in (stream(4, 7, "gyro"), stream(3, 8, "gyro"), stream(3, 7, "gps")):
        assert not np.any(first == other.standard_normal(8))


def test_stream_does_not_depend_on_what_was_drawn_before():
    """A flight of a campaign draws what it would draw alone."""
    alone = stream(0, 2, "gyro").standard_normal(4)
    for flight in range(2):
        stream(0, flight, "gyro").standard_normal(100)
    np.testing.assert_array_equal(alone, stream(0, 2, "gyro").standard_normal(4))


def test_streams_of_different_names_are_uncorrelated():
    n = 100_000
    a, b = stream(0, 0, "gyro").standard_normal(n), stream(0, 0, "accelerometer").standard_normal(n)
    assert abs(np.mean(a * b)) < 5.0 / np.sqrt(n)  # five sigma of the mean of n products
