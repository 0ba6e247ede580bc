"""How an aeroplane came down: series and metrics of a landing without a motor."""

import numpy as np

from scenarios.harness.checks import Check
from scenarios.harness.metrics.series import (
    NOTHING,
    Measured,
    Metric,
    Moment,
    Series,
    SeriesOf,
    after,
    bank_size_deg,
    last,
    time_s,
)
from sim.log import Flight, Outcome

_BEFORE_S = 0.1  # the ground has not yet been touched
MOST_SINK_M_S, MOST_BANK_DEG = 3.0, 30.0  # of a landing that a model survives (assumption)
before_ground: Moment = after(last, -_BEFORE_S)


def sink_m_s(flight: Flight) -> Series:
    """Rate of descent, true, m/s."""
    value = flight.log.truth["v_e_m_s"][:, 2]
    return Series(time_s(flight), value, np.ones(len(value), np.bool_))


def at_ground(series: SeriesOf) -> Metric:
    """Metric: `series` just before it touched the ground; not measured if it did not."""

    def metric(flight: Flight) -> Measured:
        if flight.outcome != Outcome.GROUND_CONTACT:
            return NOTHING
        values = series(flight).within(-np.inf, before_ground(flight)).value
        return Measured(float(values[-1])) if len(values) else NOTHING

    return metric


def survived_by_landing(earliest_s: float) -> Check:
    """The check "survived" of a flight that ends on the ground: slowly, wings about level, not before `earliest_s`.

    It fails as well if it did not come down.
    """

    def landed(flight: Flight) -> Measured:
        sink, bank = (at_ground(series)(flight).value for series in (sink_m_s, bank_size_deg))
        gentle = sink <= MOST_SINK_M_S and bank <= MOST_BANK_DEG  # False for NaN
        return Measured(float(gentle and last(flight) >= earliest_s))

    return Check("survived", "", landed, 1.0, ">=", "count")
