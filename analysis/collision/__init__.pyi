from .effects import (
    CATALOGUE,
    MAX_EFFECTS,
    NUISANCES,
    WIDER_EFFECTS,
    effect_named,
    effects_named,
    sensor_effects,
    without_nuisances,
)
from .effects.kernel import TOUCHING, V, X, address, complex_address
from .effects.row import Acts, Effect, Parameter, SensorInput
from .laws.arguments import ARGUMENTS, Argument
from .laws.curve import Basis, Curve, graded_basis, visited_range
from .laws.forms import FORMS, Form
from .laws.functions import FUNCTIONS
from .laws.user_law import MAX_PARAMETERS, LawError, UserLaw, known_effect, law_from_table
from .parameters import KERNEL_ORDER, PAPER, Collision, Floats, Infeasible, Variant
from .solver.first_order import first_order_change, steps_per_sample
from .solver.gear import simulate
from .solver.general import Event, EventLog, Trajectory, averaged, solve
from .solver.linearisation import LinearPath, linear_path
from .solver.mechanical_effects import (
    ActiveEffect,
    FastestRates,
    active_effects,
    chain_matrix,
    chain_rules,
    direction,
    fastest_rates,
)
from .solver.on_moving_frame import moved_by_frame

__all__ = [
    "ARGUMENTS",
    "CATALOGUE",
    "FORMS",
    "FUNCTIONS",
    "KERNEL_ORDER",
    "MAX_EFFECTS",
    "MAX_PARAMETERS",
    "NUISANCES",
    "PAPER",
    "TOUCHING",
    "WIDER_EFFECTS",
    "ActiveEffect",
    "Acts",
    "Argument",
    "Basis",
    "Collision",
    "Curve",
    "Effect",
    "Event",
    "EventLog",
    "FastestRates",
    "Floats",
    "Form",
    "Infeasible",
    "LawError",
    "LinearPath",
    "Parameter",
    "SensorInput",
    "Trajectory",
    "UserLaw",
    "V",
    "Variant",
    "X",
    "active_effects",
    "address",
    "averaged",
    "chain_matrix",
    "chain_rules",
    "complex_address",
    "direction",
    "effect_named",
    "effects_named",
    "fastest_rates",
    "first_order_change",
    "graded_basis",
    "known_effect",
    "law_from_table",
    "linear_path",
    "moved_by_frame",
    "sensor_effects",
    "simulate",
    "solve",
    "steps_per_sample",
    "visited_range",
    "without_nuisances",
]
