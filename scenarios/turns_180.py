"""Three course reversals in a crosswind.

=============  ===================================================================================================
Story          Straight across the wind, then three about-turns at 35 degrees of bank, with more than 30 s of
               straight flight between the turns.  Wind from the left becomes wind from the right: the nose turns by
               180 degrees plus or minus twice the crab angle, and what was learnt on the old course no longer holds.
Verifies       Premerlani & Bizard: after a 180 degree turn in a crosswind the heading is off by up to twice the crab
               angle and comes back; a turn does not upset the matrix (Eqns 25-27)
Aircraft       endurance
Wind           5 m/s across the first leg, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; from 20 s to the end the inclination error is small; after each of the three roll-outs
               (found in the true motion) the heading error is soon small again and stays so until the next turn.  The
               variants must truly bank, keep their height within 15 m, and keep the inclination error small while
               banked, too
Variants       ``bank_30``, ``bank_45``, ``bank_60``: the turns at that bank, 25 s apart; at 60 degrees the wings carry
               2 g.  In a turn the error is mostly due to the wind, because Eqn 25 uses the speed over ground: at 30,
               45 and 60 degrees of bank it is 5 to 6 degrees RMS; in calm air, and with
               ``estimator_params.turn_speed=true``, 2 to 4 degrees.
               ``high``: at an elevation of 2500 m, with the pitot tube of the suite ``apm2``; it reads 0.88 of the
               true airspeed.  The errors are those of sea level, 2 degrees RMS; an estimator that is not told the
               elevation takes the reading for the true airspeed, and has 4 degrees while banked
=============  ===================================================================================================
"""

from autopilot.pilot import Script, Timed, reversals
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, heading_error_deg, height_m, inclination_error_deg
from scenarios.harness.metrics.manoeuvres import roll_outs, slowest_recovery, time_banked_s, while_banked
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

TURNS = 3
RECOVERED_S, RECOVERED_DEG = 10.0, 10.0
SETTLED = at(20.0)
HEIGHT_M, KEPT_M = 80.0, 15.0
TURNING_DEG = 25.0
TILT, TILT_BANKED = inclination_error_deg, while_banked(inclination_error_deg, TURNING_DEG)
RECOVERY = slowest_recovery(heading_error_deg(), RECOVERED_DEG, TURNS, RECOVERED_S)
VARIANTS = {
    "bank_30": "Three course reversals in a crosswind, at 30 degrees of bank.",
    "bank_45": "Three course reversals in a crosswind, at 45 degrees of bank.",
    "bank_60": "Three course reversals in a crosswind, at 60 degrees of bank: 2 g.",
    "high": "Three course reversals in a crosswind, in the thin air of 2500 m.",
}


def _script(config: FlightConfig) -> Script:
    m, course = config.manoeuvre, ahead(config)
    return Script([Timed(0.0, course), *reversals(m["first_s"], m["every_s"], TURNS, course).timed])


SCENARIO = Scenario(
    name="turns_180",
    story=__doc__,
    config=FlightConfig(
        duration_s=160.0,
        start=InFlightStart(height_m=HEIGHT_M),
        air=AirConfig(wind_m_s=5.0, wind_from_deg="cross", turbulence_w20_m_s=3.0),
        # A turn takes about 10 s, which leaves more than 30 s of straight flight until the next.
        manoeuvre={"height_m": HEIGHT_M, "bank_deg": 35.0, "first_s": 25.0, "every_s": 45.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check.rms("inclination error RMS", "deg", TILT, 5.0, SETTLED),
        Check("heading below 10 deg after roll-out", "s", RECOVERY, RECOVERED_S),
    ),
    milestones={"rolled out": lambda flight: [r.t_s for r in roll_outs(flight)]},
)


def _at_bank(bank_deg: float, least_s: float, inclination_deg: float) -> Scenario:
    """The variant at `bank_deg`, nine tenths of which must be flown for `least_s` in all."""
    ending, steep_deg = f"bank_{bank_deg:g}", 0.9 * bank_deg
    changes = {"manoeuvre.bank_deg": bank_deg, "manoeuvre.every_s": 25.0, "duration_s": 100.0}
    survived, inclination, recovered = SCENARIO.checks
    checks = (
        survived,
        Check(f"banked by {steep_deg:g} deg or more", "s", time_banked_s(steep_deg, SETTLED), least_s, ">="),
        Check.lowest("lowest height", "m", height_m, HEIGHT_M - KEPT_M, SETTLED),
        Check.highest("greatest height", "m", height_m, HEIGHT_M + KEPT_M, SETTLED),
        inclination.limited(inclination_deg),
        Check.rms("inclination error RMS while banked", "deg", TILT_BANKED, 8.0, SETTLED, judged_share=0.05),
        recovered,
    )
    return SCENARIO.varied(ending, VARIANTS[ending], changes, checks=checks)


def _high() -> Scenario:
    """The variant in thin air, with a pitot tube."""
    changes = {"place.elevation_m": 2500.0, "suite": "apm2"}
    survived, inclination, recovered = SCENARIO.checks
    checks = (
        survived,
        inclination.limited(3.0),
        Check.rms("inclination error RMS while banked", "deg", TILT_BANKED, 3.0, SETTLED, judged_share=0.05),
        recovered,
    )
    return SCENARIO.varied("high", VARIANTS["high"], changes, checks=checks)


SCENARIOS = (
    SCENARIO,
    _at_bank(30.0, least_s=6.0, inclination_deg=6.0),
    _at_bank(45.0, least_s=4.0, inclination_deg=6.0),
    _at_bank(60.0, least_s=3.0, inclination_deg=5.0),
    _high(),
)
