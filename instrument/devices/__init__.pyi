from .device_search import FoundDevice, found_devices, udev_instructions
from .digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError, block_samples, usual_settings
from .doctor import Check, Grade, examine
from .scpi_address import network_name, network_source
from .source_options import SourceOptions
from .sources import at_site, is_bench, listed_sources, open_source, pushed, source_of, source_words

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
    "at_site",
    "block_samples",
    "examine",
    "found_devices",
    "is_bench",
    "listed_sources",
    "network_name",
    "network_source",
    "open_source",
    "pushed",
    "source_of",
    "source_words",
    "udev_instructions",
    "usual_settings",
]
