"""GPS fixes as a receiver sends them: NMEA 0183 sentences and UBX NAV-PVT messages, written and read.

``fixes.py``   the plain structure of fixes, the place and the date it hangs from, and what is wrong with a file
``nmea.py``    GGA, RMC and VTG, by pynmeagps
``ubx.py``     NAV-PVT, by pyubx2

What is written comes back within half a unit of the last digit that the format carries, and what was read is written
back as the same bytes.  Files of other receivers are read too: every sentence that had to be dropped or repaired is
told with its place in the file.
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
