"""The docstring of an effect's module in parts: for the command, for reports, and for docs/effects.md."""

from __future__ import annotations

import inspect
import re
import sys
from dataclasses import dataclass

from spikecam_env.errors import InputError
from spikecam_env.sensor.effects import CATALOGUE, Effect

SECTIONS = ("Stage", "Seen in", "Twins", "Within a frame", "Source")


@dataclass(frozen=True)
class Sheet:
    """First line of an effect's module, the law (indented as it stands), and the named sections."""

    summary: str
    law: str
    sections: dict[str, str]

    @classmethod
    def of(cls, effect: type[Effect]) -> Sheet:
        """Read a module's docstring; InputError where it has no law."""
        text = inspect.getdoc(sys.modules[effect.__module__]) or ""
        head, *rest = re.split(rf"\b({'|'.join(SECTIONS)}):\s", text)
        summary, _, law = head.partition("\n")
        if "    " not in law:
            raise InputError(
                f"the docstring of {effect.name} has no indented equation; write its law below the first line"
            )
        named = {name: " ".join(body.split()) for name, body in zip(rest[::2], rest[1::2], strict=True)}
        return cls(summary.strip(), law.strip("\n").rstrip(), named)

    @property
    def twins(self) -> tuple[str, ...]:
        """Catalogue names that the twins section speaks of."""
        return tuple(word for word in re.findall(r"\w+", self.sections.get("Twins", "")) if word in CATALOGUE)
