"""`wingslevel replay`: what it prints, writes and returns."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.cli.app import run
from sim import recording

DATA = Path(__file__).parents[1] / "reference" / "data" / "ap_ahrs_dcm"
NUMBERS = {
    "inclination_rms_deg", "inclination_max_deg", "heading_rms_deg", "rotation_rms_deg", "rotation_max_deg",
    "ns_per_update",
}  # fmt: skip


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """A working directory with a flight of 20 s in it."""
    monkeypatch.chdir(tmp_path)
    run(["fly", "turns_180", "--duration", "20", "--no-rerun", "--out", "flown", "--seed", "1"])
    return tmp_path


def test_replay_of_a_recording_is_told_written_and_recorded(here: Path, capsys) -> None:
    """One table of 80 columns, one recording for each estimator, for the viewer too."""
    capsys.readouterr()
    code = run(
        ["replay", "flown/turns_180-premerlani-seed1", "--estimator", "premerlani,gyro_only", "--json", "r.json"]
    )
    out = capsys.readouterr().out
    assert code == 0
    assert "against     the true attitude" in out
    assert re.search(r"^ premerlani( +\d+\.\d\d){6} +\d+ *$", out, re.M)
    assert max(len(line.rstrip()) for line in out.partition("recording")[0].splitlines()) <= 80
    data = json.loads((here / "r.json").read_text())
    assert list(data["estimators"]) == ["premerlani", "gyro_only"]
    assert all(numbers.keys() >= NUMBERS for numbers in data["estimators"].values())
    assert not NUMBERS & data.keys()
    for numbers in data["estimators"].values():
        folder = here / numbers["recording"]
        assert (folder / "flight.rrd").stat().st_size > 10_000
        assert recording.load(folder).manifest["scores"]["rotation_rms_deg"] == numbers["rotation_rms_deg"]


def test_replay_json_of_one_estimator_has_its_numbers_at_the_top(here: Path, capfd) -> None:
    """What it believed aboard is what the recording says: the scores are those of the flight itself."""
    capfd.readouterr()
    assert run(["replay", "flown/turns_180-premerlani-seed1", "--settle", "0", "--no-rerun", "--json", "-"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert data.keys() >= NUMBERS
    flown = recording.load(here / "flown" / "turns_180-premerlani-seed1").log
    judged = flown.measured["gps_speed_m_s"] > 5.0
    cosine = np.einsum("nij,nij->n", flown.flown["R_eb"], flown.truth["R_eb"])[judged] / 2.0 - 0.5
    angle_deg = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    # The first judged row is left out: times count after it.  Round-off of the arc cosine near one is 1e-6 degrees.
    assert data["rotation_max_deg"] == pytest.approx(angle_deg[1:].max(), rel=0, abs=1e-5)
    assert data["rotation_rms_deg"] == pytest.approx(np.sqrt(np.mean(angle_deg[1:] ** 2)), rel=0, abs=1e-5)


def test_replay_of_reference_vectors_counts_every_row_against_firmware(tmp_path: Path, monkeypatch, capfd) -> None:
    """The file of the firmware decides what is compared; the whole 130 s are judged."""
    monkeypatch.chdir(tmp_path)
    firmware = str(DATA / "A50_ap2013_gps.csv.gz")
    code = run(["replay", str(DATA / "A50_in.csv.gz"), "--reference", firmware, "--no-rerun", "--json", "-"])
    data = json.loads(capfd.readouterr().out)
    assert code == 0
    assert (data["reference"], data["reference_kind"]) == ("A50_ap2013_gps", "firmware")
    assert data["judged_s"] == pytest.approx(130.0, rel=0, abs=1e-6)


# Asked for: 0.01 / 0.05 on E100, 0.05 / 0.15 on A50, 0.2 / 0.4 on C50 gps; for MatrixPilot 2 / 6.
@pytest.mark.parametrize(
    ("folder", "output", "estimator", "rms_deg", "max_deg"),
    [
        ("ap_ahrs_dcm", "E100_ap2013_mag_nogps_copter", "ap_dcm_2013", 0.005, 0.02),
        ("ap_ahrs_dcm", "A50_ap2013_gps", "ap_dcm_2013", 0.001, 0.002),
        ("ap_ahrs_dcm", "A50_ap2013_mag", "ap_dcm_2013", 0.001, 0.002),
        ("ap_ahrs_dcm", "C50_ap2013_gps", "ap_dcm_2013", 0.001, 0.002),
        ("matrixpilot", "C40_mp_udb4", "matrixpilot", 2.0, 6.0),
        ("matrixpilot", "C40_mp_gpscent", "matrixpilot", 2.0, 5.0),
    ],
)
def test_replay_against_an_original_is_set_as_the_original_was(
    tmp_path: Path, capfd, folder: str, output: str, estimator: str, rms_deg: float, max_deg: float
) -> None:
    """Without a setting on the command line: the names of the files tell how the original was set."""
    vectors = DATA.parent / folder
    command = ["replay", str(vectors / f"{output.partition('_')[0]}_in.csv.gz"), "--estimator", estimator]
    files = ["--reference", str(vectors / f"{output}.csv.gz"), "--out", str(tmp_path), "--no-rerun", "--json", "-"]
    assert run([*command, *files]) == 0
    data = json.loads(capfd.readouterr().out)
    assert data["rotation_rms_deg"] <= rms_deg
    assert data["rotation_max_deg"] <= max_deg


def test_replay_of_a_table_by_a_column_map_with_parameters(here: Path, capfd) -> None:
    """The flight as text in degrees and milliseconds gives the same scores; a parameter gives others."""
    log = recording.load(here / "flown" / "turns_180-premerlani-seed1").log
    m, R = log.measured, log.truth["R_eb"].reshape(-1, 9)
    columns = {
        "ms": 1e3 * m["t_s"], "new": m["gps_new"], "v": m["gps_speed_m_s"], "cog": np.degrees(m["gps_course_rad"]),
        **{f"w{i}": np.degrees(m["gyro_b_rad_s"][:, i]) for i in range(3)},
        **{f"f{i}": m["force_b_m_s2"][:, i] for i in range(3)},
        **{f"r{k // 3}{k % 3}": R[:, k] for k in range(9)},
    }  # fmt: skip
    units = {"ms": "time ms", "new": "gps.new", "v": "gps.speed m/s", "cog": "gps.course deg"}
    units |= {f"w{i}": f"gyro.{a} deg/s" for i, a in enumerate("xyz")}
    units |= {f"f{i}": f"force.{a}" for i, a in enumerate("xyz")} | {n: n for n in columns if re.match(r"r\d\d", n)}
    rows = [",".join(columns), *(",".join(map(repr, row)) for row in np.column_stack(list(columns.values())).tolist())]
    (here / "own.csv").write_text("\n".join(rows))
    receiver = ["[instruments]", "gps_filter_s = 1.0", "gps_latency_s = 0.3"]
    columns_ = ["[columns]", *(f'{n} = "{unit}"' for n, unit in units.items())]
    (here / "own.toml").write_text("\n".join(columns_ + receiver))
    capfd.readouterr()
    found = []
    for arguments in (
        ["flown/turns_180-premerlani-seed1"],
        ["own.csv", "--columns", "own.toml"],
        ["own.csv", "--columns", "own.toml", "--set", "w_rp=0.05"],
    ):
        assert run(["replay", *arguments, "--no-rerun", "--json", "-"]) == 0
        found.append(json.loads(capfd.readouterr().out))
    ours, table, other = (data["rotation_rms_deg"] for data in found)
    assert table == pytest.approx(ours, rel=0, abs=1e-6)  # the intervals are differences of times: off by round-off
    assert other != pytest.approx(ours, rel=0, abs=1e-3)
    assert found[1]["repairs"] == []


def test_replay_tells_what_it_repaired(here: Path, capsys) -> None:
    """A gyro in degrees is named on the terminal and in the JSON."""
    log = recording.load(here / "flown" / "turns_180-premerlani-seed1").log.measured
    numbers = np.column_stack((log["t_s"], np.degrees(log["gyro_b_rad_s"]), log["force_b_m_s2"]))
    np.savetxt(here / "deg.csv", numbers, delimiter=",", header="t,gx,gy,gz,ax,ay,az", comments="")
    assert run(["replay", "deg.csv", "--no-rerun", "--json", "r.json"]) == 0
    assert "repaired    column gx gy gz (gyro) in degrees per second" in capsys.readouterr().out
    data = json.loads((here / "r.json").read_text())
    assert len(data["repairs"]) == 1
    assert (data["reference"], data["rotation_rms_deg"]) == (None, None)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.csv"], "no log at none.csv"),
        (["bad.csv"], "bad.csv: line 3, column gx: 'x' is not a number"),
        (["bad.csv", "--columns", "nothing"], "no column map 'nothing'"),
        (["bad.csv", "--estimator", "premerlany"], "unknown estimator 'premerlany': did you mean premerlani"),
        (["bad.csv", "--estimator", "gyro_only,gyro_only"], "each only once"),
        (["bad.csv", "--set", "gain=2"], "unknown parameter 'gain' of estimator premerlani"),
        (["bad.csv", "--settle", "-1"], "settle_s = -1 s: must be zero or more"),
    ],
)
def test_replay_that_cannot_be_is_one_line_and_exit_code_2(tmp_path, monkeypatch, capsys, arguments, said) -> None:
    """Found before anything is written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.csv").write_text(
        "t,gx,gy,gz,ax,ay,az\n0.02,0,0,0,0,0,-9.8\n0.04,x,0,0,0,0,-9.8\n0.06,0,0,0,0,0,-9.8\n"
    )
    assert run(["replay", *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bad.csv"]


def test_replay_of_an_estimator_that_fails_is_exit_code_1(here: Path, capsys) -> None:
    """A fault of one's own estimator is a result: one line, and the recording is kept."""
    Path("own.py").write_text("class Clumsy:\n    def update(self, m):\n        return 1 / 0\n", encoding="utf-8")
    assert run(["replay", "flown/turns_180-premerlani-seed1", "--estimator", "own.py:Clumsy", "--no-rerun"]) == 1
    assert re.search(r"Clumsy failed: Clumsy at 0\.02 s: ZeroDivisionError", capsys.readouterr().out)
    assert (here / "flights" / "replay_turns_180-premerlani-seed1-Clumsy" / "flight.parquet").is_file()


@pytest.mark.parametrize(
    ("roll", "said"),
    [
        (np.nan, "2000 without a number"),
        (np.inf, "2000 without a number"),
        (0.0, "2000 before the filter had started"),
    ],
)
def test_replay_against_an_attitude_of_which_nothing_can_be_used_is_exit_code_1(
    tmp_path: Path, monkeypatch, capsys, roll, said
) -> None:
    """Columns of an attitude are one to judge by; the reason is that of the ledger, and stands once."""
    monkeypatch.chdir(tmp_path)
    n = 2000
    columns = {"time_s": 0.02 * np.arange(n), **{f"gyro_{a}_rad_s": np.zeros(n) for a in "xyz"}}
    columns |= {"force_x_m_s2": np.zeros(n), "force_y_m_s2": np.zeros(n), "force_z_m_s2": np.full(n, -9.8)}
    columns |= {"roll": np.full(n, roll), "pitch": np.zeros(n), "yaw": np.zeros(n)}
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in np.column_stack(list(columns.values())).tolist())]
    Path("log.csv").write_text("\n".join(lines), encoding="utf-8")
    assert run(["replay", "log.csv", "--estimator", "gyro_only", "--no-rerun"]) == 1
    out, err = capsys.readouterr()
    assert out.count(f"nothing judged: attitude in log.csv: no attitude can be used: {said}") == 1
    assert "Warning" not in err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--airborne", "50"], "ground speed never above 50 m/s"),
        (["--settle", "100"], "nothing is left after 100 s to settle"),
        (["--reference", "later.csv"], r"later.csv: its times, .* do not overlap those of the log"),
    ],
)
def test_replay_in_which_nothing_is_judged_says_why_and_is_exit_code_1(here: Path, capsys, arguments, why) -> None:
    """A gate on which nothing was judged must not be open."""
    (here / "later.csv").write_text("t,roll,pitch,yaw\n" + "".join(f"{1000 + 0.1 * k},0.1,0,0\n" for k in range(50)))
    capsys.readouterr()
    command = ["replay", "flown/turns_180-premerlani-seed1", *arguments, "--no-rerun", "--json", "r.json"]
    assert run(command) == 1
    assert re.search(f"^nothing judged: .*{why}", capsys.readouterr().out, re.M)
    data = json.loads((here / "r.json").read_text())
    assert data["judged_s"] == 0.0
    assert re.search(why, data["not_judged"])
    assert all(e["read"] == e["used"] + sum(e["left_out"].values()) for e in data["ledger"].values())


def test_replay_of_a_log_without_a_usable_fix_says_that_the_ground_is_judged_too(here: Path, capsys) -> None:
    """Fixes below three dimensions are left out: no speed says when it flew."""
    log = recording.load(here / "flown" / "turns_180-premerlani-seed1").log
    m, R = log.measured, log.truth["R_eb"].reshape(-1, 9)
    header = [
        "t",
        "gx",
        "gy",
        "gz",
        "ax",
        "ay",
        "az",
        "vn",
        "ve",
        "gps_fix",
        *(f"r{i}{j}" for i in range(3) for j in range(3)),
    ]
    v_e, fix = m["gps_v_e_m_s"][:, :2], np.full(len(m), 2.0)
    numbers = np.column_stack((m["t_s"], m["gyro_b_rad_s"], m["force_b_m_s2"], v_e, fix, R))
    np.savetxt(here / "no_fix.csv", numbers, delimiter=",", header=",".join(header), comments="", fmt="%.12g")
    capsys.readouterr()
    assert run(["replay", "no_fix.csv", "--estimator", "gyro_only", "--no-rerun", "--json", "r.json"]) == 0
    assert "no fix is usable: all rows are judged" in capsys.readouterr().out
    assert json.loads((here / "r.json").read_text())["judged_s"] > 5.0
