"""The configuration of one flight: what flies, where from, through what air, with which sensors, for how long.

A configuration may leave values to chance (``"random"``).  `resolve` draws each of them once, from its named stream.
The resolved configuration goes into the manifest, from which the flight can be repeated.
"""

import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from estimator.instruments import PROPERTIES, property_names, property_value
from estimator.interface import MEASURED_DTYPE
from scenarios.harness.config.air import AirConfig as AirConfig  # scenarios find it beside the rest
from scenarios.harness.config.air import parse_wind, resolve_air
from scenarios.harness.config.battery import BatteryConfig
from scenarios.harness.config.faults import require_faults_possible, typed_faults
from scenarios.harness.config.fence import FenceConfig, within_box
from scenarios.harness.config.place import PlaceConfig
from scenarios.harness.config.start import AnyStart, BenchStart, HandThrowStart, InFlightStart, resolve_start
from scenarios.harness.config.tolerances import AirframeConfig, TolerancesConfig, resolve_airframe
from scenarios.harness.config.validation import validated
from scenarios.harness.plugins import Maker
from scenarios.harness.seeds import LARGEST_SEED
from scenarios.harness.settings import parameter_name
from sim.clock import Rates, physics_hz
from sim.log import FLOWN_DTYPE, TRUTH_DTYPE
from sim.outside.numbers import RIGHT, is_odd, number
from sim.outside.wording import printable
from sim.params import changed as change_params
from sim.params import dotted_fields, require_fitted, shown, unit_of
from sim.sensors.fitting import SuiteParams, own_files, suite_params

MOST_BYTES = 2_000_000_000  # of a flight's log, which is held in memory
ROW_BYTES = sum(dtype.itemsize for dtype in (TRUTH_DTYPE, MEASURED_DTYPE, FLOWN_DTYPE))
SMALLEST, LARGEST = 1e-12, 1e9  # size of a non-zero number, in any unit

Figure = float | bool | str | tuple[float, ...]  # type of a sensor field; the dataclass says which


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class RatesConfig(_Model):
    """Rates in hertz; the slower ones divide the physics rate (`sim.clock.Rates`).

    physics_hz : None is 200 Hz, or the inertial rate where that is higher
    gps_hz : None is the rate of the receiver that is fitted; a resolved configuration holds the numbers
    """

    physics_hz: int | None = None
    imu_hz: int = 50
    gps_hz: float | None = None

    @model_validator(mode="after")
    def _divide(self) -> "RatesConfig":
        if self.gps_hz is None:
            Rates(self.physics_hz or physics_hz(self.imu_hz), self.imu_hz)
        else:
            self.build()
        return self

    def build(self) -> Rates:
        """The clock of these rates; ValueError if the GPS rate is still the receiver's own."""
        if self.gps_hz is None:
            raise ValueError("rates.gps_hz = None: resolve the configuration first")
        return Rates(self.physics_hz or physics_hz(self.imu_hz), self.imu_hz, self.gps_hz)


class FlightConfig(_Model):
    """Everything that decides a flight, apart from the code.

    estimator, autopilot : a registered name, ``module:Class`` or ``file.py:Class``; an estimator also ``library.so``
    estimator_params : fields of the estimator's parameter dataclass
    instruments : properties of the instruments set by the user, ``{"gps_latency_s": 1.0}``: every estimator and
    autopilot with a parameter of that name gets them instead of the figures of the suite
    withheld : names of properties to hide from flight code
    duration_s : after the release          suite, sensors : name of the suite or ``path/to/suite.toml``, and fields
    changed in it by their dotted names, ``{"gps.latency_s": 1.0}``
    turn_table : the magnetometer was turned on a table before the flight: an estimator with a parameter
    ``calibration`` is given the result, see `aboard`
    files : path -> text of the user's own sensor files; a resolved configuration holds them
    airframe, tolerances : differences of the aeroplane from its drawing, and the deviations they are drawn from
    manoeuvre : the scenario's own parameters
    faults : of sensors, surfaces and motor, each as text, ``gyro.x:stuck@20-25``, see `config.faults.parse_fault`
    fence : the geofence, see `config.fence`
    box_radius_m, box_height_m : of the cylinder around the launch point; the flight ends when it is left
    seed, flight : campaign, and number of the flight in it: they name the random streams
    """

    aircraft: str = "endurance"
    estimator: str = "premerlani"
    estimator_params: dict[str, Any] = Field(default_factory=dict)
    instruments: dict[str, float | bool] = Field(default_factory=dict)
    withheld: tuple[str, ...] = ()
    autopilot: str = "dcm"
    duration_s: float = Field(default=60.0, gt=0.0, le=36000.0)
    rates: RatesConfig = Field(default_factory=RatesConfig)
    suite: str = "generic"
    sensors: dict[str, Figure] = Field(default_factory=dict)
    turn_table: bool = False
    files: dict[str, str] = Field(default_factory=dict)
    faults: tuple[str, ...] = ()
    battery: BatteryConfig = Field(default_factory=BatteryConfig)
    air: AirConfig = Field(default_factory=AirConfig)
    place: PlaceConfig = Field(default_factory=PlaceConfig)
    airframe: AirframeConfig = Field(default_factory=AirframeConfig)
    tolerances: TolerancesConfig = Field(default_factory=TolerancesConfig)
    start: Annotated[AnyStart, Field(discriminator="kind")] = Field(default_factory=InFlightStart)
    manoeuvre: dict[str, float] = Field(default_factory=dict)
    fence: FenceConfig = Field(default_factory=FenceConfig)
    box_radius_m: float = Field(default=3000.0, gt=0.0, le=20000.0)
    box_height_m: float = Field(default=1000.0, gt=0.0, le=5000.0)
    seed: int = Field(default=0, ge=0, le=LARGEST_SEED)
    flight: int = Field(default=0, ge=0, le=LARGEST_SEED)

    @field_validator("faults", mode="before")
    @classmethod
    def _typed_faults(cls, faults: Any) -> Any:
        return typed_faults(faults)

    @field_validator("instruments", mode="before")
    @classmethod
    def _known_properties(cls, values: Any) -> Any:
        return {name: property_value(name, value) for name, value in dict(values).items()}

    @field_validator("withheld", mode="before")
    @classmethod
    def _names_of_properties(cls, names: Any) -> Any:
        return property_names(names.split(",") if isinstance(names, str) else names)

    @model_validator(mode="after")
    def _calm_indoors(self) -> "FlightConfig":
        if isinstance(self.start, BenchStart) and not self.air.calm:
            raise ValueError(
                "air: the flight is on a table indoors, in still air; leave out wind, gusts, turbulence and thermals"
            )
        return self

    @model_validator(mode="after")
    def _fence_within_box(self) -> "FlightConfig":
        within_box(self.fence, self.box_radius_m, self.box_height_m)
        return self

    @model_validator(mode="after")
    def _fits_in_memory(self) -> "FlightConfig":
        tick_s = 1.0 / self.rates.imu_hz
        if self.duration_s < tick_s:
            raise ValueError(f"duration_s = {self.duration_s!r} s: must be at least {tick_s:g} s, one tick of the loop")
        most_s = MOST_BYTES / (ROW_BYTES * self.rates.imu_hz) - self.held_s
        if self.duration_s > most_s:
            raise ValueError(
                f"duration_s = {self.duration_s:g} s: must be at most {max(most_s, 0.0):.0f} s at {self.rates.imu_hz} "
                f"Hz: the log is held in memory and may take {MOST_BYTES / 1e9:g} GB"
            )
        return self

    @property
    def heading_deg(self) -> float:
        """Heading at the start; ValueError if it has not been drawn yet."""
        heading_deg = self.start.heading_deg
        if isinstance(heading_deg, str):
            raise ValueError(f"start.heading_deg = {heading_deg!r}: resolve the configuration first")
        return heading_deg

    @property
    def flies(self) -> bool:
        """Whether it leaves the table."""
        return not isinstance(self.start, BenchStart)

    @property
    def held_s(self) -> float:
        """Time from power-up to the release; on a table, to the end of the calibration."""
        match self.start:
            case HandThrowStart(hold_s=hold_s, push_s=push_s):
                return hold_s + push_s
            case BenchStart(calibration_s=calibration_s):
                return calibration_s
        return 0.0

    @property
    def calibration_s(self) -> float:
        """Time from power-up over which the gyro offset is measured; 0 for a start in the air."""
        return 0.0 if isinstance(self.start, InFlightStart) else self.start.calibration_s


def override(config: FlightConfig, overrides: Mapping[str, Any]) -> FlightConfig:
    """`config` with fields changed by their dotted names; values may be text, as from a command line.

    ``wind`` takes what `parse_wind` takes; ``gps.``, ``gyro.`` and ``accelerometer.`` are short for ``sensors.gps.``
    and so on, and the name of a property of the instruments for ``instruments.`` and that name.  Parameters of the
    estimator are spelled as `scenarios.harness.settings` says.

    Raises
    ------
    ValueError      one line with the field, the value, its unit and what would be right
    """
    return overridden(config, overrides)[0]


def overridden(
    config: FlightConfig, overrides: Mapping[str, Any], maker: Maker | None = None
) -> tuple[FlightConfig, SuiteParams]:
    """The result of `override`, and the figures of its suite; `maker` makes the estimator, where it is given."""
    data = config.model_dump()
    if "suite" in overrides:  # first, for its fields are named by other overrides; its files are read anew
        data |= {"suite": str(overrides["suite"]), "files": {}}
        config = config.model_copy(update={"suite": data["suite"], "files": {}})
    unchanged = suite_params(config.suite, {}, config.files)
    estimator = maker or str(overrides.get("estimator", config.estimator))
    for name, value in overrides.items():
        if name == "wind":
            wind = parse_wind(str(value))
            data["air"] |= {"wind_m_s": wind.m_s, "wind_from_deg": wind.from_deg}
        else:
            full_name = _field(name, config, unchanged) or _parameter(name, config, unchanged, estimator)
            _refuse_odd(full_name, value)
            _put(data, full_name, value)
    changed = validated(FlightConfig, data)
    fitted = change_params(unchanged, changed.sensors, f"sensor suite {changed.suite}")
    flies = not isinstance(changed.start, BenchStart)
    require_faults_possible(changed.faults, fitted, changed.rates.gps_hz, changed.aircraft, flies)
    changed.battery.require_possible(changed.aircraft, flies)
    if changed.turn_table and fitted.magnetometer is None:
        raise ValueError(f"turn_table = True: sensor suite {changed.suite} has no magnetometer to be turned")
    return changed, fitted


def fitted_suite(config: FlightConfig) -> SuiteParams:
    """The figures of the suite that is carried under `config`; ValueError if there is no such suite or figure."""
    return suite_params(config.suite, config.sensors, config.files)


_TEXTS = ("aircraft", "estimator", "autopilot", "suite", "withheld", "faults", "air.gusts", "fence.action")


def is_field(name: str, config: FlightConfig, overrides: Mapping[str, Any]) -> bool:
    """Whether a name that `override` takes is a field of the configuration, and no parameter of the estimator."""
    changed = {"suite": str(overrides["suite"]), "files": {}} if "suite" in overrides else {}
    config = config.model_copy(update=changed)
    return name == "wind" or bool(_field(name, config, suite_params(config.suite, {}, config.files)))


def _field(name: str, config: FlightConfig, fitted: SuiteParams) -> str:
    """Dotted name of a field that exists, empty if it does not exist; `fitted` is its suite."""
    if name in dotted_fields(fitted):
        return f"sensors.{name}"
    if name in PROPERTIES:
        return f"instruments.{name}"
    # The estimator's own dataclass checks the names of its parameters.
    return name if name.startswith("estimator_params.") or name in _known(config, fitted) else ""


def _parameter(name: str, config: FlightConfig, fitted: SuiteParams, estimator: str | Maker) -> str:
    """Dotted name of a parameter of the estimator, or a ValueError with suggestions."""
    require_fitted(fitted, name.removeprefix("sensors."), f"sensor suite {config.suite}")
    return parameter_name(name, estimator, [*_known(config, fitted), *dotted_fields(fitted)])


def _known(config: FlightConfig, fitted: SuiteParams) -> list[str]:
    properties = [f"instruments.{property_}" for property_ in PROPERTIES]
    return [*_dotted(config), *properties, *(f"sensors.{f}" for f in dotted_fields(fitted)), "wind"]


def _dotted(config: FlightConfig) -> list[str]:
    """Names of the fields that can be changed."""
    names: list[str] = []
    for name, value in config:
        if isinstance(value, BaseModel):
            names += [f"{name}.{inner}" for inner in type(value).model_fields if inner != "kind"]
        elif name == "manoeuvre":
            names += [f"{name}.{inner}" for inner in value]
        elif name not in ("sensors", "estimator_params", "instruments", "files"):
            names.append(name)
    return names


def _refuse_odd(name: str, value: Any) -> None:
    """ValueError for text that only Python reads as a number, unless the field is a text."""
    if isinstance(value, str) and name not in _TEXTS and is_odd(value):
        raise ValueError(f"{name} = {printable(value, 60)} {unit_of(name)}".rstrip() + f": {RIGHT}")


def _put(data: dict[str, Any], name: str, value: Any) -> None:
    """Set the field of dotted `name`; the rest after ``sensors.`` is one key."""
    head, _, rest = name.partition(".")
    if not rest:
        data[head] = value
    elif head in ("estimator_params", "sensors"):
        read = literal(value)
        if not _is_sane(read):
            raise ValueError(f"{shown(name, value)}: must be 0, or between {SMALLEST:g} and {LARGEST:g} in size")
        data[head] = {**data[head], rest: read}
    else:
        data[head] = {**data[head], rest: value}


def literal(value: Any) -> Any:
    """The number, boolean or list that `value` spells, else the text itself."""
    if not isinstance(value, str):
        return value
    for read in (json.loads, number):  # .5 is a number, but not JSON
        try:
            return read(value)
        except (ValueError, RecursionError):
            continue
    return value


def _is_sane(value: Any) -> bool:
    """Whether all numbers in it have a plausible size; NaN and infinity do not."""
    if isinstance(value, list | tuple):
        return all(map(_is_sane, value))
    return not isinstance(value, int | float) or value == 0 or SMALLEST <= abs(value) <= LARGEST


def resolve(config: FlightConfig, suite: SuiteParams | None = None) -> FlightConfig:
    """`config` in plain numbers: random values drawn, each from its named stream; idempotent.

    The rate of the GPS becomes the receiver's own, and the text of the user's own sensor files is kept.

    suite : what is carried, as `fitted_suite` gives it; None looks it up
    """
    start = resolve_start(config.start, config.seed, config.flight)
    air = resolve_air(config.air, start.heading_deg, config.seed, config.flight)
    files, rates = config.files or own_files(config.suite), _resolve_rates(config, suite)
    airframe = resolve_airframe(
        config.airframe, config.tolerances, config.aircraft, config.flies, config.seed, config.flight
    )
    return config.model_copy(update={"start": start, "air": air, "airframe": airframe, "files": files, "rates": rates})


def _resolve_rates(config: FlightConfig, suite: SuiteParams | None) -> RatesConfig:
    rates = config.rates
    if rates.gps_hz is not None and rates.physics_hz is not None:
        return rates
    receiver_hz = rates.gps_hz or (suite or fitted_suite(config)).gps.rate_hz
    rates = rates.model_copy(update={"gps_hz": receiver_hz, "physics_hz": rates.physics_hz or physics_hz(rates.imu_hz)})
    rates.build()  # refuses a receiver whose rate the physics cannot keep
    return rates
