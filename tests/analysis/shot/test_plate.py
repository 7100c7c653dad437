"""The plate against docs/physics.md, "the paper against itself", against numerical integration, and both ways round."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from scipy.integrate import quad
from uncertainties import ufloat

from analysis.shot import plate as plates
from analysis.shot.plate import Disc, PlateTolerance
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Plate
from tests.analysis import thin_plate

EXACT = PlateTolerance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
PAPER_PLATE = Plate(
    arm_length_m=15e-3,
    arm_width_m=2e-3,
    thickness_m=0.3e-3,
    disc_diameter_m=10e-3,
    density_kg_m3=8.51e3,
    youngs_modulus_pa=131e9,
)


def integrated_compliance(plate: Plate, disc: Disc) -> float:
    """The moment's square over E I along the plate, by quadrature."""
    length, radius = plate.arm_length_m, plate.disc_diameter_m / 2
    load = length + radius

    def bent(low: float, high: float, width: object) -> float:
        return quad(lambda x: (load - x) ** 2 / (width(x) * plate.thickness_m**3 / 12), low, high, epsabs=0.0)[0]  # type: ignore[operator]

    neck = load - math.sqrt(radius**2 - (plate.arm_width_m / 2) ** 2)
    total = bent(0.0, neck if disc is Disc.BENDING_NECK else length, lambda x: plate.arm_width_m)
    if disc is not Disc.RIGID:
        total += bent(neck, load, lambda x: 2 * math.sqrt(radius**2 - (load - x) ** 2))
    return total / plate.youngs_modulus_pa


def integrated_effective_mass(plate: Plate) -> float:
    """Rayleigh's integral over arm and disc, strip by strip."""
    length, radius = plate.arm_length_m, plate.disc_diameter_m / 2
    load = length + radius

    def shape(x: float) -> float:
        bent = min(x, length)
        return bent**2 * (3 * load - bent) / 6 + max(x - length, 0.0) * (load * length - length**2 / 2)

    sheet = plate.density_kg_m3 * plate.thickness_m
    arm = quad(lambda x: plate.arm_width_m * shape(x) ** 2, 0.0, length, epsabs=0.0)[0]
    disc = quad(
        lambda a: 2 * radius**2 * math.cos(a) ** 2 * shape(load + radius * math.sin(a)) ** 2,
        -math.pi / 2,
        math.pi / 2,
        epsabs=0.0,
    )[0]
    return sheet * (arm + disc) / shape(load) ** 2


def uncertain(quantity: Quantity) -> plates.Number:
    return ufloat(quantity.value, quantity.std) if quantity.std > 0.0 else quantity.value


def known(number: plates.Number) -> Quantity:
    return Quantity(getattr(number, "nominal_value", number), getattr(number, "std_dev", 0.0))


def modulus_pa(stiffness: Quantity, plate: Plate, tolerance: PlateTolerance, disc: Disc = Disc.RIGID) -> Quantity:
    """Return E from a measured k_p and the plate's geometry, as the budget computes it."""
    numbers = {f.name: Quantity(getattr(plate, f.name), getattr(tolerance, f.name)) for f in fields(plate)}
    numbers["beam_theory"] = Quantity(1.0, tolerance.beam_theory)
    compliance = plates.compliance_of({name: uncertain(number) for name, number in numbers.items()}, disc)
    return known(uncertain(stiffness) * compliance)


def stiffness_from_slope(slope: Quantity, plate_mass: Quantity, contact: Quantity, block_mass: Quantity) -> Quantity:
    """Return k_p from a measured slope, which the block's mass scales, as F = m_b a."""
    mass = uncertain(block_mass)
    scaled = uncertain(slope) * mass / block_mass.value
    return known(plates.corrected_slope(scaled, uncertain(plate_mass), uncertain(contact), mass))


def test_check_values_of_the_paper() -> None:
    assert plates.stiffness_n_per_m(PAPER_PLATE) == pytest.approx(224.6, abs=0.05)
    assert plates.coefficient_c(PAPER_PLATE) == pytest.approx(3.0 / 7.0, rel=1e-12)
    assert plates.stiffness_n_per_m(PAPER_PLATE, Disc.BENDING) == pytest.approx(223.3, abs=0.05)
    assert plates.mass_kg(PAPER_PLATE) == pytest.approx(0.277e-3, abs=0.5e-6)
    ratio = plates.effective_mass_kg(PAPER_PLATE) / plates.mass_kg(PAPER_PLATE)
    assert ratio == pytest.approx(0.772, abs=0.0005)
    assert plates.bare_beam_mass_ratio() == pytest.approx(33.0 / 140.0, rel=1e-12)


@examples(max_examples=40, deadline=None)
@given(
    length=st.floats(5e-3, 60e-3),
    width=st.floats(0.5e-3, 6e-3),
    thickness=st.floats(0.1e-3, 1e-3),
    diameter=st.floats(6.5e-3, 30e-3),
)
def test_closed_forms_are_the_integrals(length: float, width: float, thickness: float, diameter: float) -> None:
    plate = Plate(length, width, thickness, diameter, 8510.0, 131e9)
    for disc in Disc:
        expected = 1.0 / integrated_compliance(plate, disc)
        assert plates.stiffness_n_per_m(plate, disc) == pytest.approx(expected, rel=1e-7)
    assert plates.effective_mass_kg(plate) == pytest.approx(integrated_effective_mass(plate), rel=1e-9)
    assert plates.stiffness_n_per_m(plate) > plates.stiffness_n_per_m(plate, Disc.BENDING)
    assert plates.stiffness_n_per_m(plate, Disc.BENDING) > plates.stiffness_n_per_m(plate, Disc.BENDING_NECK)
    k = plates.coefficient_c(plate) * 131e9 * thickness**3 * width / (4 * length**3)
    assert k == pytest.approx(plates.stiffness_n_per_m(plate), rel=1e-12)


@pytest.mark.parametrize("disc", list(Disc))
def test_modulus_and_stiffness_are_inverse(disc: Disc) -> None:
    stiffness = Quantity(plates.stiffness_n_per_m(PAPER_PLATE, disc), 0.1)
    modulus = modulus_pa(stiffness, PAPER_PLATE, PlateTolerance(), disc)
    assert modulus.value == pytest.approx(PAPER_PLATE.youngs_modulus_pa, rel=1e-12)


def test_a_plate_in_two_dimensions_agrees_within_the_stated_share() -> None:
    """Thin-plate elements, nothing shared with the beams: without Poisson's effect the narrow arm is a beam."""
    beam = plates.stiffness_n_per_m(PAPER_PLATE, Disc.BENDING_NECK)
    assert thin_plate.stiffness_n_per_m(PAPER_PLATE, 0.0, 0.2e-3) == pytest.approx(beam, rel=3e-3)
    # Held flat at the clamp, a real alloy is stiffer than its beam: that is what beam_theory allows for.
    real = thin_plate.stiffness_n_per_m(PAPER_PLATE, 0.3, 0.2e-3)
    assert real > beam
    assert abs(real / beam - 1.0) < 1.2 * PlateTolerance().beam_theory
    for disc in Disc:
        assert real == pytest.approx(
            plates.stiffness_n_per_m(PAPER_PLATE, disc), rel=1.2 * PlateTolerance().beam_theory
        )


def test_uncertainties_are_those_of_random_plates() -> None:
    """First-order propagation against a Monte Carlo draw of plates (GUM supplement 1)."""
    tolerance = PlateTolerance(beam_theory=0.0)
    rng = np.random.default_rng(3)
    drawn = [
        replace(
            PAPER_PLATE,
            **{
                f.name: rng.normal(getattr(PAPER_PLATE, f.name), getattr(tolerance, f.name))
                for f in fields(PAPER_PLATE)
            },
        )
        for _ in range(4000)
    ]
    stiffness = Quantity(221.4, 0.0)
    for disc in Disc:
        modulus = modulus_pa(stiffness, PAPER_PLATE, tolerance, disc)
        values = [modulus_pa(stiffness, p, EXACT, disc).value for p in drawn]
        assert modulus.std == pytest.approx(float(np.std(values)), rel=0.06)


def test_the_theory_itself_is_uncertain() -> None:
    stiffness = Quantity(221.4, 0.0)
    tolerances = (PlateTolerance(beam_theory=share) for share in (0.0, 0.02))
    sure, doubted = (modulus_pa(stiffness, PAPER_PLATE, tolerance) for tolerance in tolerances)
    extra = math.sqrt(doubted.std**2 - sure.std**2)
    assert extra == pytest.approx(0.02 * sure.value, rel=1e-6)


def test_modulus_uncertainty_has_no_part_of_the_stated_modulus() -> None:
    stiffness = Quantity(221.4, 0.2)
    one = modulus_pa(stiffness, PAPER_PLATE, PlateTolerance(youngs_modulus_pa=1e9))
    two = modulus_pa(stiffness, PAPER_PLATE, PlateTolerance(youngs_modulus_pa=50e9))
    assert one.std == pytest.approx(two.std, rel=1e-12)
    exact = modulus_pa(stiffness, PAPER_PLATE, EXACT)
    assert exact.std / exact.value == pytest.approx(0.2 / 221.4, rel=1e-9)


def slope_n_per_m(
    stiffness_n_per_m: float, plate_mass_kg: float, contact_stiffness_n_per_m: float, block_mass_kg: float
) -> float:
    """Return dF/dy of the block's slow motion on plate and contact spring: m_b omega^2 of the slow mode."""
    mu, soft = plate_mass_kg / block_mass_kg, 1.0 / contact_stiffness_n_per_m
    # k_p = s / (1 - s/k_N) + mu s, solved for the smaller s
    a, b, c = mu * soft, 1.0 + mu + stiffness_n_per_m * soft, stiffness_n_per_m
    return 2.0 * c / (b + math.sqrt(b * b - 4.0 * a * c))


def test_slope_lies_below_the_stiffness() -> None:
    slope = slope_n_per_m(221.4, 1.984e-4, 1e4, 17.85e-3)
    assert slope == pytest.approx(214.33, abs=0.01)  # of the reference solution, 6 to 28 ms
    assert slope == pytest.approx(221.4 / (1 + 1.984e-4 / 17.85e-3 + 221.4 / 1e4), rel=5e-4)
    assert slope_n_per_m(221.4, 0.0, 1e12, 17.85e-3) == pytest.approx(221.4, rel=1e-9)


@examples(max_examples=50, deadline=None)
@given(st.floats(50, 1000), st.floats(0.0, 1e-3), st.floats(2e3, 1e6), st.floats(5e-3, 0.2))
def test_slope_is_the_slow_mode_and_is_inverted_exactly(k_p: float, m_p: float, k_n: float, m_b: float) -> None:
    slope = slope_n_per_m(k_p, m_p, k_n, m_b)
    stiffness = np.array([[k_n, -k_n], [-k_n, k_n + k_p]])
    if m_p > 1e-7:
        root = np.diag([m_b**-0.5, m_p**-0.5])
        assert slope == pytest.approx(m_b * np.linalg.eigvalsh(root @ stiffness @ root)[0], rel=1e-6)
    back = stiffness_from_slope(Quantity(slope, 0.1), Quantity(m_p, 0.0), Quantity(k_n, 0.0), Quantity(m_b, 0.0))
    assert back.value == pytest.approx(k_p, rel=1e-9)


def test_corrected_slope_includes_every_uncertainty() -> None:
    exact = (Quantity(214.32, 0.0), Quantity(1.984e-4, 0.0), Quantity(1e4, 0.0), Quantity(17.85e-3, 0.0))
    base = stiffness_from_slope(*exact).value
    for index, step in enumerate((0.05, 2e-6, 150.0, 2e-5)):
        one = list(exact)
        one[index] = Quantity(exact[index].value, step)
        up, down = list(exact), list(exact)
        up[index] = Quantity(exact[index].value + step, 0.0)
        down[index] = Quantity(exact[index].value - step, 0.0)
        if index == 3:  # the mass scales the measured slope as well
            up[0] = Quantity(exact[0].value * up[3].value / exact[3].value, 0.0)
            down[0] = Quantity(exact[0].value * down[3].value / exact[3].value, 0.0)
        expected = abs(stiffness_from_slope(*up).value - stiffness_from_slope(*down).value) / 2
        assert stiffness_from_slope(*one).std == pytest.approx(expected, rel=1e-3)
    assert base == pytest.approx(221.4, abs=0.02)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"thickness_m": 0.0}, "thickness_m"),
        ({"arm_length_m": math.nan}, "arm_length_m"),
        ({"arm_width_m": 0.02}, "wider"),
    ],
)
def test_an_impossible_plate_is_refused(change: dict[str, float], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        plates.stiffness_n_per_m(replace(PAPER_PLATE, **change))


def test_a_tabulated_modulus_is_doubted_by_as_much_as_tables_of_one_alloy_differ() -> None:
    """Handbooks give hardened beryllium copper 125 to 131 GPa by temper and author, any of them as likely (GUM 4.3.7).

    Without a stated uncertainty the modulus is doubted by that spread at least, and not by twice as much.
    """
    spread = (131e9 - 125e9) / 2.0 / math.sqrt(3.0)
    assert spread < PlateTolerance().youngs_modulus_pa < 2.0 * spread
