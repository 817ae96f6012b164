"""What the audit finds in sections II and III up to the admittance: the beam and its forces."""

from __future__ import annotations

from dualbend.arm.mjcf import LEVER_ARM_M
from icra1995 import beam
from icra1995 import filter as audit_filter
from icra1995.row import EXACT, Finding, Printed, called, either, finding, rounding

_SHIPPED, _STIFFER, _BOOK = (0.4, 0.057, 5e-4), (0.6, 0.1, 1e-3), (0.61, 0.457, 8e-4)


def closed_form(paper: Printed) -> list[Finding]:
    """Return the findings on (1)-(6)."""
    force, rise = called(beam.closed_form_error, "force"), called(beam.closed_form_error, "rise")
    moment, integral = called(beam.closed_form_error, "moment"), called(beam.integral_error)
    flat, arc = called(beam.flat_distance), called(beam.smallest_force)
    knot, wrong = called(beam.last_knot, 4), beam.moment_if_m_is_the_modulus()
    return [
        finding(
            "(1)",
            "end force F = (2R)² EI/L²",
            force,
            f"differs from the solved rod by {rounding(force.number)}, 0.05 to 1.2 rad",
            either(
                force.number < EXACT,
                (
                    "confirmed",
                    "Usable. As α → 0 it tends to the Euler load "
                    f"({beam.force_at_no_bending():.3f} π²EI/L²), not to 0.",
                ),
                ("not reproducible", "Do not use (1)."),
            ),
        ),
        finding(
            "(2), (5)",
            "two elliptic integrals with m = sin²(α/2)",
            integral,
            f"K(m), E(m) differ from quadrature by {rounding(integral.number)}",
            either(
                integral.number < EXACT,
                (
                    "confirmed",
                    "m is the parameter of common libraries. Passed as the modulus instead it "
                    f"makes a moment of {wrong:.1f} EI/L at 1 rad.",
                ),
                ("not reproducible", "Do not use (2), (5)."),
            ),
        ),
        finding(
            "(3)",
            "the x of the end-effectors",
            flat,
            f"x/L = {{:.3f}} when flat; as half distance it leaves a moment of "
            f"{rounding(moment.number)} EI/L",
            either(
                abs(flat.number - 0.5) < EXACT and moment.number < EXACT,
                ("confirmed under an assumption", "Correct, once x is known to be half the chord."),
                ("not reproducible", "Do not use (3)."),
            ),
            "x is half the distance between the grippers",
        ),
        finding(
            "(4)",
            "y = (L/R) sin(α/2)",
            rise,
            f"rise differs from the solved rod by {rounding(rise.number)} L",
            either(
                rise.number < EXACT,
                ("confirmed", "y is the height of the ends above the middle."),
                ("not reproducible", "Do not use (4)."),
            ),
        ),
        finding(
            "II",
            "on the optimal trajectory forces and moments are at a minimum",
            arc,
            "bent to an arc of a circle at the same angle the sheet needs "
            f"{rounding(arc.number)} of the force (1)",
            either(
                arc.number < 0.99,
                (
                    "not reproducible",
                    "Only the moment is: force can be traded for moment down to no force at all.",
                ),
                ("confirmed", "Forces and moments are at a minimum."),
            ),
        ),
        finding(
            "(6)",
            "α(k) = k/N, k = 1 … N, for a target α",
            knot,
            "the last of 4 knots is {:.3g} rad whatever the target",
            either(
                abs(knot.number - 0.8) > EXACT,
                (
                    "misprint",
                    "Read α(k) = (k/N) α_d, k = 0 … N. As printed it fits α_d = 1 rad only, and "
                    f"with N = {round(1.0 / paper.interval_rad)} the {paper.interval_rad} rad "
                    "pieces of Fig. 6.",
                ),
                ("confirmed", "The knots end at the target."),
            ),
        ),
    ]


def pieces(paper: Printed) -> list[Finding]:
    """Return the findings on the linear pieces and on what bending loads do."""
    step = paper.interval_rad
    knot, force = called(beam.knot_moment, step), called(beam.force_ratio, step)
    first, last = called(beam.piece_peak, step, 0), called(beam.piece_peak, step, -1)
    alike, slope = called(beam.force_follows_moment, step), called(beam.moment_per_slope)
    push = beam.force_per_slope()
    return [
        finding(
            "V, Fig. 6",
            "the moment is zero at the ends of the pieces and peaks between them",
            first,
            f"peaks {{:.3f}} … {last.number:.3f} EI/L from first to last piece, "
            f"{rounding(knot.number)} at the knots",
            either(
                knot.number < EXACT < last.number < first.number,
                ("confirmed under an assumption", "The shape of Fig. 6 is beam theory."),
                ("not reproducible", "Beam theory does not give Fig. 6."),
            ),
            "no weight, and arms that do not lag behind the knots",
        ),
        finding(
            "II",
            "the force of the linear approximation is much larger than the optimal one",
            force,
            "up to {:.2f} times, at the start of the first piece",
            either(
                force.number > 1.5,
                ("confirmed", "True in the first piece; later pieces are far milder."),
                ("not reproducible", "The force is hardly larger."),
            ),
        ),
        finding(
            "V",
            "the force behaves like the moment, so the moment alone is shown",
            alike,
            "correlation {:.2f} of the force in excess of (1) with the moment, 0.2 to 1 rad",
            either(
                alike.number > 0.9,
                (
                    "confirmed under an assumption",
                    "The rest of the force, about π²EI/L², has no counterpart in the moment; it "
                    "is what the x compliance yields to.",
                ),
                ("not reproducible", "Force and moment are different criteria."),
            ),
            "the part of the force above (1)",
        ),
        finding(
            "III",
            "adding the rotation reduces moment and force",
            slope,
            f"dM/dα = {{:.2f}} EI/L, dF/dα = {push:.1f} EI/L² at 0.6 rad and fixed x",
            either(
                slope.number < 0.0 and push < 0.0,
                ("confirmed", "The sign of the rotational feedback is right."),
                ("not reproducible", "The sign is wrong."),
            ),
        ),
    ]


def loads(paper: Printed) -> list[Finding]:
    """Return the findings on yielding along x, on weight and on the stiffness of the sheet."""
    compliance = 1.0 / audit_filter.static_stiffness(paper.b_x, paper.k_x)
    ours = called(beam.moment_made, *_SHIPPED, 0.4, compliance)
    stiffer = called(beam.moment_made, *_STIFFER, 0.4, compliance)
    weight = called(beam.weight_share, *_SHIPPED, 0.2)
    chord, flat = called(beam.chord_stiffness, *_BOOK, 0.2), beam.flat_stiffness(*_STIFFER)
    lever = called(beam.lever_share, *_SHIPPED, 0.5, LEVER_ARM_M)
    near = 0.5 < paper.k_e / 1e3 / chord.number < 2.0
    return [
        finding(
            "III",
            "the motion along x reduces forces and moments",
            stiffer,
            "yielding to the optimal force itself makes {:.2f} of the next piece's peak on a "
            f"600 × 100 × 1 mm sheet, {ours.number:.2f} on 400 × 57 × 0.5 mm (at 0.4 rad)",
            either(
                ours.number < 1.0 < stiffer.number,
                (
                    "confirmed under an assumption",
                    "The filter sees the whole force, not its error. On a stiffer sheet the x "
                    "compliance makes more moment than it removes.",
                ),
                either(
                    stiffer.number <= 1.0,
                    ("confirmed", "The offset stays below the peaks."),
                    ("not reproducible", "The offset is above the peaks on either sheet."),
                ),
            ),
            "an end force of a few newtons, filter (15) as printed, mm",
        ),
        finding(
            "III",
            "complying along x and in rotation only keeps gravity out",
            weight,
            "the weight takes {:.0%} off the end force of a 400 × 57 × 0.5 mm sheet at 0.2 rad, "
            f"{beam.weight_share(0.6, 0.2, 5e-4, 0.2):.0%} at 600 × 200 × 0.5 mm",
            either(
                weight.number > 0.05,
                (
                    "not reproducible",
                    "A hanging sheet pulls its ends together as a chain does: weight is in the x "
                    "loop, and as qL²/12 in the moment of the flat sheet.",
                ),
                ("confirmed", "Weight does not enter."),
            ),
        ),
        finding(
            "V, Fig. 7",
            "the force on the lever arm L_x has to be subtracted from the torque read",
            lever,
            f"with L_x = {1e3 * LEVER_ARM_M:.0f} mm (assumed) it makes {{:.1f}} times the moment's "
            "peak at 0.5 rad (400 × 57 × 0.5 mm)",
            either(
                lever.number > 1.0,
                (
                    "confirmed",
                    "The moment of Figs. 6, 8, 9 is a small difference of two larger ones: 1 mm "
                    f"of error in L_x is {lever.number / 1e3 / LEVER_ARM_M:.0%} of the peak.",
                ),
                ("not reproducible", "The lever arm hardly matters."),
            ),
        ),
        finding(
            "IV",
            f"stiffness of the environment {paper.k_e:g} N/mm",
            chord,
            "{:.1f} N/mm along x at 0.2 rad for a 610 × 457 × 0.8 mm sheet; EA/L of a flat "
            f"600 × 100 × 1 mm one {flat:.0f} N/mm",
            either(
                near,
                (
                    "confirmed under an assumption",
                    "As N/m it is a bent sheet's order of size. As N/mm it is a flat sheet under "
                    "tension, which is not bending and which no arm of 20-70 N/mm could feel. "
                    "Which was meant cannot be told.",
                ),
                ("not reproducible", "No bent sheet of the book's size has this stiffness."),
            ),
            "N/m, not N/mm",
        ),
    ]
