"""Effects made stronger or weaker."""

from instrument.bench.effects import ALL, Effects


def scaled(effects: Effects, strength: float) -> dict[str, dict[str, float]]:
    """Return ``effects`` with their sizes multiplied by ``strength`` (the plate's modal mass is divided by it)."""
    result: dict[str, dict[str, float]] = {}
    for name, values in effects.items():
        known = ALL[name]
        power = -1.0 if name == "second_plate_mode" else 1.0
        result[name] = {key: value * strength**power if known[key].scales else value for key, value in values.items()}
    return result
