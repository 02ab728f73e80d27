"""The two parts of a glTF file: its tree (JSON) and its bytes, inside the file, beside it, or as a data URI."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from spikecam_env.errors import InputError, shown

Tree = dict[str, Any]
MAGIC, JSON_CHUNK, BIN_CHUNK = b"glTF", b"JSON", b"BIN\0"
HEAD, CHUNK_HEAD = 12, 8
"""Bytes before the first chunk of a GLB, and before the content of each."""


@dataclass
class File:
    """A glTF file that is open.

    `unread` collects parts of the file that no surface shows, by name.
    """

    tree: Tree
    """The file's JSON."""
    body: bytes | None
    """Bytes of a GLB after its tree."""
    beside: Callable[[str], bytes]
    """Returns the bytes of a file that this one names."""
    unread: dict[str, None] = field(default_factory=dict)
    """Names of parts that are left out, in the order in which they are met."""
    _buffers: dict[int, bytes] = field(default_factory=dict)

    def item(self, kind: str, index: Any) -> Tree:
        """An entry of one of the tree's lists.

        Args:
            kind: name of the list, e.g. "accessors".
            index: number of the entry, from 0.

        Raises:
            InputError: there is no such entry.
        """
        entries = self.tree.get(kind, [])
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(entries):
            raise InputError(f"the file names {kind} {shown(index)}, and has {len(entries)}; export it again")
        return dict(entries[index])

    def without(self, name: str) -> None:
        """Note a part of the file that no surface shows."""
        self.unread[name] = None

    def view(self, index: Any) -> bytes:
        """The bytes of a bufferView.

        Raises:
            InputError: the view does not lie within its buffer.
        """
        view = self.item("bufferViews", index)
        start, length = view.get("byteOffset", 0), view["byteLength"]
        data = self._buffer(view["buffer"])
        if not 0 <= start <= start + length <= len(data):
            extent = f"bytes {shown(start)} to {shown(start + length)}"
            raise InputError(
                f"bufferView {index} is of {extent}, its buffer has {len(data)}; the file is cut off or damaged"
            )
        return data[start : start + length]

    def at(self, uri: str) -> bytes:
        """The bytes that a URI stands for: in it, or in a file beside this one."""
        if not uri.startswith("data:"):
            return self.beside(unquote(uri))
        head, _, content = uri.partition(",")
        return b64decode(content) if head.endswith(";base64") else unquote_to_bytes(content)

    def _buffer(self, index: Any) -> bytes:
        if index not in self._buffers:
            buffer = self.item("buffers", index)
            if "uri" in buffer:
                self._buffers[index] = self.at(buffer["uri"])
            elif index == 0 and self.body is not None:
                self._buffers[index] = self.body
            else:
                raise InputError(f"buffer {index} has no bytes in the file; export the mesh without compression")
        return self._buffers[index]


def opened(data: bytes, beside: Callable[[str], bytes]) -> File:
    """A glTF file from its bytes, text or binary.

    Args:
        data: content of a .gltf or .glb file.
        beside: returns the bytes of a file that this one names, and raises an error where there is none.

    Raises:
        InputError: the bytes are no glTF of version 2.
    """
    body = None
    if data[:4] == MAGIC:
        chunks = dict(reversed(list(_chunks(data))))
        if JSON_CHUNK not in chunks:
            raise InputError("the file has no tree (JSON); it is cut off or damaged")
        data, body = chunks[JSON_CHUNK], chunks.get(BIN_CHUNK)
    tree = json.loads(data)
    version = str(tree["asset"]["version"])
    if version.partition(".")[0] != "2":
        raise InputError(f"the file is glTF {shown(version)}; version 2 is read, export it again")
    return File(tree, body, beside)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """(kind, content) of each chunk of a GLB."""
    chunks, at = [], HEAD
    while at + CHUNK_HEAD <= len(data):
        length, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + CHUNK_HEAD]
        at += CHUNK_HEAD
        if at + length > len(data):
            raise InputError(f"a chunk of {length} bytes ends beyond the file's {len(data)}; it is cut off or damaged")
        chunks.append((kind, data[at : at + length]))
        at += length
    return chunks
