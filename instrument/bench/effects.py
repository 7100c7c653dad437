"""The effects that the simulated rig can add to the paper's model: names, parameters, usual sizes, text syntax.

Conventions of this rig: the bearing's force is zero where the resting plate is touched.  The internal mass is part of
the block's mass.  The clamp is a mass 1 / (C omega^2) on a spring 1 / C, undamped.  Adhesion is a constant force while
the gap is smaller than its range.  The contact's reference overlap is 10 um.  The demodulation lag is of first order.
Drift and vibration act on the measured path, not on the block, and start with the recording.  A frame vibration that
also moves the plate moves its clamp by ``plate_factor`` times the motion of the optics.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from instrument.bench import forces as slot

Effects = Mapping[str, Mapping[str, float]]  # {"coulomb_friction": {"force_n": 2e-5}}
TWO_PI = 2 * math.pi


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect: usual range (drawn logarithmically), free sign or not, and index in forces.py.

    ``slot`` None: the parameter belongs to no force, see measured_path.py.
    """

    low: float
    high: float
    slot: int | None = None
    factor: float = 1.0
    signed: bool = False
    scales: bool = True  # proportional to the strength of the effect

    @property
    def usual(self) -> float:
        """Get the default value."""
        return math.sqrt(self.low * self.high)


_p = Parameter


# names as in docs/catalogue.md
CATALOGUE: Mapping[str, Mapping[str, Parameter]] = {
    "coulomb_friction": {"force_n": _p(1e-5, 3e-4, slot.F_COULOMB)},
    "viscous_drag": {"coefficient_n_s_per_m": _p(5e-5, 2e-3, slot.C_VISCOUS)},
    "quadratic_drag": {"coefficient_n_s2_per_m2": _p(2e-4, 5e-3, slot.C_QUADRATIC)},
    "tilt": {"angle_rad": _p(5e-5, 1e-3, slot.TILT_RAD, signed=True)},
    "bearing_gradient": {"stiffness_n_per_m": _p(5e-3, 0.2, slot.K_BEARING)},
    "block_mode": {
        "mass_kg": _p(1e-4, 1.5e-3, slot.M_HIDDEN),
        "frequency_hz": _p(250.0, 3000.0, slot.W_HIDDEN, factor=TWO_PI, scales=False),
        "damping_ratio": _p(2e-3, 0.05, slot.Z_HIDDEN, scales=False),
    },
    "cubic_stiffness": {"coefficient_n_per_m3": _p(5e4, 2e6, slot.K_CUBIC)},
    "plate_damping": {"coefficient_n_s_per_m": _p(1e-4, 3e-3, slot.C_PLATE)},
    "viscoelastic_arm": {
        "stiffness_n_per_m": _p(0.5, 10.0, slot.K_ARM),
        "relaxation_time_s": _p(2e-4, 1e-2, slot.TAU_ARM, scales=False),
    },
    "second_plate_mode": {
        "mass_kg": _p(1e-3, 3e-2, slot.M_MODE),
        "frequency_hz": _p(1500.0, 6000.0, slot.W_MODE, factor=TWO_PI, scales=False),
        "damping_ratio": _p(2e-3, 0.03, slot.Z_MODE, scales=False),
    },
    "support_compliance": {
        "compliance_m_per_n": _p(1e-6, 1e-4, slot.CLAMP_COMPLIANCE),
        "frequency_hz": _p(300.0, 3000.0, slot.W_CLAMP, factor=TWO_PI, scales=False),
    },
    "plate_motion": {
        "velocity_m_per_s": _p(3e-4, 5e-3, signed=True),
        "displacement_m": _p(3e-7, 4e-6, signed=True),
    },
    "contact_exponent": {"delta": _p(0.05, 0.5, slot.CONTACT_DELTA)},
    "nonlinear_contact_damping": {"coefficient_n_s_per_m2": _p(1e3, 3e4, slot.C_OVERLAP)},
    "adhesion": {
        "force_n": _p(5e-4, 1e-2, slot.F_ADHESION),
        "range_m": _p(5e-6, 2e-4, slot.D_ADHESION, scales=False),
    },
    "sensor_drift": {"ramp_m_per_s2": _p(1e-5, 2e-3, signed=True)},
    "demodulation_lag": {"time_s": _p(2e-6, 3e-5)},
    "frame_vibration": {
        "amplitude_m_per_s": _p(2e-6, 1e-4),
        "frequency_hz": _p(40.0, 1500.0, scales=False),
        "phase_rad": _p(1e-3, TWO_PI, signed=True, scales=False),
    },
    "cyclic_error": {"amplitude_m": _p(3e-10, 6e-9), "order": _p(1.0, 1.0, scales=False)},  # 1 or 2 if drawn
}

# effects of the catalogue with further parameters; never drawn at random
EXTENDED_EFFECTS: Mapping[str, Mapping[str, Parameter]] = {
    "frame_vibration_with_plate": {**CATALOGUE["frame_vibration"], "plate_factor": _p(0.2, 1.0, scales=False)},
}

# effects unknown to the analysis; it must report "unexplained" or name no effect
OFF_CATALOGUE: Mapping[str, Mapping[str, Parameter]] = {
    "bristle_friction": {  # LuGre with a Stribeck curve
        "force_n": _p(3e-5, 5e-4, slot.F_BRISTLE),
        "static_force_n": _p(9e-5, 2e-3, slot.F_BRISTLE_STATIC),
        "stribeck_velocity_m_per_s": _p(0.03, 0.15, slot.V_BRISTLE, scales=False),
        "deflection_m": _p(3e-6, 3e-5, scales=False),
    },
    "contact_area": {  # stiffness grows from k_N to k_N (1 + a) within a few overlaps
        "gain": _p(0.1, 0.8, slot.AREA_GAIN),
        "overlap_m": _p(3e-6, 2e-5, slot.AREA_XI, scales=False),
    },
    "mass_jump": {  # the block picks up a mass on the way out
        "mass_kg": _p(1e-8, 1e-6, slot.JUMP_MASS),
        "position_m": _p(3e-4, 1.5e-3, slot.JUMP_X, scales=False),
    },
    "asymmetric_drag": {"coefficient_n_s_per_m": _p(5e-5, 1e-3, slot.C_ASYMMETRIC)},  # -c |v|
    "magnet": {
        "force_n": _p(1e-4, 5e-3, slot.F_MAGNET, signed=True),
        "range_m": _p(2e-4, 1.5e-3, slot.D_MAGNET, scales=False),
    },
    "clamp_slip": {
        "threshold_n": _p(0.05, 0.2, slot.F_SLIP, scales=False),
        "mobility_m_per_n_s": _p(1e-6, 1e-4, slot.SLIP_MOBILITY),
    },
}

ALL: Mapping[str, Mapping[str, Parameter]] = {**CATALOGUE, **EXTENDED_EFFECTS, **OFF_CATALOGUE}

PER_SHOT = {
    "plate_motion": ("velocity_m_per_s", "displacement_m"),
    "frame_vibration": ("phase_rad",),
    "frame_vibration_with_plate": ("phase_rad",),
}


def parse(text: str) -> dict[str, dict[str, float]]:
    """Parse effects written as ``NAME:PARAMETER=VALUE,...``, separated by ``;``; omitted parameters get defaults.

    Raises ValueError, in one line.
    """
    effects: dict[str, dict[str, float]] = {}
    for part in filter(None, (piece.strip() for piece in text.split(";"))):
        name, _, rest = part.partition(":")
        given: dict[str, float] = {}
        for assignment in filter(None, (piece.strip() for piece in rest.split(","))):
            key, equals, value = assignment.partition("=")
            if not equals:
                raise ValueError(f"effect {name.strip()}: {assignment!r} is not PARAMETER=VALUE")
            try:
                given[key.strip()] = float(value)
            except ValueError:
                raise ValueError(f"effect {name.strip()}: {key.strip()}={value!r} is not a number") from None
        effects[name.strip()] = given
    if not effects:
        raise ValueError("no effect is named; NAME:PARAMETER=VALUE,... is expected")
    return complete(effects)


def complete(effects: Effects) -> dict[str, dict[str, float]]:
    """Return ``effects`` with defaults for omitted parameters.  Raises ValueError for an unknown or impossible one."""
    result: dict[str, dict[str, float]] = {}
    for name, given in effects.items():
        known = ALL.get(name)
        if known is None:
            raise ValueError(f"no effect is called {name!r}; there are {', '.join(ALL)}")
        for key, value in given.items():
            if key not in known:
                raise ValueError(f"effect {name} has no parameter {key!r}; it has {', '.join(known)}")
            if not math.isfinite(value) or (value < 0 and not known[key].signed):
                raise ValueError(f"effect {name}: {key}={value:g} is not possible")
        result[name] = {key: float(given.get(key, parameter.usual)) for key, parameter in known.items()}
        _check(name, result[name])
    return result


def _check(name: str, values: Mapping[str, float]) -> None:
    if name == "cyclic_error" and values["order"] not in (1.0, 2.0, 3.0, 4.0):
        raise ValueError(f"effect cyclic_error: order={values['order']:g} is not 1, 2, 3 or 4")
    for key in ("frequency_hz", "relaxation_time_s", "range_m", "overlap_m", "deflection_m"):
        if key in values and values[key] <= 0.0:
            raise ValueError(f"effect {name}: {key} must be above zero")
    if "plate_factor" in values and values["plate_factor"] > 1.0:
        raise ValueError(f"effect {name}: plate_factor={values['plate_factor']:g} is more than the frame itself")


def force_slots(effects: Effects) -> dict[int, float]:
    """Return the parameters of forces.py that ``effects`` set, as {index: value}."""
    extra: dict[int, float] = {}
    for name, values in effects.items():
        known = ALL[name]
        for key, value in values.items():
            if (at := known[key].slot) is not None:
                extra[at] = value * known[key].factor
        if name == "bristle_friction":
            extra[slot.K_BRISTLE] = values["force_n"] / values["deflection_m"]
    return extra


def draw(name: str, random: np.random.Generator) -> dict[str, float]:
    """Return parameters of an effect drawn from their usual ranges."""
    values: dict[str, float] = {}
    for key, parameter in ALL[name].items():
        value = float(np.exp(random.uniform(np.log(parameter.low), np.log(parameter.high))))
        values[key] = -value if parameter.signed and random.random() < 0.5 else value
    if name == "cyclic_error":
        values["order"] = float(random.integers(1, 3))
    if name in ("frame_vibration", "frame_vibration_with_plate"):
        values["phase_rad"] = float(random.uniform(-math.pi, math.pi))
    if name == "bristle_friction":
        values["static_force_n"] = values["force_n"] * float(random.uniform(1.5, 4.0))
    return values


def effects_of_shot(effects: Effects, shot: int, seed: int) -> dict[str, dict[str, float]]:
    """Return the effects of one shot of a set: PER_SHOT parameters are drawn at random, except for shot 0."""
    result = {name: dict(values) for name, values in effects.items()}
    if shot == 0:
        return result
    random = np.random.default_rng((seed, shot, 0xE))
    for name, keys in PER_SHOT.items():
        for key in keys:
            if name in result and key == "phase_rad":
                result[name][key] = float(random.uniform(-math.pi, math.pi))
            elif name in result:
                result[name][key] *= float(random.uniform(0.3, 1.0) * random.choice([-1.0, 1.0]))
    return result
