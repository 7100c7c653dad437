"""The rig a real digitizer is taken to hang on until the operator says more: the paper's."""

from types import MappingProxyType

from analysis.shot.recording import Setup

PAPER_MOVING_MASS_KG = 17.85e-3


def assumed_rig(bits: int) -> Setup:
    """Return the paper's block behind a digitizer of ``bits``; the recording says that it is assumed."""
    return Setup(
        moving_mass_kg=PAPER_MOVING_MASS_KG,
        digitizer_bits=bits,
        extra=MappingProxyType({"moving_mass_assumed": True}),
    )
