"""A short flight on prescribed curves, as an autopilot would log it: each instrument at times of its own."""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.interface import MEASURED_DTYPE
from scenarios.harness import logs
from scenarios.harness.cli import console
from scenarios.harness.gate import workers
from scenarios.harness.logs.recorded import RecordedLog, Reference
from sim.place import geodetic

PLACE = 47.4, 8.5, 488.0
FIELD_E_UT = np.array([21.5, 1.2, 43.0])


@dataclass(frozen=True, repr=False)
class LoggedFlight:
    """Inertial samples at 50 Hz, and what else was measured, at times (microseconds) between their ticks,
    and those of the air on ticks.

    Each of fix, field and air has ``_us`` shape (n,), and its values.
    """

    t_us: NDArray[Any]
    rate: NDArray[Any]
    force: NDArray[Any]
    R_eb: NDArray[Any]
    fix_us: NDArray[Any]
    p_e: NDArray[Any]
    v_e: NDArray[Any]
    geodetic: NDArray[Any]
    field_us: NDArray[Any]
    field: NDArray[Any]
    air_us: NDArray[Any]
    airspeed: NDArray[Any]
    height: NDArray[Any]

    def expected(self, *, stamped: bool = True) -> NDArray[Any]:
        """The rows that a reader should make of it, filled by walking along it; `stamped`: with times of the fixes."""
        rows = np.zeros(len(self.t_us), MEASURED_DTYPE)
        rows["t_s"], rows["dt_s"] = self.t_us / 1e6, 0.02
        rows["gyro_b_rad_s"], rows["force_b_m_s2"] = self.rate, self.force
        rows["baro_height_m"] = np.nan
        for k, t_us in enumerate(self.t_us):
            for i in np.flatnonzero((self.fix_us > t_us - 20_000) & (self.fix_us <= t_us)):
                n, e, _ = self.v_e[i]
                rows["gps_new"][k], rows["gps_valid"][k:] = 1, 1
                rows["gps_t_s"][k:] = self.fix_us[i] / 1e6 if stamped else np.nan
                rows["gps_p_e_m"][k:], rows["gps_v_e_m_s"][k:] = self.p_e[i] - self.p_e[0], self.v_e[i]
                rows["gps_course_rad"][k:], rows["gps_speed_m_s"][k:] = np.arctan2(e, n) % (2 * np.pi), np.hypot(n, e)
            for i in np.flatnonzero((self.field_us > t_us - 20_000) & (self.field_us <= t_us)):
                rows["mag_new"][k], rows["mag_b_ut"][k:] = 1, self.field[i]
            for i in np.flatnonzero((self.air_us > t_us - 20_000) & (self.air_us <= t_us)):
                rows["air_new"][k] = 1
                rows["equivalent_airspeed_m_s"][k:], rows["baro_height_m"][k:] = self.airspeed[i], self.height[i]
        return rows

    def log(self) -> RecordedLog:
        """The same as a log, with the true attitude."""
        instruments = ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
        return RecordedLog(self.expected(), "expected", instruments, Reference(self.R_eb, "truth", "the curve"))


@pytest.fixture
def in_process(monkeypatch) -> None:
    """Flights of `check`, `compare` and `claims` in this process, where a test can reach into them."""

    def results(tasks, _workers, limit_s):
        for i, task in enumerate(tasks):
            yield i, workers._fly(task, limit_s)

    monkeypatch.setattr(workers, "_results", results)


@pytest.fixture(scope="session")
def logged() -> LoggedFlight:
    """20 s along sines, nose into the course and banking, from 30 s after power-up on."""
    n, t0_us = 1000, 30_000_000
    t_us = t0_us + 20_000 * np.arange(n + 1)
    mean, amplitude = np.array([15.0, 5.0, 0.0]), np.array([40.0, 30.0, 5.0])
    w, phase = np.array([0.25, 0.4, 0.6]), np.array([0.3, 0.0, 1.0])

    def position(us: NDArray[Any]) -> NDArray[Any]:
        t = us[:, None] / 1e6
        return mean * t + amplitude * np.sin(w * t + phase)

    def velocity(us: NDArray[Any]) -> NDArray[Any]:
        return mean + amplitude * w * np.cos(w * us[:, None] / 1e6 + phase)

    roll = 0.6 * np.sin(0.7 * t_us / 1e6)
    v_n, v_e, v_d = velocity(t_us).T
    R = Rotation.from_euler(
        "ZYX", np.stack((np.arctan2(v_e, v_n), -np.arctan2(v_d, np.hypot(v_n, v_e)), roll), axis=-1)
    )
    rate = (R[:-1].inv() * R[1:]).as_rotvec() / 0.02  # the mean rate of an interval turns from tick to tick
    acceleration = -amplitude * w**2 * np.sin(w * t_us[1:, None] / 1e6 + phase)
    force = R[1:].inv().apply(acceleration - [0.0, 0.0, 9.80665])
    fix_us, air_us = (
        np.arange(t0_us + first, t_us[-1], every) for first, every in ((133_000, 200_000), (40_000, 100_000))
    )
    field_us = np.arange(t0_us + 81_000, t_us[-1], 100_000)
    p_e = position(fix_us)
    return LoggedFlight(
        t_us[1:], rate, force, R[1:].as_matrix(),
        fix_us, p_e, velocity(fix_us), geodetic(p_e - p_e[0], *PLACE),
        field_us, R[(field_us - t0_us) // 20_000].inv().apply(FIELD_E_UT),
        air_us, np.linalg.norm(velocity(air_us), axis=1) - 2.0, 60.0 - position(air_us)[:, 2],
    )  # fmt: skip


def same_rows(found: NDArray[Any], expected: NDArray[Any], tolerance: dict[str, float]) -> None:
    """Demand every column equal, within `tolerance` (or 1e-9) absolutely, flags exactly."""
    for name in MEASURED_DTYPE.names:
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=tolerance.get(name, 1e-9), err_msg=name)


@pytest.fixture(scope="session")
def demand_same_rows() -> Any:
    """`same_rows`, for tests."""
    return same_rows


def _beside(name: str) -> ModuleType:
    """The test module of that name: test folders are no packages, from which it could be imported."""
    spec = importlib.util.spec_from_file_location(f"_{name}", Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def dataflash() -> ModuleType:
    """The writer of ArduPilot's logs, and a flight in its words: Writer, TODAY, messages."""
    return _beside("test_log_dataflash")


@pytest.fixture(scope="session")
def px4() -> ModuleType:
    """The writer of PX4's logs, and a flight in its words: framed, ulog, TODAY, messages."""
    return _beside("test_log_ulog")


@pytest.fixture
def read_back(tmp_path: Path) -> Callable[..., RecordedLog]:
    """Writes pieces of bytes to a log of that name and reads it; its ledger must add up."""

    def _read_back(pieces: list[bytes], name: str, **options: Any) -> RecordedLog:
        path = tmp_path / name
        path.write_bytes(b"".join(pieces))
        log = logs.read(path, **options)
        demand_books_agree(log)
        return log

    return _read_back


def demand_books_agree(log: RecordedLog) -> None:
    """Demand that everything read is used or left out, and that what is used is what the rows hold."""
    for stream, entry in log.ledger.items():
        assert entry.read == entry.used + sum(entry.left_out.values()), (stream, entry)
        assert min(entry.read, entry.used, *entry.left_out.values()) >= 0, (stream, entry)
    assert log.ledger["imu"].used == len(log.rows)
    for stream, new in (("gps", "gps_new"), ("magnetometer", "mag_new"), ("airspeed", "air_new")):
        used = log.ledger[stream].used if stream in log.ledger else 0
        assert used == np.count_nonzero(log.rows[new])


@pytest.fixture(scope="session")
def demand_agreement() -> Any:
    """`demand_books_agree`, for tests."""
    return demand_books_agree


class HandHeld:
    """Ten seconds of turning at 50 Hz, held and not accelerated, as columns of a table; fixes every half second."""

    n = 500
    t_s = 0.02 * np.arange(1, n + 1)
    rate = np.stack([0.8 * np.sin(2.0 * t_s), 0.4 * np.cos(1.3 * t_s), 0.3 + 0.2 * np.sin(0.7 * t_s)], axis=-1)

    def __init__(self) -> None:
        turned = [Rotation.identity()]
        for rate in self.rate:  # exact for a rate that is constant in each interval
            turned.append(turned[-1] * Rotation.from_rotvec(0.02 * rate))
        self.attitude = Rotation.concatenate(turned[1:])
        self.R_eb = self.attitude.as_matrix()
        self.force = self.attitude.inv().apply([0.0, 0.0, -9.80665])

    def columns(self, *, attitude: bool = True) -> dict[str, NDArray[Any]]:
        """By names in use."""
        last = np.maximum(0, (np.arange(self.n) + 1) // 25 * 25 - 1)
        yaw, pitch, roll = self.attitude.as_euler("ZYX").T
        return {
            "t": self.t_s,
            **{f"g{a}": self.rate[:, i] for i, a in enumerate("xyz")},
            **{f"a{a}": self.force[:, i] for i, a in enumerate("xyz")},
            "vn": 1.0 + 0.1 * last,
            "ve": -2.0 + 0.0 * last,
            **({"roll": roll, "pitch": pitch, "yaw": yaw} if attitude else {}),
        }

    @staticmethod
    def lines(columns: dict[str, NDArray[Any]]) -> list[str]:
        """The lines of a text file of these columns."""
        table = np.column_stack(list(columns.values()))
        return [",".join(columns), *(",".join(f"{v:.12g}" for v in row) for row in table)]


@pytest.fixture(scope="session")
def held() -> HandHeld:
    """A motion as columns."""
    return HandHeld()


@pytest.fixture(autouse=True)
def _no_word_of_compiling(monkeypatch):
    """Commands run in this process do not say that kernels are compiled: what they print is the same on a cold cache.

    `test_compiling` has a fixture of this name that leaves it be.
    """
    monkeypatch.setattr(console._Compiling, "__call__", lambda self, progress: None)
