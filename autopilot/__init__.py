"""Autopilots: they steer on the estimate and the measurements, never on the truth.

An autopilot is any class with ``update`` (`autopilot.interface.Autopilot`).  The shipped one is in `dcm.py`, and uses
`stabilise.py` for attitude, `guidance.py` for course and return, `route.py` for circles and legs, `energy.py` for
height and speed, `launch.py` for throw detection, `failsafe.py` for the active mode and `mixer.py` for the surfaces.
`pilot.py` is the scripted pilot, `figures.py` has aerobatic figures for it.

=========  ==========================================  ==========================  ===================================
Mode       Setpoint                                    Held by the autopilot       Default throttle
=========  ==========================================  ==========================  ===================================
MANUAL     aileron, elevator, rudder                   nothing                     off
RATE       roll, pitch and yaw rates                   the rates                   cruise
STABILISE  bank and pitch; 0, 0 is level               bank and pitch              from pitch
COURSE     course, height, bank limit                  course and height           from height
LOITER     centre, radius, direction, height           the circle                  from height
WAYPOINTS  a route with heights                        the legs, repeatedly        from height
RETURN     height                                      passes over launch point    from height
LAUNCH     height                                      wings level, climb pitch,   off until the throw is detected,
                                                       then height                 then full, then from pitch
CIRCLE     failsafe modes, which cannot be             a gentle circle             cruise
GLIDE      commanded; see `failsafe.py` for            the same circle             off
LEVEL      conditions and precedence                   wings level                 cruise
LOW                                                    a climb on course           from height
=========  ==========================================  ==========================  ===================================
"""

AUTOPILOTS = {"dcm": "autopilot.dcm:DcmAutopilot"}  # name -> "module:Class", created without arguments
