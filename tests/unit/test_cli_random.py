"""Hundreds of command lines, good and bad values mixed by chance: no traceback, no hang, no half-told success."""

import json
import os
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from scenarios.harness.cli.app import run
from sim.outside.signals import limited

HANGS_S = 300.0  # a line takes a second; the first with an estimator may compile, on a machine that is busy
CODES = {0, 1, 2, 3, 130}
BLOCK = 50

ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e308", "1e-320", "1e400", "-0", "-1", "\u0663", "\uff13", "1_000", "0x10", " 5 ",
    "9" * 5000, "true", "[1,2]", "[" * 3000, "{}", "null", "1e9", "-1e9", "0", "18446744073709551616", "\xb2", "1,5",
    "--", "1e", "+", ".",
)  # fmt: skip
ODD_TEXTS = (
    "", " ", "x" * 256, "x" * 10_000, "\ud800", "\udcff.py", "\x1b[31mred", "<script>alert(1)</script>", "a\0b",
    "a|b`c`", "[bold]x[/]", "[/]", "\u202eright", "e\u0301" * 40, "\U0001f600", "two\nlines", "$x$", "../..", "/",
    "/dev/null/x", "a,,b", "*", "%s{}", "a=b=c", "-", "--json", "'", '"', "~", "no.py:C", ":", "os:system",
    "json:loads", "/dev/full:C",
)  # fmt: skip
ODD_FILES = (
    "/dev/full", "/dev/null/x", "nowhere/file", ".", "x" * 256, "a\0b", "", "/proc/no", "taken/below", "\udcff/\udcff",
)  # fmt: skip
SHORT = ("0.02", "0.1", "0.3", "1")
FIELDS = (
    "gps.latency_s", "gyro.bias_deg_s", "accelerometer.range_g", "board.rest_s", "air.shear", "start.height_m",
    "rates.imu_hz", "rates.physics_hz", "box_radius_m", "seed", "flight", "estimator_params.k_p", "gps_latency_s",
    "air.wind_m_s", "air.wind_from_deg", "gps.rate_hz", "turn_table", "declination_rad", "start.heading_deg",
    "start.airspeed_m_s", "air.turbulence_w20_m_s", "manoeuvre.leg_s", "start.out_m", "box_height_m", "air.inversion_m",
)  # fmt: skip
NO_FIELDS = (
    "suits.nonsense", "a.b.c.d", "config", "start", "start.kind", "rates", "sensors", "files", "manoeuvre", "", ".",
    "gps.", "estimator_params", "estimator_params.", "estimator_params.nonsense", "instruments.nonsense", "x" * 300,
    "gps.latency_s.x",
)  # fmt: skip
GOOD_VALUES = ("0", "1", "0.5", "2", "5", "50", "200", "true")
SCENARIOS = ("crosswind", "hand_launch", "turns_180", "stall_spin")


def _of(good: tuple[str, ...], odd: tuple[str, ...], odd_share: float = 0.15) -> Callable[[random.Random], str]:
    return lambda rng: rng.choice(odd if rng.random() < odd_share else good)


def _set(rng: random.Random) -> str:
    name = rng.choice(NO_FIELDS if rng.random() < 0.3 else FIELDS)
    return f"{name}={rng.choice(ODD_NUMBERS + ODD_TEXTS if rng.random() < 0.4 else GOOD_VALUES)}"


ODD_WINDS = ("nan@270", "5@nan", "\u0663@90", "1e2@4", "-5@90", "5@361", "5@")
ODD_GUSTS = ("nan@1", "4@-1", "1e9@1", "\u0663@1s", "4@1s/0s", "9" * 400 + "@1")
ODD_FAULTS = ("gyro:stuck@nan", "gps:jump=inf@1", "gyro:bias=\u0663@1", "x:y@z")
AIR: dict[str, Callable[[random.Random], str]] = {
    "--wind": _of(("5@270", "calm", "3@cross", "0@0"), (*ODD_WINDS, *ODD_TEXTS)),
    "--shear": _of(("0", "0.14"), ODD_NUMBERS),
    "--gust": _of(("4@1s", "4@0/1s:up"), (*ODD_GUSTS, *ODD_TEXTS)),
    "--turbulence": _of(("calm", "light", "3"), ODD_NUMBERS),
    "--thermals": _of(("0", "3"), ODD_NUMBERS),
    "--fault": _of(("gyro.x:stuck@0", "gps:outage@0-1"), (*ODD_FAULTS, *ODD_TEXTS)),
}
CARRIED: dict[str, Callable[[random.Random], str]] = {
    "--aircraft": _of(("endurance", "gentle_lady"), ODD_TEXTS),
    "--autopilot": _of(("dcm",), ODD_TEXTS),
    "--gps-rate": _of(("1", "4", "5"), ODD_NUMBERS),
    "--imu-rate": _of(("50", "100"), ODD_NUMBERS),
    "--sensors": _of(("generic", "ideal", "apm2"), ODD_TEXTS),
    "--withhold": _of(("all", "gps_latency_s"), ODD_TEXTS),
    "--set": _set,
}
ESTIMATOR = {"--estimator": _of(("premerlani", "gyro_only", "matrixpilot", "oracle", "ins_ekf"), ODD_TEXTS, 0.25)}
JSON = {"--json": _of(("out.json", "-"), ODD_FILES)}
MARKDOWN = {"--markdown": _of(("out.md",), ODD_FILES)}
SEEDS = {
    "--seeds": _of(("0", "0,3", "7-8"), ("\u0663", "0-99999999999", "0-4294967295", "5-2", "-1", "0,,1", *ODD_NUMBERS))
}


def _options(rng: random.Random, table: dict[str, Any], most: int) -> list[str]:
    chosen = rng.sample(sorted(table), k=rng.randint(0, min(most, len(table))))
    return [text for name in chosen for text in (name, table[name](rng))]


def _scenario(rng: random.Random) -> str:
    return rng.choice(ODD_TEXTS if rng.random() < 0.12 else SCENARIOS)


def _fly(rng: random.Random) -> list[str]:
    table = (
        AIR
        | CARRIED
        | ESTIMATOR
        | JSON
        | {"--out": _of(("flights", "a/b"), ODD_FILES), "--seed": _of(("0", "4"), ODD_NUMBERS)}
    )
    duration = rng.choice(("1e9", *ODD_NUMBERS)) if rng.random() < 0.15 else rng.choice(SHORT)
    return [
        "fly",
        _scenario(rng),
        *_options(rng, table, 5),
        "--duration",
        "0.1" if duration == "0" else duration,
        "--no-rerun",
    ]


def _check(rng: random.Random) -> list[str]:
    table = AIR | CARRIED | ESTIMATOR | JSON | MARKDOWN | {"--junit": _of(("out.xml",), ODD_FILES)}
    seeds = ["--seeds", SEEDS["--seeds"](rng)]
    names = [_scenario(rng) for _ in range(rng.randint(1, 2))]
    return [
        "check",
        *names,
        *_options(rng, table, 4),
        *seeds,
        "--workers",
        "1",
        "--set",
        f"duration_s={rng.choice(SHORT)}",
    ]


def _compare(rng: random.Random) -> list[str]:
    named = {"--estimators": _of(("gyro_only", "premerlani,gyro_only"), ODD_TEXTS)}
    picture = {"--picture": _of(("out.png", "out.svg"), ("out.bmp", *ODD_FILES))}
    chosen = ["--estimators", "gyro_only"] if rng.random() < 0.5 else ["--estimators", named["--estimators"](rng)]
    table = AIR | CARRIED | JSON | MARKDOWN | picture
    short = ["--seeds", SEEDS["--seeds"](rng), "--workers", "1", "--set", f"duration_s={rng.choice(SHORT)}"]
    return ["compare", _scenario(rng), *chosen, *_options(rng, table, 3), *short]


def _claims(rng: random.Random) -> list[str]:
    return ["claims", rng.choice(("offset*", *ODD_TEXTS)), "--list", *_options(rng, SEEDS | JSON | MARKDOWN, 2)]


def _replay(rng: random.Random) -> list[str]:
    table = JSON | {
        "--estimator": _of(("premerlani", "gyro_only"), ODD_TEXTS),
        "--airborne": _of(("0", "5"), ODD_NUMBERS),
        "--settle": _of(("0", "1"), ODD_NUMBERS),
        "--calibration": _of(("0", "1"), ODD_NUMBERS),
        "--imu": _of(("0",), ODD_NUMBERS),
        "--columns": _of(("umn_ultrastick",), ODD_TEXTS),
        "--reference": _of(("{log}",), ODD_FILES),
        "--set": _set,
        "--out": _of(("flights",), ODD_FILES),
    }
    log = rng.choice(("{log}", "{log}", "taken", *ODD_FILES))
    return ["replay", log, *_options(rng, table, 4), "--no-rerun"]


AGREE = JSON | {
    "--tolerance": _of(("0", "0.1"), ODD_NUMBERS),
    "--report-only": _of(("none", "faults"), ODD_TEXTS),
}
_verdict = _of(("{verdict}",), ("taken", *ODD_FILES), 0.2)


def _small(rng: random.Random) -> list[str]:
    """Commands that fly nothing."""
    files = _of(("out.x",), ODD_FILES)
    return rng.choice((
        ["list", *_options(rng, JSON, 1)],
        ["bench", "--seconds", rng.choice(ODD_NUMBERS), *_options(rng, ESTIMATOR | JSON, 1), "--repeats", "0"],
        ["aircraft", rng.choice(ODD_TEXTS), *_options(rng, {"--picture": files}, 1)],
        ["sensors", rng.choice(ODD_TEXTS), *_options(rng, {"--picture": files}, 1)],
        ["export", rng.choice(ODD_FILES), "--nmea", files(rng), "--start", rng.choice((*ODD_TEXTS, "2026-01-01"))],
        ["view", rng.choice(ODD_FILES)],
        ["agree", _verdict(rng), _verdict(rng), *_options(rng, AGREE, 3)],
        [rng.choice(ODD_TEXTS), *rng.choices(ODD_TEXTS, k=2)],
        [rng.choice(("fly", "check", "compare")), rng.choice(("--help", "--nonsense", "-x", "--duration"))],
        [rng.choice(("--version", "--quiet", "-q", "--nonsense", "--show-completion=bash")), "list"],
    ))  # fmt: skip


KINDS = (_fly,) * 5 + (_check,) * 3 + (_compare, _claims, _replay, _replay) + (_small,) * 3


def command_lines(n: int) -> Iterator[list[str]]:
    """The same `n` command lines every time."""
    rng = random.Random(20260702)
    for _ in range(n):
        line = rng.choice(KINDS)(rng)
        if rng.random() < 0.1:
            line.insert(rng.choice((0, len(line))), "--quiet")
        yield line


@pytest.fixture
def inputs(tmp_path: Path, held, capfd) -> dict[str, str]:
    """A log and a verdict to name; the kernels are compiled when they are there."""
    log, verdict = tmp_path / "log.csv", tmp_path / "verdict.json"
    log.write_text("\n".join(held.lines(held.columns())))
    arguments = ["fly", "crosswind", "--duration", "0.1", "--no-rerun", "--out", str(tmp_path / "flown")]
    run([*arguments, "--json", str(verdict)])
    capfd.readouterr()
    return {"{log}": str(log), "{verdict}": str(verdict)}


def _files(folder: Path) -> dict[str, int]:
    return {str(path): path.lstat().st_size for path in folder.rglob("*")}


def _demand_complete(where: str, folder: Path, stdout: str, line: list[str]) -> None:
    """Demand whole reports of a command that says all is well."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("out.*") if path.suffix != ".png"}
    if "--json" in line and "-" in line[line.index("--json") + 1 :][:1]:
        texts["out.json"] = stdout
    for name, text in texts.items():
        if name.endswith(".json"):
            data = json.loads(text)
            text.encode("utf-8")
            assert "flights" not in data or line[0] == "compare" or data.get("passed", True), where
            assert "interrupted" not in data, where
        if name.endswith(".xml"):
            assert ElementTree.fromstring(text).get("errors") == "0", where


def _try(line: list[str], inputs: dict[str, str], folder: Path, capfd, monkeypatch) -> None:
    folder.mkdir()
    (folder / "taken").write_text("mine")
    monkeypatch.chdir(folder)
    line = [inputs.get(text, text) for text in line]
    before, where = _files(folder), f"{line!r}"[:2000]
    try:
        with limited(HANGS_S):
            code = run(line)
    except BaseException as error:
        raise AssertionError(f"{where}: {type(error).__name__}") from error
    stdout, stderr = capfd.readouterr()
    assert code in CODES, where
    assert "Traceback" not in stderr + stdout, where
    if code == 2:
        assert len([text for text in stderr.splitlines() if text.startswith("wingslevel: ")]) == 1, f"{where}\n{stderr}"
        assert _files(folder) == before, where
    elif code == 0:
        _demand_complete(where, folder, stdout, line)


def _try_all(lines: list[list[str]], inputs: dict[str, str], tmp_path: Path, capfd, monkeypatch) -> None:
    faults = []
    for i, line in enumerate(lines):
        try:
            _try(line, inputs, tmp_path / str(i), capfd, monkeypatch)
        except AssertionError as error:
            faults.append(f"{error} <- {error.__cause__!r}")
    assert not faults, "\n".join(faults)
    assert os.getcwd().startswith(str(tmp_path))


def test_command_lines_by_chance_some_end_in_an_exit_code_and_one_line(inputs, tmp_path, capfd, monkeypatch) -> None:
    """The first 40 of them."""
    _try_all(list(command_lines(40)), inputs, tmp_path, capfd, monkeypatch)


@pytest.mark.long
@pytest.mark.parametrize("block", range(10))
def test_command_lines_by_chance_500_end_in_an_exit_code_and_one_line(
    block, inputs, tmp_path, capfd, monkeypatch
) -> None:
    """All 500, fifty at a time."""
    lines = list(command_lines(10 * BLOCK))[block * BLOCK : (block + 1) * BLOCK]
    _try_all(lines, inputs, tmp_path, capfd, monkeypatch)
