"""The network of many planes a pass in OpenVINO, an optional package (`pip install spikecam-env[openvino]`).

OpenVINO takes the network over from torch, without files, and compiles it once for every size of frame, number of
streams and number of threads (some two seconds).  Threads are as many as torch's.  The package is imported when it is
first asked for.

OpenVINO reports its import and every `openvino.convert_model` to Intel over the network, and writes an identity into
the home folder.  Nothing here may: it is imported without its telemetry, and its front end is called instead.
"""

from __future__ import annotations

import copy
import os
import sys
import threading
from importlib import import_module
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
import torch
from torch import Tensor, nn

from denoiser.stream_network import StreamDnSS
from spikecam_env.errors import InputError

TELEMETRY = "openvino_telemetry"
"""The package by which OpenVINO reports; it takes its absence."""

EXAMPLE = 16
"""Rows and columns of the frames with which the network is traced; what is traced holds for any size."""


class OpenvinoPasses:
    """`StreamDnSS.passed` of one network, computed in the type of `seen`; the network is copied.

    May be copied, pickled and called from several threads; what was compiled stays with the process.
    Raises InputError where OpenVINO is not installed, and for a network of one plane a pass.
    """

    def __init__(self, network: nn.Module) -> None:
        if not isinstance(network, StreamDnSS):
            raise InputError("engine 'openvino' takes networks of many planes a pass, as mode 'best' is; use 'torch'")
        _openvino()
        self._network = copy.deepcopy(network).float().eval().requires_grad_(False)
        self.__setstate__(self.__getstate__())

    def passed(self, seen: Tensor, beside: Tensor, hidden: Tensor, planes: Tensor | None) -> tuple[Tensor, Tensor]:
        """As `StreamDnSS.passed`; seen and hidden have their channels last in memory, and beside is part of seen."""
        given = [seen.permute(0, 2, 3, 1), hidden.permute(0, 2, 3, 1), *([] if planes is None else [planes])]
        sizes = tuple(tuple(tensor.shape) for tensor in given)
        key = os.getpid(), torch.get_num_threads(), seen.dtype, sizes
        with self._lock:
            if key not in self._requests:
                self._requests[key] = self._compiled(sizes, seen.shape[1] - beside.shape[1], seen.dtype)
            rate, kept = self._requests[key].infer([_shared(tensor.contiguous()) for tensor in given]).values()
        return torch.from_numpy(rate), torch.from_numpy(kept)

    def _compiled(self, sizes: tuple[tuple[int, ...], ...], span: int, number_type: torch.dtype) -> Any:
        """What runs passes over input of these sizes, the first and second with their channels last."""
        ov = _openvino()
        (count, _, _, channels), (*_, carry) = sizes[:2]
        example = [
            torch.zeros(count, EXAMPLE, EXAMPLE, channels),
            torch.zeros(count, EXAMPLE // 2, EXAMPLE // 2, carry),
        ]
        example += [torch.zeros(count, size[1], EXAMPLE, EXAMPLE) for size in sizes[2:]]
        model = _taken_over(_ChannelsLast(self._network, span), tuple(example))
        model.reshape(dict(enumerate(sizes)))
        element = ov.Type.bf16 if number_type == torch.bfloat16 else ov.Type.f32
        pixels = ov.preprocess.PrePostProcessor(model)
        for place in (0, 1):
            pixels.input(place).tensor().set_element_type(element)
        options = {"INFERENCE_PRECISION_HINT": element, "INFERENCE_NUM_THREADS": torch.get_num_threads()}
        return ov.Core().compile_model(pixels.build(), "CPU", options).create_infer_request()

    def __getstate__(self) -> dict[str, Any]:
        return {"_network": self._network}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._network = state["_network"]
        self._lock = threading.Lock()
        self._requests: dict[tuple[Any, ...], Any] = {}


class _ChannelsLast(nn.Module):
    """(N, H, W, channels) seen, (N, H/2, W/2, carry) hidden, planes as they are -> rate and kept, channels first.

    `beside` is cut off before the axes are changed: OpenVINO then takes the memory as it lies.
    """

    def __init__(self, network: StreamDnSS, span: int) -> None:
        super().__init__()
        self.network, self.span = network, span

    def forward(self, seen: Tensor, hidden: Tensor, planes: Tensor | None = None) -> tuple[Tensor, Tensor]:
        seen, beside, hidden = (x.permute(0, 3, 1, 2) for x in (seen, seen[..., self.span :], hidden))
        return self.network.passed(seen, beside, hidden, planes)


def _taken_over(network: nn.Module, example: tuple[Tensor, ...]) -> Any:
    """The model of OpenVINO, traced with float32 arrays."""
    from openvino.frontend import FrontEndManager
    from openvino.frontend.pytorch.ts_decoder import TorchScriptPythonDecoder

    front_end = FrontEndManager().load_by_framework("pytorch")
    with torch.inference_mode(False), torch.no_grad(), torch.autocast("cpu", enabled=False), catch_warnings():
        simplefilter("ignore", DeprecationWarning)  # torch's tracing, by which OpenVINO reads networks
        decoder = TorchScriptPythonDecoder(network, example_input=example)  # has to live until all is converted
        return front_end.convert(front_end.load(decoder))


def _openvino() -> Any:
    """The package; imported without its telemetry, unless the program that this is part of has imported it already."""
    if "openvino" not in sys.modules:
        before = sys.modules.get(TELEMETRY)
        sys.modules[TELEMETRY] = None  # type: ignore[assignment]  # cannot be imported
        try:
            import_module("openvino")
        except ImportError as error:
            raise InputError(
                "OpenVINO is not installed; pip install 'spikecam-env[openvino]', or take engine 'torch'"
            ) from error
        finally:
            del sys.modules[TELEMETRY]
            if before is not None:
                sys.modules[TELEMETRY] = before
    return import_module("openvino")


def _shared(tensor: Tensor) -> Any:
    """A tensor of OpenVINO on the same memory; numpy has no bfloat16."""
    ov = _openvino()
    if tensor.dtype == torch.bfloat16:
        return ov.Tensor(tensor.view(torch.int16).numpy().view(np.uint16), list(tensor.shape), ov.Type.bf16)
    return ov.Tensor(tensor.numpy(), shared_memory=True)
