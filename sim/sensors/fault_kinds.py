"""The kinds of sensor fault, by their code in the kernels; `sim.sensors.faults` says what each does."""

from enum import IntEnum


class Kind(IntEnum):
    """Kinds of fault, by their code in the kernel."""

    STUCK = 1  # 0: no fault
    DROPOUT = 2
    NAN = 3
    SPIKES = 4
    BIAS = 5
    GAIN = 6
    SATURATED = 7
    OUTAGE = 8
    JUMP = 9
    FROZEN_COURSE = 10
    FROZEN_VELOCITY = 11
    FROZEN_POSITION = 12
    WHOLE_DEGREES = 13
    RATE = 14
    DRIFT = 15
