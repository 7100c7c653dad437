from .live_thread import LiveThread, warm
from .live_view import ChannelSignal, LiveView, empty_view
from .ring import DeliveredRate, Overwritten, Ring, Stream
from .setup_check import CHANNEL_NAMES, MOVING_HZ, doppler_shift_hz, judge, judge_beat, judge_site, try_signals

__all__ = [
    "CHANNEL_NAMES",
    "MOVING_HZ",
    "ChannelSignal",
    "DeliveredRate",
    "LiveThread",
    "LiveView",
    "Overwritten",
    "Ring",
    "Stream",
    "doppler_shift_hz",
    "empty_view",
    "judge",
    "judge_beat",
    "judge_site",
    "try_signals",
    "warm",
]
