"""Sensors: from the truth of a tick to what the instruments report, with their errors and faults.

`suite` measures all sensors in one kernel per tick; each module has the parameters, drawn errors and kernel of one
instrument, built from `device`, `board` and `noise`.  `datasheet` and `fitting` read parts and suites from files,
`known` is their record for flight code, and `trial` tests single sensors.
"""
