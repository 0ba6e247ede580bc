"""Every gyro and accelerometer that has a part file, hours at rest: noise and bias instability as the file states them.

The judge is allantools.  Each error is drawn once for all parts of a kind, as a part with that error alone would
have it, and scaled by the figures of each; for every part its own draw of an hour must equal that sum.
"""

import math
from dataclasses import replace
from functools import partial

import allantools
import numpy as np
import pytest

from sim.clock import Rates
from sim.rng import stream
from sim.sensors.board import BoardParams
from sim.sensors.datasheet import PERFECT, load_part, part_names
from sim.sensors.trial import FLIGHTS, HOUR_S, IMU_HZ, INERTIAL, SEED, figures

PARTS = {
    kind: {name: load_part(name).devices[kind] for name in part_names() if kind in load_part(name).devices}
    for kind in INERTIAL
}
TAU_S = np.array([0.1, 1.0, 10.0, 30.0, 100.0])


def drawn(kind, params, flight):
    """What `draw` makes of an hour before the converter, less its mean, shape (n, 3), in the unit of the page."""
    how, rates = INERTIAL[kind], Rates(imu_hz=IMU_HZ)
    noise = np.zeros(rates.ticks(HOUR_S), list(how.module.NOISE))
    how.module.draw(params, BoardParams(), rates, partial(stream, SEED, flight), noise)
    bias, white = (name for name, *_ in how.module.NOISE)
    signal = how.scale * (noise[bias] + noise[white])
    return signal - signal.mean(axis=0)


@pytest.fixture(scope="module")
def variances():
    """Mean Allan variance of 66 axis-hours at TAU_S, for each kind and name."""
    found = {(kind, name): np.zeros(len(TAU_S)) for kind, parts in PARTS.items() for name in parts}
    for kind, parts in PARTS.items():
        how, silent = INERTIAL[kind], PERFECT[kind]
        ones = [replace(silent, **{name: 1.0}) for name in how.figures]
        for flight in range(FLIGHTS):
            alone = [drawn(kind, params, flight) for params in ones]
            for name, params in parts.items():
                signal = sum(figure * error for figure, error in zip(figures(kind, params), alone, strict=True))
                if flight == 0:  # round-off of a sum of a few terms, against the largest of them
                    np.testing.assert_allclose(drawn(kind, params, 0), signal, rtol=0.0, atol=1e-9 * np.ptp(signal))
                for axis in range(3):
                    _, deviation, _, _ = allantools.oadev(signal[:, axis], IMU_HZ, "freq", TAU_S)
                    found[kind, name] += deviation**2 / (3 * FLIGHTS)
    return found


def test_every_board_has_its_gyro_and_its_accelerometer():
    """The four gyros and three accelerometers of the boards are among the parts."""
    assert {"adxrs401", "lisy300al", "itg3200", "mpu6000"} <= set(PARTS["gyro"])
    assert {"mma7260q", "bma180", "mpu6000"} <= set(PARTS["accelerometer"])


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, parts in PARTS.items() for name in parts])
def test_part_has_the_noise_its_file_states(variances, kind, name):
    """Noise density within 5 %, bias instability within 10 %, by allantools over 66 independent hours.

    Each is read where its own term rules, the two others subtracted as stated (IEEE Std 952-1997, annex C).  The
    variance of means over 100 s, 36 of them in an hour, scatters by 3 % over 66 hours, and B by half that over the
    share that flicker noise has in it.
    """
    (density, flicker_figure, walk_figure), found = figures(kind, PARTS[kind][name]), variances[kind, name]
    assert density > 0.0
    white_2, walk = density**2 / 2.0, walk_figure**2 * TAU_S / 3.0
    flicker = 2.0 * math.log(2.0) / math.pi * flicker_figure**2
    white = math.sqrt((found[0] - flicker - walk[0]) * TAU_S[0])
    assert math.sqrt(2.0) * white == pytest.approx(density, rel=0.05)
    if flicker_figure > 0.0:
        at = int(np.argmax(flicker / (white_2 / TAU_S + flicker + walk)))
        instability = math.sqrt((found[at] - white_2 / TAU_S[at] - walk[at]) * math.pi / (2.0 * math.log(2.0)))
        assert instability == pytest.approx(flicker_figure, rel=0.10)
