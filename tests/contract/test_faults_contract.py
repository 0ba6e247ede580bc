"""What every fault of every channel obeys: it touches its own columns in its own window, and repeats bit for bit."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from autopilot.interface import NEUTRAL
from scenarios.harness.config.faults import parse_fault
from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find
from sim.clock import Rates
from sim.log import Log, Outcome
from sim.motion.prescribed_plant import PrescribedPlant, SteadyTurn
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.faults import CHANNELS, kinds_of, require_possible
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import SUITES, Suite

N, FIRST, END = 300, 150, 200  # window from 3 to 4 s, rows that end at 3.00 to 3.98 s
WINDOW = "@3-3.99"
EVERYTHING = replace(
    SUITES["generic"],
    magnetometer=MagnetometerParams(noise_ut=0.5, range_ut=200.0),
    airspeed=AirspeedParams(noise_pa=5.0, range_pa=500.0),
    barometer=BarometerParams(rate_hz=5.0, noise_pa=5.0),
)
COLUMNS = {
    "gyro": ("gyro_b_rad_s",),
    "accelerometer": ("force_b_m_s2",),
    "magnetometer": ("mag_new", "mag_b_ut"),
    "airspeed": ("equivalent_airspeed_m_s",),
    "barometer": ("baro_height_m",),
    "gps": ("gps_new", "gps_valid", "gps_t_s", "gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s"),
}
BIAS = {"gyro": "gyro_bias_b_rad_s", "accelerometer": "force_bias_b_m_s2"}


def is_possible(text):
    """Whether the sensors flown here can have the fault."""
    try:
        require_possible(parse_fault(text), EVERYTHING)
    except ValueError:
        return False
    return True


SURE = {"spikes": "spikes=2,1"}  # in every reading, so that no test hangs on chance
WRONG = [f"{channel}:{SURE.get(kind, kind)}" for channel in CHANNELS for kind in kinds_of(channel)]
every_fault = pytest.mark.parametrize("what", [what for what in WRONG if is_possible(f"{what}@0")])


def truth_log(n=N):
    """A log with the truth of a turn in wind, no row measured yet."""
    log = Log.empty(n)
    plant = PrescribedPlant(SteadyTurn(0.6, wind_e_m_s=(3.0, 1.0, 0.0)), Rates())
    plant.reset(log)
    for k in range(n):
        plant.advance(k, NEUTRAL)
    return log


def suite_of(*faults, seed=3):
    """New sensors, everything fitted, with faults given as text."""
    return Suite(EVERYTHING, Rates(), seed, faults=[parse_fault(fault) for fault in faults])


def flown(*faults, seed=3):
    """The log of a turn, measured with faults."""
    log, suite = truth_log(), suite_of(*faults, seed=seed)
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log


def assert_bit_equal(a, b, rows=slice(None)):
    """Truth and measurements are the same, bit for bit."""
    assert a.measured[rows].tobytes() == b.measured[rows].tobytes()
    assert a.truth[rows].tobytes() == b.truth[rows].tobytes()


def test_nothing_wrong_is_as_without():
    """A fault after the end changes no bit."""
    assert_bit_equal(flown(), flown(*(f"{what}@90" for what in WRONG if is_possible(f"{what}@0"))))


@every_fault
def test_fault_touches_its_own_columns_alone(what):
    """Every other sensor reports the same bits, and the truth differs in no more than the bias of that sensor."""
    clean, wrong = flown(), flown(f"{what}{WINDOW}")
    part, _, axis = what.partition(":")[0].partition(".")
    for name in clean.measured.dtype.names:
        if name not in COLUMNS[part]:
            assert clean.measured[name].tobytes() == wrong.measured[name].tobytes(), name
    for name in clean.truth.dtype.names:
        if name != BIAS.get(part) or what.partition(":")[2] not in ("bias", "gain"):
            assert clean.truth[name].tobytes() == wrong.truth[name].tobytes(), name
    if axis:
        others = ["xyz".index(other) for other in "xyz" if other != axis]
        column = COLUMNS[part][-1]
        np.testing.assert_array_equal(clean.measured[column][:, others], wrong.measured[column][:, others])


@every_fault
def test_fault_is_over_when_its_window_is(what):
    """Before the window all is the same; after it a fix, a sample is held until the next, which is right again."""
    clean, wrong = flown(), flown(f"{what}{WINDOW}")
    assert_bit_equal(clean, wrong, slice(0, FIRST - 1))
    every = {"gps": 13, "magnetometer": 5, "airspeed": 5, "barometer": 10}  # ticks, at most
    back = END - 1 + every.get(what.partition(":")[0].partition(".")[0], 0)
    assert_bit_equal(clean, wrong, slice(back, N))


@every_fault
def test_fault_is_felt_in_its_window(what):
    """No fault that can be named does nothing."""
    rows = slice(FIRST - 1, END - 1)
    clean, wrong = flown().measured[rows], flown(f"{what}{WINDOW}").measured[rows]
    assert any(
        clean[name].tobytes() != wrong[name].tobytes() for name in COLUMNS[what.partition(":")[0].partition(".")[0]]
    )


@every_fault
def test_fault_flown_again_is_the_same_and_goes_on_after_a_snapshot(what):
    """Same seed, same bits; and half the window, snapshot, restore into other sensors, the other half."""
    faults = (f"{what}{WINDOW}", "gyro:spikes=50,0.3@0-5")
    if faults[0].startswith("gyro:spikes"):
        faults = (faults[0], "gyro:bias@3.2-3.7")
    whole, log = flown(*faults), truth_log()
    assert_bit_equal(whole, flown(*faults))
    half = (FIRST + END) // 2
    first = suite_of(*faults)
    first.reset(log)
    for k in range(half):
        first.measure(k)
    snapshot, later = first.snapshot(), copy.deepcopy(log)
    second = suite_of(seed=99)
    second.reset(later)
    second.restore(snapshot)
    for k in range(half, N):
        second.measure(k)
    assert_bit_equal(whole, later)


# All but the same again, and those that leave no sample for the second to act on.
@pytest.mark.parametrize(
    "what", [w for w in WRONG if is_possible(f"{w}@0") and not w.endswith((":nan", ":outage", ":dropout", ":rate"))]
)
def test_two_faults_overlap_in_their_order(what):
    """The second acts on what the first left: where it sets the reading, the first is not seen."""
    channel = what.partition(":")[0]
    last = f"{channel}:nan{WINDOW}"
    both, alone = flown(f"{what}@2-3.6", last), flown(last)
    rows = slice(FIRST - 1, END - 1)
    for name in COLUMNS[channel.partition(".")[0]]:
        a, b = both.measured[name][rows], alone.measured[name][rows]
        if not channel.startswith(("gyro", "accelerometer")):
            a, b = a[13:], b[13:]  # from the first new report on
        np.testing.assert_array_equal(a, b)


def test_another_seed_has_other_spikes_and_stuck_readings():
    """Faults are as random as the flight."""
    a, b = (flown("gyro:spikes=100,0.5@0", seed=seed).measured["gyro_b_rad_s"] for seed in (3, 4))
    assert np.mean((np.abs(a) > 1.0) != (np.abs(b) > 1.0)) > 0.3


@pytest.mark.parametrize("what", [what for what in WRONG if what.partition(":")[0] in ("gyro", "accelerometer", "gps")])
@pytest.mark.parametrize("window", ["@-9-2", "@2-5"])
def test_flight_with_a_fault_is_flown_by_code_that_never_fails(what, window):
    """From the calibration in the hand, or in flight: the aeroplane may crash; the estimate stays a rotation."""
    flight = fly_scenario(find("hand_launch"), {"faults": [f"{what}{window}"], "duration_s": 7.0})
    assert flight.outcome in (Outcome.COMPLETED, Outcome.GROUND_CONTACT), flight.message
    R = flight.log.flown["R_eb"]
    off = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max()
    assert off < 1e-3  # what every estimator here promises, whatever comes
    assert np.linalg.det(R).min() > 0.0
