"""The public API: flying, and what a flight offers."""

import json
import math
import subprocess
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import wingslevel as wl
from estimator.premerlani import Premerlani
from scenarios.harness.cli.app import run

SHORT: dict[str, Any] = {"duration": 6, "seed": 3, "wind": "5@270"}


class Level:
    """Believes that it flies level, to the north."""

    def __init__(self, roll_deg: float = 0.0) -> None:
        roll = np.radians(roll_deg)
        self.R_eb = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])

    def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
        """Always the same."""
        return wl.AttitudeEstimate(self.R_eb)


@pytest.fixture(scope="module")
def flight() -> wl.Flight:
    """A short flight."""
    return wl.fly("crosswind", **SHORT)


def test_import_loads_nothing_heavy() -> None:
    """Only the standard library, until something is used."""
    code = "import sys; before = set(sys.modules); import wingslevel; print(*(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert "wingslevel" in loaded
    assert loaded <= {*sys.stdlib_module_names, "wingslevel"}


def test_every_public_name_is_there_with_a_docstring() -> None:
    """`__all__` names what there is, sorted, and `dir` shows it."""
    assert sorted(wl.__all__, key=str) == wl.__all__
    for name in wl.__all__:
        assert getattr(wl, name).__doc__, name
    assert set(wl.__all__) <= set(dir(wl))
    with pytest.raises(AttributeError, match="has no attribute 'flly'"):
        wl.flly  # noqa: B018 - looked up


def test_fly_gives_the_numbers_of_the_command(flight: wl.Flight, tmp_path: Path) -> None:
    """The same flight, judged the same: bit for bit."""
    options = ["--duration", "6", "--seed", "3", "--wind", "5@270", "--no-rerun"]
    run(["fly", "crosswind", *options, "--out", str(tmp_path), "--json", str(tmp_path / "fly.json")])
    (told,) = json.loads((tmp_path / "fly.json").read_text())["flights"]
    assert told["metrics"] == flight.metrics
    assert told == json.loads(json.dumps(flight.to_json()))
    (folder,) = (path for path in tmp_path.iterdir() if path.is_dir())
    loaded = wl.load(folder)
    for table in ("truth", "measured", "flown"):
        assert getattr(loaded, table).tobytes() == getattr(flight, table).tobytes()
    assert loaded.manifest["verdict"] == flight.manifest["verdict"]


def test_flight_is_the_same_saved_and_loaded(flight: wl.Flight, tmp_path: Path) -> None:
    """Numbers, verdict, events and the texts about it."""
    folder = flight.save(tmp_path / "mine", rerun=False)
    assert {path.name for path in folder.iterdir()} == {"flight.parquet", "manifest.json"}
    loaded = wl.load(folder)
    assert loaded.metrics == flight.metrics
    assert repr(loaded) == repr(flight)
    assert loaded._repr_html_() == flight._repr_html_()
    assert (loaded.events, loaded.passed, loaded.seed) == (flight.events, flight.passed, flight.seed)
    assert wl.load(folder / "flight.parquet").outcome == "completed"


def test_fly_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    """Neither on standard output nor on standard error."""
    wl.fly("crosswind", duration=1)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("estimator", "name"),
    [
        (Level, f"{__name__}:Level"),
        (partial(Level, roll_deg=30.0), f"{__name__}:Level(roll_deg=30.0)"),
        (lambda: Level(30.0), f"{__name__}:<lambda>"),
        ("estimator.baselines:GyroOnly", "estimator.baselines:GyroOnly"),
    ],
)
def test_fly_takes_an_estimator_of_any_kind(estimator: Any, name: str) -> None:
    """A class, a partial, a function that makes one, a name."""
    flown = wl.fly("crosswind", estimator=estimator, duration=1)
    assert flown.estimator == name
    if "30" in name or "lambda" in name:
        assert flown.flown["R_eb"][-1, 2, 1] == pytest.approx(0.5)


def test_fly_takes_numbers_of_numpy_and_texts() -> None:
    """They mean the same flight as plain numbers."""
    plain = wl.fly("crosswind", duration=2, wind="5@270", gps_rate=5, seed=4, settings={"gps.latency_s": 0.5})
    odd = wl.fly(
        "crosswind", duration="2", wind=(np.float64(5), np.int64(270)), gps_rate=np.float32(5.0), seed=np.uint8(4),
        settings={"gps.latency_s": "0.5"},
    )  # fmt: skip
    assert odd.config == plain.config
    assert odd.flown.tobytes() == plain.flown.tobytes()


def test_fly_sets_parameters() -> None:
    """Of the estimator by name."""
    assert wl.fly("crosswind", duration=1, params={"k_p": 0.25}).config["estimator_params"] == {"k_p": 0.25}
    assert wl.fly("crosswind", estimator=Premerlani, params={"k_p": 0.25}, duration=1).outcome == "completed"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scenario": "crosswnd"}, "crosswind"),
        ({"estimator": "premerlni"}, "premerlani"),
        ({"estimator": Level()}, "name the class"),
        ({"params": {"kp": 1}}, "k_p"),
        ({"wind": "strong"}, "5@270"),
        ({"wind": 5}, "5@270"),
        ({"duration": -1}, "duration_s"),
        ({"seed": -1}, "seed"),
        ({"settings": {"seed": 3}}, "as an argument"),
        ({"duration": 2, "settings": {"duration_s": 3}}, "name it once"),
        ({"faults": "gyro.x:stick@3"}, "stuck"),
        ({"aircraft": "albatros"}, "unknown aircraft"),
        ({"timeout": 0}, "timeout"),
        ({"timeout": "soon"}, "timeout = 'soon': must be a number"),
        ({"scenario": None}, "scenario = None: must be a name or a path"),
        ({"scenario": 3}, "scenario = 3: must be a name or a path"),
        ({"params": [1]}, "params = .*must be a dict"),
        ({"params": "kp=1"}, "params = 'kp=1': must be a dict"),
        ({"settings": [1]}, "settings = .*must be a dict"),
        ({"faults": 3}, "faults = 3: must be a text or a list of texts"),
        ({"gust": 4}, "gust = 4: must be a text or a list of texts"),
        ({"gust": [4]}, "gust = .*must be a text or a list of texts"),
        ({"progress": 3}, "progress = 3: must be True, False, or a function"),
    ],
)
def test_fly_refuses_in_one_line(arguments: dict[str, Any], message: str) -> None:
    """What cannot be is a `WingslevelError`, which is a ValueError."""
    with pytest.raises(ValueError, match=message) as refused:
        wl.fly(**{"scenario": "crosswind", "duration": 1, **arguments})
    assert type(refused.value) is wl.WingslevelError
    assert "\n" not in str(refused.value)


def test_fly_refuses_an_option_that_there_is_not() -> None:
    """As Python does, with the near misses."""
    with pytest.raises(TypeError, match="gust"):
        wl.fly("crosswind", gusts="4@2")  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="unknown option 'estimtor': did you mean estimator"):
        wl.fly("crosswind", estimtor="premerlani")  # type: ignore[call-arg]


def test_fly_warns_of_a_fault_after_the_end() -> None:
    """It is allowed, and hardly meant."""
    with pytest.warns(wl.WingslevelWarning, match=r"gps:outage@30.* never happens") as warned:
        wl.fly("crosswind", duration=1, faults="gps:outage@30")
    lasts = "the flight of 'crosswind' lasts from 0 s to 1 s after the release"
    assert [str(one.message) for one in warned] == [f"fault gps:outage@30 never happens: {lasts}"]


def test_flight_of_an_estimator_that_raises_is_a_result() -> None:
    """It fails, says why, and everything that shows it works."""

    class Broken:
        def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
            raise RuntimeError("<b>broken</b> | $x$")

    flown = wl.fly("crosswind", estimator=Broken, duration=2)
    assert (flown.outcome, flown.passed) == ("estimator_failed", False)
    assert "broken" in flown.message
    assert "\n" not in repr(flown)
    assert "<b>broken</b>" not in flown._repr_html_()
    assert "&lt;b&gt;broken" in flown._repr_html_()


def test_timeout_is_an_outcome() -> None:
    """The flight up to there is returned."""

    class Slow(Level):
        def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
            import time

            time.sleep(0.02)
            return super().update(m)

    flown = wl.fly("crosswind", estimator=Slow, duration=60, timeout=0.5)
    assert flown.outcome == "timed_out"
    assert 0 < len(flown) < 3000


def test_table_has_euler_angles_and_names(flight: wl.Flight) -> None:
    """Angles against SciPy, errors against the metrics, names against the numbers; every column says what it means."""
    table = flight.to_arrow()
    frame = flight.to_pandas()
    assert list(frame) == table.column_names
    assert len(frame) == len(flight)
    for whose in ("truth", "flown"):
        angles = Rotation.from_matrix(getattr(flight, whose)["R_eb"]).as_euler("ZYX", degrees=True)
        for column, i in (("roll_deg", 2), ("pitch_deg", 1), ("heading_deg", 0)):
            difference = (frame[f"{whose}.{column}"].to_numpy() - angles[:, i] + 180.0) % 360.0 - 180.0
            assert np.abs(difference).max() < 1e-5
    assert frame["truth.heading_deg"].between(0.0, 360.0, inclusive="left").all()
    rms = math.sqrt(np.nanmean(frame["inclination_error_deg"].to_numpy() ** 2))
    assert rms == pytest.approx(flight.metrics["inclination_rms_deg"], rel=1e-12)
    assert (frame["flown.health_name"] == "good").equals(frame["flown.health"] == wl.Health.GOOD)
    assert set(frame["flown.mode_name"].dropna()) == {"course"}
    assert set(frame["truth.phase_name"]) == {"flying"}
    np.testing.assert_array_equal(frame["truth.R_eb.zx"].to_numpy(), flight.truth["R_eb"][:, 2, 0])
    assert all(field.metadata[b"meaning"] for field in table.schema)


def test_to_pandas_says_what_to_install(flight: wl.Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line, where pandas is missing."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r'^to_pandas\(\) requires pandas: pip install "wingslevel\[pandas\]"$'):
        flight.to_pandas()


def test_texts_about_a_flight(flight: wl.Flight) -> None:
    """A line, and a table with every check."""
    assert repr(flight).startswith("<Flight crosswind, premerlani, seed 3: ")
    html = flight._repr_html_()
    assert all(row.name in html for row in flight.verdict.rows)
    assert html.count("<tr>") == 1 + len(flight.verdict.rows)


def test_plot_is_a_figure_that_a_notebook_shows(flight: wl.Flight) -> None:
    """Truth and estimate in each panel of the attitude; a picture without pyplot."""
    figure = flight.plot()
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels[:3] == ["roll, deg", "pitch, deg", "heading, deg"]
    drawn = {line.get_label() for line in figure.axes[0].lines}
    assert {"truth", "estimate"} <= drawn
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]


def test_plot_of_nothing_is_refused() -> None:
    """A flight that did not begin has no row."""

    class Dead:
        heading_reference = "nose"

        def reset(self, on_ground: object) -> None:
            raise RuntimeError("dead")

        def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
            raise RuntimeError("dead")

    flown = wl.fly("crosswind", estimator=Dead, duration=2)
    assert len(flown) == 0
    assert "crosswind" in flown._repr_html_()
    with pytest.raises(wl.WingslevelError, match="nothing was flown"):
        flown.plot()


def test_progress_is_told_to_a_function() -> None:
    """Seconds done, of how many."""
    told: list[tuple[float, float]] = []
    wl.fly("crosswind", duration=3, progress=lambda done, total: told.append((done, total)))
    assert told == [(pytest.approx(k), pytest.approx(3.0)) for k in (1, 2, 3)]


def test_a_check_that_was_not_measured_says_so_everywhere(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Checks begin at 20 s: a flight of 2 s measures none of those."""
    flown = wl.fly("crosswind", duration=2)
    missing = [row for row in flown.verdict.rows if not math.isfinite(row.measured)]
    assert missing
    html = flown._repr_html_()
    assert html.count(">not measured<") == len(missing)
    drawn = [text.get_text() for axis in flown.plot().axes for text in axis.texts]
    assert drawn.count("not measured") == len(missing)
    run(["fly", "crosswind", "--duration", "2", "--no-rerun", "--out", str(tmp_path)])
    assert capsys.readouterr().out.count("not measured") == len(missing)
    markdown = wl.check("crosswind", seeds=0, duration=2, workers=1).to_markdown()
    assert "not measured" in markdown
    assert "none" not in markdown


def test_load_refuses_in_one_line(tmp_path: Path) -> None:
    """No recording there, or something else."""
    with pytest.raises(wl.WingslevelError, match="path = None: must be a name or a path"):
        wl.load(None)  # type: ignore[arg-type]
    with pytest.raises(wl.WingslevelError, match=r"flight\.parquet"):
        wl.load(tmp_path)
    (tmp_path / "flight.parquet").write_bytes(b"no")
    with pytest.raises(wl.WingslevelError, match="not a Parquet file"):
        wl.load(tmp_path)


def test_save_refuses_in_one_line(flight: wl.Flight, tmp_path: Path) -> None:
    """A folder that is a file."""
    (tmp_path / "file").write_text("")
    with pytest.raises(wl.WingslevelError, match="cannot write"):
        flight.save(tmp_path / "file" / "below")


def test_listings_are_those_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    """The same names with the same lines."""
    run(["list", "--json", "-"])
    listed = json.loads(capsys.readouterr().out)
    for kind in ("scenarios", "estimators", "autopilots"):
        assert getattr(wl, kind)() == {name: one["about"] for name, one in listed[kind].items()}


def test_parameters_of_an_estimator_by_name_and_of_a_class() -> None:
    """What `params` takes, with defaults and units."""
    found = wl.parameters("premerlani")
    assert found == wl.parameters(Premerlani)
    assert (found["gps_latency_s"].unit, bool(found["k_p"].meaning)) == ("s", True)
    assert wl.fly("crosswind", duration=1, params={name: found[name].default for name in ("k_p", "k_i")})


def test_help_names_the_options() -> None:
    """Of the flight, one by one, with what they mean."""
    import inspect

    assert {"wind", "faults", "settings", "gps_rate"} <= set(inspect.signature(wl.fly).parameters)
    assert "5@cross" in (wl.fly.__doc__ or "")


def test_warnings_are_no_errors_without_reason() -> None:
    """An ordinary flight warns of nothing."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wl.fly("crosswind", duration=1)
