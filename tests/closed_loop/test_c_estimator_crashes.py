"""A shared library that crashes, exits or hangs costs its own flight: a verdict comes out, and the others fly."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-c", "from scenarios.harness.gate.guard import main; main()"]
# Level for a second; then whatever CRASH says, where a bit of the noise of this flight is set.
SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include <unistd.h>
#include <wingslevel_estimator.h>
WINGSLEVEL_ESTIMATOR(wingslevel)
static const wingslevel_description DESCRIPTION = {sizeof(wingslevel_description), WINGSLEVEL_ABI_VERSION, "crashes",
    "", WINGSLEVEL_COURSE, WINGSLEVEL_GYRO, 0, sizeof(wingslevel_parameter), 0, 0};
static volatile int *volatile nowhere;
const wingslevel_description *wingslevel_describe(uint32_t version) { AT_LOAD; return version ? &DESCRIPTION : 0; }
void *wingslevel_create(const double *p, char *message, uint64_t size)
{
    (void)p, (void)message, (void)size;
    return malloc(1);
}
void wingslevel_reset(void *object, const wingslevel_measurements *on_ground) { (void)object, (void)on_ground; }
int32_t wingslevel_update(void *object, const wingslevel_measurements *m, wingslevel_estimate *e)
{
    int i;
    (void)object, (void)nowhere;
    for (i = 0; i < 3; i++) e->R_eb[i][0] = e->R_eb[i][1] = e->R_eb[i][2] = 0.0, e->R_eb[i][i] = 1.0;
    if (m->t_s > 1.0 && WHEN) CRASH;
    return 0;
}
void wingslevel_destroy(void *object) { free(object); }
"""
SEGFAULT = "*nowhere = 1"


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """The kernels that the commands need."""
    for estimator in ("premerlani", "gyro_only"):
        fly_scenario(find("crosswind"), {"duration_s": 1.0}, estimator=estimator)


@pytest.fixture
def crashing(build):
    """Builds a library that crashes in this way."""

    def _crashing(crash, when="1", at_load="(void)0"):
        macros = (f"-DCRASH={crash}", f"-DWHEN={when}", f"-DAT_LOAD={at_load}")
        return build(SOURCE, "crashes.c", "-std=gnu99", *macros)

    return _crashing


def wingslevel(here: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command, run to its end."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [*COMMAND, *arguments], cwd=here, env=environment, text=True, capture_output=True, timeout=300
    )


QUICK = ("--set", "duration_s=2", "--no-rerun", "--json", "-")


@pytest.mark.parametrize(
    ("crash", "options", "outcome", "says"),
    [
        (SEGFAULT, (), "worker_died", "was killed by signal 11"),
        ("abort()", (), "worker_died", "was killed by signal 6"),
        ("_exit(0)", (), "worker_died", "ended by itself (exit code 0)"),
        ("exit(0)", (), "worker_died", "ended by itself (exit code 0)"),
        (
            "for (;;) nowhere = 0",
            ("--flight-timeout", "3"),
            "timed_out",
            "gave no answer within the time limit and was stopped",
        ),
    ],
)
def test_fly_library_that_crashes_is_reported_with_exit_code_1(crashing, tmp_path, crash, options, outcome, says):
    """Segmentation fault, abort, exit, a loop without end: one verdict, which fails, and says what became of it."""
    crashing(crash)
    done = wingslevel(tmp_path, "fly", "crosswind", "--estimator", "./crashes.so", *QUICK, *options)
    (flight,) = json.loads(done.stdout)["flights"]
    assert (done.returncode, flight["outcome"]) == (1, outcome)
    assert says in flight["message"]
    assert "Traceback" not in done.stderr


def test_fly_library_that_crashes_while_it_is_loaded_is_exit_code_2(crashing, tmp_path):
    """Nothing was flown."""
    crashing(SEGFAULT, at_load=SEGFAULT)
    done = wingslevel(tmp_path, "fly", "crosswind", "--estimator", "./crashes.so", *QUICK)
    assert (done.returncode, done.stdout) == (2, "")
    assert "was killed by signal 11" in done.stderr


def test_check_flights_of_a_library_that_does_not_crash_in_them_are_judged(crashing, tmp_path):
    """It crashes where the noise of a flight has it so: these flights are lost, the others have their numbers."""
    crashing(SEGFAULT, when="fmod(fabs(m->gyro_b_rad_s[0]) * 1e6, 1.0) < 0.014")
    arguments = ["check", "crosswind", "--seeds", "0-5", "--workers", "2", "--set", "duration_s=2", "--json", "-"]
    done = wingslevel(tmp_path, *arguments, "--estimator", "./crashes.so")
    outcomes = [flight["outcome"] for flight in json.loads(done.stdout)["flights"]]
    assert done.returncode == 1
    assert len(outcomes) == 6
    assert set(outcomes) == {"worker_died", "completed"}


def test_compare_and_replay_leave_the_other_estimators_their_numbers(crashing, tmp_path):
    """Side by side with a library that crashes, the others are as they are without it."""
    crashing(SEGFAULT)
    options = ["--seeds", "0", "--set", "duration_s=2", "--json", "-"]
    done = wingslevel(tmp_path, "compare", "crosswind", "--estimators", "./crashes.so,gyro_only", *options)
    flights = json.loads(done.stdout)["flights"]
    assert done.returncode == 1
    assert {flight["estimator"]: flight["outcome"] for flight in flights} == {
        "./crashes.so": "worker_died", "gyro_only": "completed",
    }  # fmt: skip
    assert wingslevel(tmp_path, "fly", "crosswind", *QUICK).returncode in (0, 1)
    log = ["flights/crosswind-premerlani-seed0", "--estimator", "./crashes.so,gyro_only", "--json", "-"]
    done = wingslevel(tmp_path, "replay", *log)
    each = json.loads(done.stdout)["estimators"]
    assert done.returncode == 1
    assert "was killed by signal 11" in each["crashes"]["failure"]
    assert "failure" not in each["gyro_only"]
