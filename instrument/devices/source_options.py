"""Read the options of a source with checks, as in ``scpi:ADDRESS?roles=switch,measurement&mass=0.0213``."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any
from urllib.parse import unquote

from analysis.collision import PAPER
from analysis.shot import Role, Setup
from instrument.devices.digitizer import DigitizerError
from instrument.files import shown

RIG = {"mass": "moving_mass_kg", "rest": "rest_frequency_hz", "wavelength": "wavelength_air_m"}  # option -> Setup


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """The options of one source by name.  Every method raises DigitizerError for an invalid value."""

    given: Mapping[str, str]

    @classmethod
    def read(cls, text: str, source: str, known: Sequence[str]) -> "SourceOptions":
        """Parse the options in ``text`` ("a=1&b=2"); names outside ``known`` are an error."""
        given = {}
        for item in filter(None, text.split("&")):
            name, equals, value = item.partition("=")
            if name not in known or not equals or not value:
                raise DigitizerError(f"source {source}: {shown(item)} is no option", f"known are {', '.join(known)}")
            given[name] = unquote(value)
        return cls(given)

    def __contains__(self, name: str) -> bool:
        return name in self.given

    def text(self, name: str, default: str) -> str:
        return self.given.get(name, default)

    def number(self, name: str, default: str, what: str = "") -> float:
        """Return a number; ``what`` is its name in an error message, if not ``name``."""
        text = self.text(name, default)
        if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?", text.strip()):
            raise DigitizerError(f"{shown(text)} is no {what or name}")
        return float(text)

    def whole(self, name: str, default: str, what: str = "") -> int:
        """Return a whole number of at most four digits."""
        (found,) = self.wholes(name, default, what, several=False)
        return found

    def wholes(self, name: str, default: str, what: str = "", *, several: bool = True) -> tuple[int, ...]:
        """Return whole numbers written with commas between them."""
        text = self.text(name, default)
        parts = text.split(",") if several else [text]
        for part in parts:
            if not re.fullmatch(r"\d{1,4}", part.strip()):
                raise DigitizerError(f"{shown(part)} is no {what or name} number")
        return tuple(map(int, parts))

    def roles(self, default: str) -> tuple[Role, ...]:
        """Return the roles of the channels, in order."""
        text = self.text("roles", default)
        try:
            return tuple(Role(name.strip()) for name in text.split(","))
        except ValueError as error:
            raise DigitizerError(f"{shown(text)} names an unknown role", f"known are {', '.join(Role)}") from error

    def assigned(self, channels: Sequence[Any]) -> dict[Any, Role]:
        """Return the role of each channel."""
        usual = ("reference", "measurement", "switch")[: len(channels)] if len(channels) > 1 else ("measurement",)
        roles = self.roles(",".join(usual))
        if len(roles) != len(channels) or len(set(channels)) != len(channels):
            raise DigitizerError("channels and roles must name each channel once and be equally many")
        return dict(zip(channels, roles, strict=True))

    def slope(self) -> str:
        """Return the slope of the trigger, "rising" or "falling"."""
        slope = self.text("slope", "rising")
        if slope not in ("rising", "falling"):
            raise DigitizerError(f"the slope {shown(slope)} is neither rising nor falling")
        return slope

    def rig(self) -> Setup | None:
        """Return ``assumed_rig`` with the values given by the options; None if the options give none."""
        given = {}
        for name, key in RIG.items():
            if name in self:
                given[key] = self.number(name, "")
                if given[key] <= 0:
                    raise DigitizerError(f"{name}={self.given[name]} is not above zero")
        if not given:
            return None
        rig = assumed_rig()
        if "mass" in self:
            rig = replace(rig, extra={key: value for key, value in rig.extra.items() if key != "moving_mass_assumed"})
        return replace(rig, **given)  # type: ignore[arg-type]


def assumed_rig() -> Setup:
    """Return a set-up with the paper's block, marked in the recording as assumed."""
    return Setup(moving_mass_kg=PAPER.block_mass_kg, extra=MappingProxyType({"moving_mass_assumed": True}))
