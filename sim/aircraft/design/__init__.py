"""From the design of an aeroplane to its JSBSim model; used only to rebuild a model, by its ``build.py``.

`design` states shape, masses and drive; `lattice` and `stall` compute the coefficients of attached and separated flow,
`masses` the inertia; `aerodynamics` and `builder` write the XML.
"""
