"""Convert a diagnosed model to and from TOML text: base, effects, parameters, covariance, shots, errors.

These are pure functions on text; the caller reads and writes the file.
"""

import math
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Effect, known_effect, without_nuisances
from analysis.diagnosis.findings.result import Diagnosis, Errors
from analysis.drive import LAWS
from analysis.shot import AnalysisError, Fit, Quantity
from levimass import BASE_MODELS, base_model

SCHEMA = "levimass.model/1"
_LARGEST, _SMALLEST = 1e15, 1e-15  # in SI units: largest size of any parameter, smallest stiffness and mass
_POSITIVE = re.compile(r"^[^.]*(stiffness|mass)_[^.]*$")  # of the base; an effect's stiffness may be negative
_NOT_NEGATIVE = re.compile(r"^contact_damping_[^.]*$")
_ROUNDING = 1e-6  # tolerance of a correlation, for rounding when written and read
_ERRORS = ("before", "after", "held_out_before", "held_out_after")
_COMBINED = "combined standard uncertainties: noise, and mass, wavelength, air and clock"


class ModelFileError(AnalysisError):
    """A text is no valid model; the message is one line that names the key."""


@dataclass(frozen=True, slots=True)
class SavedModel:
    """A saved model.

    ``parameters`` have the names of a fit ("plate_stiffness_n_per_m", effects as "effect.parameter"); ``covariance``
    has their order.  ``errors`` may hold "before", "after", "held_out_before" and "held_out_after".
    ``base_parameters`` are those of the base alone fitted to the same shots, if it was: the reference for predictions
    of other shots.  ``tried`` are those of ``effects`` that the user added and no diagnosis named.
    """

    base: str
    effects: tuple[Effect, ...]
    parameters: Mapping[str, Quantity]
    covariance: NDArray[np.float64]
    shots: tuple[str, ...]
    errors: Mapping[str, Errors]
    base_parameters: Mapping[str, Quantity] = field(default_factory=dict)
    tried: tuple[Effect, ...] = ()


def saved(
    fit: Fit, shots: Sequence[str], diagnosis: Diagnosis | None = None, tried: Collection[Effect] = ()
) -> SavedModel:
    """Return the model to save from a fit of ``shots``, with the errors of the diagnosis that led to it.

    ``tried`` may name effects that are not in the fit.
    """
    errors: dict[str, Errors] = {}
    if diagnosis is not None:
        given = {name: getattr(diagnosis, f"error_{name}") for name in _ERRORS}
        errors = {name: value for name, value in given.items() if value is not None}
    bare = (
        diagnosis.fit_before if diagnosis is not None and not without_nuisances(diagnosis.fit_before.effects) else None
    )
    base = dict(bare.parameters) if bare is not None and bare.converged else {}
    only_tried = tuple(effect for effect in fit.effects if effect in tried)
    parameters = dict(fit.parameters)
    return SavedModel(fit.model, fit.effects, parameters, fit.covariance, tuple(shots), errors, base, only_tried)


def to_text(model: SavedModel, combined_std: Mapping[str, float] | None = None) -> str:
    """Return the model as TOML; ``combined_std`` are the combined uncertainties of parameters that have a budget."""
    std = " and standard uncertainty" if combined_std is None else ", and standard uncertainty from noise alone"
    tried = ", ".join(_string(effect.key) for effect in model.tried)
    lines = [
        f"schema = {_string(SCHEMA)}",
        f"base = {_string(model.base)}",
        f"effects = [{', '.join(_string(effect.key) for effect in model.effects)}]",
        *([f"tried = [{tried}]  # no diagnosis named them"] if model.tried else []),
        f"shots = [{', '.join(_string(name) for name in model.shots)}]",
        "",
        f"[parameters]  # value{std}, SI units",
    ]
    lines += _quantities(model.parameters)
    lines += ["", "[covariance]  # of the parameters, in their order", "rows = ["]
    lines += [f"  [{', '.join(_number(float(value)) for value in row)}]," for row in model.covariance]
    lines += ["]"]
    if model.base_parameters:
        lines += [
            "",
            "[base_parameters]  # of the base alone, fitted to the same shots",
            *_quantities(model.base_parameters),
        ]
    for name, errors in model.errors.items():
        lines += ["", f"[errors.{name}]"]
        lines += [f"{key} = {_number(value)}" for key, value in asdict(errors).items()]
    if combined_std:
        lines += ["", f"[combined_std]  # {_COMBINED}"]
        lines += [f"{name} = {_number(value)}" for name, value in combined_std.items()]
    return "\n".join(lines) + "\n"


def from_text(text: str) -> SavedModel:
    """Read a model from TOML.  Raises ModelFileError, which says in one line what is wrong."""
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a TOMLDecodeError, or an integer of thousands of digits
        raise ModelFileError(f"not TOML: {' '.join(str(error).split())[:100]}") from None
    if data.get("schema") != SCHEMA:
        raise ModelFileError(f"schema: {SCHEMA!r} is expected, not {str(data.get('schema'))[:40]!r}")
    base = data.get("base")
    if not isinstance(base, str) or base not in BASE_MODELS:
        raise ModelFileError(f"base: {str(base)[:40]!r} is none of {', '.join(BASE_MODELS)}")
    effects = _effects(_strings(data, "effects"), base)
    tried = _strings(data, "tried")
    if strange := [name for name in tried if name not in effects]:
        raise ModelFileError(f"tried: {strange[0][:40]!r} is not among the effects")
    parameters, base_parameters = _read_quantities(data, "parameters"), _read_quantities(data, "base_parameters")
    for table, quantities in (("parameters", parameters), ("base_parameters", base_parameters)):
        _check_values(table, quantities)
    return SavedModel(
        base, tuple(effects.values()), parameters, _read_covariance(data, parameters), _strings(data, "shots"),
        _read_errors(data), base_parameters, tuple(effects[name] for name in tried),
    )  # fmt: skip


def _read_covariance(data: dict[str, Any], parameters: Mapping[str, Quantity]) -> NDArray[np.float64]:
    """Return the covariance of the parameters, shape (p, p), or (0, 0) if the file has none."""
    rows = _table(data, "covariance").get("rows", [])
    try:
        covariance = np.array(rows, dtype=np.float64).reshape(len(rows), -1 if rows else 0)
    except (TypeError, ValueError, OverflowError):
        raise ModelFileError("covariance.rows: rows of numbers are expected") from None
    if covariance.shape not in ((0, 0), (len(parameters), len(parameters))):
        raise ModelFileError(f"covariance.rows: {len(parameters)} rows of {len(parameters)} numbers are expected")
    if covariance.size:
        _check_covariance(covariance, parameters)
    return covariance


def _read_errors(data: dict[str, Any]) -> dict[str, Errors]:
    errors = {}
    for name, entry in _table(data, "errors").items():
        if name not in _ERRORS or not isinstance(entry, dict):
            raise ModelFileError(f"errors.{name}: one of {', '.join(_ERRORS)} is expected")
        errors[name] = Errors(*(_float(entry, of.name, name) for of in fields(Errors)))
    return errors


def effect_in_file(key: str, base: str) -> Effect | None:
    """Return the effect that a model file with this base calls ``key``; None where there is none."""
    return (known_effect if base_model(base).collides else LAWS.get)(key)


def _effects(names: Sequence[str], base: str) -> dict[str, Effect]:
    """Return the effects by name.  Raises ModelFileError where one is unknown or named twice."""
    if twice := [name for name in names if names.count(name) > 1]:
        raise ModelFileError(f"effects: {twice[0][:40]!r} is named twice")
    effects = {name: effect_in_file(name, base) for name in names}
    if unknown := [name for name, effect in effects.items() if effect is None]:
        raise ModelFileError(f"effects: no effect is called {unknown[0][:40]!r}")
    return {name: effect for name, effect in effects.items() if effect is not None}


def _check_values(table: str, quantities: Mapping[str, Quantity]) -> None:
    """Refuse values that no rig has; a standard uncertainty may be nan or inf where the data do not determine it."""
    for name, quantity in quantities.items():
        where, value = f"{table}.{name[:60]}", quantity.value
        if not abs(value) <= _LARGEST:
            raise ModelFileError(f"{where}.value: {value:g} is no value that a rig can have")
        if quantity.std < 0.0:
            raise ModelFileError(f"{where}.std: {quantity.std:g} is below zero")
        if _POSITIVE.search(name) and not value >= _SMALLEST:
            raise ModelFileError(f"{where}.value: {value:g} is not above zero")
        if _NOT_NEGATIVE.search(name) and value < 0.0:
            raise ModelFileError(f"{where}.value: {value:g} is below zero")


def _check_covariance(covariance: NDArray[np.float64], parameters: Mapping[str, Quantity]) -> None:
    """Refuse an invalid covariance; rows of parameters with an undetermined uncertainty may be nan or inf."""
    told = np.array([math.isfinite(quantity.std) for quantity in parameters.values()])
    if not told.any():
        return
    known = covariance[np.ix_(told, told)]
    if not np.all(np.isfinite(known)):
        raise ModelFileError("covariance.rows: a number is not finite")
    variances = np.diag(known)
    if np.any(variances < 0.0):
        raise ModelFileError("covariance.rows: a variance on the diagonal is below zero")
    scale = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    with np.errstate(over="ignore"):
        correlation = known / scale / scale[:, None]
    if not np.all(np.abs(correlation) <= 1.0 + _ROUNDING) or (correlation - correlation.T).max() > _ROUNDING:
        raise ModelFileError("covariance.rows: not symmetric, or a correlation beyond one")
    if np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min() < -_ROUNDING * len(correlation):
        raise ModelFileError("covariance.rows: some sum of the parameters would have a variance below zero")


def drift(model: SavedModel, fit: Fit) -> dict[str, float]:
    """Return each shared parameter's change from the saved value to a new fit's, in joint standard uncertainties."""
    out = {}
    for name, now in fit.parameters.items():
        then = model.parameters.get(name)
        spread = math.hypot(now.std, then.std) if then is not None else 0.0
        if then is not None and spread > 0:
            out[name] = (now.value - then.value) / spread
    return out


def _quantities(parameters: Mapping[str, Quantity]) -> list[str]:
    return [
        f"{_string(name)} = {{ value = {_number(q.value)}, std = {_number(q.std)} }}" for name, q in parameters.items()
    ]


def _read_quantities(data: Mapping[str, Any], key: str) -> dict[str, Quantity]:
    out = {}
    for name, entry in _table(data, key).items():
        if not isinstance(entry, dict):
            raise ModelFileError(f"{key}.{name}: value and std are expected")
        out[name] = Quantity(_float(entry, "value", name), _float(entry, "std", name), "model file")
    return out


def _string(text: str) -> str:
    whole = text.encode("utf-8", "replace").decode()  # a file's name may contain bytes that are not text
    escaped = whole.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'


def _number(value: float) -> str:
    return repr(float(value))  # inf and nan are valid TOML


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = data.get(key, {})
    if not isinstance(value, dict):
        raise ModelFileError(f"{key}: a table is expected")
    return value


def _strings(data: Mapping[str, Any], key: str) -> tuple[str, ...]:
    value = data.get(key, [])
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise ModelFileError(f"{key}: a list of names is expected")
    return tuple(value)


def _float(entry: Mapping[str, Any], key: str, where: str) -> float:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ModelFileError(f"{where}.{key}: a number is expected")
    try:
        return float(value)
    except OverflowError:
        raise ModelFileError(f"{where}.{key}: a number of hundreds of digits") from None
