"""Autopilots: they steer on the estimate and the measurements, never on the truth.

An autopilot is any class with ``update`` (`autopilot.interface.Autopilot`).  The one shipped is in
`autopilot.py`: `stabilise.py` holds attitude, `guidance.py` leads, `launch.py` feels the throw, `mixer.py`
moves the surfaces.  `pilot.py` is the stick, a script of set-points.
"""

AUTOPILOTS = {"dcm": "autopilot.autopilot:DcmAutopilot"}  # name -> "module:Class", made without arguments
