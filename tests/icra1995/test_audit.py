"""The audit of the paper: each number recomputed by other means, each verdict able to change."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy import integrate, optimize

from dualbend.beam.rod import planar as rod
from dualbend.stability import continuous as stability_continuous
from dualbend.stability.continuous import ContinuousLoop
from icra1995 import beam as audit_beam
from icra1995 import filter as audit_filter
from icra1995 import findings_beam as audit_findings_beam
from icra1995 import findings_filter as audit_findings_filter
from icra1995 import findings_scan as audit_findings_scan
from icra1995 import findings_stability as audit_findings_stability
from icra1995 import stability as audit_stability
from icra1995.audit import Audit, audit, page
from icra1995.row import PAPER, VERDICTS, Finding, Printed, called, finding

OMEGA, TWO_XI_OMEGA = 4.0 * math.pi, 25.0
CALLABLE = {
    module.__name__.rpartition(".")[2]: module
    for module in (
        audit_beam,
        audit_filter,
        audit_findings_scan,
        audit_stability,
        stability_continuous,
    )
}


@pytest.fixture(scope="module")
def found() -> Audit:
    return audit()


def only(findings: list[Finding], where: str, claim: str = "") -> Finding:
    (one,) = (f for f in findings if f.where == where and claim in f.claim)
    return one


def test_every_call_on_the_page_gives_the_number_on_the_page(found: Audit) -> None:
    numbers = []
    for f in found.findings():
        # A rounding error is small, whatever it is; arguments are shown to 12 digits.
        number = eval(f.call, {"__builtins__": {}}, CALLABLE)
        assert number == pytest.approx(f.number, rel=1e-8, abs=1e-9), f.call
        numbers.append(number)
    assert len(numbers) > 35


def test_the_committed_page_is_what_the_audit_gives(found: Audit) -> None:
    committed = Path(__file__).parents[2] / "docs" / "audit.md"
    # Golden: the whole page, made by `python docs/studies/icra1995 --out docs/audit.md`.
    assert committed.read_text(encoding="utf-8") == page(found)


def test_the_page_is_a_table_that_no_cell_breaks(found: Audit) -> None:
    for f in found.findings():
        cells = (f.where, f.claim, f.found, f.assumption, f.conclusion)
        assert not any("|" in cell or "\n" in cell or "{" in cell for cell in cells), f
        assert f.verdict in VERDICTS
        # An assumption is named exactly where the verdict needs one.
        assert bool(f.assumption) == (f.verdict == "confirmed under an assumption"), f


def rightmost(b: float, k: float, k_e: float) -> float:
    """Root of (22) from its matrix form, not from its polynomial: states x, x', δ."""
    w2 = OMEGA**2
    system = [[0.0, 1.0, 0.0], [-w2, -TWO_XI_OMEGA, -w2], [k_e / b, 0.0, -k / b]]
    return float(np.linalg.eigvals(np.array(system)).real.max())


def test_acceptance_of_23() -> None:
    """Eigenvalues of the loop as a system, bisected, against the closed forms of the page."""
    k = optimize.brentq(lambda k: rightmost(7.0, k, 11500.0), 300.0, 1000.0)
    low = optimize.brentq(lambda b: rightmost(b, 575.0, 11500.0), 1.0, 20.0)
    high = optimize.brentq(lambda b: rightmost(b, 575.0, 11500.0), 100.0, 1000.0)
    stability = {f.where: f for f in audit_findings_stability.limits(PAPER)}
    # Analytic, to the root finder's tolerance.
    assert stability["(26), (27) in (23)"].number == pytest.approx(k, rel=1e-8)
    assert k == pytest.approx(625.5, abs=0.05)
    assert stability["(23) in b"].number == pytest.approx(low, rel=1e-8)
    assert low == pytest.approx(5.7645, abs=5e-5)
    assert low < 5.77
    assert high == pytest.approx(363.2, abs=0.05)
    every = stability["(24)"].number
    assert every == pytest.approx(1449.0, abs=0.5)
    # Every b: at the k found the worst b just touches the axis; below it some b is unstable.
    touches = optimize.minimize_scalar(
        lambda u: -rightmost(math.exp(u), every, 11500.0), bounds=(2.0, 7.0), method="bounded"
    )
    assert -touches.fun == pytest.approx(0.0, abs=1e-6)
    assert rightmost(math.exp(touches.x), 0.99 * every, 11500.0) > 0.0
    assert max(rightmost(b, 1.01 * every, 11500.0) for b in np.geomspace(1.0, 2e3, 300)) < 0.0
    assert rightmost(7.0, 575.0, 11500.0) == pytest.approx(1.2457, abs=1e-3)


def test_routh_agrees_with_the_roots_and_a_wrong_one_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert audit_stability.disagreements_of_23(1000) == 0
    good = audit_stability.left_side_of_23

    def without_a_term(tried: ContinuousLoop) -> float:
        return good(tried) - tried.two_xi_omega * tried.k**2

    monkeypatch.setattr(audit_stability, "left_side_of_23", without_a_term)
    # Statistical, n = 1000: the missing term decides for some.
    assert audit_stability.disagreements_of_23(1000) > 20
    assert only(audit_findings_stability.algebra(PAPER), "(23)").verdict == "not reproducible"


def test_filter_numbers_from_their_definitions() -> None:
    a = math.exp(-575.0 * 0.028 / 7.0)
    # Analytic: the geometric sum of (15) under a steady force.
    total = sum(a**n for n in range(200)) / 7.0
    assert audit_filter.static_ratio(7.0, 575.0) == pytest.approx(575.0 * total, rel=1e-12)
    assert 575.0 * total == pytest.approx(91.3, abs=0.05)
    assert audit_filter.static_ratio(7.0, 575.0, "impulse-invariant") == pytest.approx(
        0.028 * 575.0 * total, rel=1e-12
    )
    assert audit_filter.static_ratio(7.0, 575.0, "static") == pytest.approx(1.0, rel=1e-12)
    assert audit_filter.missing_factor(7.0, 575.0) == pytest.approx(1.0 / 0.028, rel=1e-12)
    # Two taps average: half the variance, half a period.
    assert audit_filter.noise_left("fir", 2, 10.0) == pytest.approx(math.sqrt(0.5), rel=1e-12)
    assert audit_filter.filter_delay_ms("fir", 2, 10.0) == pytest.approx(14.0, rel=1e-9)
    delays = [audit_filter.filter_delay_ms("iir", n, 10.0) for n in (1, 2, 4)]
    assert [audit_filter.longest_quicker_fir(n, 10.0) for n in (1, 2, 4)] == [
        1 + math.floor(2.0 * d / 28.0) for d in delays
    ]


def ramped_loop(gain: float, pole: float, delay: int, cycles: int = 4000) -> float:
    """Growth of the sampled loop, integrated in time by small steps, not by its state space."""
    steps = 28
    h = 0.028 / steps
    y = v = 0.0
    sent = [0.0] * (delay + 2)
    deviation, peaks = 0.0, [0.0, 0.0]
    for cycle in range(cycles // 20):
        deviation = pole * deviation + gain * (1.0 * (cycle == 0) - y)
        sent = [*sent[1:], deviation]
        for i in range(steps):
            u = sent[0] + (sent[1] - sent[0]) * (i + 0.5) / steps
            v += h * (OMEGA**2 * (u - y) - TWO_XI_OMEGA * v)
            y += h * v
        half = int(cycle >= cycles // 40)
        peaks[half] = max(peaks[half], abs(y))
    return math.log(peaks[1] / peaks[0])


@pytest.mark.parametrize("delay", [0, 2])
def test_largest_stiffness_is_a_boundary_in_time(delay: int) -> None:
    k_e = audit_filter.sampled_stiffness(7.0, 575.0, delay)
    pole = math.exp(-575.0 * 0.028 / 7.0)
    # Discretisation-limited: 1 ms steps of first order move the boundary by a few per cent.
    assert ramped_loop(0.9 * k_e / 7.0, pole, delay) < 0.0
    assert ramped_loop(1.1 * k_e / 7.0, pole, delay) > 0.0
    # Golden: by frequency sweep elsewhere.
    assert k_e == pytest.approx({0: 39.9, 2: 16.35}[delay], abs=0.05)


def test_beam_numbers_from_the_differential_equation() -> None:
    """Shoot EI θ'' = −P sin θ from the middle: an oracle apart from the rod solver."""

    def half(alpha: float, P: float, curvature: float) -> tuple[float, float, float]:
        def slope(_: float, u: list[float]) -> list[float]:
            return [u[1], -P * math.sin(u[0]), math.cos(u[0])]

        end = integrate.solve_ivp(
            slope, (0.0, 0.5), [alpha, curvature, 0.0], rtol=1e-11, atol=1e-12
        )
        return tuple(end.y[:, -1])

    ends = [float(audit_beam.elastica.half_distance(a, 1.0)) for a in (0.2, 0.4)]

    def moment(alpha: float) -> float:
        x = ends[0] + (alpha - 0.2) / 0.2 * (ends[1] - ends[0])
        found = optimize.root(
            lambda u: [half(alpha, *u)[0], half(alpha, *u)[2] - x], [10.0, 0.1], tol=1e-10
        )
        return abs(float(found.x[1]))

    peak = optimize.minimize_scalar(
        lambda alpha: -moment(alpha), bounds=(0.22, 0.36), method="bounded", options={"xatol": 1e-3}
    )
    # Discretisation-limited: the peak is flat, 1e-3 rad off it is 1e-5.
    assert audit_beam.piece_peak(0.2, 1) == pytest.approx(-peak.fun, rel=1e-4)
    assert audit_beam.piece_peak(0.2, 0) == pytest.approx(0.402, abs=5e-4)
    # Analytic: to second order the stiffness in rotation is −π² EI/L near the flat sheet.
    assert audit_beam.moment_per_slope(0.05) == pytest.approx(-(math.pi**2), rel=1e-3)
    # A circular arc is bent by moments alone.
    assert half(0.6, 0.0, -1.2)[0] == pytest.approx(0.0, abs=1e-9)
    assert half(0.6, 0.0, -1.2)[2] == pytest.approx(math.sin(0.6) / 1.2, rel=1e-9)
    assert audit_beam.smallest_force(0.6) < 1e-9


def test_weight_takes_force_off_by_shooting() -> None:
    """EI θ'' + P sin θ + q (L/2 − s) cos θ = 0 with EI = L = 1, both end conditions by Newton."""
    strip = audit_beam.strip(0.4, 0.057, 5e-4)
    q = strip.weight_per_length_n_per_m * 0.4**3 / strip.bending_stiffness_nm2
    x = float(audit_beam.elastica.half_distance(0.2, 1.0))

    def misses(u: list[float]) -> list[float]:
        def slope(s: float, y: list[float]) -> list[float]:
            bending = -u[0] * math.sin(y[0]) - q * (0.5 - s) * math.cos(y[0])
            return [y[1], bending, math.cos(y[0])]

        end = integrate.solve_ivp(slope, (0.0, 0.5), [0.2, u[1], 0.0], rtol=1e-11, atol=1e-12)
        return [end.y[0, -1], end.y[2, -1] - x]

    P = float(optimize.root(misses, [8.0, 0.0], tol=1e-11).x[0])
    unloaded = float(audit_beam.elastica.end_force(0.2, 1.0, 1.0))
    # Analytic, to the integrator's tolerance.
    share = audit_beam.weight_share(0.4, 0.057, 5e-4, 0.2)
    assert share == pytest.approx(1.0 - P / unloaded, rel=1e-6)
    assert share > 0.2


def test_one_grip_moves_against_the_sheet() -> None:
    """Stiffness by central differences; the moment made by moving one grip, not half of it both."""
    book = audit_beam.strip(0.61, 0.457, 8e-4)
    x = float(audit_beam.elastica.half_distance(0.2, 0.61))

    def force(moved: float) -> float:
        return rod.solve_planar(
            book.bending_stiffness_nm2,
            0.61,
            (-x + moved, 0.0, 0.2),
            (x, 0.0, 0.2),
            book.weight_per_length_n_per_m,
            None,
            book.axial_stiffness_n,
        ).end_force_n

    # Discretisation-limited: central differences of second order.
    slope = (force(1e-6) - force(-1e-6)) / 2e-6
    assert audit_beam.chord_stiffness(0.61, 0.457, 8e-4, 0.2) == pytest.approx(
        slope / 1e3, rel=1e-4
    )
    strip = audit_beam.strip(0.4, 0.057, 5e-4)
    EI, at = strip.bending_stiffness_nm2, float(audit_beam.elastica.half_distance(0.4, 0.4))
    given = 0.15e-3 * float(audit_beam.elastica.end_force(0.4, EI, 0.4))
    state = rod.solve_planar(EI, 0.4, (-at - given, 0.0, 0.4), (at, 0.0, 0.4))
    peak = audit_beam.piece_peak(0.2, 2) * EI / 0.4
    # Analytic: only the distance of the grips counts.
    made = audit_beam.moment_made(0.4, 0.057, 5e-4, 0.4, 0.15)
    assert made == pytest.approx(abs(state.end_moment_nm) / peak, rel=1e-6)


def test_robust_k_is_what_every_damping_needs_and_five_per_cent() -> None:
    k = audit_stability.robust_k(11500.0, OMEGA, TWO_XI_OMEGA)
    grid = np.geomspace(1.0, 2e3, 400)
    # Analytic: stable for every b at k and at k/1.04, not at k/1.06.
    assert max(rightmost(b, k / 1.04, 11500.0) for b in grid) < 0.0
    assert max(rightmost(b, k / 1.06, 11500.0) for b in grid) > 0.0


Section = Callable[[Printed], list[Finding]]


@pytest.mark.parametrize(
    ("section", "where", "claim", "changed", "verdict"),
    [
        (audit_findings_stability.limits, "(26), (27) in (23)", "", {"k_x": 630.0}, "confirmed"),
        (audit_findings_stability.limits, "(23) in b", "", {"b_x": 5.7}, "confirmed"),
        (audit_findings_stability.limits, "(24)", "", {"limit_k": 1449.0}, "confirmed"),
        (audit_findings_stability.limits, "(25)", "", {"limit_b": 5.21}, "misprint"),
        (
            audit_findings_stability.limits,
            "(24), (25), read otherwise",
            "",
            {"limit_k": 600.0},
            "not reproducible",
        ),
        (audit_findings_stability.delay, "IV, V", "", {"k_e": 3600.0}, "confirmed"),
        (audit_findings_stability.delay, "IV", "any time", {"b_x": 2000.0}, "confirmed"),
        (audit_findings_filter.admittance, "(15)", "", {"period_s": 0.02}, "not reproducible"),
        (audit_findings_filter.admittance, "(8), (15)", "", {"b_x": 14.0}, None),
        (audit_findings_filter.gains, "(26), (27), x", "", {"b_x": 14.0}, "not reproducible"),
        (
            audit_findings_filter.gains,
            "(26), (27), rotation",
            "",
            {"k_rotation": 50.0},
            "confirmed",
        ),
        (audit_findings_filter.clock, "V", "", {"period_s": 0.02}, "not reproducible"),
        (audit_findings_filter.clock, "IV", "", {"two_xi_omega": 60.0}, "not reproducible"),
        (audit_findings_filter.low_pass, "V", "phase lag than", {"cutoff_hz": 17.0}, None),
        (audit_findings_filter.low_pass, "V", "affected", {"cutoff_hz": 3.0}, "confirmed"),
        (audit_findings_beam.loads, "IV", "", {"k_e": 1.0e6}, "not reproducible"),
        (
            audit_findings_beam.loads,
            "III",
            "motion along x",
            {"b_x": 0.5, "k_x": 50.0},
            "not reproducible",
        ),
        (
            audit_findings_beam.loads,
            "III",
            "motion along x",
            {"b_x": 70.0, "k_x": 5750.0},
            "confirmed",
        ),
    ],
)
def test_another_number_in_the_paper_changes_the_verdict(
    section: Section, where: str, claim: str, changed: dict[str, float], verdict: str | None
) -> None:
    paper = msgspec.structs.replace(PAPER, **changed)
    before, after = only(section(PAPER), where, claim), only(section(paper), where, claim)
    if verdict is None:
        assert after.number != before.number
    else:
        assert after.verdict == verdict
        assert before.verdict != verdict or before.number != after.number


@pytest.mark.parametrize(
    ("function", "where"),
    [("end_force", "(1)"), ("rise", "(4)"), ("half_distance", "(3)")],
)
def test_a_wrong_closed_form_is_found_out(
    function: str, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = getattr(audit_beam.elastica, function)
    assert only(audit_findings_beam.closed_form(PAPER), where).verdict.startswith("confirmed")
    monkeypatch.setattr(audit_beam.elastica, function, lambda *given: right(*given) * (1.0 - 1e-6))
    assert only(audit_findings_beam.closed_form(PAPER), where).verdict == "not reproducible"


def test_a_wrong_22_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    right = ContinuousLoop.polynomial.fget
    assert right is not None
    wrong = property(lambda self: right(self) * np.array([1.0, 1.0, 1.0, 1.0 + 1e-6]))
    monkeypatch.setattr(ContinuousLoop, "polynomial", wrong)
    assert only(audit_findings_stability.algebra(PAPER), "(19)-(22)").verdict == "not reproducible"


def test_the_printed_sign_of_18_is_positive_feedback() -> None:
    # Analytic: G/(1 − GZ) is off G/(1 + GZ) by 2GZ/(1 − GZ), hence G/(1 + GZ) is right.
    assert audit_stability.error_of_18(-1.0) < 1e-9
    assert audit_stability.error_of_18(1.0) > 0.1
    assert only(audit_findings_stability.algebra(PAPER), "(17), (18)").verdict == "misprint"


def test_a_finding_shows_how_to_ask_again() -> None:
    call = called(audit_filter.pole, 7.0, 575.0)
    assert call.text == "filter.pole(7, 575)"
    kept = finding("w", "c", call, "{:.2f}", ("confirmed", "so"), "only if")
    # An assumption belongs to the verdict that needs it, and to no other.
    assert (kept.found, kept.assumption) == ("0.10", "")
