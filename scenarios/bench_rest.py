"""Ten minutes at rest on a table: the ground test of Dilshad and Jahan.

=============  ===================================================================================================
Story          The board lies on a table, a little askew, somewhere indoors where the GPS finds nothing.  The gyro
               offsets are measured over the first 2 s; then the parts warm up by 8 K, and the offsets go with it, by
               more than 1 deg/s.  Nothing moves for ten minutes: whatever the estimate does is wrong.
Verifies       Dilshad & Jahan, section V, figure 10: once calibrated "roll and pitch stay zero after some random
               fluctuations for a few seconds", and with the magnetometer (``bench_rest_magnetometer``, their estimator)
               yaw is "static with a very little value".  They give no figures.  Premerlani & Bizard: the integral
               takes up the offsets that the accelerometer can see (Eqns 28-29)
Aircraft       none; roll 3 and pitch -4 degrees, any heading
Wind           none
Sensors        dilshad_9dof: ITG-3200, BMA180, HMC5843 (turned on a table before); no fix
Passes when    it lasts; from 60 s to the end the inclination error is at most 2.5 degrees RMS (an accelerometer offset
               of 15 mg a sigma is 0.9 degrees on either axis, and nothing tells it from a tilt) and never above 4;
               standard deviations of its roll and its pitch part at most 0.5 degrees; from 300 s on the gyro offset
               across the vertical is learnt to 0.6 deg/s RMS.  With their magnetometer besides: standard deviation of
               the heading at most 1 degree, the heading never off by more than 12 degrees
=============  ===================================================================================================

Without a reference (the default estimator has the course, and there is none) the heading drifts with the offset of the
vertical gyro, tens of degrees: it is not judged.
"""

import math

import numpy as np

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from estimator.interface import Array
from estimator.rotation import heading_error_rad
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import BenchStart, FlightConfig
from scenarios.harness.metrics import (
    Series,
    SeriesOf,
    at,
    heading_error_deg,
    highest,
    inclination_error_deg,
    over,
    rms,
    time_s,
)
from scenarios.harness.scenario import Scenario
from sim.log import Flight

SETTLED, WARM = at(60.0), at(300.0)


def _spread(values: Array) -> float:
    return float(np.std(values)) if len(values) else math.nan


def _everywhere(flight: Flight, value: Array) -> Series:
    return Series(time_s(flight), value, np.ones(len(value), np.bool_))


def _tilt_deg(axis: int) -> SeriesOf:
    """The part of the inclination error about the body `axis`, with its sign: 0 roll, 1 pitch."""

    def series(flight: Flight) -> Series:
        down, true_down = flight.log.flown["R_eb"][:, 2], flight.log.truth["R_eb"][:, 2]
        return _everywhere(flight, np.degrees(np.cross(down, true_down)[:, axis]))

    return series


def _signed_heading_error_deg(flight: Flight) -> Series:
    error = heading_error_rad(flight.log.flown["R_eb"], flight.log.truth["R_eb"])
    return _everywhere(flight, np.degrees(np.unwrap(error)))


def _offset_across_deg_s(flight: Flight) -> Series:
    """Error of the gyro offset learnt, its part across the vertical, deg/s: what an accelerometer can tell."""
    error = flight.log.flown["gyro_bias_b_rad_s"] - flight.log.truth["gyro_bias_b_rad_s"]
    across = np.cross(error, flight.log.truth["R_eb"][:, 2])
    return _everywhere(flight, np.degrees(np.linalg.norm(across, axis=1)))


def _script(config: FlightConfig) -> Script:  # noqa: ARG001 - nobody steers a table
    return Script([Timed(0.0, Setpoint(Mode.MANUAL))])


SCENARIO = Scenario(
    name="bench_rest",
    story=__doc__,
    config=FlightConfig(
        duration_s=600.0,
        suite="dilshad_9dof",
        turn_table=True,
        faults=("gps:outage@-10",),
        start=BenchStart(roll_deg=3.0, pitch_deg=-4.0),
    ),
    script=_script,
    # Beside each limit: measured with its own estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check(
            "inclination error RMS",
            "deg",
            over(inclination_error_deg, rms, SETTLED),
            2.5,  # 1.25, 1.25 left
            pooled="rms",
            per_flight_limit=3.5,
        ),
        Check(
            "inclination error at its worst",
            "deg",
            over(inclination_error_deg, highest, SETTLED),
            4.0,  # 2.8, 1.2 left
        ),
        Check("roll, standard deviation", "deg", over(_tilt_deg(0), _spread, SETTLED), 0.5),  # 0.19, 0.31 left
        Check("pitch, standard deviation", "deg", over(_tilt_deg(1), _spread, SETTLED), 0.5),  # 0.18, 0.32 left
        Check(
            "offset across the vertical not learnt",
            "deg/s",
            over(_offset_across_deg_s, rms, WARM),
            0.6,  # 0.15, 0.45 left; 1.5 where nothing is learnt
            pooled="rms",
            per_flight_limit=0.85,
        ),
    ),
)

VARIANTS = {
    "magnetometer": "Ten minutes at rest with the estimator and the magnetometer of Dilshad and Jahan.",
}

MAGNETOMETER = SCENARIO.varied(
    "magnetometer",
    VARIANTS["magnetometer"],
    {"estimator": "dilshad"},
    # The checks above measure 1.26, 2.8, 0.25, 0.24 and 0.18 with its own estimator.
    checks=(
        *SCENARIO.checks,
        Check(
            "heading, standard deviation",
            "deg",
            over(_signed_heading_error_deg, _spread, SETTLED),
            1.0,  # 0.36, 0.64 left
        ),
        Check(
            "heading error at its worst",
            "deg",
            over(heading_error_deg("nose"), highest, SETTLED),
            12.0,  # 7.0, 5.0 left: a tilt of 2.6 degrees by the accelerometer is 6 of heading through the dip
        ),
    ),
)

SCENARIOS = (SCENARIO, MAGNETOMETER)
