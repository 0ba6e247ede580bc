"""A user's script that mypy --strict passes: the types of the public API are what they are said to be."""

from typing import assert_type

import numpy as np

import wingslevel as wl


class Mine:
    def __init__(self, k: float = 1.0) -> None:
        self.k = k

    def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
        assert_type(m.imu, wl.ImuSample)
        assert_type(m.gps, wl.GpsFix | None)
        return wl.AttitudeEstimate(np.eye(3), health=wl.Health.GOOD)


estimator: wl.AttitudeEstimator = Mine()
wind: str | None = None
duration: float | None = 5
numbers = wl.fly(
    "crosswind", seed=np.int64(3), duration=np.float32(2), wind=(np.float64(5), np.int64(270)), gps_rate=np.int32(5),
    imu_rate=np.int64(50), timeout=np.float64(60),
)  # fmt: skip
assert_type(wl.fly("crosswind", wind=wind, duration=duration, settings=None, faults=None), wl.Flight)
flight = wl.fly("crosswind", estimator=Mine, params={"k": 2.0}, seed=3, wind="5@270", gps_rate=5, duration=5)
assert_type(flight, wl.Flight)
assert_type(flight.passed, bool)
assert_type(flight.metrics["inclination_rms_deg"], float | None)
assert_type([row.measured for row in flight.verdict.rows], list[float])
assert_type(flight.events[0].t_s, float)
checked = wl.check(
    "crosswind", seeds=range(1), estimator=Mine, workers=np.int64(1), duration=2, faults=["gps:outage@1"]
)
assert_type(checked, wl.CheckResult)
assert_type(checked.flights[0].seed, int)
compared = wl.compare("crosswind", ["premerlani", Mine], seeds=[np.int64(0)], duration=2)
assert_type(compared, wl.Comparison)
n = 200
found = wl.estimate(
    0.02, np.zeros((n, 3)), np.tile([0.0, 0.0, -9.8], (n, 1)), gps={"t_s": [1.0], "v_e_m_s": [[9, 0, 0]]}
)
assert_type(found, wl.Attitudes)
assert_type(wl.scenarios(), dict[str, str])
assert_type(wl.aircraft(), dict[str, str])
assert_type(wl.__version__, str)
message = ""
try:
    wl.fly("crosswnd")
except wl.WingslevelError as problem:
    message = str(problem)
assert message.startswith("unknown scenario 'crosswnd': did you mean crosswind?")
if flight.passed > 1:  # never: what a checker must refuse
    wl.fly("crosswind", wnd="5@270")  # type: ignore[call-arg]
    wl.fly("crosswind", wind=5j)  # type: ignore[arg-type]
    wl.fly(3)  # type: ignore[arg-type]
assert all("\n" not in repr(result) for result in (flight, checked, compared, found))
