"""What is known of the instruments arrives: every suite, every estimator, every autopilot, every command's way in."""

import json
import math
from importlib import import_module

import pytest

from autopilot.airframes import AutopilotParams
from autopilot.dcm import DcmAutopilot
from estimator import ESTIMATORS
from estimator.instruments import BOOLEAN, PROPERTIES, Instruments, Known
from scenarios.harness.commands import compare
from scenarios.harness.config import override
from scenarios.harness.equipping import equipped, equipped_autopilot
from scenarios.harness.flight import fly_scenario, prepare, prepare_config
from scenarios.harness.registry import find
from scenarios.harness.settings import shared_settings
from sim.params import dotted_fields
from sim.sensors.fitting import SUITES

TURNS = find("turns_180")


def aboard(suite, **changes):
    """The record of a flight with that suite."""
    return prepare_config(TURNS, override(TURNS.config, {"suite": suite, **changes}), lenient=True).instruments


def own_parameters(estimator):
    """Names of its parameters, found by constructing it and nothing else."""
    params = getattr(equipped(estimator).code, "params", None)
    return set() if params is None else set(dotted_fields(params))


@pytest.mark.parametrize("suite", sorted(SUITES))
@pytest.mark.parametrize("estimator", sorted(ESTIMATORS))
def test_every_known_property_arrives_at_every_estimator_that_has_a_parameter_for_it(suite, estimator):
    """The value of the data sheet stands in its parameters, and is reported; nothing else is."""
    record = aboard(suite)
    code, known = equipped(estimator, record)
    wanted = own_parameters(estimator) & set(PROPERTIES)
    assert known.keys() == wanted
    for name in wanted & record.given.keys():
        assert getattr(code.params, name) == record[name].value, name
        assert known[name] == record[name]


# Defaults that are no assumption, with the reason.
NOT_ASSUMED = {
    ("ins_ekf", "gps_stamped"): "an unknown stamp is NaN, which the filter takes for none",
    ("premerlani", "force_full_scale_m_s2"): "without a full scale no axis counts as clipped, as in the paper",
}


@pytest.mark.parametrize("estimator", sorted(ESTIMATORS))
def test_default_of_a_parameter_is_what_is_assumed_where_nothing_is_known(estimator):
    """Constructed bare, an estimator flies with the same instruments as one with an empty record; to a rounded 0.1."""
    module, _, name = ESTIMATORS[estimator].partition(":")
    params = getattr(getattr(import_module(module), name)(), "params", None)
    wanted = own_parameters(estimator) & {name for name, known in PROPERTIES.items() if known.assumed is not None}
    assert {name for of, name in NOT_ASSUMED if of == estimator} <= wanted
    for name in wanted - {name for of, name in NOT_ASSUMED if of == estimator}:
        assert getattr(params, name) == pytest.approx(PROPERTIES[name].assumed, rel=0, abs=_rounded(name)), name


def _rounded(name):
    """How far the assumed value of a property is rounded: full scales to a digit after the point."""
    return 0.1 if name.endswith(("full_scale_rad_s", "full_scale_m_s2")) else 0.0


@pytest.mark.parametrize("suite", sorted(SUITES))
def test_every_receiver_is_known_as_its_part_file_says(suite):
    """Filter and latency of the part itself, read from the parameters of the suite; the autopilot's filter too."""
    record, gps = aboard(suite), SUITES[suite].gps
    assert record["gps_filter_s"][:2] == (gps.filter_s, "data sheet")
    assert record["gps_latency_s"][:2] == (gps.latency_s, "data sheet")
    assert record["gps_rate_hz"][:2] == (gps.rate_hz, "data sheet")
    assert record["gps_vertical_velocity"].value is (gps.resolution != "nmea")
    assert record["use_airspeed"].value is (SUITES[suite].airspeed is not None)
    pilot = equipped_autopilot("dcm", "course", "endurance", record)
    assert pilot.code.params.guidance.gps_filter_s == gps.filter_s
    assert pilot.known.keys() == {"gps_filter_s", "elevation_m"}


@pytest.mark.parametrize("suite", sorted(SUITES))
def test_known_is_the_same_for_every_seed(suite):
    """A draw of the seed is nothing that anybody could know."""
    records = [dict(aboard(suite, seed=seed, flight=flight)) for seed, flight in ((0, 0), (1, 0), (1, 3), (77, 0))]
    assert all(record == records[0] for record in records)


@pytest.mark.parametrize("name", sorted(PROPERTIES))
def test_property_that_is_set_wins_over_data_sheet_and_log_and_survives_json(name):
    """By the user, whoever else says something, and also where it is withheld."""
    value = name in BOOLEAN or 0.125
    record = Instruments({name: Known(0.5, "data sheet")}, {name: value}, [name])
    assert record[name] == (value, "set", "")
    assert Known.from_json(json.loads(json.dumps(record[name].to_json()))) == record[name]


def test_property_without_knowledge_is_assumed_or_unknown():
    """A present-day receiver: no filter, a latency between 0.1 and 0.5 s that is not certain, no stamps."""
    record = Instruments()
    assert record["gps_filter_s"] == (0.0, "assumed", "")
    assert record["gps_latency_s"].source == "assumed"
    assert 0.1 <= record.value("gps_latency_s") <= 0.5
    assert record.value("gps_stamped") is False
    assert record["declination_rad"] == (None, "unknown", "")
    assert {entry.source for entry in record.values()} == {"assumed", "unknown"}
    assert Known.from_json(Known(math.inf, "data sheet").to_json()) == (math.inf, "data sheet", "")


def test_latency_that_is_set_is_exact_and_stamps_do_not_overrule_it():
    """What the user sets is never accepted and then ignored."""
    sheet = {"gps_latency_s": Known(0.3, "data sheet"), "gps_stamped": Known(True, "data sheet")}
    assert Instruments(sheet).value("gps_stamped") is True
    assert Instruments(sheet).value("gps_latency_sigma_s") == 0.02
    record = Instruments(sheet, {"gps_latency_s": 0.8})
    assert (record.value("gps_stamped"), record.value("gps_latency_sigma_s")) == (False, 0.0)
    assert Instruments(sheet, {"gps_latency_s": 0.8, "gps_stamped": True}).value("gps_stamped") is True


class Asks:
    """A person's own estimator that asks for a property, and for the record."""

    seen = None

    def __init__(self, gps_latency_s, instruments):
        Asks.seen = gps_latency_s, instruments

    def update(self, m):
        raise NotImplementedError


def test_own_class_is_given_what_its_constructor_asks_for():
    """By name, from a file or as a class from Python; what it is given is reported."""
    for spec in (Asks, f"{__file__}:Asks"):
        made = equipped(spec, aboard("apm2"), {"gps_latency_s": 0.7})
        latency_s, record = type(made.code).seen
        assert latency_s == 0.7
        assert record["gps_latency_s"] == (0.7, "set", "")
        assert record["gps_filter_s"].value == SUITES["apm2"].gps.filter_s
        assert made.known.keys() == set(PROPERTIES)


def test_estimator_that_a_function_makes_keeps_the_parameters_it_was_made_with():
    """Whoever constructs an estimator in Python has set its parameters."""
    from estimator.premerlani import Premerlani, PremerlaniParams

    def make():
        return Premerlani(PremerlaniParams(gps_latency_s=0.9))

    assert equipped(make, aboard("apm2")).code.params.gps_latency_s == 0.9
    assert equipped(Premerlani, aboard("apm2")).code.params.gps_latency_s == SUITES["apm2"].gps.latency_s


def test_flight_from_python_knows_its_instruments_and_keeps_them():
    """The class flown from Python is given the same as by name, and the manifest says what."""
    from estimator.premerlani import Premerlani

    changes = {"suite": "apm2", "duration_s": 0.5}
    manifests = [fly_scenario(TURNS, changes, estimator=spec).manifest for spec in ("premerlani", Premerlani)]
    assert manifests[0]["known_to_estimator"] == manifests[1]["known_to_estimator"]
    assert manifests[0]["known_to_estimator"]["gps_latency_s"] == {"value": 0.2, "source": "data sheet"}
    assert manifests[0]["known"].keys() == set(PROPERTIES)


@pytest.mark.parametrize(("estimator", "setting"), [("premerlani", "gps_rate_hz"), ("gyro_only", "gps_latency_s")])
def test_property_that_is_set_and_that_nobody_takes_is_refused(estimator, setting):
    """Before anything is flown: a setting is never accepted and then ignored.  One that the autopilot takes is fine."""
    with pytest.raises(ValueError, match=f"{setting} = 0.5: neither estimator {estimator} nor autopilot dcm has"):
        prepare(TURNS, {"estimator": estimator, setting: 0.5})
    config = prepare(TURNS, {"estimator": estimator, "gps_filter_s": 0.5}).config
    assert config.instruments == {"gps_filter_s": 0.5}


def test_property_set_for_a_comparison_goes_to_those_that_have_it_and_a_note_lists_the_others():
    """And is refused where none has it."""
    plan = compare.prepare("turns_180", ["premerlani", "gyro_only"], [0], {"gps_latency_s": 0.6})
    assert plan.notes == ("gps_latency_s is set for premerlani; without that parameter: gyro_only",)
    with pytest.raises(ValueError, match=r"gps_latency_s = 0\.6: no estimator has a parameter of that name"):
        compare.prepare("turns_180", ["gyro_only"], [0], {"gps_latency_s": 0.6})


def test_setting_for_one_estimator_wins_over_one_for_all_in_any_order():
    """The more particular one."""
    for names in (("ins_ekf.gps_latency_s", "gps_latency_s"), ("gps_latency_s", "ins_ekf.gps_latency_s")):
        values = {"ins_ekf.gps_latency_s": 0.6, "gps_latency_s": 0.1}
        of_each = shared_settings(["ins_ekf", "premerlani"], {name: values[name] for name in names})
        assert of_each == {"ins_ekf": {"gps_latency_s": 0.6}, "premerlani": {"gps_latency_s": 0.1}}


class Patient(DcmAutopilot):
    """A person's own variant of the autopilot, which chooses its parameters itself."""

    def __init__(self, heading_reference="course", aircraft="endurance"):
        super().__init__(AutopilotParams(), heading_reference, aircraft)


def test_own_autopilot_that_chooses_its_parameters_itself_keeps_them():
    """Its constructor takes none: it is given none, and says so."""
    made = equipped_autopilot(f"{__file__}:Patient", "nose", "endurance", aboard("ideal"))
    assert made.code.params == AutopilotParams()
    assert made.code.heading_reference == "nose"
    assert made.known == {}
