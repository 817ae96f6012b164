"""What the audit finds in section IV: the loop (16)-(22), its condition (23), its limits."""

from __future__ import annotations

from dualbend.control.compliance.base import AdmittanceForm
from dualbend.stability.continuous import k_for_every_damping, smallest_k
from icra1995 import filter as filters
from icra1995 import stability
from icra1995.row import EXACT, Finding, Printed, called, either, finding, rounding

_READINGS = (
    len(stability.READINGS_OF_K_E)
    * len(stability.READINGS_OF_TWO_XI_OMEGA)
    * len(stability.READINGS_OF_OMEGA)
)


def algebra(paper: Printed) -> list[Finding]:
    """Return the findings on (16)-(23) as formulas."""
    printed, other = called(stability.error_of_18, 1.0), stability.error_of_18(-1.0)
    closed, wrong = called(stability.error_of_22), called(stability.disagreements_of_23, 1000)
    return [
        finding(
            "(17), (18)",
            "x_d = x_c + (Z_e/Z_c)(x − x₀)",
            printed,
            f"put into (16) it is off (19) by up to {{:.2g}} of it; with a minus by "
            f"{rounding(other)}",
            either(
                other < EXACT < printed.number,
                (
                    "misprint",
                    "The sign must be minus, as in (17) and (19). As printed the feedback is "
                    f"positive: 1 − k_e/k = {1.0 - paper.k_e / paper.k_x:.0f} at rest.",
                ),
                ("confirmed", "(18) leads to (19)."),
            ),
        ),
        finding(
            "(19)-(22)",
            "the closed loop",
            closed,
            "coefficients differ from (16), (20), (21) in (19) by "
            f"{rounding(closed.number)} on 1000 random loops",
            either(
                closed.number < EXACT,
                ("confirmed", "(22) is right."),
                ("not reproducible", "(22) is wrong."),
            ),
        ),
        finding(
            "(23)",
            "Routh's condition",
            wrong,
            "{:.0f} of 1000 random loops contradict the roots of (22)",
            either(
                wrong.number == 0,
                ("confirmed", "(23) is the exact condition of (22), for the loop without delay."),
                ("not reproducible", "(23) is wrong."),
            ),
        ),
    ]


def limits(paper: Printed) -> list[Finding]:
    """Return the findings on (24)-(25) and on the gains, put into (23)."""
    k_e, robot = paper.k_e, (paper.omega_rad_per_s, paper.two_xi_omega)
    needed = called(smallest_k, paper.b_x, k_e, *robot)
    low = called(stability.lower_damping, paper.k_x, k_e, *robot)
    high = stability.upper_damping(paper.k_x, k_e, *robot)
    every = called(k_for_every_damping, k_e, *robot)
    growth = stability.growth_per_s(paper.b_x, paper.k_x, k_e, *robot)
    implied = stability.stiffness_of_limits(paper.limit_b, paper.limit_k, *robot)
    below = called(stability.lower_damping, paper.limit_k, k_e, *robot)
    upper = stability.upper_damping(paper.limit_k, k_e, *robot)
    at_limit = smallest_k(paper.limit_b, k_e, *robot)
    return [
        finding(
            "(26), (27) in (23)",
            f"the gains that worked, b = {paper.b_x:g} and k = {paper.k_x:g}, fulfil (23)",
            needed,
            f"b = {paper.b_x:g} needs k > {{:.1f}}; (22) grows by {growth:.2f} /s",
            either(
                needed.number < paper.k_x,
                ("confirmed", "The gains fulfil (23)."),
                (
                    "not reproducible",
                    "By the paper's own condition its working gains are unstable.",
                ),
            ),
        ),
        finding(
            "(23) in b",
            f"b = {paper.b_x:g} is allowed at k = {paper.k_x:g}",
            low,
            f"holds for b < {{:.4f}} or b > {high:.1f}",
            either(
                paper.b_x < low.number or paper.b_x > high,
                ("confirmed", "The paper's b is allowed."),
                ("not reproducible", "The paper's b lies between: a smaller one would be allowed."),
            ),
        ),
        finding(
            "(24)",
            f"k > {paper.limit_k:g}",
            every,
            f"every b is allowed only if k > {{:.0f}}; at b = {paper.limit_b:g} (25) k > "
            f"{at_limit:.1f} is enough. (b, k) of (24), (25) is on the boundary for k_e = "
            f"{implied:.0f}",
            either(
                min(abs(every.number / paper.limit_k - 1), abs(at_limit / paper.limit_k - 1))
                < 0.02,
                ("confirmed", "(24) follows from (23)."),
                ("not reproducible", "(24) does not follow from (23) and the stated numbers."),
            ),
        ),
        finding(
            "(25)",
            f"b > {paper.limit_b:g}",
            below,
            f"at k = {paper.limit_k:g} (23) holds for b < {{:.2f}}",
            either(
                abs(below.number / paper.limit_b - 1) < 0.02,
                ("misprint", "The number follows from (23), with the sign turned round."),
                (
                    "not reproducible",
                    "Neither the number nor the direction follows: at this k a lower bound of b "
                    f"exists only at {upper:.0f}.",
                ),
            ),
        ),
        _other_reading(paper),
    ]


def _other_reading(paper: Printed) -> Finding:
    error, (e, c, w) = stability.nearest_reading(paper)
    robot = w * paper.omega_rad_per_s, c * paper.two_xi_omega
    k = called(smallest_k, paper.limit_b, e * paper.k_e, *robot)
    b = stability.lower_damping(paper.limit_k, e * paper.k_e, *robot)
    own = smallest_k(paper.b_x, e * paper.k_e, *robot)
    return finding(
        "(24), (25), read otherwise",
        f"k > {paper.limit_k:g}, b > {paper.limit_b:g}",
        k,
        f"k > {{:.1f}} at b = {paper.limit_b:g}, b < {b:.2f} at k = {paper.limit_k:g}, with k_e "
        f"times {e:g}, 2ξω_n times {c:g}, ω_n times {w:.3g}",
        either(
            error < 0.01,
            (
                "confirmed under an assumption",
                f"Best of {_READINGS} readings tried, and a boundary point matched is one number, "
                "not two: chance is not excluded. If it is right, "
                f"the gains fulfil (23) (k > {own:.0f} at b = {paper.b_x:g}), and (25) has its "
                "sign turned round.",
            ),
            ("not reproducible", f"None of {_READINGS} readings tried gives (24), (25)."),
        ),
        f"k_e is {e:g} and 2ξω_n {c:g} times the printed number (two arms; ξω_n ≥ 25)",
    )


def delay(paper: Printed) -> list[Finding]:
    """Return the findings on what (23) leaves out: delay, sampling, Fig. 9."""
    robot = paper.omega_rad_per_s, paper.two_xi_omega
    robust = stability.robust_k(paper.k_e, *robot)
    margin = called(stability.delay_margin_s, paper.b_x, robust, paper.k_e, *robot)
    onsets = called(stability.onsets_by_less_damping, paper.k_x, paper.k_e, *robot)
    forms: tuple[AdmittanceForm, ...] = ("printed", "impulse-invariant", "static")
    borne = [filters.sampled_stiffness(paper.b_x, paper.k_x, 0, form) for form in forms]
    best = called(
        filters.sampled_stiffness, paper.b_x, paper.k_x, 0, forms[borne.index(max(borne))]
    )
    at_b = filters.sampled_stiffness(paper.b_x, paper.k_x, 2)
    halved = called(filters.sampled_stiffness, 0.5 * paper.b_x, paper.k_x, 2)
    true = filters.sampled_stiffness(0.5 * paper.b_x, paper.k_x, 2, "static")
    true /= filters.sampled_stiffness(paper.b_x, paper.k_x, 2, "static")
    return [
        finding(
            "IV",
            "a small damping b can result in instability, by (23)",
            onsets,
            "{:.0f} onsets of instability as b falls from 10 to 0.0001",
            either(
                onsets.number == 0,
                ("not reproducible", "In (23) a smaller b below the gap only helps."),
                ("confirmed", "A smaller b destabilises."),
            ),
        ),
        finding(
            "IV",
            "(23) may be used with any time delay in the loop neglected",
            margin,
            f"with k = {robust:.0f}, 5 % above what every b needs, the loop bears "
            f"{1e3 * margin.number:.1f} ms",
            either(
                margin.number < paper.period_s,
                (
                    "not reproducible",
                    "Less than one 28 ms command period: (23) says nothing about a loop that has "
                    "one. Use the sampled loop.",
                ),
                ("confirmed", "The loop bears a command period of delay."),
            ),
        ),
        finding(
            "IV, V",
            f"k_e = {paper.k_e:g} beside k = {paper.k_x:g}, in one unit",
            best,
            "largest k_e of the sampled loop without any delay: "
            + ", ".join(f"{form} {k:.0f}" for form, k in zip(forms, borne, strict=True)),
            either(
                best.number < paper.k_e,
                (
                    "not reproducible",
                    "k_e and K cannot be in the same unit. With k_e in N/m and K in N/mm "
                    f"({paper.k_e / 1e3:g} against {at_b:.1f} at two cycles of delay, printed "
                    f"form) the loop is {'stable' if paper.k_e / 1e3 < at_b else 'unstable'}.",
                ),
                ("confirmed", "The sampled loop is stable with these numbers."),
            ),
        ),
        finding(
            "V, Fig. 9",
            "reducing B further makes the loop oscillate",
            halved,
            f"half of b lowers the largest k_e from {at_b:.1f} to {{:.1f}} (two cycles of delay); "
            f"with the true stiffness k it changes by a factor of {true:.2f}",
            either(
                halved.number < 0.9 * at_b,
                (
                    "confirmed under an assumption",
                    "The gain of (15) is 1/b, so a smaller b is a larger gain: sampling explains "
                    "Fig. 9, (23) does not.",
                ),
                ("not reproducible", "A smaller B does not destabilise."),
            ),
            "the sampled loop with (15) as printed or with its T",
        ),
    ]
