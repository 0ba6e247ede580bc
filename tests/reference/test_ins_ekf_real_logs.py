"""The navigation filter on logs from elsewhere: what it reaches without being told anything, and the latency it learns.

The logs are not part of the project: two missions of ArduPlane 4.7 over a simulated `endurance` with true attitude, a
flight of ArduPlane in 2013 and one of the University of Minnesota in 2012, in the folder ../shared/data.  The same code
runs on synthetic motion in `tests/unit/test_ins_ekf.py`.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.logs import read
from scenarios.harness.replay import replay

FOLDER = Path(os.environ.get("WINGSLEVEL_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")
MISSIONS = ("arduplane_4_7/mission_apm2_airspeed.bin", "arduplane_4_7/mission_apm2_no_airspeed.bin")
LATER_S, LATER_ROWS = 0.2, 10


def log_of(name, columns=None):
    """The log, its fixes without time stamps; skips where it is absent."""
    path = FOLDER / name
    if not path.is_file():
        pytest.skip(f"no {name} in the folder {FOLDER}; WINGSLEVEL_DATA names another")
    log = read(path, columns=columns)
    rows = log.rows.copy()
    rows["gps_t_s"] = np.nan
    return replace(log, rows=rows)


def later(log):
    """The same log with its fixes arriving later."""
    rows = log.rows.copy()
    for column in [name for name in rows.dtype.names if name.startswith("gps_")]:
        rows[column][LATER_ROWS:] = log.rows[column][:-LATER_ROWS]
        rows[column][:LATER_ROWS] = 0
    return replace(log, rows=rows)


def learnt_s(log, **params):
    """The latency learnt over the log, s."""
    known = replay(log, "ins_ekf", params).known["gps_latency_s"]
    assert known.source == "learnt"
    return known.value


@pytest.mark.parametrize("mission", MISSIONS)
def test_latency_of_fixes_moved_later_is_learnt_longer_by_as_much(mission):
    """Fixes that arrive 0.2 s later are learnt to be 0.15 to 0.25 s later; the firmware's GPS itself is 0.3 s late."""
    log = log_of(mission)
    before_s, after_s = learnt_s(log), learnt_s(later(log))
    assert 0.2 <= before_s <= 0.4  # 0.27
    assert 0.15 <= after_s - before_s <= 0.25  # 0.20


@pytest.mark.parametrize("assumed_s", [0.1, 0.2, 0.3, 0.5])
@pytest.mark.parametrize(("mission", "most_deg"), list(zip(MISSIONS, (1.3, 1.4), strict=True)))
def test_mission_attitude_whatever_latency_is_assumed(mission, most_deg, assumed_s):
    """An assumption that is wrong by 0.2 s costs nothing after the first turns."""
    scores = replay(log_of(mission), "ins_ekf", {"gps_latency_s": assumed_s, "gps_latency_sigma_s": 0.15}).scores
    assert scores["inclination_rms_deg"] <= most_deg  # 1.0 to 1.2
    assert scores["heading_rms_deg"] <= 2.0  # 1.1 to 1.4


def test_aerobatic_flight_against_its_firmware():
    """ArduPlane 2013 in wind, 5 Hz GPS; the reference is the firmware's own DCM."""
    scores = replay(log_of("logs/TestLog2.bin"), "ins_ekf").scores
    assert scores["inclination_rms_deg"] <= 6.0  # 4.1


def test_ultrastick_flight_against_its_filter():
    """University of Minnesota, 1 Hz GPS, by the column map that is shipped; the reference is the filter aboard."""
    replayed = replay(log_of("thor75.mat", "umn_ultrastick"), "ins_ekf")
    assert replayed.scores["inclination_rms_deg"] <= 2.6  # 1.9
    assert replayed.scores["heading_rms_deg"] <= 5.2  # 4.3
    assert replayed.scores["inclination_max_deg"] <= 12.0  # 8
