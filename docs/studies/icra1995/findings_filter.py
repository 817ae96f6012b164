"""What the audit finds of the discrete admittance, its gains, the clock and the low-pass filter."""

from __future__ import annotations

import math

from icra1995 import filter as filters
from icra1995.row import EXACT, Finding, Printed, called, either, finding, rounding

_ORDER = 2
"""Order of the Butterworth filter that stands for the IIR, which the paper does not describe."""


def admittance(paper: Printed) -> list[Finding]:
    """Return the findings on (7)-(15)."""
    gains = paper.b_x, paper.k_x
    impulse = called(filters.impulse_error, *gains)
    step = called(filters.recursion_error, *gains, paper.period_s)
    factor = called(filters.missing_factor, *gains)
    ratio = called(filters.static_ratio, *gains)
    with_t = filters.static_ratio(*gains, "impulse-invariant")
    return [
        finding(
            "(7)-(13)",
            "h(t) = (1/b) e^(−kt/b)",
            impulse,
            f"differs from the impulse response of (8) by {rounding(impulse.number)} of 1/b",
            either(
                impulse.number < EXACT,
                ("confirmed", "The continuous filter is right."),
                ("not reproducible", "The continuous filter is wrong."),
            ),
        ),
        finding(
            "(14)",
            "a discrete filter of the same impulse response (impulse invariance)",
            factor,
            "its output is {:.4g} times that of impulse invariance, which is 1/T",
            either(
                abs(factor.number - 1.0) > EXACT,
                (
                    "misprint",
                    "The factor T is missing. Whether the program had it cannot be told from the "
                    "equation: both forms have to be tried on the figures (below).",
                ),
                ("confirmed", "The form is impulse invariance."),
            ),
        ),
        finding(
            "(15)",
            "the recursion of (14)",
            step,
            f"differs from the impulse response of (14) by {rounding(step.number)} of 1/b",
            either(
                step.number < EXACT,
                ("confirmed", "(15) follows from (14), with its missing T."),
                ("not reproducible", "(15) is not (14)."),
            ),
        ),
        finding(
            "(8), (15)",
            "K is the stiffness of the compliance",
            ratio,
            f"a steady force gives {{:.1f}} times F/k with (15), {with_t:.3f} times with T",
            either(
                abs(ratio.number - 1.0) < 0.05,
                ("confirmed", "K is the stiffness."),
                (
                    "not reproducible",
                    "K is not the stiffness of either form, and with (15) cannot be: 1/T is the "
                    "least ratio for any b, k. ((1 − a)/k) F in place of F/b has it.",
                ),
            ),
        ),
    ]


def gains(paper: Printed) -> list[Finding]:
    """Return the findings on (26)-(27)."""
    pole = called(filters.pole, paper.b_x, paper.k_x)
    turn = called(filters.static_stiffness, paper.b_rotation, paper.k_rotation)
    rotation = filters.pole(paper.b_rotation, paper.k_rotation)
    exponent = paper.k_rotation * paper.period_s / paper.b_rotation
    real = filters.static_stiffness(paper.b_x, paper.k_x)
    return [
        finding(
            "(26), (27), x",
            f"b = {paper.b_x:g}, k = {paper.k_x:g}",
            pole,
            f"pole {{:.4f}}; stiffness of (15) {real:.2f}, not {paper.k_x:g}",
            either(
                abs(pole.number - 0.1) < 0.002,
                (
                    "confirmed under an assumption",
                    "b and k were probably chosen for this pole. The gains can be used, but not "
                    "as a damper and a spring.",
                ),
                ("not reproducible", "No simple choice leads to these gains."),
            ),
            "the designers wanted a pole of 0.1 in 28 ms",
        ),
        finding(
            "(26), (27), rotation",
            f"b = {paper.b_rotation:g}, k = {paper.k_rotation:g}",
            turn,
            f"pole e^(−{exponent:.0f}); stiffness of (15) {{:.3g}}, which is b",
            either(
                rotation < 1e-6,
                (
                    "not reproducible",
                    "No memory is left: δα = M/b. The printed K has no effect; any value above "
                    f"{forgotten_above(paper):.0f} gives the same loop.",
                ),
                ("confirmed", "Both numbers act."),
            ),
        ),
    ]


def forgotten_above(paper: Printed) -> float:
    """Return the rotation's k above which its pole is below 1e-6."""
    return paper.b_rotation / paper.period_s * 6.0 * math.log(10.0)


def clock(paper: Printed) -> list[Finding]:
    """Return the findings on 28 ms, 35.7 Hz, 2 Hz and 25 rad/s."""
    robot = paper.omega_rad_per_s, paper.two_xi_omega
    rate, ratio = called(filters.rate_hz, paper.period_s), called(filters.damping_ratio, *robot)
    lag = filters.tracking_lag_s(*robot)
    return [
        finding(
            "V",
            f"28 ms and {paper.rate_hz:g} Hz",
            rate,
            "1/T = {:.2f} Hz",
            either(
                abs(rate.number - paper.rate_hz) < 0.05,
                ("confirmed", "One clock: the loop runs once per ALTER command."),
                ("not reproducible", "Two clocks."),
            ),
        ),
        finding(
            "IV",
            f"2 Hz and 2ξω_n = {paper.two_xi_omega:g} rad/s",
            ratio,
            f"ξ = {{:.3f}}; the robot follows a ramp {1e3 * lag:.0f} ms late, "
            f"{lag / paper.period_s:.1f} periods",
            either(
                0.7 < ratio.number < 1.3,
                (
                    "confirmed",
                    "Together they are a critically damped arm. It is slow beside the 28 ms "
                    "clock: the lag of the arm, not of the filter, rules the loop.",
                ),
                ("not reproducible", "The two limits do not belong to one servo."),
            ),
        ),
    ]


def low_pass(paper: Printed) -> list[Finding]:
    """Return the findings on FIR against IIR at the printed cut-off."""
    cut = paper.cutoff_hz
    taps = called(filters.longest_quicker_fir, _ORDER, cut)
    noise = called(filters.noise_left, "fir", 2, cut)
    fir = called(filters.filtered_stiffness, paper.b_x, paper.k_x, "fir", 2, cut)
    iir = filters.filtered_stiffness(paper.b_x, paper.k_x, "iir", _ORDER, cut)
    three = filters.filtered_stiffness(paper.b_x, paper.k_x, "fir", 3, cut)
    delays = [filters.filter_delay_ms("fir", n, cut) for n in (2, 3, 5)]
    corner = filters.low_pass("fir", 3, cut).minus_3db_hz
    return [
        finding(
            "V",
            "a FIR has less phase lag than the IIR",
            taps,
            f"FIR of 2, 3, 5 taps {delays[0]:.0f}, {delays[1]:.0f}, {delays[2]:.0f} ms; "
            f"Butterworth {filters.filter_delay_ms('iir', _ORDER, cut):.1f} ms at 2 Hz: quicker up "
            "to {:.0f} taps",
            either(
                taps.number >= 2,
                (
                    "confirmed under an assumption",
                    "A longer FIR at this rate lags more than the IIR that it replaced.",
                ),
                ("not reproducible", "No FIR filter at this rate lags less."),
            ),
            "2 taps, against a Butterworth of order 2, both at 35.7 Hz",
        ),
        finding(
            "V",
            "the phase lag of the IIR affected the stability",
            fir,
            f"largest stable k_e with 2 taps {{:.1f}}, 3 taps {three:.1f}, IIR {iir:.1f} (unit of "
            "k; two cycles of delay)",
            either(
                fir.number / iir > 1.1,
                ("confirmed", "The FIR clearly allows a stiffer sheet."),
                (
                    "not reproducible",
                    f"The exchange is worth {100 * (fir.number / iir - 1):.0f} % of gain at best. "
                    "It decides only for a loop that is at its boundary.",
                ),
            ),
        ),
        finding(
            "V",
            f"a low-pass filter of {cut:g} Hz gets rid of the noise",
            noise,
            f"{filters.nyquist_share(cut):.2f} of the Nyquist frequency; 2 taps leave {{:.0%}} of "
            "white noise, "
            + ("3 taps have no −3 dB point" if corner is None else f"3 taps: {corner:.1f} Hz"),
            either(
                noise.number < 0.5,
                ("confirmed", "The filter removes most of the noise."),
                (
                    "not reproducible",
                    "At 35.7 Hz such a filter can hardly smooth. If the noise went, another "
                    "filter, faster or lower, did it.",
                ),
            ),
        ),
    ]
