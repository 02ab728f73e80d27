"""Spike streams: packing, files, intervals (ISI) and pictures (TFP, TFI)."""

from spikecam_env.streams.isi import isi_plane, isi_planes
from spikecam_env.streams.packing import pack_frames, unpack_frames
from spikecam_env.streams.pictures import middleTFI, middleTFP, tfp_film

__all__ = [
    "isi_plane",
    "isi_planes",
    "middleTFI",
    "middleTFP",
    "pack_frames",
    "tfp_film",
    "unpack_frames",
]
