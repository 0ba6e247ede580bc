"""GPS fixes as receiver messages, written and read: NMEA 0183 sentences and UBX NAV-PVT.

``fixes.py``   the structure of fixes, its origin in place and time, and the problems of a file
``nmea.py``    GGA, RMC and VTG, by pynmeagps
``ubx.py``     NAV-PVT, by pyubx2

Written fixes are read back within half a unit of the last digit of the format, and fixes that were read are written as
the same bytes.  Files of other receivers can be read; each sentence that was dropped or repaired is reported with its
place in the file.
"""

from sim.gps_messages.fixes import LAUNCH, START, Accuracy, Fixes, Place, Problem, Reading
from sim.gps_messages.nmea import decode_nmea, encode_nmea, read_nmea, write_nmea
from sim.gps_messages.ubx import decode_ubx, encode_ubx, read_ubx, write_ubx

__all__ = [
    "LAUNCH",
    "START",
    "Accuracy",
    "Fixes",
    "Place",
    "Problem",
    "Reading",
    "decode_nmea",
    "decode_ubx",
    "encode_nmea",
    "encode_ubx",
    "read_nmea",
    "read_ubx",
    "write_nmea",
    "write_ubx",
]
