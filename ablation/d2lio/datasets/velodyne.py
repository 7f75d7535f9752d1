# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""velodyne_msgs/VelodyneScan: the raw packets of a VLP-16 or HDL-32E to points with their times.

A packet holds 12 blocks of 100 bytes: flag 0xFFEE, azimuth in 0.01 deg, 32 channels of distance
in 2 mm and reflectivity. Elevations and firing times are those of the sensors' manuals (VLP-16
user manual, chapter 9; HDL-32E user manual, appendix E) and equal to the ROS driver's tables,
except that the driver takes two lasers of the HDL-32E for one firing. The lasers' vertical
offsets, at most 11 mm, are left out.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from d2lio.datasets.events import NS_PER_S, Int64, Notes, RawScan
from d2lio.errors import DataError

MESSAGE_TYPES = ("velodyne_msgs/msg/VelodyneScan",)

PACKET_BYTES = 1206
BLOCKS = 12
CHANNELS = 32
UPPER_BANK = 0xEEFF  # bytes FF EE
TURN = 36_000  # azimuth units of 0.01 deg
DISTANCE_UNIT_M = 0.002
DUAL_RETURN = 0x39  # return mode byte; 0x37 strongest, 0x38 last
MAX_STAMP_APART_NS = NS_PER_S  # a packet further than this from its scan's header is none of it

_CHANNEL = np.dtype([("distance", "<u2"), ("reflectivity", "u1")])
_BLOCK = np.dtype([("flag", "<u2"), ("azimuth", "<u2"), ("channels", _CHANNEL, CHANNELS)])
_DATA = np.dtype(
    [("blocks", _BLOCK, BLOCKS), ("clock_us", "<u4"), ("mode", "u1"), ("product", "u1")]
)
_PACKET = np.dtype([("sec", "<u4"), ("nsec", "<u4"), ("data", _DATA)])  # 1214 bytes
_PACKET_CDR = np.dtype({"names": ["packet"], "formats": [_PACKET], "itemsize": 1216})


@dataclass(frozen=True, slots=True)
class Model:
    """Geometry and timing of a sensor.

    Attributes:
        elevations: float64 [32], rad, by channel of a block (VLP-16: two firings of 16).
        offsets_ns: float64 [32], firing time of a channel after its block's first, ns.
        block_ns: time from block to block (single return), ns.
    """

    name: str
    elevations: np.ndarray
    offsets_ns: np.ndarray
    block_ns: float

    @property
    def rings(self) -> np.ndarray:
        """uint16 [32], ring of each channel, 0 the lowest."""
        levels = np.unique(self.elevations)
        return np.searchsorted(levels, self.elevations).astype(np.uint16)


def _vlp16() -> Model:
    elevations = np.column_stack([np.arange(-15, 0, 2), np.arange(1, 16, 2)]).ravel()
    laser, firing = np.arange(CHANNELS) % 16, np.arange(CHANNELS) // 16
    offsets = 2_304.0 * laser + 55_296.0 * firing
    return Model("vlp16", np.deg2rad(np.tile(elevations, 2)), offsets, 110_592.0)


def _hdl32e() -> Model:
    low = -92.0 / 3.0 + 4.0 / 3.0 * np.arange(16)
    elevations = np.column_stack([low, low + 64.0 / 3.0]).ravel()
    return Model("hdl32e", np.deg2rad(elevations), 1_152.0 * np.arange(CHANNELS), 46_080.0)


MODELS = {"vlp16": _vlp16(), "hdl32e": _hdl32e()}
PRODUCTS = {0x22: "vlp16", 0x21: "hdl32e"}  # the factory bytes' second


def _read_ros1(raw: bytes, notes: Notes) -> tuple[int, np.ndarray]:
    """Header stamp [ns] and packets; also those declared uint8[], each with its own size."""
    _, sec, nsec, frame_size = struct.unpack_from("<4I", raw)
    offset = 16 + frame_size
    (count,) = struct.unpack_from("<I", raw, offset)
    offset += 4
    stamp = sec * NS_PER_S + nsec
    if len(raw) - offset == count * _PACKET.itemsize:
        return stamp, np.frombuffer(raw, _PACKET, count, offset)
    return stamp, _read_sized(raw, offset, count, notes)


def _read_sized(raw: bytes, offset: int, count: int, notes: Notes) -> np.ndarray:
    kept = []
    for _ in range(count):
        *_, size = struct.unpack_from("<3I", raw, offset)
        end = offset + 12 + size
        if end > len(raw):
            raise DataError(f"VelodyneScan claims {count} packets but holds only {len(raw)} bytes")
        if size == PACKET_BYTES:
            kept.append(raw[offset : offset + 8] + raw[offset + 12 : end])
        else:
            notes.count("packets_wrong_size")
        offset = end
    return np.frombuffer(b"".join(kept), _PACKET)


def _read_cdr(raw: bytes) -> tuple[int, np.ndarray]:
    """As `_read_ros1`, for the CDR encoding (alignment counts from byte 4)."""
    body = raw[4:]
    sec, nsec, frame_size = struct.unpack_from("<iII", body)
    offset = (12 + frame_size + 3) // 4 * 4
    (count,) = struct.unpack_from("<I", body, offset)
    data = body[offset + 4 :]
    # CDR pads between the packets, not after the last one.
    if len(data) < count * _PACKET_CDR.itemsize - (2 if count else 0):
        raise DataError(f"VelodyneScan claims {count} packets but holds only {len(raw)} bytes")
    packets = np.frombuffer(data + b"\0\0", _PACKET_CDR, count)["packet"]
    return sec * NS_PER_S + nsec, packets


def decode_velodyne_scan(
    raw: bytes,
    log_stamp: int,
    *,
    cdr: bool = False,
    model: str = "",
    notes: Notes | None = None,
) -> RawScan:
    """Points of one VelodyneScan in the order fired; channels without a return are left out.

    `times` are int32 ns from the header stamp, `ring` counts up with the elevation. Of two
    returns the strongest stays.

    Args:
        raw: serialised message.
        log_stamp: time of reception, ns.
        cdr: ROS 2 serialisation.
        model: vlp16 or hdl32e, for packets whose factory byte tells neither.
        notes: counts packets_wrong_size, blocks_wrong_flag, packets_wrong_stamp,
            packets_dual_return.

    Raises:
        DataError: a truncated message, or a sensor that is neither.
    """
    raw, notes = bytes(raw), notes or Notes()
    try:
        stamp, packets = _read_cdr(raw) if cdr else _read_ros1(raw, notes)
    except struct.error as err:
        raise DataError(f"VelodyneScan of {len(raw)} bytes is truncated") from err
    sensor = _model_of(packets, model)
    begin = _packet_times(packets, stamp, sensor)
    near = np.abs(begin) <= MAX_STAMP_APART_NS
    _count(notes, "packets_wrong_stamp", int((~near).sum()))
    return _points(packets["data"][near], begin[near], sensor, (stamp, log_stamp), notes)


def _count(notes: Notes, reason: str, number: int) -> None:
    if number:
        notes.count(reason, number)


def _model_of(packets: np.ndarray, name: str) -> Model:
    products = np.unique(packets["data"]["product"])
    known = {PRODUCTS[p] for p in products.tolist() if p in PRODUCTS}
    if len(known) == 1:
        return MODELS[known.pop()]
    if name in MODELS:
        return MODELS[name]
    if len(packets) == 0:
        return MODELS["vlp16"]
    shown = ", ".join(f"0x{p:02x}" for p in products)
    raise DataError(
        f"VelodyneScan of a sensor with product byte {shown}; known are 0x22 (vlp16) and 0x21 "
        "(hdl32e), or name one of the two as lidar.model"
    )


def _packet_times(packets: np.ndarray, stamp: int, model: Model) -> Int64:
    """int64 [P], ns from the header stamp to each packet's first firing."""
    stamps = packets["sec"].astype(np.int64) * NS_PER_S + packets["nsec"]
    if stamps.any():
        return stamps - stamp
    # Some drivers leave the packets' stamps empty.
    return np.round(np.arange(len(packets)) * BLOCKS * model.block_ns).astype(np.int64)


def _points(
    data: np.ndarray, begin: Int64, model: Model, stamps: tuple[int, int], notes: Notes
) -> RawScan:
    blocks = data["blocks"]  # [P, 12]
    dual = data["mode"] == DUAL_RETURN
    _count(notes, "packets_dual_return", int(dual.sum()))
    azimuth = blocks["azimuth"].astype(np.int64)
    good = (blocks["flag"] == UPPER_BANK) & (azimuth < TURN)
    _count(notes, "blocks_wrong_flag", int((~good).sum()))
    good[dual, 0::2] = False  # the last returns; the odd blocks are the strongest
    order = np.where(dual[:, None], np.arange(BLOCKS) // 2, np.arange(BLOCKS))
    in_block = model.offsets_ns / model.block_ns
    turned = azimuth[..., None] + _steps(azimuth, dual, good)[..., None] * in_block
    times = begin[:, None, None] + order[..., None] * model.block_ns + model.offsets_ns
    distance = blocks["channels"]["distance"]
    seen = good[..., None] & (distance > 0)  # [P, 12, 32]
    angle = np.deg2rad(turned[seen] * 0.01)
    channel = np.broadcast_to(np.arange(CHANNELS), seen.shape)[seen]
    metres = distance[seen] * DISTANCE_UNIT_M
    flat = metres * np.cos(model.elevations[channel])
    # The azimuth turns clockwise from x seen from above.
    xyz = [flat * np.cos(angle), -flat * np.sin(angle), metres * np.sin(model.elevations[channel])]
    return RawScan(
        stamp=stamps[0],
        log_stamp=stamps[1],
        xyz=np.stack(xyz, axis=1).astype(np.float32),
        times=np.round(times[seen]).astype(np.int32),
        intensity=blocks["channels"]["reflectivity"][seen].astype(np.float32),
        ring=model.rings[channel],
    )


def _steps(azimuth: Int64, dual: np.ndarray, good: np.ndarray) -> np.ndarray:
    """float64 [P, 12]: azimuth turned from a block to the next, 0.01 deg.

    The last block of a packet, and blocks beside a bad one, take the scan's median.
    """
    steps = np.zeros(azimuth.shape)
    for mask, stride in ((~dual, 1), (dual, 2)):
        steps[mask, :-stride] = (azimuth[mask, stride:] - azimuth[mask, :-stride]) % TURN
    usable = good & (steps > 0) & (steps < TURN / 8)
    middle = float(np.median(steps[usable])) if usable.any() else 0.0
    return np.where(usable & (steps < 2 * middle), steps, middle)
