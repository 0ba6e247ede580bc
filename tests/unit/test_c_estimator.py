"""Estimators in C: the structs of the header, the example against Python, what is rejected, and every command."""

import ctypes
import gc
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import wingslevel
from estimator.complementary import Complementary
from estimator.interface import MEASURED_DTYPE, Health, ImuSample, Measurements
from scenarios.harness import c_library, logs
from scenarios.harness.c_library import ESTIMATE, MEASUREMENTS
from scenarios.harness.cli.app import run
from scenarios.harness.equipping import equipped, load_estimator, parameters_of
from scenarios.harness.flight import fly_scenario, prepare
from scenarios.harness.gate import sources
from scenarios.harness.parameters import Parameter, estimator_parameters
from scenarios.harness.plugins import PluginError, short_name
from scenarios.harness.registry import find
from scenarios.harness.replay import replay
from sim import recording
from sim.log import Outcome

EXAMPLES = Path(wingslevel.get_include()).parent / "examples"
# An estimator that is always level, with something wrong or odd as macros say.
SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <wingslevel_estimator.h>
#ifndef PREFIX
#define PREFIX wingslevel
#endif
#ifndef VERSION
#define VERSION WINGSLEVEL_ABI_VERSION
#endif
#ifndef NAME
#define NAME "level"
#endif
#ifndef REFERENCE
#define REFERENCE WINGSLEVEL_NOSE
#endif
#ifndef USES
#define USES WINGSLEVEL_GYRO
#endif
#ifndef FLAGS
#define FLAGS 0
#endif
#ifndef SECOND
#define SECOND "gps_latency_s"
#endif
#ifndef SIZE
#define SIZE sizeof(wingslevel_description)
#endif
#ifndef FOUND
#define FOUND &DESCRIPTION
#endif
#ifndef UPDATE
#define UPDATE
#endif
#define FUNCTIONS(prefix) WINGSLEVEL_ESTIMATOR(prefix)
#define JOINED(prefix, name) prefix##_##name
#define NAMED(prefix, name) JOINED(prefix, name)
FUNCTIONS(PREFIX)

static const wingslevel_parameter PARAMETERS[] = {
    {"k_p", "1/s", 0.5, "gain higher: quicker; lower: steadier"},
    {SECOND, "s", 0.3, "of the receiver"}, {"use_airspeed", "", 0.0, "a flag"}};
static const wingslevel_description DESCRIPTION = {SIZE, VERSION, NAME, "Always level.", REFERENCE, USES, FLAGS,
    sizeof(wingslevel_parameter), 3, PARAMETERS};
int living;
static int updates;
typedef struct { double k_p, latency_s, airspeed, ground[2]; int64_t ticks; } level;

const wingslevel_description *NAMED(PREFIX, describe)(uint32_t version)
{
    return version ? FOUND : &DESCRIPTION;
}
void *NAMED(PREFIX, create)(const double *p, char *message, uint64_t size)
{
    level *s;
    if (p[0] < 0.0) {
        strncpy(message, "k_p is below zero", (size_t)size);
        return NULL;
    }
    if (p[0] > 100.0) return NULL;
    s = calloc(1, sizeof *s);
    s->k_p = p[0], s->latency_s = p[1], s->airspeed = p[2];
    living++;
    return s;
}
void NAMED(PREFIX, reset)(void *object, const wingslevel_measurements *on_ground)
{
    level *s = object;
    s->ticks = 0;
    s->ground[0] = on_ground ? on_ground->force_b_m_s2[2] : 1.0;
    s->ground[1] = on_ground ? on_ground->dt_s : 1.0;
}
int32_t NAMED(PREFIX, update)(void *object, const wingslevel_measurements *m, wingslevel_estimate *e)
{
    level *s = object;
    int i;
    s->ticks++;
    updates++;
    for (i = 0; i < 3; i++) e->R_eb[i][0] = e->R_eb[i][1] = e->R_eb[i][2] = 0.0, e->R_eb[i][i] = 1.0;
    e->omega_b_rad_s[0] = s->k_p, e->omega_b_rad_s[1] = s->latency_s, e->omega_b_rad_s[2] = s->airspeed;
    e->gyro_bias_b_rad_s[0] = s->ground[0], e->gyro_bias_b_rad_s[1] = s->ground[1];
    e->gyro_bias_b_rad_s[2] = (double)updates;
    (void)m;
    UPDATE;
    return 0;
}
void NAMED(PREFIX, destroy)(void *object) { free(object); living--; }
"""


@pytest.fixture
def level(build, tmp_path, monkeypatch):
    """Builds `SOURCE` with macros, in the working directory, as ``level.so`` or another name."""
    monkeypatch.chdir(tmp_path)

    def _level(name="level", **macros):
        return build(SOURCE, f"{name}.c", *(f"-D{macro}={value}" for macro, value in macros.items()))

    return _level


@pytest.fixture
def example(build, tmp_path, monkeypatch):
    """The example in C, built, in the working directory."""
    monkeypatch.chdir(tmp_path)
    return build(EXAMPLES / "complementary.c")


def one_row(**columns):
    """Measurements of one tick, level at rest."""
    rows = np.zeros(1, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"], rows["force_b_m_s2"] = 0.02, 0.02, [0.0, 0.0, -9.8]
    for name, value in columns.items():
        rows[name] = value
    return Measurements(rows, 0)


def offsets(struct):
    """Offset of each field of a structure of ctypes."""
    return {name: getattr(struct, name).offset for name, _ in struct._fields_}


def test_structs_have_the_layout_of_the_header(build, tmp_path):
    """Every offset and size, as the compiler has them: what the header says is what is handed over."""
    structs = {
        "wingslevel_measurements": {name: MEASUREMENTS.fields[name][1] for name in MEASUREMENTS.names},
        "wingslevel_estimate": {name: ESTIMATE.fields[name][1] for name in ESTIMATE.names},
        "wingslevel_parameter": offsets(c_library._Parameter),
        "wingslevel_description": offsets(c_library._Description),
    }
    numbers = [f"offsetof({struct}, {name})" for struct, names in structs.items() for name in names]
    sizes = [f"sizeof({struct})" for struct in structs]
    library = build(
        "#include <stddef.h>\n#include <wingslevel_estimator.h>\nextern const uint64_t found[];\n"
        f"const uint64_t found[] = {{{', '.join(numbers + sizes)}}};\n",
        "layout.c",
    )
    found = (ctypes.c_uint64 * (len(numbers) + len(sizes))).in_dll(ctypes.CDLL(str(library)), "found")
    expected = [offset for names in structs.values() for offset in names.values()]
    expected += [
        MEASUREMENTS.itemsize, ESTIMATE.itemsize, ctypes.sizeof(c_library._Parameter),
        ctypes.sizeof(c_library._Description),
    ]  # fmt: skip
    assert list(found) == expected


def test_measurements_of_version_1_are_these_columns():
    """Other columns may follow in a later version; none of these may move or go."""
    assert MEASUREMENTS.names[2:] == MEASURED_DTYPE.names[:16]
    assert (MEASUREMENTS.itemsize, ESTIMATE.itemsize) == (216, 160)


def test_every_column_arrives_whatever_the_rows_are_laid_out_like(build, tmp_path):
    """Each number of a row is echoed, from rows of a log, from every second row, and from rows with other columns."""
    source = SOURCE.replace("UPDATE;\n", "memcpy(e->R_eb, (const char *)m + 8 * (int)s->k_p, 8);\n")
    spec = f"{build(source, 'echo.c')}"
    numbers = 26  # eight bytes each, behind the two first numbers
    rows = np.zeros(6, MEASURED_DTYPE)
    rows.view("f8")[:] = np.arange(6 * numbers) + 0.5
    for name in MEASURED_DTYPE.names:
        if MEASURED_DTYPE[name].kind == "i":
            rows[name] = np.arange(6) + 7
    wide = np.zeros(6, [("first", "f8"), *((n, MEASURED_DTYPE[n]) for n in reversed(MEASURED_DTYPE.names))])
    for name in MEASURED_DTYPE.names:
        wide[name] = rows[name]
    wanted = rows.view("u8").reshape(6, numbers)
    for laid_out, step in ((rows, 1), (rows[::2], 2), (wide, 1)):
        for i in range(numbers):
            estimator = equipped(spec, settings={"k_p": i + 1.0}).code
            got = estimator.update(Measurements(laid_out, 2)).R_eb[0, 0]
            assert np.float64(got).view("u8") == wanted[2 * step, i], (i, step)


def test_example_in_c_is_the_python_filter(example):
    """The same operations in the same order: 1e-12, for libm's sine and NumPy's may differ in the last bit."""
    log = fly_scenario(find("crosswind"), {"duration_s": 20.0, "estimator": "complementary"}).log
    known = {"gps_latency_s": 0.3, "gps_filter_s": 1.0}
    ours, theirs = (equipped(spec, settings=known).code for spec in ("complementary", str(example)))
    on_ground = ImuSample(2.0, 0.02, np.array([0.01, -0.02, 0.03]), np.array([1.0, -0.5, -9.7]))
    for estimator in (ours, theirs):
        estimator.reset(on_ground)
    python = ours.replay(log.measured)
    c = [theirs.update(Measurements(log.measured, k)) for k in range(len(log))]
    for name in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s"):
        np.testing.assert_allclose([getattr(e, name) for e in c], python[name], rtol=0, atol=1e-12)
    np.testing.assert_array_equal([e.health for e in c], python["health"])
    assert theirs.rejected == ours.rejected


def test_example_in_c_follows_the_python_filter_through_bad_samples(example):
    """NaN, absurd numbers, repeated and lost ticks: the same samples are rejected."""
    rng = np.random.default_rng(1)
    rows = np.zeros(600, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, 601), 0.02
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = rng.normal(0, 0.3, (600, 3)), rng.normal([0, 0, -9.8], 1.0, (600, 3))
    rows["gps_new"][::10], rows["gps_v_e_m_s"] = 1, [8.0, 9.0, 0.5]
    rows["gyro_b_rad_s"][100:130, 1], rows["force_b_m_s2"][150] = np.nan, 1e30
    rows["gps_v_e_m_s"][200], rows["t_s"][250], rows["dt_s"][260] = np.inf, rows["t_s"][249], np.nan
    rows["t_s"][300:] += 0.1
    rows["t_s"][400:] -= 5.0
    rows["gps_new"][450:] = 0
    ours, theirs = Complementary(), load_estimator(str(example))
    python = ours.replay(rows)
    c = [theirs.update(Measurements(rows, k)) for k in range(600)]
    np.testing.assert_allclose([e.R_eb for e in c], python["R_eb"], rtol=0, atol=1e-9)
    np.testing.assert_array_equal([e.health for e in c], python["health"])
    assert theirs.rejected == ours.rejected == 35  # 30 of the gyro; force, fix, two times, the clock set back


@pytest.mark.parametrize("seed", range(3))
def test_example_never_leaves_the_rotations_whatever_the_samples_are(example, seed):
    """Any number in any column at any time, and a clock that leaps: a rotation and finite rates at every tick."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(3000, MEASURED_DTYPE)
    rows["t_s"] = np.cumsum(rng.choice([0.02, 0.02, 0.02, 0.0, -0.5, -1.5, 0.3, 1e6], 3000))
    rows["dt_s"] = 0.02
    absurd = np.array([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e30, 5e-324, 36.0, -36.0, 160.0, 999.0, 0.0, -1.0])
    for name in MEASURED_DTYPE.names:
        if MEASURED_DTYPE[name].kind == "i":
            rows[name] = rng.integers(0, 2, 3000)
        elif name != "t_s":
            hit = rng.random(rows[name].shape) < 0.05
            if name != "dt_s":
                rows[name] = rng.normal(0.0, 10.0, rows[name].shape)
            rows[name][hit] = rng.choice(absurd, np.count_nonzero(hit))
    estimator = load_estimator(str(example))
    for k in range(len(rows)):
        estimate = estimator.update(Measurements(rows, k))
        assert np.abs(estimate.R_eb @ estimate.R_eb.T - np.eye(3)).max() < 1e-2
        assert np.linalg.det(estimate.R_eb) > 0.0
        assert np.all(np.isfinite([estimate.omega_b_rad_s, estimate.gyro_bias_b_rad_s]))
    assert estimator.rejected > 1000


def test_example_turns_fast_rotations_in_parts(example):
    """At 20 rad/s for 0.2 s: three parts a tick of 0.133 rad, each short by a third of its cube."""
    estimator = load_estimator(str(example))
    for k in range(10):
        last = estimator.update(one_row(t_s=0.02 * (k + 1), gyro_b_rad_s=[0.0, 0.0, 20.0]))
    np.testing.assert_allclose(last.R_eb, Rotation.from_euler("z", 4.0 - 0.0237).as_matrix(), rtol=0, atol=1e-3)


def test_example_flown_and_replayed_is_the_same_to_the_last_bit(example, tmp_path):
    """The recording of its flight through the same library: no state is left over, nothing depends on the loop."""
    flight = fly_scenario(find("hand_launch"), {"duration_s": 12.0}, seed=2, estimator=str(example))
    log = logs.read(recording.save(flight, tmp_path / "flight"))
    replayed = replay(log, str(example))
    assert not replayed.failure
    for column in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "health"):
        got, flown = replayed.log.flown[column], flight.log.flown[column]
        np.testing.assert_array_equal(got[replayed.first :], flown[replayed.first :])
    assert replayed.rejected == 0
    assert replayed.known["gps_latency_s"].source == "data sheet"


def test_class_of_a_library_says_what_the_library_says(level):
    """Heading reference, instruments, parameters with unit, default and doc."""
    estimator = load_estimator(str(level()))
    assert (estimator.heading_reference, estimator.uses) == ("nose", ("gyro",))
    assert type(estimator).__name__ == "level"
    assert type(estimator).__doc__ == "Always level."
    assert parameters_of(str(level())) == {"k_p", "gps_latency_s", "use_airspeed"}
    assert (estimator.params.k_p, estimator.params.use_airspeed) == (0.5, False)
    k_p, latency, flag = estimator_parameters(str(level()))
    assert k_p == Parameter("k_p", 0.5, "1/s", "gain", "quicker", "steadier")
    assert (latency.unit, latency.meaning, flag.unit, flag.default) == ("s", "of the receiver", "switch", False)


def test_estimate_that_sets_the_attitude_alone_has_the_usual_rest(level):
    """As in Python: rates of what was set, no wind, good health, no count of rejected samples."""
    estimator = load_estimator(str(level()))
    assert estimator.rejected is None
    estimate = estimator.update(one_row())
    assert (estimate.wind_e_m_s, estimate.health, estimator.rejected) == (None, Health.GOOD, None)
    np.testing.assert_array_equal(estimate.R_eb, np.eye(3))


def test_estimate_carries_wind_health_and_rejected_samples(level):
    """What a library may say besides."""
    says = "e->wind_e_m_s[0]=1;e->wind_e_m_s[1]=2;e->wind_e_m_s[2]=3;e->health=2;e->rejected=4"
    estimator = load_estimator(str(level(UPDATE=says)))
    estimate = estimator.update(one_row())
    np.testing.assert_array_equal(estimate.wind_e_m_s, [1.0, 2.0, 3.0])
    assert (estimate.health, estimator.rejected) == (Health.POOR, 4)
    estimator.reset()
    assert estimator.rejected is None


def test_reset_hands_over_the_sample_on_the_ground(level):
    """Or null where the flight starts in the air."""
    estimator = load_estimator(str(level()))
    estimator.reset(ImuSample(2.0, 0.02, np.zeros(3), np.array([0.0, 0.0, -9.5])))
    np.testing.assert_array_equal(estimator.update(one_row()).gyro_bias_b_rad_s[:2], [-9.5, 0.02])
    estimator.reset(None)
    np.testing.assert_array_equal(estimator.update(one_row()).gyro_bias_b_rad_s[:2], [1.0, 1.0])


def test_parameters_are_set_by_the_user_and_by_what_is_known_of_the_instruments(level):
    """``--set estimator_params.k_p=2``; the latency is that of the receiver; a flag is a truth value."""
    spec = str(level())
    prepared = prepare("crosswind", {"estimator": spec, "estimator_params.k_p": 2.0})
    assert (prepared.estimator.code.params.k_p, prepared.estimator.known["gps_latency_s"].value) == (2.0, 0.3)
    estimator = equipped(spec, settings={"k_p": 2.0, "gps_latency_s": 0.7, "use_airspeed": True}).code
    np.testing.assert_array_equal(estimator.update(one_row()).omega_b_rad_s, [2.0, 0.7, 1.0])
    with pytest.raises(ValueError, match=r"unknown parameter 'k_q' of estimator .*level\.so: did you mean k_p"):
        equipped(spec, settings={"k_q": 1.0})
    with pytest.raises(PluginError, match=r"level\.so: k_p is below zero"):
        equipped(spec, settings={"k_p": -1.0})
    with pytest.raises(PluginError, match=r"level\.so: create returned null and gave no reason"):
        equipped(spec, settings={"k_p": 101.0})


def test_objects_of_a_library_share_no_state_and_are_destroyed(level):
    """As many objects as instances, and none left when these are gone."""
    library = level()
    living = ctypes.c_int.in_dll(ctypes.CDLL(str(library)), "living")
    one, other = load_estimator(str(library)), load_estimator(str(library))
    assert living.value == 2
    one.reset(ImuSample(2.0, 0.02, np.zeros(3), np.array([0.0, 0.0, -9.5])))
    assert one.update(one_row()).gyro_bias_b_rad_s[0] == -9.5
    assert other.update(one_row()).gyro_bias_b_rad_s[0] == 0.0
    del one, other
    gc.collect()
    assert living.value == 0


@pytest.mark.parametrize(("flags", "expected"), [("0", 4.0), ("WINGSLEVEL_STATIC_STATE", 1.0)])
def test_static_variables_are_shared_unless_the_library_says_that_it_has_state_in_them(level, flags, expected):
    """Then each object has its own copy of the library."""
    spec = str(level(FLAGS=flags))
    one, other = load_estimator(spec), load_estimator(spec)
    for _ in range(3):
        one.update(one_row())
    assert other.update(one_row()).gyro_bias_b_rad_s[2] == expected


def test_returned_arrays_are_the_callers_to_keep(level):
    """Writing on an estimate changes no later one."""
    estimator = load_estimator(str(level()))
    first = estimator.update(one_row())
    for array in (first.R_eb, first.omega_b_rad_s, first.gyro_bias_b_rad_s):
        array[:] = np.nan
    assert np.all(np.isfinite(estimator.update(one_row()).R_eb))


def test_row_beyond_the_log_is_no_read_beyond_it(level):
    """An index that cannot be raises, as NumPy would."""
    estimator = load_estimator(str(level()))
    for k in (-1, 1):
        with pytest.raises(IndexError):
            estimator.update(Measurements(one_row().rows, k))


@pytest.mark.parametrize(
    ("macros", "says"),
    [
        ({"VERSION": "3"}, "level.so is built for version 3 of the interface, not 2: rebuild it with the header"),
        ({"VERSION": "0"}, "is built for version 0"),
        ({"FOUND": "NULL"}, "level.so does not offer version 2 of the interface"),
        ({"SIZE": "8"}, "describes itself in 8 and 32 bytes, too few"),
        ({"REFERENCE": "7"}, "heading_reference is 7; it must be 0 (course) or 1 (nose)"),
        ({"USES": "64"}, "uses is 0x40; it must be made of the bits of gyro"),
        ({"NAME": '"two words"'}, "name is called 'two words'; it must be an identifier"),
        ({"NAME": "NULL"}, "name is called ''; it must be an identifier"),
        ({"SECOND": '"k_p"'}, "two parameters are called k_p"),
        ({"SECOND": '"a.b"'}, "parameter 1 is called 'a.b'"),
        ({"PREFIX": "other"}, "has no function wingslevel_describe: declare all five with WINGSLEVEL_ESTIMATOR(wingsl"),
    ],
)
def test_library_that_cannot_be_used_is_one_line_and_exit_code_2(level, capsys, macros, says):
    """Before anything is flown."""
    level(**macros)
    _refused(capsys, "./level.so", says)


def _refused(capsys, spec, says):
    assert run(["fly", "crosswind", "--estimator", spec]) == 2
    said = capsys.readouterr()
    (line,) = said.err.strip().splitlines()
    assert line.startswith(f"wingslevel: estimator {spec!r}: ")
    assert says in line
    assert not Path("flights").exists()


def test_file_that_is_no_library_is_one_line_and_exit_code_2(example, capsys):
    """Missing, text, of another machine, cut short: in words that say what to do."""
    _refused(capsys, "./absent.so", "no file 'absent.so'")
    Path("text.so").write_text("int main;", encoding="utf-8")
    _refused(capsys, "./text.so", "text.so is not a shared library: build one with cc -shared -fPIC")
    data = bytearray(example.read_bytes())
    Path("cut.so").write_bytes(data[:100])
    _refused(capsys, "./cut.so", "cannot be loaded: ")
    data[18:20] = (243).to_bytes(2, "little")
    Path("foreign.so").write_bytes(data)
    _refused(capsys, "./foreign.so", f"foreign.so is built for riscv, this machine is {os.uname().machine}")
    _refused(capsys, "./complementary.so:mine", "complementary.so has no function mine_describe")


def test_prefix_names_one_of_several_estimators_of_a_library(level):
    """``level.so:other`` has functions other_describe and so on, and goes by that name."""
    spec = f"{level(PREFIX='other')}:other"
    assert load_estimator(spec).params.k_p == 0.5
    assert (short_name(spec), short_name("./build/mine.so"), short_name("libmine.so.1:x")) == ("other", "mine", "x")


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ("return 3", "update returned 3; it must return 0"),
        ("e->R_eb[0][0]=NAN", "R_eb is not finite"),
        ("e->R_eb[0][0]=2", "R_eb is not a rotation"),
        ("e->health=9", "health is"),
        ("e->omega_b_rad_s[1]=INFINITY", "omega_b_rad_s is not finite"),
        ("e->wind_e_m_s[0]=1e30", "wind_e_m_s is beyond"),
        ("e->rejected=0;memset(e->R_eb,0,72)", "R_eb is not a rotation"),
    ],
)
def test_answer_that_is_none_ends_the_flight_as_failed(level, wrong, says):
    """The recording up to there is kept, one line names the estimator, the time and the fault."""
    spec = str(level(UPDATE=f"if(m->t_s>0.5){{{wrong};}}"))
    flight = fly_scenario(find("crosswind"), {"duration_s": 2.0}, estimator=spec)
    assert flight.outcome == Outcome.ESTIMATOR_FAILED
    assert flight.message.startswith("level at 0.52 s: ")
    assert says in flight.message
    assert len(flight.log) == 25


def test_ledger_knows_a_library_by_its_bytes(level):
    """One that is built anew, from another source, is another estimator; the same bytes elsewhere are the same."""
    first, second = level("first"), level("second", NAME='"second"')
    copy = shutil.copy(first, first.with_name("copy.so"))
    found = [sources._of_code("estimator", str(path), c_library.__name__) for path in (first, second, copy)]
    assert found[0] == found[2] != found[1]
    assert len(found[0]) == 64
    prints = [sources.fingerprint(sources.decided_by("crosswind", prepare("crosswind", {"estimator": str(path)})))
              for path in (first, second)]  # fmt: skip
    assert prints[0] != prints[1]


def test_manifest_holds_the_hash_of_the_library(example):
    """So that a recording says which build has flown."""
    manifest = fly_scenario(find("crosswind"), {"duration_s": 0.5}, estimator="./complementary.so").manifest
    assert manifest["estimator_sha256"] == sources._of_code("estimator", str(example), "")
    assert manifest["known_to_estimator"]["gps_latency_s"] == {"value": 0.3, "source": "data sheet"}


def test_every_command_takes_a_library(example, in_process, capsys):
    """fly, check, compare, replay and bench, with the same spelling of a parameter."""
    spec, short = "./complementary.so", ["--set", "duration_s=3"]
    assert run(["fly", "crosswind", "--estimator", spec, *short, "--set", "complementary.tilt_s=9"]) in (0, 1)
    manifest = json.loads(Path("flights/crosswind-complementary-seed0/manifest.json").read_text())
    assert manifest["config"]["estimator_params"] == {"tilt_s": 9}
    assert run(["check", "crosswind", "--seeds", "0-1", "--workers", "1", "--estimator", spec, *short]) in (0, 1)
    compared = ["compare", "crosswind", "--seeds", "0", "--workers", "1", "--estimators", f"{spec},gyro_only"]
    assert run([*compared, "--set", "complementary.tilt_s=9", *short]) == 0
    replayed = ["replay", "flights/crosswind-complementary-seed0", "--estimator", f"{spec},gyro_only"]
    assert run([*replayed, "--no-rerun", "--settle", "0", "--set", "complementary.tilt_s=9", "--json", "r.json"]) == 0
    assert json.loads(Path("r.json").read_text())["estimators"]["complementary"]["heading_reference"] == "course"
    assert run(["bench", "--estimator", spec, "--seconds", "2", "--repeats", "3"]) in (0, 1)


def test_python_flies_a_library(example):
    """``wl.fly(estimator="mine.so")``."""
    flight = wingslevel.fly("crosswind", estimator="./complementary.so", params={"tilt_s": 9.0}, duration=2.0)
    assert flight.outcome == "completed"


def test_include_folder_is_printed_for_the_compiler():
    """``cc -I"$(python -m wingslevel.include)"``."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "wingslevel.include"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert done.stdout == f"{wingslevel.get_include()}\n"
    assert Path(wingslevel.get_include(), "wingslevel_estimator.h").is_file()
