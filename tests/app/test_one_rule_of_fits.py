"""An effect added in the window and a model file on the command line: the same shot, the same numbers."""

import json
from pathlib import Path

import pytest

from analysis.collision.effects import effects_named
from analysis.report import result
from analysis.shot.shot import AnalysisSettings
from app.session.load import load_and_analyse
from app.session.model_work import refit_shot
from instrument.bench.simulated_shots import simulate


def _told(shot: object) -> str:
    """Return all that a result file would hold of a shot, but for how long it took."""
    told = result([shot], None)  # type: ignore[list-item]

    def bare(value: object) -> object:
        if isinstance(value, dict):
            return {key: bare(inner) for key, inner in value.items() if "seconds" not in key}
        return [bare(inner) for inner in value] if isinstance(value, list) else value

    return json.dumps(bare(told), indent=1, sort_keys=True)


@pytest.mark.parametrize(
    "effects", [("viscous_drag",), pytest.param(("cubic_stiffness", "coulomb_friction"), marks=pytest.mark.slow)]
)
def test_what_is_added_in_the_window_is_what_a_model_file_gives(tmp_path: Path, effects: tuple[str, ...]) -> None:
    sizes = {"viscous_drag": {"coefficient_n_s_per_m": 1e-3}, "cubic_stiffness": {"coefficient_n_per_m3": 1e6}}
    sizes["coulomb_friction"] = {"force_n": 1e-4}
    (path,) = simulate(tmp_path, 1, 4, {name: sizes[name] for name in effects})
    opened = load_and_analyse(path)
    chosen = effects_named(effects)
    added = refit_shot(opened, chosen, progress=lambda _what, _share: None, cancelled=lambda: False)
    replayed = load_and_analyse(path, "paper", settings=AnalysisSettings(effects=chosen))
    assert added.fit is not None and set(effects) <= {name.split(".")[0] for name in added.fit.parameters}
    assert _told(added) == _told(replayed)
    assert _told(added) != _told(opened)
