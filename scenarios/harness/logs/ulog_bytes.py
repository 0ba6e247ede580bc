"""The complete messages of a ULog file, without damaged bytes, so that pyulog reads all of them.

A message is a length, a letter and a body.  Any two-byte length is legal, so the body is checked by its letter to avoid
taking damaged bytes for a message.  If a log was appended to after a crash, its flag bits give the offsets, and the
message before each offset may be cut off.
"""

import struct
from pathlib import Path

from scenarios.harness.logs.recorded import LogError

HEADER_LENGTH, FLAGS_LENGTH, APPENDED_AT, PLACES = 16, 40, 16, 3  # body of the flag bits: 8 + 8 flags, three places
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
DATA, ANNOUNCED, REMOVED, FORMAT, FLAGS, INFO, SEVERAL, PARAMETER, DEFAULT, TEXT, TAGGED, MARK, DROPOUT = (
    b"DARFBIMPQLCSO"
)
_KEPT = frozenset((DATA, ANNOUNCED, FORMAT, PARAMETER, DEFAULT, DROPOUT))  # what the reader needs
_SHORTEST = {
    DATA: 2, ANNOUNCED: 4, REMOVED: 2, FORMAT: 2, FLAGS: FLAGS_LENGTH, INFO: 2, SEVERAL: 3, PARAMETER: 6, DEFAULT: 7,
    TEXT: 9, TAGGED: 11, MARK: len(SYNC), DROPOUT: 2,
}  # fmt: skip
_FIXED = (REMOVED, FLAGS, MARK, DROPOUT)  # as long as the shortest
_KEY_AT = {INFO: 0, PARAMETER: 0, SEVERAL: 1, DEFAULT: 1}  # where the length of the key is
_AFTER_KEY = {PARAMETER: 4, DEFAULT: 4}  # the length of what follows the key


def whole(path: Path, raw: bytes, repairs: list[str]) -> bytes:
    """The log with the complete messages that the reader needs; other bytes are counted.

    A message is accepted if another one, the end or appended data follows it, or if it defines a topic in readable
    text, since the topic would be lost otherwise.  Data must be of an announced topic and as long as its other data.

    Raises
    ------
    LogError      a newer format, by its flags
    """
    walk = _Walk(raw, _appended(path, raw))
    at, end = HEADER_LENGTH, len(raw)
    parts, bad, first = [raw[:HEADER_LENGTH]], 0, -1
    while at < end:
        after = walk.after(at)
        if not after:
            bad, first = bad + 1, at if first < 0 else first
            at += 1
            continue
        if raw[at + 2] in _KEPT:
            parts.append(raw[at:after])
        at = after
    if bad:
        repairs.append(f"{bad} bytes outside complete messages left out, first at byte {first}")
    return b"".join(parts)


def _appended(path: Path, raw: bytes) -> list[int]:
    """Where appended data begin, by the flag bits, which are the first message if present."""
    at = HEADER_LENGTH
    if len(raw) < at + 3 + FLAGS_LENGTH or raw[at + 2] != FLAGS:
        return []
    body = raw[at + 3 : at + 3 + FLAGS_LENGTH]
    unknown = body[8] & ~1, *body[9:16]
    if any(unknown):
        raise LogError(f"{path}: a newer ULog format, by its incompatible flags {body[8:16].hex()}: cannot be read")
    places = struct.unpack(f"<{PLACES}Q", body[APPENDED_AT:])
    return [place for place in places if body[8] & 1 and HEADER_LENGTH < place < len(raw)]


class _Walk:
    """Recognises messages, and keeps the data length of each topic."""

    def __init__(self, raw: bytes, appended: list[int]) -> None:
        self.raw, self.end, self.lengths = raw, len(raw), dict[int, int]()  # 0 before the first data of a topic
        self.appended = [place for place in appended if self._looks(place, self.end)]

    def after(self, at: int) -> int:
        """The end of the message that begins at `at`; 0 if there is no acceptable message."""
        stop = min((place for place in self.appended if place > at), default=self.end)
        after = self._looks(at, stop)
        if not after or not (self._goes_on(after, stop) or self._defines(at, after)):
            return 0
        kind = self.raw[at + 2]
        if kind == DATA:
            topic = int.from_bytes(self.raw[at + 3 : at + 5], "little")
            usual = self.lengths.get(topic, -1)
            if usual not in (0, after - at):
                return 0
            self.lengths[topic] = after - at
        elif kind == ANNOUNCED:
            self.lengths.setdefault(int.from_bytes(self.raw[at + 4 : at + 6], "little"), 0)
        return after

    def _begins(self, at: int) -> int:
        """The end of a message at `at` by its length and letter alone; 0 if none can begin there."""
        raw = self.raw
        if at + 3 > self.end:
            return 0
        kind, length = raw[at + 2], raw[at] | raw[at + 1] << 8
        shortest = _SHORTEST.get(kind, 1 << 16)
        return at + 3 + length if length >= shortest and (kind not in _FIXED or length == shortest) else 0

    def _looks(self, at: int, stop: int) -> int:
        """The end of the message at `at` if its bytes fit its letter and it ends by `stop`; otherwise 0."""
        after, raw = self._begins(at), self.raw
        if not after or after > stop:
            return 0
        kind, length = raw[at + 2], after - at - 3
        if kind == DATA:
            return after
        body = raw[at + 3 : after]
        if kind == MARK:
            return after if body == SYNC else 0
        if kind in (FORMAT, ANNOUNCED):
            return after if _readable(body if kind == FORMAT else body[3:]) else 0
        if kind in (TEXT, TAGGED):
            return after if 0x30 <= body[0] <= 0x37 else 0  # a level, "0" to "7"
        if kind in _KEY_AT:
            begin = _KEY_AT[kind] + 1
            end = begin + body[begin - 1]
            good = end > begin and end <= length and _readable(body[begin:end])
            return after if good and length - end == _AFTER_KEY.get(kind, length - end) else 0
        return after

    def _goes_on(self, at: int, stop: int) -> bool:
        """Whether a message, complete or cut off, begins at `at`, or the data end there."""
        return at + 3 > stop or self._begins(at) > 0

    def _defines(self, at: int, after: int) -> bool:
        """Whether the message defines or announces a topic."""
        return self.raw[at + 2] in (FORMAT, ANNOUNCED) and after - at > 6


def _readable(text: bytes) -> bool:
    return bool(text) and text.isascii() and text.decode().isprintable()
