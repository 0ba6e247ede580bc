"""Viewing a flight in Rerun: the recording and its layout, the viewer process, plots, and the drawn aeroplane.

Only `rerun_view` and `layout` import rerun; `mesh`, `loft` and `fuselage` make the shape from the aircraft's geometry.
"""
