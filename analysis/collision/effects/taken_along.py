"""What differs from shot to shot and is no finding: fitted beside everything else, never searched for or named."""

from typing import Any

from analysis.collision.effects.kernel import BLOCK_MASS, ON_BLOCK, SIGN_V
from analysis.collision.effects.row import Acts, Effect, Parameter


def flight_acceleration(s: Any, p: Any, out: Any) -> None:
    """Add m_b a, a = p[0] on the way in and p[1] on the way out; p = (both in m/s^2), each shot's own.

    A track that is bent or tilted where this shot flew, its air, its cable: no law that the shots share.
    """
    out[ON_BLOCK] += s[BLOCK_MASS] * (p[0] if s[SIGN_V].real < 0.0 else p[1])


ROWS = (
    Effect(
        "flight_acceleration",
        "an acceleration in flight that each shot has for itself",
        Acts.ON_BLOCK,
        (
            Parameter("before_m_per_s2", "m/s²", 1e-3, tried=(0.0,), own=True),
            Parameter("after_m_per_s2", "m/s²", 1e-3, tried=(0.0,), own=True),
        ),
        "before_m_per_s2",
        flight_acceleration,
    ),
)
