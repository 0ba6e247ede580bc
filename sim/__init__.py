"""The simulation: truth, sensors and the loop.

The loop (`sim.loop`) runs a plant, sensors, an estimator and an autopilot; `sim.log` defines the recorded columns.
Rooms: ``aeroplane`` (JSBSim), ``motion`` (prescribed motion), ``air``, ``sensors``, ``gps_messages``, ``aircraft`` (the
models), ``view`` (Rerun) and ``outside`` (files, processes and user code).  Flight code never imports from here.
"""
