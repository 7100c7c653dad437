"""Sets of shots from the bench, which shares no code with the analysis, and the base model's fit of a set."""

from dataclasses import replace

import numpy as np

from analysis.inference.fit import first_fit as begin
from analysis.inference.fit.first_fit import first_fit
from analysis.inference.fit.problem import Fitted
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import base_named
from analysis.inference.model.free_parameters import trial_effects
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.site import STILL_FRAME
from analysis.shot.motion import Motion
from analysis.shot.shot import AnalysisSettings
from analysis.signal.record import motion_from_displacement
from instrument.bench.effects import Effects
from tests.bench.blind import Truth, drawn, records
from tests.bench.displacement_noise import Noise, NoiseKind

WHITE_M = 1e-10
KINDS = {kind.effect.name: kind for kind in trial_effects()}


def shots(effects: Effects, *, seed: int = 3, count: int = 3, floor: bool = False) -> tuple[Motion, ...]:
    """Return motions of a rig with ``effects``, white noise of 0.1 nm a sample and, if asked for, a floor of 0.3 nm."""
    noise = Noise(NoiseKind.FLOOR if floor else NoiseKind.WHITE, white_m=WHITE_M)
    truth: Truth = replace(drawn((), seed, noise, count), effects=effects)
    return motions_of(truth)


def motions_of(truth: Truth) -> tuple[Motion, ...]:
    """Return the shots of a rig as the demodulator would give them."""
    settings = AnalysisSettings()
    out = []
    for record in records(truth):
        motion = motion_from_displacement(
            record.time_s, record.displacement_m, None, None, record.moving_mass_kg, 1e-6, settings.bandwidth_hz
        )
        std = np.full(record.time_s.size, record.noise_m)
        out.append(replace(motion, wavelength_m=record.wavelength_m, displacement_std_m=std))
    return tuple(out)


def calm() -> bool:
    """Never ask to stop."""
    return False


def base_fit(motions: tuple[Motion, ...]) -> Fitted:
    """Return the base model's best fit at the diagnosis' rate."""
    data = JointData(averaged_shots(motions), base_named("paper"))
    return begin.base_fit(data, first_fit(averaged_shots(motions), "paper", STILL_FRAME, calm), calm)
