from .live_thread import LiveThread, warm
from .live_view import ChannelSignal, LiveView, empty_view
from .ring import DeliveredRate, Overwritten, Ring, Stream
from .setup_check import judge, judge_site, try_signals

__all__ = [
    "ChannelSignal",
    "DeliveredRate",
    "LiveThread",
    "LiveView",
    "Overwritten",
    "Ring",
    "Stream",
    "empty_view",
    "judge",
    "judge_site",
    "try_signals",
    "warm",
]
