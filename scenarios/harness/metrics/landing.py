"""How an aeroplane came down: series and metrics of a landing without a motor."""

import numpy as np

from scenarios.harness.metrics.series import NOTHING, Measured, Metric, Moment, Series, SeriesOf, after, last, time_s
from sim.log import Flight, Outcome

_BEFORE_S = 0.1  # the ground has not yet been touched
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
