"""Spike streams: packing, files, intervals (ISI) and pictures (TFP, TFI)."""

from spikecam_env.streams.array_files import save_npz
from spikecam_env.streams.hdf5 import SpikeWriter, read_truth
from spikecam_env.streams.isi import isi_plane, isi_planes
from spikecam_env.streams.packing import pack_frames, unpack_frames
from spikecam_env.streams.pictures import middleTFI, middleTFP, tfp_film
from spikecam_env.streams.recording import Recording, read_recording
from spikecam_env.streams.vidar import load_vidar_dat, save_vidar_dat

__all__ = [
    "Recording",
    "SpikeWriter",
    "isi_plane",
    "isi_planes",
    "load_vidar_dat",
    "middleTFI",
    "middleTFP",
    "pack_frames",
    "read_recording",
    "read_truth",
    "save_npz",
    "save_vidar_dat",
    "tfp_film",
    "unpack_frames",
]
