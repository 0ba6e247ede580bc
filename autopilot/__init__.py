"""Autopilots: they steer on the estimate and the measurements, never on the truth.

An autopilot is any class with ``update`` (`autopilot.interface.Autopilot`).  The one shipped is in
`autopilot.py`: `stabilise.py` holds attitude, `guidance.py` leads, `route.py` leads round circles and along legs,
`energy.py` holds height and speed, `launch.py` feels the throw, `failsafe.py` decides which mode is in force,
`mixer.py` moves the surfaces.  `pilot.py` is the stick, a script of set-points.

=========  ==========================================  ==========================  ===================================
Mode       The pilot, or the script, says              Held by the autopilot       Throttle, where not given
=========  ==========================================  ==========================  ===================================
MANUAL     aileron, elevator, rudder                   nothing                     off
RATE       rates of roll, pitch and yaw                the rates, by damping       of cruise
STABILISE  bank and pitch; 0, 0, hands off, is level   bank and pitch              by the pitch
COURSE     course, height, steepest bank               course and height           by the height
LOITER     centre, radius, which way round, height     the circle                  by the height
WAYPOINTS  a route, with a height for each point       the legs, round after       by the height
                                                       round
RETURN     height                                      over the launch point       by the height
                                                       again and again
LAUNCH     height                                      wings level, the pitch of   off until the throw is felt, then
                                                       the climb, then the height  full, then by the pitch
CIRCLE     failsafes: nobody asks for them; when       a gentle circle             of cruise
GLIDE      they take over, and which goes before       the same                    off
LEVEL      which, is told in `failsafe.py`             wings level                 of cruise
LOW                                                    a climb on the way          by the height
=========  ==========================================  ==========================  ===================================
"""

AUTOPILOTS = {"dcm": "autopilot.dcm:DcmAutopilot"}  # name -> "module:Class", made without arguments
