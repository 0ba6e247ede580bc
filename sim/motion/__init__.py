"""Prescribed motion in closed form, flown as a plant without dynamics: exact truth for sensors and estimators.

`prescribed_plant` has the plant and the basic motions (rest, turn, loop, free fall), `hover` a hovering multi-rotor,
`turn_table` the calibration of a magnetometer.
"""
