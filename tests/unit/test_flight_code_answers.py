"""What flight code returns, says of itself and writes into: judged alike in a flight and over a log."""

import json
from pathlib import Path

import numpy as np
import pytest

from autopilot.interface import ActuatorCommand
from estimator.interface import AttitudeEstimate
from scenarios.harness.cli.app import run
from sim import recording
from sim.flight_code import Unusable, record_command, record_estimate
from sim.log import FLOWN_DTYPE, Log, Outcome
from sim.sensors.fitting import SUITES
from sim.sensors.suite import Suite

EYE = np.eye(3)
FLY = ("fly", "bench_rest", "--set", "duration_s=0.2", "--no-rerun", "--estimator")
REPLAY = ("replay", "log.csv", "--no-rerun", "--json", "r.json", "--estimator")
HEAD = """import numpy as np
from estimator.blocks.compiled import ESTIMATE_DTYPE
from estimator.interface import AttitudeEstimate
"""
MINE = f"""{HEAD}
class Mine:
    def update(self, m):
        return AttitudeEstimate(np.eye(3))
"""


class _Bad:
    def __array__(self, *_, **__):
        raise SystemExit


class _Liar:
    __class__ = np.ndarray
    shape = (3, 3)


class _Own(AttitudeEstimate):
    pass


@pytest.fixture
def flown():
    return np.zeros(1, FLOWN_DTYPE)


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """An empty working directory with a log of six seconds at rest."""
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{0.02 * k:.2f},0.01,0,0,0,0,-9.8" for k in range(300))
    (tmp_path / "log.csv").write_text(f"t,gx,gy,gz,ax,ay,az\n{rows}\n")
    return tmp_path


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (AttitudeEstimate(EYE.astype(object)), "R_eb is made of object; it must be made of numbers"),
        (AttitudeEstimate(EYE.astype(str)), "R_eb is made of <U32"),
        (AttitudeEstimate(EYE + 0j), "R_eb is made of complex128"),
        (AttitudeEstimate(EYE.astype("M8[s]")), "R_eb is made of datetime64"),
        (AttitudeEstimate(np.ma.masked_array(EYE, EYE)), "R_eb has masked elements"),
        (AttitudeEstimate([[10**400, 0, 0], [0, 1, 0], [0, 0, 1]]), "R_eb is made of object"),
        (AttitudeEstimate(_Liar()), "R_eb has shape"),
        (AttitudeEstimate(None), r"R_eb has shape \(\); it must have shape \(3, 3\)"),
        (AttitudeEstimate("R"), "R_eb has shape"),
        (AttitudeEstimate(1e300 * EYE), "R_eb is not finite"),
        (AttitudeEstimate(EYE, np.full(3, 1e300)), r"omega_b_rad_s is not finite, or beyond 1e\+06 rad/s"),
        (AttitudeEstimate(EYE, gyro_bias_b_rad_s=["a", "b", "c"]), "gyro_bias_b_rad_s is made of <U1"),
        (AttitudeEstimate(EYE, wind_e_m_s=np.full(3, np.inf)), "wind_e_m_s is beyond"),
        (AttitudeEstimate(EYE, wind_e_m_s="calm"), "wind_e_m_s has shape"),
        (AttitudeEstimate(EYE, health=10**30), "health is not a Health: .* it is 1000"),
        (AttitudeEstimate(EYE, health="good"), "it is 'good'"),
        (AttitudeEstimate(EYE, health=None), "it is None"),
        (AttitudeEstimate(EYE, health=float("nan")), "it is nan"),
        (AttitudeEstimate(EYE, health=1.0), "it is 1.0"),
        (AttitudeEstimate(EYE, health=np.array([1, 2])), r"it is array\(\[1, 2\]\)"),
        (_Own(EYE), "returned _Own; it must return an AttitudeEstimate"),
        (tuple.__new__(AttitudeEstimate, (EYE,)), "has 1 fields; it must have 5"),
        (float("nan"), "returned float"),
    ],
)
def test_record_estimate_of_a_hostile_answer_is_refused_by_name(flown, answer, says):
    with pytest.raises(Unusable, match=says):
        record_estimate(flown, 0, answer)


def test_record_estimate_of_an_array_that_raises_lets_it_through_to_be_blamed(flown):
    """Where it was raised tells whose fault it is."""
    with pytest.raises(SystemExit):
        record_estimate(flown, 0, AttitudeEstimate(_Bad()))


def test_record_estimate_hands_on_arrays_of_floats(flown):
    """The autopilot is not blamed for what the estimator gave in lists."""
    given = AttitudeEstimate(EYE.tolist(), (0.1, 0.2, 0.3), np.zeros(3, ">f4"), [1, 2, 3], np.int8(2))
    e = record_estimate(flown, 0, given)
    assert {a.dtype for a in e[:4]} == {np.dtype(float)}
    assert e.health is not given.health
    assert flown["health"][0] == 2
    np.testing.assert_array_equal(e.wind_e_m_s, [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"aileron": "0"}, "aileron is '0'; it must be a number"),
        ({"aileron": None}, "aileron is None"),
        ({"elevator": 1j}, "elevator is 1j"),
        ({"elevator": np.zeros(1)}, r"elevator is array\(\[0.\]\)"),
        ({"rudder": 10**400}, "rudder is 1000.* must be within"),
        ({"rudder": float("nan")}, "must be within"),
        ({"throttle": 1e300}, "must be within"),
        ({"mode": 1.5}, "mode 1.5 is not a Mode"),
        ({"mode": float("nan")}, "mode nan is not a Mode"),
        ({"mode": "3"}, "mode '3' is not a Mode"),
        ({"mode": 10**30}, "mode 1000.* is not a Mode"),
        ({"bank_demand_rad": "steep"}, "bank_demand_rad is 'steep'"),
    ],
)
def test_record_command_of_a_hostile_answer_is_refused_by_name(flown, change, says):
    command = ActuatorCommand(0.0, 0.0, 0.0, 0.0)._replace(**change)
    with pytest.raises(Unusable, match=says):
        record_command(flown, 0, command)


@pytest.mark.parametrize(
    ("returned", "says"),
    [
        ("None", "replay() returned NoneType; it must return a structured array of 200 rows with R_eb, omega_b_rad_s"),
        ("np.zeros(200)", "replay() returned ndarray; it must return a structured array"),
        ("e[:-1]", "replay() returned an array of shape (199,)"),
        ("e[['R_eb', 'health']]", "replay() returned an array without omega_b_rad_s, gyro_bias_b_rad_s, wind_e_m_s"),
        ("spoilt('R_eb', 150, np.nan)", "Mine at 5.00 s: R_eb is not finite"),
        ("spoilt('R_eb', 0, 2.0)", "Mine at 2.00 s: R_eb is not a rotation"),
        ("spoilt('R_eb', 199, np.diag([1.0, 1.0, -1.0]))", "Mine at 5.98 s: R_eb is not a rotation"),
        ("spoilt('omega_b_rad_s', 150, np.inf)", "Mine at 5.00 s: omega_b_rad_s is not finite"),
        ("spoilt('gyro_bias_b_rad_s', 150, np.nan)", "Mine at 5.00 s: gyro_bias_b_rad_s is not finite"),
        ("spoilt('wind_e_m_s', 150, 1e300)", "Mine at 5.00 s: wind_e_m_s is beyond 1e+06 m/s"),
        ("spoilt('health', 150, 7)", "Mine at 5.00 s: health is not a Health"),
        ("spoilt('health', 150, -2**62)", "Mine at 5.00 s: health is not a Health"),
        ("e.astype([(n, 'O') for n in e.dtype.names])", "R_eb has shape (200,); it must have shape (200, 3, 3)"),
        ("e.astype([(n, 'U9', e.dtype[n].shape) for n in e.dtype.names])", "R_eb is made of <U9"),
    ],
)
def test_replay_that_returns_rubbish_fails_and_is_recorded(here: Path, capfd, returned: str, says: str) -> None:
    """As strict as a flight; the other estimator goes on."""
    (here / "own.py").write_text(
        f"""{HEAD}
class Mine:
    def update(self, m): pass
    def replay(self, rows):
        e = np.zeros(len(rows), ESTIMATE_DTYPE)
        e["R_eb"] = np.eye(3)
        if len(rows) == 1:
            return e
        def spoilt(name, k, value):
            e[name][k] = value
            return e
        return {returned}
"""
    )
    assert run([*REPLAY, "own.py:Mine,gyro_only"]) == 1
    told = json.loads((here / "r.json").read_text())["estimators"]
    assert says in told["Mine"]["failure"]
    assert "failure" not in told["gyro_only"]
    flight = recording.load(told["Mine"]["recording"])
    assert flight.outcome == Outcome.ESTIMATOR_FAILED
    assert np.isfinite(flight.log.flown["R_eb"]).all()


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ("rejected = float('nan')", "rejected is nan; it must be a number of samples"),
        ("rejected = 'many'", "rejected is 'many'"),
        ("rejected = -1", "rejected is -1"),
        ("rejected = 10**5000", "rejected is "),
        ("refused = 'gps'", "refused is 'gps'; it must be numbers of samples by instrument"),
        ("refused = {'gps': 'all'}", "refused['gps'] is 'all'"),
        ("refused = dict.fromkeys(range(100000), 1)", "refused is {0: 1"),
        ("learnt = 'gps_latency_s'", "learnt is 'gps_latency_s'; it must be a mapping"),
        ("learnt = float('nan')", "learnt is nan"),
        ("learnt = {'gps_latency_s': float('nan')}", "learnt: gps_latency_s = nan: must be a number"),
        ("learnt = {'gps_latency_s': 'late'}", "learnt holds 'gps_latency_s': 'late'; it must hold names and numbers"),
        ("learnt = {'gps_latncy_s': 0.3}", "learnt: unknown property of the instruments 'gps_latncy_s'"),
        ("learnt = {i: i for i in range(100000)}", "learnt holds 0: 0"),
    ],
)
def test_rubbish_that_an_estimator_says_of_itself_fails_it(here: Path, said: str, says: str) -> None:
    """Nothing that is no number gets into a report."""
    (here / "own.py").write_text(f"{MINE}    {said}\n")
    assert run([*REPLAY, "own.py:Mine,gyro_only"]) == 1
    assert says in json.loads((here / "r.json").read_text())["estimators"]["Mine"]["failure"]
    if said.startswith("learnt"):
        assert run([*FLY, "own.py:Mine", "--json", "f.json"]) == 1
        (flight,) = json.loads((here / "f.json").read_text())["flights"]
        assert flight["outcome"] == "estimator_failed"
        assert says in flight["message"]


@pytest.mark.parametrize("reference", ["['nose']", "None", "3", "np.eye(3)", "{}", "'Nose'"])
def test_heading_reference_that_is_none_is_refused(here: Path, capfd, reference: str) -> None:
    """Of an unhashable type, or of one that compares to an array, too."""
    (here / "own.py").write_text(f"{MINE}    heading_reference = {reference}\n")
    assert run([*FLY, "own.py:Mine"]) == 2
    assert "heading_reference is" in capfd.readouterr().err


TAMPERS = """
def spoil(rows):
    chain = [rows]
    while isinstance(chain[-1].base, np.ndarray):
        chain.append(chain[-1].base)
    for array in reversed(chain):  # the owner first
        array.flags.writeable = True
    chain[-1]["gyro_b_rad_s"] = 7.0


class Tampers:
    def reset(self, on_ground):
        if on_ground is not None:
            on_ground.gyro_b_rad_s[:] = 7.0
    def update(self, m):
        spoil(m.rows)
        return AttitudeEstimate(np.eye(3))
"""


def test_measurements_that_an_estimator_writes_into_are_recorded_as_measured(here: Path) -> None:
    """In a flight: bit for bit what the same flight records with an estimator that does not."""
    (here / "own.py").write_text(MINE + TAMPERS)
    logs = []
    for name in ("Mine", "Tampers"):
        run([*FLY, f"own.py:{name}", "--json", "f.json"])
        flight = recording.load(json.loads((here / "f.json").read_text())["recording"])
        assert flight.outcome == Outcome.COMPLETED
        logs.append(flight.log.measured)
    assert logs[0].tobytes() == logs[1].tobytes()


@pytest.mark.parametrize("method", ["update", "replay"])
def test_log_that_an_estimator_writes_into_is_replayed_as_it_was_to_the_next(here: Path, method: str) -> None:
    """Over a log: neither what is recorded nor what the next estimator is given."""
    replay = """
    def replay(self, rows):
        spoil(rows)
        e = np.zeros(len(rows), ESTIMATE_DTYPE)
        e["R_eb"] = np.eye(3)
        return e
"""
    (here / "own.py").write_text(HEAD + TAMPERS + (replay if method == "replay" else ""))
    assert run([*REPLAY, "gyro_only"]) == 0
    alone = json.loads((here / "r.json").read_text())
    assert run([*REPLAY, "own.py:Tampers,gyro_only"]) == 0
    told = json.loads((here / "r.json").read_text())["estimators"]
    logs = [recording.load(of_it["recording"]).log for of_it in (alone, *told.values())]
    assert len({log.measured.tobytes() for log in logs}) == 1
    assert logs[0].flown.tobytes() == logs[2].flown.tobytes()


def test_measurements_do_not_lead_to_the_truth_or_the_record():
    """What flight code is shown shares no memory with the log, whichever way it follows it."""
    from sim.clock import Rates

    log = Log.empty(3)
    suite = Suite(SUITES["generic"], Rates(), 0)
    suite.reset(log)
    rows = suite.measure(0).rows
    while isinstance(rows, np.ndarray):
        assert not any(np.shares_memory(rows, table) for table in (log.truth, log.measured, log.flown))
        rows.shape = (3, 1)  # nor can it be put out of shape for the sensors
        rows = rows.base
    assert suite.measure(1).k == 1
    assert log.measured["t_s"].shape == (3,)


def test_estimator_that_says_it_is_the_oracle_is_shown_nothing(here: Path) -> None:
    """The log, with the truth, is shown to the oracle alone."""
    (here / "own.py").write_text(
        MINE
        + """
    from sim.oracle import Oracle
    __class__ = property(lambda self: self.Oracle)
    def watch(self, log):
        raise SystemExit("shown")
"""
    )
    run([*FLY, "own.py:Mine", "--json", "f.json"])
    (flight,) = json.loads((here / "f.json").read_text())["flights"]
    assert flight["outcome"] == "completed"
