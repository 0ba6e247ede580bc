"""Aeroplanes flown by JSBSim: the plant and its model, the throwing hand, and analysis of the model.

`jsbsim_plant` and `jsbsim_model` fly it, with `built` for its tolerances, and `actuators` and `battery` for what moves
it.  `trim` finds steady flights, `linear` and `derivatives` the modes and coefficients about a trim, `performance`
stall, glide, climb and turns.
"""
