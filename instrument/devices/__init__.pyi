from .device_search import FoundDevice, found_devices, udev_instructions
from .digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError, block_samples, usual_settings
from .doctor import Check, Grade, check_computer
from .scpi import network_name, network_source
from .source_options import SourceOptions
from .sources import is_bench, listed_sources, open_source, source_of, source_words, with_push, with_site

__all__ = [
    "Block",
    "Capabilities",
    "CaptureSettings",
    "Check",
    "Digitizer",
    "DigitizerError",
    "FoundDevice",
    "Grade",
    "SourceOptions",
    "block_samples",
    "check_computer",
    "found_devices",
    "is_bench",
    "listed_sources",
    "network_name",
    "network_source",
    "open_source",
    "source_of",
    "source_words",
    "udev_instructions",
    "usual_settings",
    "with_push",
    "with_site",
]
