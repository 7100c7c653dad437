from .acting import Active, FastestRates, active_effects, chain_matrix, chain_rules, direction, fastest_rates
from .effects import CATALOGUE, MOST_AT_ONCE, NUISANCES, WIDER, effects_named, findings, named, sensors
from .effects.kernel import TOUCHING, V, X, address, complex_address
from .effects.row import Acts, Effect, Parameter, Sensed
from .first_order import along, steps_for
from .gear import simulate
from .general import Event, EventLog, TooManyEvents, Trajectory, UnboundedMotion, averaged, solve
from .laws.arguments import ARGUMENTS, Argument
from .laws.curve import Basis, Curve, graded_basis, visited_range
from .laws.forms import FORMS, Form
from .laws.functions import FUNCTIONS
from .laws.own import MOST_PARAMETERS, LawError, OwnLaw, from_mapping, known_effect
from .linearisation import LinearPath, linear_path
from .on_moving_frame import moved_by_frame
from .parameters import KERNEL_ORDER, PAPER, Collision, Floats, Infeasible, Variant

__all__ = [
    "ARGUMENTS",
    "CATALOGUE",
    "FORMS",
    "FUNCTIONS",
    "KERNEL_ORDER",
    "MOST_AT_ONCE",
    "MOST_PARAMETERS",
    "NUISANCES",
    "PAPER",
    "TOUCHING",
    "WIDER",
    "Active",
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
    "OwnLaw",
    "Parameter",
    "Sensed",
    "TooManyEvents",
    "Trajectory",
    "UnboundedMotion",
    "V",
    "Variant",
    "X",
    "active_effects",
    "address",
    "along",
    "averaged",
    "chain_matrix",
    "chain_rules",
    "complex_address",
    "direction",
    "effects_named",
    "fastest_rates",
    "findings",
    "from_mapping",
    "graded_basis",
    "known_effect",
    "linear_path",
    "moved_by_frame",
    "named",
    "sensors",
    "simulate",
    "solve",
    "steps_for",
    "visited_range",
]
