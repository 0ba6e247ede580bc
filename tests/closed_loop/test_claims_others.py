"""Claims of the four companion papers: what is measured against closed forms, and their verdicts on one seed."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenarios.claims import (
    dilshad_magnetometer,
    roll_pitch,
    roll_pitch_equations,
    starlino,
    starlino_rotations,
    van_zundert,
)
from scenarios.harness.claims.claim import Claim
from scenarios.harness.claims.motions import DECLINATION_RAD, FIELD_E_UT, seen, tilt_deg
from scenarios.harness.metrics import rms
from sim.motion.prescribed_plant import Rest, SteadyTurn

G = 9.8
CHEAP = {
    claim.name: claim
    for module in (dilshad_magnetometer, roll_pitch, roll_pitch_equations, starlino, starlino_rotations, van_zundert)
    for claim in vars(module).values()
    if isinstance(claim, Claim)
    # A flight a seed, or ten minutes of tens of thousands of single updates: left to `wingslevel claims`.
    and claim.name
    not in {
        "velocity_change_in_turns",
        "velocity_change_in_wind",
        "velocity_change_at_launch",
        "summed_between_reports",
        "starlino_drift",
        "van_zundert_half_degree",
        "van_zundert_offset",
    }
}


@pytest.mark.parametrize("name", CHEAP)
def test_cheap_claim_on_one_seed_has_its_verdict(name):
    """Measured anew, the verdict is the one written down, and every line is a number."""
    finding = CHEAP[name].measure([0])
    assert finding.verdict == CHEAP[name].expected
    assert all(math.isfinite(row.measured) for row in (*finding.lines, *finding.conditional_lines))


def test_note_at_rest_removes_a_tilt_as_its_equations_say():
    """Eqn 4 is the sine of the mean tilt since the last report, and its correction is held until the next."""
    log = seen(Rest(), 10.0)
    start = Rotation.from_rotvec([math.radians(10.0), 0.0, 0.0]).as_matrix()
    tilt = tilt_deg(roll_pitch_equations.note(log.measured, start), log)
    reports = np.flatnonzero(log.measured["gps_new"])[1:]  # the first begins the first interval
    part = roll_pitch_equations.GAIN_1_S * 0.2
    expected = [10.0]
    for _ in reports[1:]:
        mean = math.radians(0.5 * (expected[-1] + (expected[-2] if len(expected) > 1 else 10.0)))
        expected.append(expected[-1] - math.degrees(part * math.sin(mean)))
    # The earth turns at 0.004 deg/s, 0.008 degrees at this gain; the mean of a tick is half a tick old: 1 %.
    np.testing.assert_allclose(tilt[reports], expected, rtol=0, atol=0.05)


@pytest.mark.parametrize("wind_m_s", [2.5, 5.0])
def test_paper_of_2009_in_a_turn_in_wind_tilts_by_the_closed_form(wind_m_s):
    """Eqn 25 with the ground speed, V + w cos(heading) to the first order, towards the centre of the turn.

    Seen from the earth its error is omega w / g times (cos^2, sin cos) of the heading: half of it a constant, half
    turning at twice the rate, which a correction of weight W follows to one part in sqrt(1 + (2 omega / W)^2).
    """
    log = roll_pitch.circle(35.0, wind_m_s)
    V = float(np.median(log.truth["airspeed_m_s"][roll_pitch.SETTLED :]))
    omega = G * math.tan(math.radians(35.0)) / V
    mean = omega * wind_m_s / (2.0 * G)
    turning = mean / math.hypot(1.0, 2.0 * omega / roll_pitch.WEIGHT)
    measured = rms(roll_pitch.tilts_deg(roll_pitch.paper_of_2009(**roll_pitch.AT_ONCE), log))
    # Second order in w / V: at 0.4, (w / V)^2 / 4 = 4 %; the bank is held to half a degree, 2 %.
    assert measured == pytest.approx(math.degrees(math.hypot(mean, turning)), rel=0.08, abs=0)
    # And the change of velocity does not know of the wind.
    assert rms(roll_pitch.tilts_deg(roll_pitch.note_of_2011(**roll_pitch.AT_ONCE), log)) < 0.1 * measured


def test_paper_of_2009_in_a_steep_calm_turn_tilts_by_the_angle_of_attack():
    """tan(bank) (alpha sin(bank) - beta cos(bank)), followed at the rate of the turn; the note has half at most."""
    log = roll_pitch.circle(60.0)
    measured = rms(roll_pitch.tilts_deg(roll_pitch.paper_of_2009(**roll_pitch.AT_ONCE), log))
    # Small angles: chi is 4 degrees, tilt 7; the bank wanders by half a degree, 4 % of tan(60 deg).
    assert measured == pytest.approx(roll_pitch.attack_costs_deg(log), rel=0.08, abs=0)
    assert rms(roll_pitch.tilts_deg(roll_pitch.note_of_2011(**roll_pitch.AT_ONCE), log)) < 0.5 * measured


@pytest.mark.parametrize(("bank_deg", "believed"), [(33.0, True), (34.0, False)])
def test_starlino_accelerometer_is_out_beyond_the_bank_that_weighs_a_fifth_more(bank_deg, believed):
    """In a coordinated turn the length felt is g / cos(bank): 1.2 g at arccos(1 / 1.2) = 33.6 degrees."""
    assert (bank_deg < math.degrees(math.acos(1.0 / 1.2))) == believed
    log = seen(SteadyTurn(math.radians(bank_deg)), 6.0)
    estimator = starlino.set_attitude(starlino.six_axes(), log.truth["R_eb"][0])
    tilt = tilt_deg(estimator.replay(log.measured)["R_eb"], log)
    assert (tilt[-1] > 5.0) if believed else (tilt.max() < 0.1)


def test_starlino_error_between_two_axes_is_cubed_and_quartered():
    """(a - e b / 2) . (b - e a / 2) = e^3 / 4 between unit vectors; their lengths then are 1 - 3 e^2 / 4, squared."""
    for e in (0.01, 0.1, 0.5):
        expected = 0.25 * e**3 / (1.0 - 0.75 * e**2)
        assert starlino_rotations.left_of(e) == pytest.approx(expected, rel=1e-9, abs=0)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(20.0, 0.0), (0.0, 5.0), (0.0, 20.0)])
def test_dilshad_printed_tilt_compensation_turns_the_wrong_way_in_pitch(roll_deg, pitch_deg):
    """Rolled it is right; pitched it turns the field by twice the pitch, away from level instead of to it."""
    R_eb, m_b = dilshad_magnetometer.tilted(roll_deg, pitch_deg)
    heading = np.arctan2(R_eb[:, 1, 0], R_eb[:, 0, 0]) - DECLINATION_RAD
    roll, pitch = np.full(len(m_b), math.radians(roll_deg)), np.full(len(m_b), math.radians(pitch_deg))
    read = dilshad_magnetometer.printed_heading_rad(m_b, roll, pitch)
    level, down = math.hypot(*FIELD_E_UT[:2]), FIELD_E_UT[2]
    off = 2.0 * math.radians(pitch_deg)
    forward = level * np.cos(heading) * math.cos(off) - down * math.sin(off)
    expected = np.arctan2(level * np.sin(heading), forward)
    np.testing.assert_allclose(np.exp(1j * read), np.exp(1j * expected), rtol=0, atol=1e-9)


def test_van_zundert_integral_as_reported_leaves_the_offset_to_the_proportional_term():
    """Set, not added: at rest k_P sin(tilt) carries what the limit of 0.5 deg/min a second over 5 s leaves."""
    log = van_zundert.bench(Rest(), 60.0, 50)
    limit_deg_s = 5.0 * 0.5 / 60.0
    left_deg_s = math.hypot(0.8 - limit_deg_s, 0.6 - limit_deg_s)
    expected = math.degrees(math.asin(math.radians(left_deg_s) / 0.3))
    tilt = tilt_deg(van_zundert.as_reported(log.measured), log)
    # The limit is taken over 5.0 to 5.2 s (4 %, of 5 % of the offset); the earth turns at 0.004 deg/s, 0.4 %.
    assert tilt[-1] == pytest.approx(expected, rel=0.01, abs=0)
    added = van_zundert.as_reported(log.measured, set_integral=False, earth_frame=False)
    np.testing.assert_allclose(added, van_zundert.original().replay(log.measured)["R_eb"], rtol=0, atol=1e-12)
