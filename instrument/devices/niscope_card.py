"""Driver of NI-SCOPE cards (the paper's PCI-5105) through NI's optional package ``niscope``."""

import contextlib
import importlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from analysis.shot import Channel, Role, Setup
from instrument.devices.digitizer import Capabilities, CaptureSettings, DigitizerError
from instrument.devices.source_options import SourceOptions
from instrument.devices.triggered_digitizer import HardwareTrigger, Piece, Pieces, TriggeredDigitizer
from instrument.files import error_words

PACKAGE_REMEDY = "pip install 'levimass[niscope]'"
RUNTIME_REMEDY = "install the NI-SCOPE runtime from ni.com/downloads (Windows and Linux), then restart"
RATES_HZ = (30e6, 60e6, 20e6, 15e6, 10e6, 6e6, 4e6, 2e6, 1e6)  # the paper's rate first
EXTERNAL = "VAL_EXTERNAL"

_ROLES: Mapping[str, Role] = {"0": Role.REFERENCE, "1": Role.MEASUREMENT}
_TRIGGER = HardwareTrigger("2", level_v=1.0)
_POLL_S = 0.02


def load_package() -> Any:
    """Return the ``niscope`` package.  Raises DigitizerError with the remedy if it is not installed."""
    try:
        return importlib.import_module("niscope")
    except ImportError as error:
        raise DigitizerError("NI-SCOPE needs the niscope package, which is not installed", PACKAGE_REMEDY) from error


class NiscopeCard(TriggeredDigitizer[str]):
    """An NI digitizer card; one ``arm`` is one triggered record.

    ``roles`` are the roles of the card's channels, ``range_v`` is the full vertical range of each.  The ``trigger`` is
    a channel or a digital line ("VAL_RTSI_0", "PFI_1").  NI-SCOPE refuses a record that does not fit the card's memory;
    its message is passed on.
    """

    _ends_within_s = 10.0

    def __init__(
        self,
        resource: str,
        roles: Mapping[str, Role] = _ROLES,
        trigger: HardwareTrigger = _TRIGGER,
        *,
        range_v: float = 2.0,
        setup: Setup | None = None,
        package: Any = None,
    ) -> None:
        super().__init__("card", roles, setup)
        self._niscope = package if package is not None else load_package()
        self._resource = resource
        self._trigger = trigger
        self._range_v = range_v
        self._scales = [(range_v / 65536, 0.0)] * len(roles)
        self._session: Any = self._open()

    @property
    def capabilities(self) -> Capabilities:
        """Get the card's capabilities; the scales are those of the last shot."""
        return Capabilities(
            name=f"NI-SCOPE {self._resource}",
            channels=tuple(
                Channel(role, *scale) for role, scale in zip(self._roles.values(), self._scales, strict=True)
            ),
            bits=16,
            rates_hz=RATES_HZ,
            max_samples=1 << 28,
            hardware_trigger=True,
            real_time=False,
        )

    def default_settings(self) -> CaptureSettings:
        """Return the paper's 5 M samples at 30 MS/s."""
        return CaptureSettings(30e6, 5_000_000, 750_000)

    def arm(self, settings: CaptureSettings) -> None:
        """Configure the card and wait for its trigger.  Raises DigitizerError, also if the card rounds the rate."""
        self.stop()
        if not 0 <= settings.pre_trigger_samples < settings.samples:
            raise DigitizerError(f"{self._resource}: the pre-trigger part must be shorter than the record")
        if self._session is None:
            self._session = self._open()
        try:
            self._configure(settings)
            rate = float(self._session.horz_sample_rate)
        except Exception as error:  # niscope's errors derive directly from Exception
            raise self._described(error) from error
        if abs(rate / settings.sample_rate_hz - 1) > 1e-6:
            raise DigitizerError(
                f"{self._resource} samples at {rate:g}/s, not at {settings.sample_rate_hz:g}", f"ask for {rate:g}"
            )
        self._begin(settings)

    def close(self) -> None:
        self.stop()
        session, self._session = self._session, None
        if session is not None:
            with contextlib.suppress(Exception):  # an error while closing must not lose the shot
                session.close()

    def _open(self) -> Any:
        try:
            return self._niscope.Session(self._resource)
        except Exception as error:
            raise self._described(error) from error

    def _configure(self, settings: CaptureSettings) -> None:
        niscope, session, trigger = self._niscope, self._session, self._trigger
        session.channels[",".join(self._roles)].configure_vertical(self._range_v, niscope.VerticalCoupling.DC)
        session.configure_horizontal_timing(
            min_sample_rate=settings.sample_rate_hz,
            min_num_pts=settings.samples,
            ref_position=100.0 * settings.pre_trigger_samples / settings.samples,
            num_records=1,
            enforce_realtime=True,
        )
        slope = niscope.TriggerSlope.POSITIVE if trigger.slope == "rising" else niscope.TriggerSlope.NEGATIVE
        if not str(trigger.source).isdigit() and trigger.source != EXTERNAL:  # a digital line
            session.configure_trigger_digital(trigger.source, slope)
        else:
            session.configure_trigger_edge(trigger.source, trigger.level_v, niscope.TriggerCoupling.DC, slope)

    def _take_shot(self, settings: CaptureSettings, out: Pieces) -> None:
        with self._session.initiate():
            while self._session.acquisition_status() != self._niscope.AcquisitionStatus.COMPLETE:
                if self._cancel.wait(_POLL_S):
                    out.put(None)
                    return
            counts = np.empty((len(self._roles), settings.samples), np.int16)
            infos = self._session.channels[",".join(self._roles)].fetch_into(
                counts.reshape(-1), timeout=max(5.0, settings.samples * 2e-6)
            )
        self._scales = [(float(info.gain), float(info.offset)) for info in infos]
        first, *_ = infos  # all channels have one time base
        step_s, start_s = float(first.x_increment), float(first.relative_initial_x)
        if not math.isfinite(step_s) or step_s <= 0:
            raise DigitizerError(f"{self._resource} reports a sample every {step_s:g} s", "re-arm")
        if not all(math.isfinite(value) for scale in [*self._scales, [start_s]] for value in scale):
            raise DigitizerError(f"{self._resource} reports no scale for its counts", "re-arm")
        out.put(Piece(counts.T, round(-start_s / step_s), last=True))

    def _described(self, error: Exception) -> DigitizerError:
        if type(error).__name__ in ("DriverNotInstalledError", "DriverTooOldError"):
            return DigitizerError("the NI-SCOPE runtime is not installed", RUNTIME_REMEDY)
        return DigitizerError(f"{self._resource}: {error_words(error)}", "check the name in NI MAX, or levimass doctor")


def open_digitizer(resource: str, options: SourceOptions) -> NiscopeCard:
    """Open the card named ``resource`` in NI MAX."""
    channels = [str(number) for number in options.wholes("channels", "0,1", "channel")]
    trigger = HardwareTrigger(options.text("trigger", "2"), options.slope(), options.number("level", "1"))
    range_v = options.number("range", "2")
    return NiscopeCard(resource, options.assigned(channels), trigger, range_v=range_v, setup=options.rig())
