"""Every effect of the model's catalogue is one that the diagnosis tries, under the same names."""

from analysis.diagnosis.knobs import kinds
from analysis.model.effects import CATALOGUE


def test_the_diagnosis_tries_what_the_catalogue_holds() -> None:
    tried = {kind.name: {knob.name for knob in kind.knobs} for kind in kinds()}
    assert set(tried) == set(CATALOGUE)
    for name, effect in CATALOGUE.items():
        assert tried[name] <= {parameter.name for parameter in effect.parameters}, name
