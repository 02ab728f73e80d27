"""The engine of OpenVINO beside torch's: rates, bits for any cutting, and what is said where it cannot be had."""

from __future__ import annotations

import copy
import importlib.util
import os
import pickle
import subprocess
import sys
from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from denoiser.many import ManyDnSS
from denoiser.online import OnlineDnSS
from scenes import RotatingDisk
from spikecam_env.errors import InputError
from spikecam_env.sensor import SpikeSensor

SHAPE = (38, 45)
MOST_APART = 1e-3
"""Of rates, rms [spikes/frame]; bfloat16 rounds a rate near 1 by up to 2e-3."""

CI = ("CI", "TF_BUILD", "JENKINS_URL")
"""Variables by which OpenVINO knows a CI, in which it reports nothing."""

MAP = (np.linspace(0.8, 1.2, SHAPE[0] * SHAPE[1]).reshape(SHAPE), np.full(SHAPE, 0.002))


@pytest.fixture(scope="module")
def spikes() -> NDArray[np.uint8]:
    return SpikeSensor("scsim", SHAPE, 0).step(RotatingDisk(SHAPE).radiance(0, 90), 90)


def online(engine: str = "openvino", **options) -> OnlineDnSS:
    if engine == "openvino" and importlib.util.find_spec("openvino") is None:
        pytest.skip("OpenVINO is not installed (pip install 'spikecam-env[openvino]')")
    return OnlineDnSS.pretrained("best", engine=engine, output="rate", **options)


def rates(denoiser: OnlineDnSS, chunks: Iterable[NDArray[np.uint8]]) -> NDArray[np.float32]:
    return np.concatenate([*(denoiser.push(chunk) for chunk in chunks), denoiser.flush()])


@pytest.mark.parametrize("unit", [None, MAP], ids=["no map", "map"])
@pytest.mark.parametrize("precision", ["bfloat16", "float32"])
def test_engines_agree(spikes, precision, unit):
    found, wanted = (rates(online(e, precision=precision, unit=unit), [spikes]) for e in ("openvino", "torch"))
    apart = float(np.sqrt(np.mean((found - wanted) ** 2)))
    print(f"{precision}: {apart:.1e} apart, rms")
    assert wanted.std() > 10 * MOST_APART
    assert apart < (MOST_APART if precision == "bfloat16" else 1e-6)


def test_online_is_offline_bit_for_bit(spikes):
    whole = rates(online(), [spikes])
    pieces = rates(online(), np.split(spikes, [1, 3, 40, 41, 77]))
    assert np.array_equal(whole, pieces)


def test_many_streams_are_denoised_as_alone(spikes):
    one = online(precision="float32")
    both = np.stack([spikes, spikes[::-1]])
    for found, stream in zip(ManyDnSS(one, 2, SHAPE).push(both), both, strict=True):
        assert np.abs(found - one.another().push(stream)).max() < 1e-5


def test_the_engine_can_be_copied_and_pickled(spikes):
    first = online()
    whole = rates(first, [spikes])
    for other in (copy.deepcopy(first), pickle.loads(pickle.dumps(first))):
        other.reset()
        assert np.array_equal(rates(other, [spikes]), whole)


class Missing:
    """Finds no OpenVINO."""

    def find_spec(self, name, path=None, target=None):
        if name == "openvino":
            raise ModuleNotFoundError(name)


REPORTED = """
import numpy as np
from denoiser.online import OnlineDnSS
online = OnlineDnSS.pretrained("best", engine="openvino")
assert len(online.push(np.zeros((40, 8, 8), np.uint8))) == 16
"""


def test_nothing_is_reported_to_anybody(tmp_path):
    """What reports writes an identity into the home folder first, unless it is told that this is a CI."""
    online()
    environment = {name: value for name, value in os.environ.items() if name not in CI} | {"HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", REPORTED], env=environment, check=True)
    assert not list(tmp_path.glob("[Ii]ntel*"))


def test_a_state_of_the_other_engine_is_refused(spikes):
    denoiser = online("torch")
    denoiser.push(spikes)
    with pytest.raises(InputError, match="engine"):
        online().restore(denoiser.state())


def test_where_it_is_missing_the_extra_is_named(monkeypatch):
    monkeypatch.delitem(sys.modules, "openvino", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Missing(), *sys.meta_path])
    with pytest.raises(InputError, match=r"spikecam-env\[openvino\]"):
        OnlineDnSS.pretrained("best", engine="openvino")


def test_a_network_of_one_plane_a_pass_and_other_names_are_refused():
    with pytest.raises(InputError, match="many planes"):
        OnlineDnSS.pretrained("paper", engine="openvino")
    with pytest.raises(InputError, match="engine 'onnx'"):
        OnlineDnSS.pretrained("best", engine="onnx")
